"""How far tracks stray from their median point."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from recon.dense.order import median, quantile
from twin.geometry import Array


def spread(points: Array, visible: NDArray[np.bool_], share: float) -> tuple[Array, NDArray[np.int64]]:
    """Distance (K,) from a track's median point within which this share of its points (T, K, D) lies, in
    their unit, and how many of them are visible (T, K); 0 where none is."""
    return _spread(np.ascontiguousarray(points), np.ascontiguousarray(visible), share)


@njit(cache=True, nogil=True)
def _spread(points, visible, share):  # type: ignore[no-untyped-def]
    frames, tracks, dims = points.shape
    out, count = np.zeros(tracks), np.zeros(tracks, np.int64)
    seen = np.empty(frames, np.int64)
    for k in range(tracks):
        n = 0
        for t in range(frames):
            if visible[t, k]:
                seen[n] = t
                n += 1
        count[k] = n
        if n == 0:
            continue
        square, values = np.zeros(n), np.empty(n)
        for d in range(dims):
            for m in range(n):
                values[m] = points[seen[m], k, d]
            middle = median(values, n)
            for m in range(n):
                square[m] += (points[seen[m], k, d] - middle) ** 2
        for m in range(n):
            square[m] = np.sqrt(square[m])
        out[k] = quantile(square, n, share)
    return out, count
