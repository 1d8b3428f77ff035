"""A part's front: the large outer face that a person opens it by, and the rim around it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from recon.contact.faces import SurfaceSamples, outer_faces
from recon.interaction.parts.moving_part import MovingPart
from twin import geometry as geo
from twin.geometry import Array
from twin.scene import Prismatic

_ENOUGH = 0.5  # of the largest face; chosen by us
ALONG = 0.7  # cosine between a front's normal and the way of what slides along it


@dataclass(frozen=True, eq=False)
class Front:
    """Points (n, 3) of the part's large outer face at state 0 and the rim (r, 3) around it."""

    points: Array
    rim: Array
    normal: Array


def front_of(surface: SurfaceSamples, part: MovingPart, eyes: Array) -> Front:
    """The part's front: of the largest flat faces, the one towards the viewer; of a slide, one square to its
    motion if any. A small piece before the others is no front: its rim is not the part's."""
    faces = outer_faces(surface)
    if isinstance(part.joint, Prismatic):
        square = [f for f in faces if abs(f.normal @ part.joint.axis) > ALONG]
        if square and len(square[0].points) > 0.2 * len(faces[0].points):
            faces = square
    enough = _ENOUGH * len(faces[0].points)
    same = [f for f in faces if abs(f.normal @ faces[0].normal) > 0.9 and len(f.points) >= enough]
    middle = eyes.mean(axis=0)
    face = max(same, key=lambda f: float(middle @ f.normal - f.offset))
    return Front(face.points, _rim(face.points, face.normal), face.normal)


def _rim(points: Array, normal: Array, step: float = 0.01) -> Array:
    """Points (r, 3) every `step` m on the convex outline of a flat face."""
    basis = geo.orthogonal_basis(normal)
    local = points @ basis
    try:
        corners = local[ConvexHull(local[:, :2]).vertices]
    except QhullError:
        return points
    rim = []
    for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        n = max(1, round(float(np.linalg.norm(b - a)) / step))
        rim.append(a + (b - a) * (np.arange(n) / n)[:, None])
    return np.asarray(np.concatenate(rim) @ basis.T)
