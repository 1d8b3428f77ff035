"""Collision shapes: boxes for boards, convex hulls for the rest, clear of one another over the whole opening.

A piece of a mesh that is closed is a body: one box or hull where it is convex, CoACD's pieces where it is not
(twin.closed_pieces). What a camera saw is open: there boards are found first (twin.boards) and the rest is split
(twin.splitting). CoACD would close such a surface with voxels first, which thickens it: benchmarks/collision.md.
"""

from __future__ import annotations

import hashlib
import os
import tempfile
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from twin.boards import BoardSearch, beyond, find_boards
from twin.clearance import make_clear, points_of, sweep_states
from twin.closed_pieces import closed_piece_shapes
from twin.convex import cut, thick_hull, triangles_of
from twin.geometry import Array
from twin.main_axes import main_axes, outline_axes
from twin.scene import Box, Collision, Mesh, Twin
from twin.solid import pieces_of
from twin.splitting import decompose, merge

_VERSION = 3  # part of the cache key: raise it whenever the same input may give other shapes
_SPLITS = 3  # bodies of one part that CoACD may split, the largest: each takes seconds


@dataclass(frozen=True)
class CollisionConfig:
    """How shapes are made; lengths in metres. All defaults chosen by us.

    part_faces, static_faces: meshes are decimated to this many triangles first. tolerance: hulls of a part keep within it
    of the surface (a finger needs the gap behind a handle, which is 20-40 mm). thickness: least thickness of a shape.
    near: around everything the parts reach, the static scene is covered finely (near_tolerance), beyond it coarsely.
    clearance: between a part and what it moves past. step: the opening is sampled so that no point moves further.
    """

    part_faces: int = 6000
    static_faces: int = 16000
    tolerance: float = 0.007
    thickness: float = 0.006
    part_pieces: int = 32
    near: float = 0.25
    near_tolerance: float = 0.015
    near_pieces: int = 64
    far_tolerance: float = 0.06
    far_pieces: int = 48
    clearance: float = 0.002
    step: float = 0.02
    part_boards: BoardSearch = field(default_factory=BoardSearch)
    near_boards: BoardSearch = field(
        default_factory=lambda: BoardSearch(cell=0.01, smallest=0.004, noise=0.004, most=120)
    )
    far_boards: BoardSearch = field(
        default_factory=lambda: BoardSearch(
            deepest=0.06, thickness=0.01, cell=0.04, fill=0.85, smallest=0.08, noise=0.01, most=80
        )
    )


def with_collision(
    twin: Twin, config: CollisionConfig | None = None, cache_dir: Path | None = None, renew: bool = False
) -> Twin:
    """Give the static scene and every part collision shapes in the world frame at state 0.

    The shapes of a part keep `clearance` from those of the static scene over its whole range: static shapes give way,
    because the recording showed that the part moves there.

    Args:
        cache_dir: shapes are kept there under a key of meshes, joints and config, and read back when they match.
        renew: replace shapes that the twin has already; otherwise a twin in which everything has shapes is returned as is.
    """
    config = CollisionConfig() if config is None else config
    if not renew and twin.static.collision and all(p.collision for p in twin.parts):
        return twin
    path = None if cache_dir is None else cache_dir / f"collision_{_key(twin, config)}.npz"
    shapes = _read(path) if path is not None and path.exists() else _make(twin, config)
    if path is not None and not path.exists():
        _write(path, shapes)
    parts = tuple(replace(p, collision=tuple(s)) for p, s in zip(twin.parts, shapes[1:], strict=True))
    return replace(twin, static=replace(twin.static, collision=tuple(shapes[0])), parts=parts)


def _make(twin: Twin, config: CollisionConfig) -> list[list[Collision]]:
    parts = [part_shapes(p.mesh, config) for p in twin.parts]
    reach = [np.concatenate([points_of(s) for s in shapes]) for shapes in parts if shapes]
    moved = [
        q
        for p, points in zip([p for p, s in zip(twin.parts, parts, strict=True) if s], reach, strict=True)
        for q in (p.joint.pose(s)[:3, :3] @ points.T + p.joint.pose(s)[:3, 3:] for s in sweep_states(p, 0.1))
    ]
    corners = np.concatenate([q.T for q in moved]) if moved else np.zeros((0, 3))
    static = static_shapes(twin.static.mesh, corners, config)
    return make_clear(twin, [static, *parts], config.clearance, config.step)


def part_shapes(mesh: Mesh, config: CollisionConfig) -> list[Collision]:
    """Shapes of one part: boxes and hulls of its closed pieces; of open ones boxes where it is made of boards, hulls elsewhere."""
    shapes: list[Collision] = []
    rest: list[Mesh] = []
    pieces = sorted(pieces_of(mesh), key=lambda row: -row[0].area)
    splits = 0
    for k, (piece, closed) in enumerate(pieces):
        room = config.part_pieces - len(shapes) - (len(pieces) - 1 - k)
        found = None
        if closed and room > 0:
            found = closed_piece_shapes(piece, config.tolerance, room, splits < _SPLITS)
        if found is None:
            rest.append(piece)
        else:
            shapes += found
            splits += len(found) > 1
    if not rest:
        return shapes
    triangles = triangles_of(decimated(joined(rest), config.part_faces))
    if not len(triangles):
        return shapes
    room = max(4, config.part_pieces - len(shapes))
    return shapes + _cover(triangles, config.part_boards, config.tolerance, room, config.thickness, True)


def joined(meshes: Sequence[Mesh]) -> Mesh:
    """All meshes as one, without colours."""
    start = np.cumsum([0, *(len(m.vertices) for m in meshes)])
    return Mesh(
        np.concatenate([m.vertices for m in meshes]),
        np.concatenate([m.faces + n for m, n in zip(meshes, start, strict=False)]),
    )


def static_shapes(mesh: Mesh, reach: Array, config: CollisionConfig) -> list[Collision]:
    """Shapes of the static scene, fine around the points (n, 3) which the parts reach, coarse elsewhere."""
    triangles = triangles_of(decimated(mesh, config.static_faces))
    if not len(triangles):
        return []
    far, near = [], triangles
    if len(reach):
        low, high = reach.min(axis=0) - config.near, reach.max(axis=0) + config.near
        for k, axis in enumerate(np.eye(3)):
            outside, near = cut(near, axis, float(low[k]))
            near, beyond_high = cut(near, axis, float(high[k]))
            far += [outside, beyond_high]
    shapes: list[Collision] = []
    if len(near):
        shapes += _cover(
            near, config.near_boards, config.near_tolerance, config.near_pieces, config.thickness, False
        )
    rest = np.concatenate(far) if far else np.zeros((0, 3, 3))
    if len(rest):
        shapes += _cover(rest, config.far_boards, config.far_tolerance, config.far_pieces, 0.01, False)
    return shapes


def _cover(
    triangles: Array, search: BoardSearch, tolerance: float, most: int, thickness: float, tidy: bool
) -> list[Collision]:
    boxes, rest = find_boards(triangles, outline_axes(triangles) if tidy else main_axes(triangles), search)
    rest = beyond(rest, boxes, 2.5 * search.noise)
    pieces: list[Array] = []
    if len(rest):
        pieces = decompose(rest, lambda _: tolerance, thickness, most)
        if tidy:
            pieces = merge(pieces, lambda _: tolerance, thickness)
    hulls = [h for h in (thick_hull(p, thickness) for p in pieces) if h is not None]
    return [*boxes, *(h.mesh for h in hulls)]


def decimated(mesh: Mesh, faces: int) -> Mesh:
    """The mesh with at most about `faces` triangles (quadric edge collapse)."""
    if len(mesh.faces) <= faces:
        return mesh
    import fast_simplification

    vertices, triangles = fast_simplification.simplify(
        mesh.vertices.astype(np.float32), mesh.faces.astype(np.int32), target_count=faces
    )
    return Mesh(vertices.astype(np.float64), triangles)


def _key(twin: Twin, config: CollisionConfig) -> str:
    h = hashlib.sha256(f"{_VERSION}{asdict(config)}".encode())
    for mesh in (twin.static.mesh, *(p.mesh for p in twin.parts)):
        h.update(mesh.vertices.tobytes() + mesh.faces.tobytes())
    for p in twin.parts:
        h.update(p.joint.pose(p.joint.upper).tobytes() + p.joint.pose(1.0).tobytes())
        h.update(f"{p.id} {p.parent} {p.joint.lower!r} {p.joint.upper!r}".encode())
    return h.hexdigest()[:24]


def _write(path: Path, shapes: Sequence[Sequence[Collision]]) -> None:
    arrays: dict[str, NDArray[np.generic]] = {"count": np.array([len(s) for s in shapes])}
    for i, owner in enumerate(shapes):
        for k, piece in enumerate(owner):
            if isinstance(piece, Box):
                arrays[f"{i}_{k}_pose"], arrays[f"{i}_{k}_size"] = piece.T_world_box, piece.size
            else:
                arrays[f"{i}_{k}_vertices"], arrays[f"{i}_{k}_faces"] = piece.vertices, piece.faces
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, temporary = tempfile.mkstemp(suffix=".npz", dir=path.parent)
    with os.fdopen(handle, "wb") as out:
        np.savez(out, **arrays)  # type: ignore[arg-type]
    Path(temporary).replace(path)


def _read(path: Path) -> list[list[Collision]]:
    with np.load(path, allow_pickle=False) as data:
        return [
            [
                Box(data[f"{i}_{k}_pose"], data[f"{i}_{k}_size"])
                if f"{i}_{k}_pose" in data
                else Mesh(data[f"{i}_{k}_vertices"], data[f"{i}_{k}_faces"])
                for k in range(int(n))
            ]
            for i, n in enumerate(data["count"])
        ]
