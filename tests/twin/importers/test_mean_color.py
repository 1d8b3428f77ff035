"""The one colour of a geom that has no picture in a file."""

from __future__ import annotations

import mujoco
import numpy as np

from twin.importers.mjcf_look import mean_color

SCENE = """<mujoco><asset>
  <texture name="red" type="2d" builtin="flat" rgb1="1 .2 0" width="8" height="8"/>
  <texture name="half" type="2d" builtin="checker" rgb1="1 1 1" rgb2="0 0 0" width="8" height="8"/>
  <material name="plain" rgba=".4 .5 .6 1"/>
  <material name="red" texture="red"/>
  <material name="half" texture="half" rgba="1 .5 1 1"/>
</asset><worldbody>
  <geom name="own" size=".1" material="plain" rgba=".1 .2 .3 1"/>
  <geom name="plain" size=".1" material="plain"/>
  <geom name="red" size=".1" material="red"/>
  <geom name="half" size=".1" material="half"/>
</worldbody></mujoco>"""


def test_its_own_goes_before_its_materials_and_a_picture_has_its_mean() -> None:
    model = mujoco.MjModel.from_xml_string(SCENE)
    told = {name: mean_color(model, model.geom(name).id) for name in ("own", "plain", "red", "half")}
    assert np.allclose(told["own"], [0.1, 0.2, 0.3, 1.0])
    assert np.allclose(told["plain"], [0.4, 0.5, 0.6, 1.0])
    assert np.allclose(told["red"], [1.0, 0.2, 0.0, 1.0], atol=0.003)
    assert np.allclose(told["half"], [0.5, 0.25, 0.5, 1.0], atol=0.003)
