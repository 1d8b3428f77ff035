"""One part of a file that moves alone."""

from __future__ import annotations

import mujoco
import pytest

from twin.probes.moved import moved, pose_of

TWO = """<mujoco><worldbody>
  <body name="door"><joint name="door_joint" type="hinge" range="0 90"/><geom size=".1"/></body>
  <body name="drawer"><joint name="drawer_joint" type="slide" axis="1 0 0" range="0 .4"/><geom size=".1"/></body>
</worldbody>
<sensor>
  <jointpos name="door_joint_pos" joint="door_joint"/><jointvel name="door_joint_vel" joint="door_joint"/>
  <jointpos name="drawer_joint_pos" joint="drawer_joint"/><jointvel name="drawer_joint_vel" joint="drawer_joint"/>
</sensor></mujoco>"""


def test_sensors_of_the_parts_that_are_held_go_with_their_joints() -> None:
    spec = mujoco.MjSpec.from_string(TWO)
    alone = moved(spec, spec.compile(), "door", {"drawer": 0.3})
    assert (alone.model.njnt, alone.model.nsensor) == (1, 2)
    data = alone.data(0.0)
    held = pose_of(data, alone.model.body("drawer").id)
    assert held[:3, 3] == pytest.approx([0.3, 0.0, 0.0])
