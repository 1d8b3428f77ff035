"""Handles before fronts of the furniture that stand still."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from twin.completion.board import Board
from twin.completion.cloud import OUT, Cloud
from twin.completion.handle import Handle, find_handles
from twin.completion.leaf import Leaf
from twin.completion.squared import PLANE

# m, noise of a face of the static scene (twin.completion.static searches its boards with as much).
_NOISE = 0.004


def furniture_handles(fronts: Sequence[Board], cloud: Cloud) -> list[Handle]:
    """Handles before fronts that stand still, sought on one plane at once: a front may be many boards."""
    found: list[Handle] = []
    left = sorted(fronts, key=lambda b: -float(b.high[OUT]))
    while left:
        plane = float(left[0].high[OUT])
        same = [b for b in left if plane - b.high[OUT] < PLANE]
        left = left[len(same) :]
        corners = np.stack(
            [np.min([b.low[:2] for b in same], axis=0), np.max([b.high[:2] for b in same], axis=0)]
        )
        up = np.array([0.0, 0.0, float(np.median([b.high[OUT] for b in same]))])
        lifted = Cloud(cloud.points - up, cloud.normals, cloud.area)
        whole = Leaf(corners, 0.0, "evidence", "")
        for h in find_handles(lifted, whole, _NOISE, None, f"handle_{len(found) + 1}"):
            if any(_before(h, b) for b in same):
                boards = tuple(replace(b, low=b.low + up, high=b.high + up) for b in h.boards)
                found.append(Handle(boards, h.low + up, h.high + up))
    named = []
    for k, h in enumerate(found):  # names count over all planes
        first = h.boards[0].name
        boards = tuple(replace(b, name=b.name.replace(first, f"handle_{k + 1}", 1)) for b in h.boards)
        named.append(replace(h, boards=boards))
    return named


def _before(handle: Handle, board: Board) -> bool:
    middle = (handle.low + handle.high)[:2] / 2
    return bool(np.all((middle > board.low[:2]) & (middle < board.high[:2])))
