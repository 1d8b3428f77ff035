"""Surfaces of primitive shapes and of mesh files, each in its own frame."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from twin.collision.convex import hull_of
from twin.errors import InputError
from twin.geometry import Array
from twin.mesh import joined, signed_volume
from twin.scene import Mesh

# Chosen by us: a knob of 4 cm is then round to 0.1 mm.
_SECTIONS = 32
_SUBDIVISIONS = 3
_CONCAVE = 0.02  # share of its hull that a mesh may leave empty and still be taken for convex (chosen by us)


def box(size: ArrayLike) -> Mesh:
    """A box of `size` (3,) m about the origin."""
    import trimesh

    return _plain(trimesh.creation.box(extents=np.asarray(size, dtype=np.float64)))


def cylinder(radius: float, length: float) -> Mesh:
    """A cylinder along z about the origin."""
    import trimesh

    return _plain(trimesh.creation.cylinder(radius=radius, height=length, sections=_SECTIONS))


def capsule(radius: float, length: float) -> Mesh:
    """A cylinder of `length` along z about the origin, with half spheres on its ends."""
    import trimesh

    made = trimesh.creation.capsule(radius=radius, height=length, count=[_SECTIONS // 2, _SECTIONS])
    made.apply_translation([0.0, 0.0, -float(made.bounds.mean(axis=0)[2])])
    return _plain(made)


def ellipsoid(half: ArrayLike) -> Mesh:
    """An ellipsoid of half axes (3,) m about the origin; a sphere where they are equal."""
    import trimesh

    made = _plain(trimesh.creation.icosphere(subdivisions=_SUBDIVISIONS, radius=1.0))
    return Mesh(made.vertices * np.asarray(half, dtype=np.float64), made.faces)


def rectangle(half: ArrayLike) -> Mesh:
    """A rectangle of half sides (2,) m in the plane z = 0, facing up."""
    x, y = np.asarray(half, dtype=np.float64)
    corners = np.array([[-x, -y, 0], [x, -y, 0], [x, y, 0], [-x, y, 0]])
    return Mesh(corners, np.array([[0, 1, 2], [0, 2, 3]], np.int32))


def painted(mesh: Mesh, rgb: Sequence[float] | Array | None) -> Mesh:
    """The mesh in one colour (r, g, b) of 0..1; as it is for None."""
    if rgb is None:
        return mesh
    color = np.round(255 * np.clip(np.asarray(rgb, dtype=np.float64)[:3], 0.0, 1.0)).astype(np.uint8)
    return Mesh(mesh.vertices, mesh.faces, np.tile(color, (len(mesh.vertices), 1)))


def welded(vertices: Array, faces: NDArray[Any], colors: NDArray[np.uint8] | None) -> Mesh:
    """A mesh in which corners at one place and of one colour are one: files repeat them for their textures."""
    key = np.round(vertices, 9) + 0.0
    if colors is not None:
        key = np.concatenate([key, colors], axis=1)
    _, first, index = np.unique(key, axis=0, return_index=True, return_inverse=True)
    faces = index.reshape(-1)[faces]
    whole = (faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])
    return Mesh(vertices[first], faces[whole].astype(np.int32), None if colors is None else colors[first])


def mesh_file(path: Path, scale: Array, owner: str) -> tuple[Mesh, bool]:
    """The mesh in a file, scaled, textures sampled at its vertices, and whether the file has colours of its own.

    Raises InputError that names `owner` when the file isn't there or can't be read.
    """
    import trimesh

    if not path.is_file():
        raise InputError(f"{owner} names the mesh {path}, which is no file", "put the mesh there")
    try:
        loaded: Any = trimesh.load_scene(str(path), process=False)
        factor = (
            trimesh.units.unit_conversion(loaded.units, "meters") if path.suffix.lower() == ".dae" else 1.0
        )
        pieces = [g for g in loaded.dump() if hasattr(g, "faces") and len(g.faces)]
        colors = [_colors_of(g) for g in pieces]
    except Exception as e:  # whatever the parser of an unknown file raises
        reason = " ".join(f"{type(e).__name__}: {e}".split())[:200]
        raise InputError(f"{owner}: the mesh {path} can't be read: {reason}", "check the mesh file") from e
    if not pieces:
        raise InputError(f"{owner}: the mesh {path} has no faces", "check the mesh file")

    made = joined(
        [
            welded(np.asarray(g.vertices, np.float64) * scale * factor, np.asarray(g.faces, np.int64), c)
            for g, c in zip(pieces, colors, strict=True)
        ]
    )
    if float(np.prod(scale)) < 0:  # a mirrored mesh is inside out
        made = Mesh(made.vertices, made.faces[:, ::-1], made.colors)
    return made, made.colors is not None


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


def _colors_of(piece: Any) -> NDArray[np.uint8] | None:
    """Colours (V, 3) of a loaded mesh; None where the file gives none."""
    visual = piece.visual
    if not visual.defined:
        return None
    if visual.kind != "texture":
        return np.asarray(visual.vertex_colors, np.uint8)[:, :3]
    if visual.uv is None:  # a material without a texture
        plain = np.asarray(visual.material.main_color, np.uint8)[:3]
        return np.tile(plain, (len(piece.vertices), 1))
    return np.asarray(visual.to_color().vertex_colors, np.uint8)[:, :3]


def _plain(made: Any) -> Mesh:
    return Mesh(np.asarray(made.vertices, np.float64), np.asarray(made.faces, np.int32))
