"""Surfaces of primitive shapes, each in its own frame, and convex hulls."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from twin.collision.convex import hull_of
from twin.mesh import signed_volume
from twin.scene import Mesh

# Chosen by us: a knob of 4 cm is then round to 0.1 mm.
_SECTIONS = 32
_SUBDIVISIONS = 3
_CONCAVE = 0.02  # share of its hull that a mesh may leave empty and still be taken for convex (chosen by us)


def box(size: ArrayLike) -> Mesh:
    """A box of `size` (3,) m about the origin."""
    import trimesh

    return _plain(trimesh.creation.box(extents=np.asarray(size, dtype=np.float64)))


def cylinder(radius: float, length: float, sections: int = _SECTIONS) -> Mesh:
    """A cylinder along z about the origin, of so many corners around it."""
    import trimesh

    return _plain(trimesh.creation.cylinder(radius=radius, height=length, sections=sections))


def capsule(radius: float, length: float, sections: int = _SECTIONS) -> Mesh:
    """A cylinder of `length` along z about the origin, with half spheres on its ends."""
    import trimesh

    made = trimesh.creation.capsule(radius=radius, height=length, count=[sections // 2, sections])
    made.apply_translation([0.0, 0.0, -float(made.bounds.mean(axis=0)[2])])
    return _plain(made)


def ellipsoid(half: ArrayLike, subdivisions: int = _SUBDIVISIONS) -> Mesh:
    """An ellipsoid of half axes (3,) m about the origin; a sphere where they are equal."""
    import trimesh

    made = _plain(trimesh.creation.icosphere(subdivisions=subdivisions, radius=1.0))
    return Mesh(made.vertices * np.asarray(half, dtype=np.float64), made.faces)


def rectangle(half: ArrayLike) -> Mesh:
    """A rectangle of half sides (2,) m in the plane z = 0, facing up."""
    x, y = np.asarray(half, dtype=np.float64)
    corners = np.array([[-x, -y, 0], [x, -y, 0], [x, y, 0], [-x, y, 0]])
    return Mesh(corners, np.array([[0, 1, 2], [0, 2, 3]], np.int32))


def convex(mesh: Mesh) -> Mesh | None:
    """The mesh's convex hull; None for a flat mesh."""
    hull = hull_of(mesh.vertices)
    return None if hull is None else hull.mesh


def is_convex(mesh: Mesh) -> bool:
    """True when the mesh fills its convex hull."""
    hull = hull_of(mesh.vertices)
    if hull is None:
        return False
    volume = signed_volume(mesh.vertices[mesh.faces] - hull.vertices.mean(axis=0))
    return abs(abs(volume) - hull.volume) <= _CONCAVE * hull.volume


def _plain(made: Any) -> Mesh:
    return Mesh(np.asarray(made.vertices, np.float64), np.asarray(made.faces, np.int32))
