"""Which axis of given tracks counts the frames: a point moves little from one frame to the next."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import NDArray

from twin.geometry import Array

MIN_LENGTH = 8  # frames and tracks; fewer say nothing about an order; chosen by us
# Chosen by us, on the closed-form tracks of the tests: frames first, neighbours on the track axis are at
# least as far from each other as a point moves in a frame; tracks first, they are 5 to 100 times nearer.
MUCH_NEARER = 0.2
# Entries along an unordered axis are as far apart as any two (1); along time they are much nearer.
NO_ORDER = 0.7


def first_axis(points: Array) -> Literal["frames", "tracks", "unclear"]:
    """What the first axis of points (A, B, 3) counts, NaN where not visible.

    "tracks" only where there is no doubt: neighbours on the second axis lie much nearer to each other than
    those on the first, and those on the first as far apart as any two, so no time. "unclear" when the first
    of these holds alone: few fast frames of dense tracks, or tracks sorted by their place.
    """
    if min(points.shape[:2]) < MIN_LENGTH:
        return "frames"
    first, second = _step(points), _step(points.swapaxes(0, 1))
    if not (np.isfinite(first) and second < MUCH_NEARER * first):
        return "frames"
    shuffled = np.random.default_rng(0).permutation(len(points))
    return "tracks" if first > NO_ORDER * _step(points, shuffled) else "unclear"


def _step(points: Array, order: NDArray[np.int64] | None = None) -> float:
    """Median distance (m) between neighbours on the first axis, over the visible ones; NaN without any."""
    p = points if order is None else points[order]
    d = np.linalg.norm(np.diff(p, axis=0), axis=-1)
    d = d[np.isfinite(d)]
    return float(np.median(d)) if d.size else float("nan")
