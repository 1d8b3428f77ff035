"""Sides of a part's cabinet continued along neighbours above and below: one board for a drawer column."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from twin import geometry as geo
from twin.completion.board import Board
from twin.completion.cloud import OUT, SIDE, UP
from twin.completion.squared import FREE, OVER, Sight, overlap, sheet
from twin.geometry import Array

_NEAR = 0.03  # m from a side's inner face within which a neighbour ends at it
_NEXT = 0.04  # m between what stands one above the other
_LEAST = 0.05  # m, less goes on nowhere


def continued(
    sides: Sequence[tuple[Board, int]], boards: Sequence[Board], sight: Sight, T_world_frame: Array
) -> list[Board]:
    """The boards with the cabinets' sides continued beside them, where seen, or where nothing says free.

    Neighbours that end short of such a side are extended to the side; boards that are a piece of it go.

    Args:
        sides: seen sides of the parts' cabinets, each with its outward direction (-1 left, 1 right).
        boards: of the furniture, in one frame.
        sight: what cameras saw, in the world.
        T_world_frame: pose (4, 4) of the frame.
    """
    out = list(boards)
    for side, sign in sides:
        inner = float((side.low if sign > 0 else side.high)[SIDE])
        for up in (-1, 1):
            column = _column(side, sign, inner, up, out)
            strip = _strip(side, up, column)
            rest = [b for b in out if not _within(b, strip)]
            if strip.size[UP] < _LEAST or any(overlap(strip, b) for b in rest):
                continue
            seen = len(rest) < len(out)
            if not seen and sight.free(geo.transform(T_world_frame, sheet(strip, OUT))) > FREE:
                continue
            out = [_reaching(b, inner, sign) if any(b is c for c in column) else b for b in rest] + [strip]
    return out


def _column(side: Board, sign: int, inner: float, up: int, boards: Sequence[Board]) -> list[Board]:
    """The neighbours that end at a side, in a row from the side's lower (up = -1) or upper end."""
    ends = [
        b
        for b in boards
        if b.role == "neighbour"
        and -OVER < sign * (inner - float((b.high if sign > 0 else b.low)[SIDE])) < _NEAR
        and b.low[OUT] - OVER < side.high[OUT] < b.high[OUT]
    ]
    found, at = [], _end(side, up)
    for b in sorted(ends, key=lambda b: up * _end(b, -up)):
        if abs(_end(b, -up) - at) < _NEXT:
            found.append(b)
            at = _end(b, up)
    return found


def _end(board: Board, up: int) -> float:
    return float((board.high if up > 0 else board.low)[UP])


def _strip(side: Board, up: int, column: Sequence[Board]) -> Board:
    low, high = side.low.copy(), side.high.copy()
    ends = sorted([_end(side, up), _end(column[-1], up) if column else _end(side, up)])
    low[UP], high[UP] = ends
    where = "above" if up > 0 else "below"
    reason = f"{side.reason.split(':')[0]}: goes on beside what is {where} it"
    return replace(side, name=f"{side.name}_{where}", low=low, high=high, basis="assumed", reason=reason)


def _reaching(board: Board, inner: float, sign: int) -> Board:
    low, high = board.low.copy(), board.high.copy()
    (high if sign > 0 else low)[SIDE] = inner
    return replace(board, low=low, high=high)


def _within(board: Board, strip: Board) -> bool:
    return bool(np.all(board.low > strip.low - OVER) and np.all(board.high < strip.high + OVER))
