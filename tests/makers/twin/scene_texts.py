"""Small articulated scenes as URDF and MJCF text."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

# A box body with a door that the file has half open, a flap on it, and a drawer that opens against its axis;
# `ref` shifts what MuJoCo counts from.
LADEN = """<mujoco model="laden"><compiler angle="radian"/><worldbody>
 <body name="body" pos="0.4 0.1 0.2" euler="0 0 0.4"><geom type="box" size="0.3 0.25 0.4"/>
  <body name="door" pos="-0.3 -0.27 0" euler="0 0 -0.5">
   <joint name="door_hinge" type="hinge" axis="0 0 -1" range="-0.5 1.0" pos="0.01 0 0" ref="0.1"/>
   <geom type="box" size="0.28 0.01 0.39" pos="0.28 0 0"/>
   <body name="knob" pos="0.5 -0.03 0"><geom type="sphere" size="0.02"/></body>
   <body name="flap" pos="0.3 -0.02 0.1" euler="0.2 0 0">
    <joint name="flap_hinge" type="hinge" axis="1 0 0" range="-1.2 0"/>
    <geom type="box" size="0.1 0.005 0.05" pos="0 0 0.05"/><geom type="cylinder" size="0.01 0.05" pos="0 -0.02 0.05"/>
   </body></body>
  <body name="drawer" pos="0 -0.27 0.45"><joint name="slide" type="slide" axis="0 1 0" range="-0.3 0"/>
   <geom type="capsule" size="0.03 0.1"/><geom type="ellipsoid" size="0.1 0.05 0.03" pos="0 0.1 0"/></body>
 </body></worldbody></mujoco>"""

HINGE = '<joint name="j" type="{}"><parent link="a"/><child link="b"/>{}</joint>'
LIMIT = '<limit lower="0" upper="1" effort="1" velocity="1"/>'


def urdf(joints: str, links: str = "") -> str:
    shape = '<visual><geometry><box size="0.4 0.02 0.6"/></geometry></visual>'
    body = "".join(f'<link name="{n}">{shape}</link>' for n in "ab")
    return f'<robot name="scene">{body}{links}{joints}</robot>'


def mjcf(body: str, after: str = "") -> str:
    return f'<mujoco><worldbody><body name="a"><geom size=".1"/>{body}</body></worldbody>{after}</mujoco>'


def board(low: ArrayLike, high: ArrayLike, attributes: str = "") -> str:
    """A box geom of MJCF between two corners (3,) m of its body."""
    a, b = np.asarray(low, np.float64), np.asarray(high, np.float64)
    middle, half = (" ".join(map(repr, v.tolist())) for v in ((a + b) / 2, (b - a) / 2))
    return f'<geom type="box" pos="{middle}" size="{half}" {attributes}/>'


def carcass(depth: float, attributes: str = "") -> str:
    """Geoms of an open box, 0.6 x `depth` x 0.3 m of 18 mm boards and a back of 3 mm, its opening in the
    plane y = 0."""
    t, w, h = 0.018, 0.6, 0.3
    corners = [
        ((0, 0, 0), (t, depth, h)),
        ((w - t, 0, 0), (w, depth, h)),
        ((t, 0, 0), (w - t, depth, t)),
        ((t, 0, h - t), (w - t, depth, h)),
        ((t, depth - 0.003, t), (w - t, depth, h - t)),
    ]
    return "".join(board(low, high, attributes) for low, high in corners)
