"""Drawers slide along the normal of their front.

A front without texture that comes straight out shows by its borders alone how far it goes aside: a tilted
axis with states that are as much longer fits all depth of its plane equally well, and what leaks into its rim
turns the axis by what it likes.
"""

from __future__ import annotations

import numpy as np

from recon.dense.noise import DepthNoise
from recon.interaction.refine.board import MAX_RMS, MAX_TURN, MIN_SURFELS, flat_face
from recon.interaction.refine.terms import FrontTie
from twin import geometry as geo
from twin.geometry import Array
from twin.scene import Joint, Prismatic

# rad that the axis a slide starts from may be from the normal of its front, told by depth alone, which is up
# to 20 deg off in the plain fronts of eight open recordings. Chosen by us
LEAN_OF_DEPTH = np.radians(25.0)
# The same told by tracks, which know a front that is slanted on purpose. Chosen by us
LEAN_OF_TRACKS = np.radians(5.0)


def find_front(
    start: Joint, points: Array, normals: Array, noise: DepthNoise, lean: float
) -> FrontTie | None:
    """The front among surfels (K, 3) with their normals, in the part's frame: the flat face square to a
    slide's axis, by `lean` (rad) at most; None without one."""
    if not isinstance(start, Prismatic) or len(points) < MIN_SURFELS:
        return None
    cosine, least = normals @ start.axis, np.cos(lean + MAX_TURN)
    facing = start.axis * (1.0 if (cosine > least).sum() >= (cosine < -least).sum() else -1.0)
    square = normals @ facing > least
    if square.sum() < MIN_SURFELS:
        return None
    face = flat_face(points[square], facing, max(MAX_RMS, float(noise.measured(1.0))))
    if face is None or geo.line_angle(face[0], start.axis) > lean:
        return None
    normal, on = face
    members = square.copy()
    members[square] = on
    return FrontTie(members, normal, side_of(points[members], normal))


def side_of(points: Array, normal: Array) -> float:
    """Side, m, of the square over which points (n, 3) of a plane with this normal would spread as wide."""
    across = (points - points.mean(axis=0)) @ geo.orthogonal_basis(normal)[:, :2]
    return float(np.sqrt(12.0) * np.sqrt(np.mean(across**2)))
