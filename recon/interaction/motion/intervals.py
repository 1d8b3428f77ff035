"""When a joint moves: the intervals of its smoothed state.

FunREC, supplement 3.5: the motion takes the place of the model.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from twin.errors import SceneError
from twin.geometry import Array

# m; a track that moves less rests: eps_s of the paper.
MIN_DISPLACEMENT = 0.01
# Standard deviations of its depth by which a mover leaves its place. Chosen by us.
MOVER_SIGMAS = 5.0
# s; a track that stays so long is at rest. Chosen by us.
REST_SECONDS = 0.33
# Share of the travelled range that still counts as rest: the metric's definition (docs/metrics.md).
REST_SHARE = 0.02


@dataclass(frozen=True)
class Interval:
    """First and last moving frame, inclusive, and the joint kind if anything but motion hints at it."""

    first: int
    last: int
    hint: str | None = None

    def __post_init__(self) -> None:
        if self.first >= self.last:
            raise SceneError(f"an interval must have first < last, got {self.first}..{self.last}")


def state_intervals(
    frames: NDArray[np.int64], state: Array, noise: float, rest_share: float = REST_SHARE
) -> tuple[Interval, ...]:
    """Intervals of a joint from its smoothed state.

    A frame is at rest while the state stays within `rest_share` of the travelled range (or 3 `noise`, if
    larger) of a plateau. Plateaus are spans at least ten frames long at both ends or in between; what lies
    between two is motion.
    """
    span = float(np.quantile(state, 0.98) - np.quantile(state, 0.02))
    tolerance = max(rest_share * span, 3.0 * noise)
    found: list[Interval] = []
    k, n = 0, len(state)
    while k < n - 1:
        away = np.flatnonzero(np.abs(state[k:] - np.median(state[k : k + 3])) > tolerance)
        if not len(away):
            break
        first = k + int(away[0])
        last = _next_plateau(state, first, tolerance)
        if last > first:
            found.append(Interval(int(frames[first]), int(frames[last])))
        k = last + 1
    return tuple(found)


def _next_plateau(state: Array, start: int, tolerance: float, length: int = 10) -> int:
    """Last moving index before the state stays within `tolerance` of one value (`length` frames or good)."""
    n = len(state)
    for k in range(start + 1, n):
        rest = state[k : min(n, k + length)]
        settled = float(np.median(rest))
        if np.all(np.abs(rest - settled) <= tolerance):
            return k - 1
    return n - 1
