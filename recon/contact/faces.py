"""Flat faces of a part's surface, and which of them lie before the hand."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from twin import geometry as geo
from twin.geometry import Array
from twin.handles import CONE, Face, outermost_face
from twin.mesh import sample_surface
from twin.scene import Mesh

SAMPLES = 40_000  # points on the mesh: some hundred on a bar that has one percent of a front's surface
_LEAST_FACE = 0.04  # of the surface: smaller flat regions are no face
_BESIDE_M = 0.04  # how far beside a face a hand may be that holds something on it
_BEHIND_M = 0.012  # how far behind a face a hand around its edge may be


@dataclass(frozen=True, eq=False)
class SurfaceSamples:
    """Evenly sampled surface: points (n, 3) and unit normals (n, 3) whose sign means nothing."""

    points: Array
    normals: Array


def sample(mesh: Mesh, count: int = SAMPLES) -> SurfaceSamples:
    """Sample a mesh evenly by area; the same for the same mesh."""
    return SurfaceSamples(*sample_surface(mesh, count, np.random.default_rng(0)))


def outer_faces(surface: SurfaceSamples) -> list[Face]:
    """The outermost flat face to either side of each direction of much surface, largest first."""
    found = []
    for direction in _directions(surface.normals):
        flat = surface.points[np.abs(surface.normals @ direction) > CONE]
        found += [outermost_face(flat, direction), outermost_face(flat, -direction)]
    return sorted(found, key=lambda f: -len(f.points))


def faces_before(surface: SurfaceSamples, hand: Array) -> list[Face]:
    """Flat faces that have the hand's centre (3,) in front of them, the largest first."""
    found = []
    for face in outer_faces(surface):
        height = float(hand @ face.normal - face.offset)
        if height > -_BEHIND_M:
            beside, _ = cKDTree(face.points).query(hand - height * face.normal)
            if beside < _BESIDE_M:
                found.append(face)
    return found


def _directions(normals: Array) -> list[Array]:
    """Directions (3,) that large shares of the normals have in common, up to their sign."""
    left = normals
    rng = np.random.default_rng(0)
    found: list[Array] = []
    while len(left) >= _LEAST_FACE * len(normals) and len(found) < 6:
        tries = left[rng.choice(len(left), min(100, len(left)), replace=False)]
        seed = tries[int(np.argmax((np.abs(tries @ left.T) > CONE).sum(axis=1)))]
        close = np.abs(left @ seed) > CONE
        if close.sum() < _LEAST_FACE * len(normals):
            break
        signed = left[close] * np.sign(left[close] @ seed)[:, None]
        found.append(geo.unit(signed.mean(axis=0)))
        left = left[~close]
    return found
