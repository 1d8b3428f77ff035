"""Order statistics for compiled loops. numba's own cost seconds in every caller."""

from __future__ import annotations

from numba import njit


@njit(cache=True, nogil=True)
def place(values, n, k):  # type: ignore[no-untyped-def]
    """The k-th smallest, from 0, of the first n values. Reorders them: none before it is larger, none behind
    it smaller (Hoare 1961, Algorithm 65: Find)."""
    first, last = 0, n - 1
    while first < last:
        pivot, i, j = values[k], first, last
        while i <= j:
            while values[i] < pivot:
                i += 1
            while pivot < values[j]:
                j -= 1
            if i <= j:
                values[i], values[j] = values[j], values[i]
                i += 1
                j -= 1
        if j < k:
            first = i
        if k < i:
            last = j
    return values[k]


@njit(cache=True, nogil=True)
def median(values, n):  # type: ignore[no-untyped-def]
    """Median of the first n values, n > 0, which it reorders; equal to numpy's without NaN."""
    upper = place(values, n, n // 2)
    if n % 2:
        return upper
    return (place(values, n // 2, n // 2 - 1) + upper) / 2


@njit(cache=True, nogil=True)
def quantile(values, n, share):  # type: ignore[no-untyped-def]
    """Value that this share, in [0, 1), of the first n values does not exceed, n > 0, between the two nearest
    ranks linearly (Hyndman and Fan 1996, type 7). Reorders them."""
    rank = 1 + (n - 1) * (share * 100.0 / 100.0)
    k = int(rank) - 1
    over = rank - int(rank)
    if k + 1 >= n:
        return place(values, n, n - 1)
    upper = place(values, n, k + 1)
    return place(values, k + 1, k) * (1 - over) + upper * over
