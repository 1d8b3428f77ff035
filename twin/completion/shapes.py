"""Collision shapes of the inferred layer: boxes of pieces, hulls of other seen surface, cut for motions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from twin import geometry as geo
from twin.collision import NEAR_TOLERANCE, PART_FACES, CollisionConfig, surface_hulls
from twin.collision.boards import BoardSearch, beyond, find_boards
from twin.collision.clearance import STEP, make_clear, points_of
from twin.collision.convex import hull_of, thick_hull, triangles_of
from twin.collision.decimation import decimated
from twin.collision.main_axes import main_axes
from twin.collision.splitting import decompose
from twin.geometry import Array
from twin.inferred import Completion
from twin.scene import Box, Collision, Mesh, Twin

# Most shapes of a body.
PART_SHAPES = 24
FURNITURE_SHAPES = 40
ROOM_SHAPES = 16
ROOM = BoardSearch(
    deepest=0.06, thickness=0.02, cell=0.05, fill=0.8, smallest=0.15, noise=0.015, most=ROOM_SHAPES
)
_MARGIN = 0.012  # m around a piece within which seen surface is its own
_LEAST_HULLS = 4  # that what lies in no piece may have, however many pieces there are
# m; least thickness of a hull of the furniture, chosen by us
_THICKNESS = 0.006
_SPECK = 1e-3  # m^2: less surface is a shred of a scan
_EXACT = 1e-3  # m


def with_shapes(twin: Twin, config: CollisionConfig | None = None) -> Twin:
    """The twin with collision shapes in its inferred layers; the rest gives way to parts over their range."""
    config = CollisionConfig() if config is None else config
    most = min(PART_SHAPES, config.part_pieces)
    layers = [twin.static.completion, *(p.completion for p in twin.parts)]
    static = layers[0]
    if static is None or any(k is None for k in layers):
        return twin
    given = [[s for p in layer.pieces for s in p.shapes] for layer in layers if layer is not None]
    given[0] += _furniture_hulls(static, FURNITURE_SHAPES - len(given[0]))
    for shapes, layer in zip(given[1:], layers[1:], strict=True):
        if layer is not None:
            left, limited = _beyond_pieces(layer), replace(config, part_pieces=most)
            room = max(min(_LEAST_HULLS, most), most - len(shapes))
            shapes += surface_hulls(left, limited, room) if len(left) else []
    own = len(given[0])
    given[0] += _of_room(static.room) if static.room is not None else []
    cleared = make_clear(twin, given, config.clearance, STEP)
    rooms = [s for s in cleared[0] if _from(s, given[0][own:]) and not _from(s, given[0][:own])]
    kept = [s for s in cleared[0] if not any(s is r for r in rooms)]
    of_furniture = _handed_out(static, kept)
    hulls = _largest(of_furniture.collision, FURNITURE_SHAPES - len(kept) + len(of_furniture.collision))
    done = [replace(of_furniture, collision=hulls, room_collision=tuple(rooms))]
    done += [
        _handed_out(layer, shapes)
        for layer, shapes in zip(layers[1:], cleared[1:], strict=True)
        if layer is not None
    ]
    parts = tuple(replace(p, completion=c) for p, c in zip(twin.parts, done[1:], strict=True))
    return replace(twin, static=replace(twin.static, completion=done[0]), parts=parts)


def _beyond_pieces(layer: Completion) -> Array:
    """Seen surface (n, 3, 3), decimated, that lies in no piece."""
    boxes = [s for p in layer.pieces for s in p.shapes if isinstance(s, Box)]
    return beyond(triangles_of(decimated(layer.shown, PART_FACES)), boxes, _MARGIN)


def _furniture_hulls(layer: Completion, room: int) -> list[Collision]:
    """Coarse hulls, at most `room` or a few, of what stands on the furniture or is no board of it."""
    left = _beyond_pieces(layer)
    pieces = decompose(left, NEAR_TOLERANCE, _THICKNESS, max(_LEAST_HULLS, room)) if len(left) else []
    large = [p for p in pieces if geo.triangle_areas(p).sum() > _SPECK]
    return [h.mesh for p in large if (h := thick_hull(p, _THICKNESS)) is not None]


def _largest(shapes: Sequence[Collision], most: int) -> tuple[Collision, ...]:
    """At most so many of the shapes: a hull cut for a part falls to slivers, the smallest of which go."""
    volumes = [-1.0 if (h := hull_of(points_of(s))) is None else h.volume for s in shapes]
    kept = set(np.argsort(volumes, kind="stable")[::-1][: max(_LEAST_HULLS, most)].tolist())
    return tuple(s for k, s in enumerate(shapes) if k in kept)


def _of_room(room: Mesh) -> list[Collision]:
    """Few boxes: floor, walls, what is large."""
    triangles = triangles_of(decimated(room, PART_FACES))
    return [b.box for b in find_boards(triangles, main_axes(triangles), ROOM)[0]] if len(triangles) else []


def _handed_out(layer: Completion, shapes: Sequence[Collision]) -> Completion:
    """The layer with its shapes, each with the piece that it was made for, as a whole or in part."""
    left = list(shapes)
    pieces = []
    for piece in layer.pieces:
        mine = [s for s in left if _from(s, piece.shapes)]
        left = [s for s in left if not any(s is m for m in mine)]
        pieces.append(replace(piece, shapes=tuple(mine)))
    return replace(layer, pieces=tuple(pieces), collision=tuple(left))


def _from(shape: Collision, made: Sequence[Collision]) -> bool:
    """Whether a shape is one of those that were made, or what is left of one."""
    points = shape.vertices if isinstance(shape, Mesh) else shape.corners
    for other in made:
        if shape is other:
            return True
        if isinstance(other, Box):
            local = geo.transform(geo.invert_pose(other.T_world_box), points)
            if np.all(np.abs(local) < other.size / 2 + _EXACT):
                return True
        elif np.all(
            (points > other.vertices.min(axis=0) - _EXACT) & (points < other.vertices.max(axis=0) + _EXACT)
        ):
            return True
    return False
