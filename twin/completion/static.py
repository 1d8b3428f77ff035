"""The inferred layer of the static scene: cabinets of the parts, boards behind seen faces; the room apart."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from twin import geometry as geo
from twin.collision.boards import BoardSearch, beyond, find_boards
from twin.collision.convex import triangles_of
from twin.completion.board import Board, distinct
from twin.completion.by_furniture import by_furniture, nearest_piece, together
from twin.completion.cloud import OUT, SIDE, UP, Cloud
from twin.completion.eyes import EVERY
from twin.completion.furniture_handles import furniture_handles
from twin.completion.grooves import split_at_grooves
from twin.completion.hanging import hanging
from twin.completion.joined import Row, joined, worktop_over
from twin.completion.opening import Opening
from twin.completion.part import color_near
from twin.completion.room import FurnitureSplit
from twin.completion.shown import shown_surface, without_shreds
from twin.completion.sides import continued
from twin.completion.squared import Sight, squared
from twin.completion.sweep import out_of_the_way
from twin.completion.trimmed import trimmed
from twin.geometry import Array
from twin.inferred import Completion, Inferred, Interior
from twin.scene import Box, Mesh

SEARCH = BoardSearch(deepest=0.045, thickness=0.012, cell=0.01, smallest=0.012, noise=0.004, most=24)
# All chosen by us. m from the plane of a part's front within which other fronts lie.
_COPLANAR = 0.04
# Least area of a front, m^2.
_FRONT = 0.02
# m by which a neighbour may reach into an opening.
_GAP = 0.004
# Most pieces of the furniture.
MOST = 32
# Pieces kept for boards beside the cabinets of the parts.
_FEWEST = 12
# m, a little more than shapes keep from parts that move past.
_CLEAR = 0.0025
# Pieces of a handle: a bar on two posts.
_PIECES = 3
# Pieces kept for handles.
_RESERVED = 12
# m. A neighbour of less depth stays a board.
_SOLID = 0.05


def complete_static(
    mesh: Mesh, found: FurnitureSplit, opened: Sequence[Opening], swept: Array, sight: Sight | None
) -> Completion:
    """The inferred layer of the static scene, without collision shapes of surface in no piece.

    Args:
        mesh: its seen surface.
        found: which triangles are furniture.
        opened: the cabinets of the parts.
        swept: points (n, 3) that the parts pass.
        sight: what cameras saw; None without camera poses.
    """
    if not opened:
        return Completion(without_shreds(mesh.of(found.furniture)), (), (), (), mesh.of(~found.furniture))
    groups = by_furniture(opened)
    nearest = nearest_piece(groups, mesh.vertices[mesh.faces].mean(axis=1))
    layers = []
    of_furniture = np.zeros(len(mesh.faces), bool)
    for k, group in enumerate(groups):
        chosen = found.furniture & (nearest == k)
        layer, loose = _complete_piece(mesh.of(chosen), group, swept, sight)
        layers.append(layer)
        of_furniture[np.flatnonzero(chosen)[~loose]] = True
    return replace(together(layers), room=mesh.of(~of_furniture))


def _complete_piece(
    furniture: Mesh, opened: Sequence[Opening], swept: Array, sight: Sight | None
) -> tuple[Completion, NDArray[np.bool_]]:
    """The inferred layer of one piece of furniture, and which of its seen triangles hang on nothing of it."""
    cabinets: list[tuple[Opening, list[Board], Array]] = []
    shown, left = furniture, triangles_of(furniture)
    for o in opened:
        T = o.front.frame.T_world_frame
        cloud, passed = Cloud.of(furniture, T), o.front.local(swept)
        freed = [out_of_the_way(b, passed) for b in o.carcass.boards if not b.contradicted(cloud)]
        cabinets.append((o, [b for b in freed if b is not None and b.real], passed))
        shown = shown_surface(shown, cabinets[-1][1], T)
        left = beyond(left, [b.box(T) for b in cabinets[-1][1]], 3 * SEARCH.noise)
    most = max(_FEWEST, MOST - sum(len(boards) for _, boards, _ in cabinets))
    panels = _panels(furniture, left, opened, swept, sight, most)
    T = opened[0].front.frame.T_world_frame
    pieces: list[Inferred] = []
    fixed, boxes = [_inside_of(o, opened[0]) for o in opened], []
    for o, boards, passed in cabinets:
        own = [
            b for b in boards if not (b.role == "top" and worktop_over(_in_first(b, o, opened[0]), panels))
        ]
        wood = color_near(o.part.mesh, o.front.leaf.board("front"), o.front.frame.T_world_frame)
        pieces += [_clear_piece(b, o.front.frame.T_world_frame, furniture, passed, wood) for b in own]
        fixed += [_in_first(b, o, opened[0]) for b in boards]
        boxes += [b.box(o.front.frame.T_world_frame) for b in own]
    handles = furniture_handles([b for b in panels if _is_front(b)], Cloud.of(furniture, T))
    handles = handles[: max(0, (most - len(panels)) // _PIECES)]
    bars, blurred = [b for h in handles for b in h.boards], [(h.low, h.high) for h in handles]
    shown = shown_surface(shown, panels, T, blurred)
    if sight is not None:
        shown = trimmed(shown, [*boxes, *(b.box(T) for b in panels)], sight.eyes[::EVERY])
    held = hanging(without_shreds(shown), [*panels, *bars], fixed, furniture, T)
    pieces += [_clear_piece(b, T, furniture, cabinets[0][2]) for b in held.boards]
    return Completion(held.shown, tuple(pieces), (), _interiors(opened)), held.loose


def _interiors(opened: Sequence[Opening]) -> tuple[Interior, ...]:
    """The insides of cabinets with a door."""
    out = []
    for o in opened:
        size = o.carcass.high - o.carcass.low
        if o.front.frame.kind != "drawer" and np.all(size > 0.05):
            middle = geo.make_pose(translation=(o.carcass.low + o.carcass.high) / 2)
            out.append(Interior(f"{o.part.name}_inside", Box(o.front.frame.T_world_frame @ middle, size)))
    return tuple(out)


def _panels(
    furniture: Mesh, left: Array, opened: Sequence[Opening], swept: Array, sight: Sight | None, most: int
) -> list[Board]:
    """Boards and solid neighbours behind faces (n, 3, 3) of no part's cabinet, in the first front's frame.

    The largest faces come first, at most `most` less the pieces kept for handles.
    """
    first = opened[0]
    T, passed = first.front.frame.T_world_frame, first.front.local(swept)
    cloud = Cloud.of(furniture, T)
    found = find_boards(left, T[:3, :3], SEARCH)[0]
    found.sort(key=lambda b: -float(np.sort(b.box.size)[1:].prod()))
    boards: list[Board] = []
    for k, b in enumerate(found):
        face = _local(f"panel_{k + 1}", b.box, b.back, T)
        for one in split_at_grooves(face, cloud) if _is_front(face) else [face]:
            free = out_of_the_way(_neighbour(one, opened, cloud), passed)
            if free is not None and free.real and not free.contradicted(cloud):
                boards.append(free)
    if sight is None:
        return boards[: most - _RESERVED]
    insides = tuple(_inside_of(o, first) for o in opened)
    rear = max(o.carcass.rear for o in opened)
    tops = tuple(_in_first(b, o, first) for o in opened for b in o.carcass.boards if b.role == "top")
    whole = joined(boards, Row(insides, tops, rear, cloud, sight, T))[: most - _RESERVED]
    wide = continued(_sides(opened), squared(whole, insides, sight, T), sight, T)
    freed = [
        w if any(w is b for b in boards) else out_of_the_way(w, passed)
        for w in wide
        if not w.contradicted(cloud)
    ]
    return distinct([b for b in freed if b is not None])


def _sides(opened: Sequence[Opening]) -> list[tuple[Board, int]]:
    """Sides of the parts' cabinets that were seen, in the first front's frame, and their outward normals."""
    out = []
    for o in opened:
        inside = _inside_of(o, opened[0])
        for b in (_in_first(b, o, opened[0]) for b in o.carcass.boards if b.role == "side"):
            if b.basis == "evidence":
                out.append(
                    (b, 1 if b.low[SIDE] + b.high[SIDE] > inside.low[SIDE] + inside.high[SIDE] else -1)
                )
    return out


def _clear_piece(
    board: Board, T_world_frame: Array, furniture: Mesh, passed: Array, color: NDArray[np.uint8] | None = None
) -> Inferred:
    """A board as a piece whose shape keeps clear of points (n, 3) that the parts pass.

    The shape is a shorter box if possible: shapes cut later fall to many pieces.
    """
    piece = board.piece(T_world_frame, color_near(furniture, board, T_world_frame, color))
    shorter = out_of_the_way(board, passed, -_CLEAR)
    return (
        piece if shorter is None or not shorter.real else replace(piece, shapes=(shorter.box(T_world_frame),))
    )


def _local(name: str, box: Box, back: str, T_world_frame: Array) -> Board:
    """A box that lies along the frame's axes, as a board in it."""
    corners = geo.transform(geo.invert_pose(T_world_frame), box.corners)
    faces = {"seen": "both faces seen", "edge": "face and edges seen"}.get(
        back, "face seen; thickness assumed, the least of boards"
    )
    basis = "assumed" if back == "table" else "evidence"
    return Board(name, "panel", corners.min(axis=0), corners.max(axis=0), basis, f"furniture: {faces}")  # type: ignore[arg-type]


def _is_front(board: Board) -> bool:
    size = board.size
    large = size[SIDE] * size[UP] > _FRONT and size[SIDE] > 0.08 and size[UP] > 0.08
    return bool(abs(board.high[OUT]) < _COPLANAR and large)


def _neighbour(board: Board, opened: Sequence[Opening], cloud: Cloud) -> Board:
    """A front beside those of the parts stands for a whole cabinet, as deep as theirs, its inside unseen."""
    rear = max(o.carcass.rear for o in opened)
    if not _is_front(board) or board.high[OUT] - rear < _SOLID:
        return board
    low = board.low.copy()
    low[OUT] = rear
    reason = "furniture: front seen, as deep as the cabinet beside it"
    solid = replace(board, low=low, role="neighbour", basis="assumed", reason=reason)
    return board if solid.contradicted(cloud) or any(_meets(solid, o, opened[0]) for o in opened) else solid


def _meets(solid: Board, o: Opening, first: Opening) -> bool:
    """Whether a solid in the first front's frame reaches into the inside of a cabinet."""
    inside = _inside_of(o, first)
    return bool(np.all(np.minimum(inside.high, solid.high) - np.maximum(inside.low, solid.low) > _GAP))


def _inside_of(o: Opening, first: Opening) -> Board:
    """The inside of a cabinet, up to its front, as a box in the first front's frame."""
    return _in_first(Board("inside", "interior", *o.inside, "assumed", "the inside of a cabinet"), o, first)


def _in_first(board: Board, o: Opening, first: Opening) -> Board:
    """A board of one front's frame in the first front's frame."""
    to_first = geo.invert_pose(first.front.frame.T_world_frame) @ o.front.frame.T_world_frame
    corners = geo.transform(to_first, np.array([board.low, board.high]))
    return replace(board, low=corners.min(axis=0), high=corners.max(axis=0))
