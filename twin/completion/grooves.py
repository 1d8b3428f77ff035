"""Grooves between fronts in one plane, which a search for flat faces took for one board."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from twin.completion.board import Board
from twin.completion.cloud import OUT, SIDE, UP, Cloud

_BIN = 0.004  # m across a groove
_CELL = 0.02  # m along it, at least
_POINTS = 3.0  # of an even surface in a cell of a bin, at least
_ON = 0.004  # m from a front's face within which surface is that face
_DEEP = (0.005, 0.06)  # m behind it where a groove has its bottom and walls
# Share of a groove's length without a face
_GROOVE = 0.8
# Share of a groove's length with something seen behind it
_BOTTOM = 0.5
_NARROWEST = 0.008  # m, less is noise
_FRONT = 0.08  # m, the least width of a front beside one


def split_at_grooves(front: Board, cloud: Cloud) -> list[Board]:
    """The fronts that a board is: cut at each groove that runs across it, upright ones first.

    front: a board whose face along out was seen. cloud: the seen surface, in the same frame.
    """
    found = [level for upright in _cut(front, cloud, SIDE) for level in _cut(upright, cloud, UP)]
    return [found[0], *(replace(b, name=f"{front.name}_{k}") for k, b in enumerate(found[1:], 2))]


def _cut(front: Board, cloud: Cloud, axis: int) -> list[Board]:
    grooves = _grooves(front, cloud, axis)
    starts = [float(front.low[axis]), *(b for _, b in grooves)]
    ends = [*(a for a, _ in grooves), float(front.high[axis])]
    if not grooves or min(b - a for a, b in zip(starts, ends, strict=True)) < _FRONT:
        return [front]
    out = []
    for a, b in zip(starts, ends, strict=True):
        low, high = front.low.copy(), front.high.copy()
        low[axis], high[axis] = a, b
        out.append(replace(front, low=low, high=high))
    return out


def _grooves(front: Board, cloud: Cloud, axis: int) -> list[tuple[float, float]]:
    """Where (m along an axis, from and to) grooves run across a front's face."""
    other = SIDE + UP - axis
    near = cloud.where(cloud.within(front.low - [0, 0, _DEEP[1]], front.high + [0, 0, _DEEP[1]]))
    behind = float(front.high[OUT]) - near.points[:, OUT]
    cell = max(_CELL, _POINTS * cloud.area / _BIN)
    counts = max(1, int(front.size[axis] / _BIN)), max(1, int(front.size[other] / cell))
    edges = [
        np.linspace(front.low[k], front.high[k], n + 1) for k, n in zip((axis, other), counts, strict=True)
    ]

    def filled(which: NDArray[np.bool_]) -> NDArray[np.bool_]:
        at = near.points[which][:, [axis, other]]
        return np.asarray(np.histogram2d(at[:, 0], at[:, 1], edges)[0] > 0)

    bare = np.mean(~filled(np.abs(behind) < _ON), axis=1) >= _GROOVE
    deep = filled((behind > _DEEP[0]) & (behind < _DEEP[1]))
    found = []
    changes = np.flatnonzero(np.diff(np.concatenate([[False], bare, [False]]).astype(int)))
    for a, b in changes.reshape(-1, 2):
        wide = float(edges[0][b] - edges[0][a]) >= _NARROWEST
        if wide and a > 0 and b < len(bare) and np.mean(deep[a:b].any(axis=0)) >= _BOTTOM:
            found.append((float(edges[0][a]), float(edges[0][b])))
    return found
