"""Collision shapes: boxes for boards, convex hulls for the rest, clear of one another over the whole opening.

A piece of a mesh that is closed is a body: one box or hull where it is convex, CoACD's pieces where it is not
(twin.collision.closed_pieces). What a camera saw is open: there boards are found first
(twin.collision.boards) and the rest is split (twin.collision.splitting). CoACD would close such a surface
with voxels first, which thickens it: benchmarks/collision.md.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from twin import geometry as geo
from twin.collision.boards import BoardSearch, Slab, beyond, find_boards
from twin.collision.cache import ShapeCache
from twin.collision.clearance import STEP, Yielding, make_clear, points_of, sweep_states
from twin.collision.closed_pieces import closed_piece_shapes
from twin.collision.convex import cut, thick_hull, triangles_of
from twin.collision.decimation import decimated, decimated_body
from twin.collision.main_axes import main_axes, outline_axes
from twin.collision.meetings import filtered_owners
from twin.collision.pieces import pieces_of
from twin.collision.splitting import decompose, merge
from twin.files.paths import AnyPath
from twin.geometry import Array
from twin.mesh import joined
from twin.runs.setting import Settings, setting
from twin.runs.settings import from_dict
from twin.scene import Collision, Mesh, Twin

# m^2: less surface than on a knob of 1 cm is a shred of a scan
_SPECK = 3e-4
# Bodies of one part that CoACD may split, the largest: each takes seconds
_SPLITS = 3
# Triangles to which a part's mesh is decimated first; chosen by us
PART_FACES = 6_000
# The same of the static scene's mesh; chosen by us
_STATIC_FACES = 16_000
# Boards of parts; chosen by us but for the thickness, which is that of the thinnest usual cabinet front
# (assets/materials.toml, 12 to 22 mm), so that a board claims no space that may be free
PART_BOARDS = BoardSearch(deepest=0.08, thickness=0.012, cell=0.006, smallest=0.006, noise=0.003, most=24)
# m; so far around everything the parts reach, the static scene is covered finely; chosen by us
_NEAR = 0.25
# Boards of the static scene there; chosen by us
_NEAR_BOARDS = BoardSearch(deepest=0.045, thickness=0.006, cell=0.01, smallest=0.004, noise=0.004, most=120)
# m; hulls of the static scene there keep within it of the surface; chosen by us
NEAR_TOLERANCE = 0.015
# Boards of the static scene beyond; chosen by us
_FAR_BOARDS = BoardSearch(
    deepest=0.06, thickness=0.01, cell=0.04, smallest=0.08, noise=0.01, most=80, fill=0.85
)
# m; as NEAR_TOLERANCE, beyond; chosen by us
_FAR_TOLERANCE = 0.06
# Most hulls beyond; chosen by us
_FAR_PIECES = 48
# m; least thickness of a hull beyond; chosen by us
_FAR_THICKNESS = 0.01


@dataclass(frozen=True)
class CollisionConfig(Settings):
    """How collision shapes are made; every default was chosen by us."""

    part_pieces: int = setting(
        32,
        "most shapes made of a part's surface, before some give way to a motion and fall to several; boards of the inferred layer "
        "stand besides",
        unit="shapes",
        at_least=1,
    )
    static_pieces: int = setting(
        64,
        "most hulls of the static scene near what the parts reach, beside its boards (`--geometry seen`)",
        unit="hulls",
        at_least=1,
    )
    tolerance: float = setting(
        0.007,
        "hulls of a part keep within it of the surface: a finger needs the gap behind a handle, which is 20 to 40 mm",
        unit="m",
        above=0,
    )
    thickness: float = setting(0.006, "least thickness of a hull", unit="m", above=0)
    clearance: float = setting(0.002, "between a part and what it moves past", unit="m", at_least=0)


def collision_config(settings: Mapping[str, Any] | None = None) -> CollisionConfig:
    """The settings of these names, and the defaults of all others. Raises ConfigError."""
    return from_dict(CollisionConfig, settings or {}, "collision")


@dataclass(frozen=True, eq=False)
class Made:
    """Shapes of one part before anything gives way, the seconds they took on the clock, and, of the area of
    its boards, the shares whose thickness is of their edges or of the table as no camera saw their back."""

    shapes: tuple[Collision, ...]
    seconds: float = 0.0
    edge: float = 0.0
    table: float = 0.0


def with_collision(
    twin: Twin, config: CollisionConfig | None = None, cache_dir: AnyPath | None = None, renew: bool = False
) -> Twin:
    """Give the static scene and every part that has no collision shapes some, in the world frame at state 0.

    The shapes of a part keep `clearance` from those of the static scene over its whole range: static shapes
    give way, because the recording showed that the part moves there. Shapes that the twin has already stay,
    and what is made gives way to them, except in filtered pairs. A part that would lose all its shapes keeps
    them, or nothing could touch it. Where shapes overlap is left to `twin.collision.meetings` to say.

    Args:
        cache_dir: shapes are kept there and read back when mesh and config match, each part's by itself, and
            all again after they gave way to one another, under a key of the twin's meshes, joints and shapes.
        renew: replace shapes that the twin has already; otherwise a twin in which everything has shapes is
            returned as is.
    """
    config = CollisionConfig() if config is None else config
    given = [twin.static.collision, *(p.collision for p in twin.parts)]
    stated: list[tuple[Collision, ...]] = [() if renew else own for own in given]
    if all(stated):
        return twin
    cache = ShapeCache(cache_dir, asdict(config))
    made = cache.cached(cache.key_of_twin(twin, stated), lambda: _make(twin, stated, config, cache))
    shapes = [own or tuple(new) for own, new in zip(stated, made, strict=True)]
    parts = tuple(replace(p, collision=s) for p, s in zip(twin.parts, shapes[1:], strict=True))
    return replace(twin, static=replace(twin.static, collision=shapes[0]), parts=parts)


def _make(
    twin: Twin, stated: Sequence[tuple[Collision, ...]], config: CollisionConfig, cache: ShapeCache
) -> list[list[Collision]]:
    parts = [
        list(own or made_for(p.mesh, config, cache).shapes)
        for p, own in zip(twin.parts, stated[1:], strict=True)
    ]
    moved = [
        geo.transform(p.joint.pose(s), np.concatenate([points_of(x) for x in shapes]))
        for p, shapes in zip(twin.parts, parts, strict=True)
        if shapes
        for s in sweep_states(p, 0.1)
    ]
    reach = np.concatenate(moved) if moved else np.zeros((0, 3))
    static = list(stated[0]) or static_shapes(twin.static.mesh, reach, config)
    yielding = Yielding({k for k, own in enumerate(stated) if own}, filtered_owners(twin))
    cleared = make_clear(twin, [static, *parts], config.clearance, STEP, yielding)
    return [cleared[0], *(left or whole for left, whole in zip(cleared[1:], parts, strict=True))]


def made_for(mesh: Mesh, config: CollisionConfig, cache: ShapeCache) -> Made:
    """What `make_part` gives, from the cache where it is there."""
    key, numbers = cache.key_of_mesh(mesh), ("seconds", "edge", "table")

    def make() -> tuple[list[list[Collision]], dict[str, float]]:
        started = time.perf_counter()
        made = make_part(mesh, config)
        return [list(made.shapes)], asdict(replace(made, shapes=(), seconds=time.perf_counter() - started))

    shapes, told = cache.cached_with(key, make, numbers)
    return Made(tuple(shapes[0]), **told)


def make_part(mesh: Mesh, config: CollisionConfig) -> Made:
    """Shapes of one part, at most `part_pieces`: boxes and hulls of its closed pieces; of what is open boxes
    where it is made of boards, hulls elsewhere."""
    shapes: list[Collision] = []
    rest: list[Mesh] = []
    pieces = sorted(pieces_of(mesh), key=lambda row: -row[0].area)
    splits = 0
    for k, (piece, closed) in enumerate(pieces):
        reserve = min(len(pieces) - 1 - k + len(rest), max(1, config.part_pieces // 4))
        room = config.part_pieces - len(shapes) - reserve
        found = None
        body = decimated_body(piece, PART_FACES) if closed and room > 0 else None
        if body is not None:
            found = closed_piece_shapes(body, config.tolerance, room, splits < _SPLITS)
        if found is None:
            rest.append(piece)
        else:
            shapes += found
            splits += len(found) > 1
    triangles = triangles_of(decimated(joined(rest), PART_FACES)) if rest else np.zeros((0, 3, 3))
    if not len(triangles):
        return Made(tuple(shapes) or whole_hull(mesh, config))
    room = max(1, config.part_pieces - len(shapes))
    covered, boards = cover(triangles, config, room)
    face = {b: float(np.prod(np.sort(b.box.size)[1:])) for b in boards}
    share = {
        s: sum(a for b, a in face.items() if b.back == s) / max(sum(face.values()), 1e-12)
        for s in ("edge", "table")
    }
    return Made((*shapes, *covered) or whole_hull(mesh, config), 0.0, share["edge"], share["table"])


def whole_hull(mesh: Mesh, config: CollisionConfig) -> tuple[Collision, ...]:
    """The hull of a mesh too small or too ragged for pieces, so that every surface can be touched."""
    small = decimated(mesh, PART_FACES)
    hull = thick_hull(small.vertices[small.faces], config.thickness) if len(small.faces) else None
    return () if hull is None else (hull.mesh,)


def static_shapes(mesh: Mesh, reach: Array, config: CollisionConfig) -> list[Collision]:
    """Shapes of the static scene, fine around the points (n, 3) which the parts reach, coarse elsewhere."""
    triangles = triangles_of(decimated(mesh, _STATIC_FACES))
    if not len(triangles):
        return []
    far, near = [], triangles
    if len(reach):
        low, high = reach.min(axis=0) - _NEAR, reach.max(axis=0) + _NEAR
        for k, axis in enumerate(np.eye(3)):
            outside, near = cut(near, axis, float(low[k]))
            near, beyond_high = cut(near, axis, float(high[k]))
            far += [outside, beyond_high]
    shapes: list[Collision] = []
    if len(near):
        shapes += _static_cover(near, _NEAR_BOARDS, NEAR_TOLERANCE, config.static_pieces, config.thickness)
    rest = np.concatenate(far) if far else np.zeros((0, 3, 3))
    if len(rest):
        shapes += _static_cover(rest, _FAR_BOARDS, _FAR_TOLERANCE, _FAR_PIECES, _FAR_THICKNESS)
    return shapes


def cover(triangles: Array, config: CollisionConfig, most: int) -> tuple[list[Collision], list[Slab]]:
    """At most `most` boxes and hulls of a part's open surface (n, 3, 3), and the boards of the boxes."""
    boards, rest = find_boards(triangles, outline_axes(triangles), PART_BOARDS)
    boards = boards[:most]
    rest = beyond(rest, [b.box for b in boards], 3 * PART_BOARDS.noise)
    hulls = surface_hulls(rest, config, most - len(boards)) if len(rest) and most > len(boards) else []
    return [*(b.box for b in boards), *hulls], boards


def surface_hulls(triangles: Array, config: CollisionConfig, most: int) -> list[Collision]:
    """Hulls of an open surface (n, 3, 3); beyond `most`, the smallest are left out."""
    filled = PART_BOARDS.deepest / 2
    pieces = decompose(triangles, config.tolerance, config.thickness, 2 * config.part_pieces, filled)
    pieces = merge(pieces, config.tolerance, config.thickness, filled)
    pieces = [p for p in pieces if geo.triangle_areas(p).sum() > _SPECK]
    pieces = sorted(pieces, key=lambda p: -float(geo.triangle_areas(p).sum()))[:most]
    return [h.mesh for p in pieces if (h := thick_hull(p, config.thickness)) is not None]


def _static_cover(
    triangles: Array, search: BoardSearch, tolerance: float, most: int, thickness: float
) -> list[Collision]:
    boards, rest = find_boards(triangles, main_axes(triangles), search)
    rest = beyond(rest, [b.box for b in boards], 2.5 * search.noise)
    pieces = decompose(rest, tolerance, thickness, most) if len(rest) else []
    hulls = [h for h in (thick_hull(p, thickness) for p in pieces) if h is not None]
    return [*(b.box for b in boards), *(h.mesh for h in hulls)]
