"""Panels that slide in their own plane: depth tells that plane, and neither how far nor which way in it.

What is not of the panel's face, as what leaks into its rim, would tell both by what it likes: of a plain
sliding door it took the axis 9 deg and the states 5 cm aside. So its face alone is observed, by one normal,
and states and axis stay where they started unless tracks tell them.
"""

from __future__ import annotations

import numpy as np

from recon.dense.noise import DepthNoise
from recon.interaction.refine.board import MAX_RMS, MAX_TURN, MIN_SURFELS, flat_face
from recon.interaction.refine.front import side_of
from recon.interaction.refine.terms import PanelTie
from twin import geometry as geo
from twin.geometry import Array
from twin.scene import Joint, Prismatic

# All chosen by us. Sine of the angle between a panel's face and its way, at most.
_IN_PLANE = np.sin(np.radians(25.0))
# Least share of the surfels that a panel's face holds, and greatest share that a front has, which tells the
# way by itself.
_MOST, _OF_FRONT = 0.5, 0.1
# Cosine between the normal of such a front and the way.
_SQUARE = 0.7


def find_panel(
    start: Joint, states: Array, points: Array, normals: Array, noise: DepthNoise
) -> tuple[PanelTie | None, tuple[Array, Array]]:
    """The face that slides in its own plane among surfels (K, 3) and their normals, None without one; and the
    surfels that are observed: of a panel its face alone, by one normal.

    start, states (n,): what the refinement starts from.
    """
    every = points, normals
    if not isinstance(start, Prismatic) or len(points) < MIN_SURFELS:
        return None, every
    if (np.abs(normals @ start.axis) > _SQUARE).mean() > _OF_FRONT:
        return None, every
    facing = geo.unit(np.median(normals, axis=0))
    near = normals @ facing > np.cos(MAX_TURN)
    if near.sum() < max(MIN_SURFELS, _MOST * len(points)):
        return None, every
    face = flat_face(points[near], facing, max(MAX_RMS, float(noise.measured(1.0))))
    if face is None or abs(face[0] @ start.axis) > _IN_PLANE:
        return None, every
    normal, on = face
    points = points[near][on]
    across = geo.unit(np.cross(normal, start.axis))
    tie = PanelTie(np.ones(len(points), bool), normal, side_of(points, normal), across, states)
    return tie, (points, np.tile(normal, (len(points), 1)))
