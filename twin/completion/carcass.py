"""The cabinet around a part: sides, top, bottom and back, from its seen faces inside and outside."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from twin.completion.board import Board
from twin.completion.cloud import OUT, SIDE, UP, Cloud, Layer, layers
from twin.completion.leaf import BENT
from twin.completion.room import Front
from twin.geometry import Array
from twin.inferred import Basis

BOARD = 0.018  # m, the usual thickness of chipboard
_AS_BOARDS = f"thickness assumed, {1000 * BOARD:.0f} mm as boards have"
DEPTH = 0.50  # m, usual depth of a cabinet, where nothing was seen of it
# m from a front's edge to the inner face of the board that it covers half of, where no face was seen
_OVERLAY = 0.009
_AROUND = 0.035  # m outside the front's edges within which the inner face of a board may lie
_INWARD = 0.12  # m inside them
_LEAST = 0.004  # m^2 of a face
_REAR_LEAST = 0.01
_NEAREST_BACK = 0.12  # m
_GAP = 0.003  # m between the front's back and the boards
_THICKEST = 0.045  # m
_DEEPEST = 1.2  # m
_BESIDE = 0.3  # m beside an opening where furniture is as deep as its cabinet
_AT_WALL = 0.03  # m before a wall where what was seen up to there stands at it
_HANGS_OVER = 0.08  # m that a front may stand over the board behind its edge
_CLOSE = 0.06  # m behind a front that hides what is closer
_DEEP = 0.75  # m: no wall nearer than this has room between it and a cabinet before it
_NAMES = {(SIDE, -1): "left", (SIDE, 1): "right", (UP, -1): "bottom", (UP, 1): "top"}


@dataclass(frozen=True, eq=False)
class Carcass:
    """Boards in the front's frame; the inside from corner low (3,) to high (3,); whether a face was seen."""

    boards: tuple[Board, ...]
    low: Array
    high: Array
    seen: bool

    @property
    def rear(self) -> float:
        """Where (m along out) the cabinet ends."""
        return float(min([self.low[OUT], *(b.low[OUT] for b in self.boards)]))


@dataclass(frozen=True, eq=False)
class _Wall:
    """A board across the front's plane: place of the inner face, thickness, and the basis of both."""

    inner: float
    thickness: float
    seen: bool
    told: str


def find_carcass(front: Front, cloud: Cloud, wall: float | None, opening: Array, name: str) -> Carcass:
    """The cabinet of a part.

    Args:
        front: of the part.
        cloud: the furniture's seen surface in the front's frame.
        wall: where (m along out, negative) a wall or the floor ends the furniture; None if none was seen.
        opening: corners (2, 2) in side and up of the area that the part covers and moves before.
        name: the part's; the pieces' names begin with this name.
    """
    start = -front.leaf.thickness - _GAP
    inside = _inside(cloud, opening, start)
    walls = {key: _wall(inside, cloud, opening, *key, start) for key in _NAMES}
    backs = (
        [k for k in layers(inside, OUT, 1, _REAR_LEAST) if k.offset < -_NEAREST_BACK] if len(inside) else []
    )
    rear, basis, told = _rear(backs, cloud, opening, wall, start)
    low = np.array([walls[SIDE, -1].inner, walls[UP, -1].inner, rear])
    high = np.array([walls[SIDE, 1].inner, walls[UP, 1].inner, start])
    boards = []
    for (axis, s), found in walls.items():
        a, b = low.copy(), high.copy()
        if axis == UP:  # top and bottom lie between the sides
            a[SIDE], b[SIDE] = low[SIDE], high[SIDE]
        else:
            a[UP], b[UP] = low[UP] - walls[UP, -1].thickness, high[UP] + walls[UP, 1].thickness
        a[axis], b[axis] = sorted((found.inner, found.inner + s * found.thickness))
        role = "side" if axis == SIDE else _NAMES[axis, s]
        depth = "; depth assumed" if found.seen and basis == "assumed" else ""
        reason = f"cabinet {_NAMES[axis, s]}: {found.told}{depth}"
        boards.append(
            Board(
                f"{name}_cabinet_{_NAMES[axis, s]}",
                role,
                a,
                b,
                "evidence" if found.seen else "assumed",
                reason,
            )
        )
    a, b = low.copy(), high.copy()
    a[:2], b[:2] = boards[2].low[:2], boards[3].high[:2]
    a[OUT], b[OUT] = rear - BOARD, rear
    if wall is not None:
        a[OUT] = min(max(a[OUT], wall), rear - 0.004)
    boards.append(
        Board(
            f"{name}_cabinet_back",
            "back",
            a,
            b,
            basis,
            f"cabinet back: {told}; {_AS_BOARDS}",
        )
    )
    seen = bool(backs) or any(w.seen for w in walls.values())
    return Carcass(tuple(k for k in boards if k.real), low, high, seen)


def _inside(cloud: Cloud, opening: Array, start: float) -> Cloud:
    low = np.array([*(opening[0] - _AROUND), -_DEEPEST])
    high = np.array([*(opening[1] + _AROUND), start])
    return cloud.where(cloud.within(low, high))


def _wall(inside: Cloud, cloud: Cloud, opening: Array, axis: int, s: int, start: float) -> _Wall:
    """The board on one side of the opening: by its inner or outer face, else at the front's edge."""
    edge = float(opening[(s + 1) // 2, axis])
    faces = (
        [k for k in layers(inside, axis, -s, _LEAST) if s * (k.offset - edge) > -_INWARD]
        if len(inside)
        else []
    )
    outer = _outer(cloud, opening, axis, s, edge, start)
    if outer is None and not faces:
        outer = _overhung(cloud, opening, axis, s, edge, start)
    if faces:
        inner = faces[0].offset
        if outer is not None and 0.004 < s * (outer.offset - inner) < _THICKEST:
            t = abs(outer.offset - inner)
            return _Wall(inner, t, True, f"both faces seen, {1000 * t:.0f} mm thick")
        return _Wall(inner, BOARD, True, f"inner face seen; {_AS_BOARDS}")
    if outer is not None:
        return _Wall(
            outer.offset - s * BOARD,
            BOARD,
            True,
            f"outer face seen; {_AS_BOARDS}",
        )
    return _Wall(
        edge - s * _OVERLAY, BOARD, False, "not seen: place and thickness assumed, at the front's edge"
    )


def _outer(cloud: Cloud, opening: Array, axis: int, s: int, edge: float, start: float) -> Layer | None:
    """The outer face of the board on one side: near the edge of the opening, looking away."""
    found = _looking_away(cloud, opening, axis, s, (edge - s * 0.02, edge + s * _THICKEST), start)
    return found[0] if found else None


def _overhung(cloud: Cloud, opening: Array, axis: int, s: int, edge: float, start: float) -> Layer | None:
    """The outer face of a board under an overhanging front, such as a chest's lid: farther in, along much of
    the opening, seen from close behind the front."""
    other = UP if axis == SIDE else SIDE
    for k in _looking_away(cloud, opening, axis, s, (edge - s * _HANGS_OVER, edge), start):
        points = k.cloud.points
        long = np.ptp(np.quantile(points[:, other], [0.05, 0.95])) > 0.5 * np.ptp(opening[:, other])
        if long and np.quantile(points[:, OUT], 0.95) > start - _CLOSE and k.cloud.size > _REAR_LEAST:
            return k
    return None


def _looking_away(
    cloud: Cloud, opening: Array, axis: int, s: int, span: tuple[float, float], start: float
) -> list[Layer]:
    """Layers behind an opening that face one side, within a span along that axis, largest first."""
    other = UP if axis == SIDE else SIDE
    low, high = np.empty(3), np.empty(3)
    low[axis], high[axis] = sorted(span)
    low[other], high[other] = opening[0, other], opening[1, other]
    low[OUT], high[OUT] = -_DEEPEST, start
    return layers(cloud.where(cloud.within(low, high)), axis, s, _LEAST)


def _rear(
    backs: list[Layer],
    cloud: Cloud,
    opening: Array,
    wall: float | None,
    start: float,
) -> tuple[float, Basis, str]:
    """Where the inside ends: at the seen back, else at the end of the outside or the room's wall."""
    if backs:
        rear = backs[0].offset
        if wall is None or rear > wall + 0.002:
            return rear, "evidence", "inner face seen"
    reach = _reach(cloud, opening, _BESIDE, start)
    if wall is not None and (reach < wall + 0.1 or wall > -_DEEP):
        if _reach(cloud, opening, _AROUND, start) < wall + _AT_WALL:
            return wall + BOARD, "evidence", "its outside was seen up to the wall behind it"
        return wall + BOARD, "assumed", "not seen; assumed to reach the wall behind it"
    if reach < start - 0.25:
        return reach + BOARD, "evidence", "as deep as what was seen around it"
    return (
        min(start - DEPTH, reach),
        "assumed",
        f"not seen; depth assumed, {100 * DEPTH:.0f} cm as cabinets have",
    )


def _reach(cloud: Cloud, opening: Array, around: float, start: float) -> float:
    """How far back (m along out) a cabinet, or surface within `around` m, was seen: its sides and top."""
    low = np.array([*(opening[0] - around), -_DEEPEST])
    high = np.array([*(opening[1] + around), start])
    sides = cloud.where(cloud.within(low, high) & ~cloud.facing(OUT, 1))
    return float(np.quantile(sides.points[:, OUT], 0.02)) - BENT if sides.size > 4 * _LEAST else start
