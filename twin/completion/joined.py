"""Boards that are one: a worktop seen in strips, with its front edge, or a plinth half hidden."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from twin import geometry as geo
from twin.completion.board import Board
from twin.completion.cloud import OUT, SIDE, UP, Cloud
from twin.completion.squared import FREE, OVER, Sight, overlap, sheet, stands_on
from twin.geometry import Array

_FLAT = 0.006  # m within which two faces are in one plane
_SAME = 0.003  # m between two faces that are one
_HIDDEN = 0.5  # share of the whole that may be hidden between its pieces; chosen by us
_EDGE = 0.06  # m, the thickest edge of a worktop
_TOUCHES = 0.03  # m between a worktop and its edge: where a fused surface rounds off
_ALONG = 0.5  # share of a worktop's length along which its edge was seen
_LONG = 0.3  # m, the shortest


@dataclass(frozen=True, eq=False)
class Row:
    """The furniture of some boards, in their frame.

    Attributes:
        cabinets: insides of the parts' cabinets, which stay free.
        tops: boards on top of these cabinets.
        rear: m along out, where the cabinets end.
        cloud: the seen surface.
        sight: what cameras saw, in the world.
        T_world_frame: pose (4, 4) of the frame.
    """

    cabinets: tuple[Board, ...]
    tops: tuple[Board, ...]
    rear: float
    cloud: Cloud
    sight: Sight
    T_world_frame: Array

    def holds(self, whole: Board, others: Sequence[Board]) -> bool:
        """Whether no seen surface, inside or solid among other boards contradicts a board."""
        solid = [b for b in others if b.role == "neighbour"]
        return not (
            any(overlap(whole, b) for b in (*self.cabinets, *solid)) or whole.contradicted(self.cloud)
        )

    def free(self, points: Array) -> float:
        """Share of points (n, 3) in the frame that some camera saw through."""
        return self.sight.free(self.T_world_frame[:3, 3] + points @ self.T_world_frame[:3, :3].T)


def joined(boards: Sequence[Board], row: Row) -> list[Board]:
    """The boards, those with one face joined where nothing seen says that it is open between them."""
    out = _strips(list(boards), row)
    out = _with_edges(out, row)
    return [_plinth(b, [o for o in out if o is not b], row) for b in out]


def _strips(boards: list[Board], row: Row) -> list[Board]:
    """Panels of one plane joined, largest first."""
    again = True
    while again:
        again = False
        boards.sort(key=lambda b: -float(np.sort(b.size)[1:].prod()))
        for a, b in combinations(boards, 2):
            others = [o for o in boards if o is not a and o is not b]
            whole = _one(a, b, others, row)
            if whole is not None:
                boards, again = [whole, *others], True
                break
    return boards


def _one(a: Board, b: Board, others: Sequence[Board], row: Row) -> Board | None:
    """Two panels and the hidden area between them as one; None if they are two."""
    axis = int(np.argmin(a.size))
    if not a.role == b.role == "panel" or axis != np.argmin(b.size) or b.size[axis] > _EDGE:
        return None
    if min(abs(a.low[axis] - b.low[axis]), abs(a.high[axis] - b.high[axis])) > _FLAT:
        return None
    low, high = np.minimum(a.low, b.low), np.maximum(a.high, b.high)
    whole = replace(a, low=low, high=high)
    points = sheet(whole, axis)
    across = [k for k in range(3) if k != axis]
    shown = np.zeros(len(points), bool)
    if any(overlap(whole, k) for k in others):
        return None  # another board stands between
    for k in (a, b, *row.tops):
        shown |= geo.every((points >= k.low - OVER)[:, across] & (points <= k.high + OVER)[:, across])
    if np.mean(~shown) > _HIDDEN or row.free(points[~shown]) > FREE or not row.holds(whole, others):
        return None
    basis = "evidence" if a.basis == b.basis == "evidence" else "assumed"
    return replace(whole, basis=basis, reason="furniture: face seen in pieces, joined where it is hidden")  # type: ignore[arg-type]


def _with_edges(boards: Sequence[Board], row: Row) -> list[Board]:
    """Worktops as thick as their front edges, which are then no boards of their own."""
    out = list(boards)
    for top in sorted(boards, key=lambda b: -float(b.size[SIDE])):
        if top.role != "panel" or int(np.argmin(top.size)) != UP:
            continue
        edge = next((e for e in out if e is not top and _is_edge(e, top)), None)
        if edge is None:
            continue
        low, high = np.minimum(top.low, edge.low), np.maximum(top.high, edge.high)
        below = tuple(_up_to(c, float(low[UP])) for c in row.cabinets)
        thick = f"furniture: worktop, {1000 * (high[UP] - low[UP]):.0f} mm thick by its front edge"
        others = [o for o in out if o is not top and o is not edge]
        whole = replace(top, low=low, high=high, basis="evidence", reason=thick)
        if replace(row, cabinets=below).holds(whole, others):
            out = [whole, *others]
    return out


def _up_to(inside: Board, level: float) -> Board:
    """Inside of a cabinet below a worktop: its top was taken to be a board, seen from above."""
    if not 0.0 < inside.high[UP] - level < _EDGE:
        return inside
    high = inside.high.copy()
    high[UP] = level
    return replace(inside, high=high)


def worktop_over(top: Board, boards: Sequence[Board]) -> bool:
    """Whether a cabinet's top lies in a worktop among boards (same frame) with a level upper face."""
    tops = [b for b in boards if int(np.argmin(b.size)) == UP and b.role == "panel"]
    return any(
        abs(b.high[UP] - top.high[UP]) < _SAME
        and np.all((top.low > b.low - OVER)[[SIDE, OUT]] & (top.high < b.high + OVER)[[SIDE, OUT]])
        for b in tops
    )


def _is_edge(edge: Board, top: Board) -> bool:
    shared = min(edge.high[SIDE], top.high[SIDE]) - max(edge.low[SIDE], top.low[SIDE])
    return bool(
        edge.role == "panel"
        and int(np.argmin(edge.size)) == OUT
        and edge.size[UP] < _EDGE
        and abs(edge.high[UP] - top.high[UP]) < 2 * _FLAT
        and -_TOUCHES < edge.low[OUT] - top.high[OUT] < _TOUCHES
        and shared > _ALONG * top.size[SIDE]
    )


def _plinth(board: Board, others: Sequence[Board], row: Row) -> Board:
    """A long panel set back below fronts as a plinth, up to the fronts and as deep as the cabinets."""
    if board.role != "panel" or int(np.argmin(board.size)) == SIDE or board.size[SIDE] < _LONG:
        return board
    above = [b for b in others if b.role == "neighbour" and stands_on(b, board)]
    if not above:
        return board
    low, high = board.low.copy(), board.high.copy()
    low[OUT], high[UP] = min(low[OUT], row.rear), min(float(b.low[UP]) for b in above)
    whole = replace(
        board,
        low=low,
        high=high,
        role="plinth",
        basis="assumed",
        reason="furniture: plinth, front seen, as deep as what it carries",
    )
    points = sheet(whole, OUT)
    hidden = points[points[:, UP] > board.high[UP]]
    return whole if row.free(hidden) <= FREE and row.holds(whole, others) else board
