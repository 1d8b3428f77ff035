"""Spot's impedance commands: the fields of its messages, and the tool's way in them."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from robots.formats import PlannedMotion, export_trajectory
from robots.formats.spot import Impedance
from tests.makers.robots import planned_motions
from tests.makers.robots.messages import BOSDYN, faults
from tests.makers.robots.planned_motions import stacked
from twin.errors import ConfigError


@pytest.fixture(scope="module")
def source():
    return planned_motions.door()


@pytest.fixture(scope="module")
def folder(source, tmp_path_factory):
    out = tmp_path_factory.mktemp("handed")
    export_trajectory(source, ["spot"], out)
    return out


def read_spot(folder):
    paths = sorted((folder / "spot").iterdir())
    return {p.stem.split("_")[-1]: json.loads(p.read_text(encoding="utf-8")) for p in paths}


def poses_of(messages):
    q = [[m["rotation"][a] for a in "xyzw"] for m in messages]
    place = [[m["position"][a] for a in "xyz"] for m in messages]
    return stacked(Rotation.from_quat(np.array(q)).as_matrix(), np.array(place))


def test_spot_files_are_the_message_field_by_field(source, folder):
    legs = read_spot(folder)
    assert list(legs) == ["approach", "move", "retreat"]
    for message in legs.values():
        assert faults(message, "ArmImpedanceCommand.Request", BOSDYN, complete=False) == []
        assert message["diagonalStiffnessMatrix"]["values"] == [500, 500, 500, 60, 60, 60]
        assert (message["maxForceMag"], message["maxTorqueMag"]) == (60, 15)
        assert message["disableSafetyCheck"] is False
        times = np.array(
            [float(p["timeSinceReference"][:-1]) for p in message["taskTformDesiredTool"]["points"]]
        )
        assert times[0] == 0
        assert np.all(np.diff(times) > 0)
        assert np.diff(times).max() < 0.15


def test_spot_follows_the_tool_from_where_it_starts(source, folder):
    """Placed where the plan has the first pose, the legs lead the tool along the trajectory, without a
    gap."""
    t, legs = source.trajectory, read_spot(folder)
    for name, message in legs.items():
        points = message["taskTformDesiredTool"]["points"]
        root = poses_of([message["rootTformTask"]])[0]
        world = t.T_world_base @ root @ poses_of([p["pose"] for p in points])
        leg = np.flatnonzero(np.array(t.phases) == name)
        begin = max(leg[0] - 1, 0)
        assert np.abs(world[0] - t.T_world_tool[begin]).max() < 1e-8
        assert np.abs(world[-1] - t.T_world_tool[leg[-1]]).max() < 1e-8
        now = np.array([float(p["timeSinceReference"][:-1]) for p in points]) + t.times[begin]
        found = np.abs(t.times[:, None] - now).argmin(axis=0)
        assert np.abs(t.times[found] - now).max() < 1e-8
        assert np.abs(world - t.T_world_tool[found]).max() < 1e-8
    first = legs["approach"]["taskTformDesiredTool"]["points"][0]["pose"]
    assert first == {
        "position": dict.fromkeys("xyz", 0.0),
        "rotation": {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0},
    }


def test_spots_hand_points_where_ours_does(folder):
    tool = poses_of([read_spot(folder)["move"]["wristTformTool"]])[0]
    assert np.allclose(tool[:3, 2], [1, 0, 0])  # our z, out of the hand, is the wrist's x
    assert np.allclose(
        tool[:3, 1], [0, 0, 1]
    )  # fingers close along our y; Spot's jaw turns about the wrist's y
    assert np.linalg.det(tool[:3, :3]) == pytest.approx(1)


def test_a_leg_that_is_gone_leaves_no_file(source, tmp_path):
    export_trajectory(source, ["spot"], tmp_path)
    t = source.trajectory
    held = [p in ("approach", "close", "move", "hold") for p in t.phases]
    keys = ("times", "q", "qd", "effort", "gripper", "part_state", "T_world_tool", "position_error")
    short = replace(t, **{k: getattr(t, k)[held] for k in keys}, phases=tuple(np.array(t.phases)[held]))
    export_trajectory(PlannedMotion(short, source.part, source.robot), ["spot"], tmp_path)
    assert list(read_spot(tmp_path)) == ["approach", "move"]


@pytest.mark.parametrize(
    "wrong",
    [
        {"stiffness": (501.0,) * 3 + (60.0,) * 3},
        {"stiffness": (500.0,) * 6},
        {"damping": (2.5,) * 5},
        {"max_force": 61.0},
        {"max_torque": 0.0},
    ],
)
def test_spot_gets_no_more_than_it_takes(wrong):
    with pytest.raises(ConfigError):
        Impedance(**wrong)
