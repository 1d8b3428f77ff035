"""Small positive definite systems."""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True, nogil=True)
def solve_positive(matrix, right):  # type: ignore[no-untyped-def]
    """Solution (n, c) of a positive definite system (n, n), right sides (n, c), by Cholesky.

    The systems are small: LAPACK's threads cost more than they save, hundredfold on a busy machine.
    """
    n, sides = right.shape
    rest, factor = matrix.copy(), np.zeros((n, n))  # row k of the factor is column k of the lower triangle
    for k in range(n):
        column = factor[k]
        column[k] = np.sqrt(max(rest[k, k], 1e-300))
        for i in range(k + 1, n):
            column[i] = rest[i, k] / column[k]
        for i in range(k + 1, n):
            times, row, other = column[i], rest[i, k + 1 : i + 1], column[k + 1 : i + 1]
            for j in range(len(row)):  # from 0 on, so that the compiler takes several at once
                row[j] -= times * other[j]
    out = right.copy()
    for i in range(n):
        for k in range(i):
            for c in range(sides):
                out[i, c] -= factor[k, i] * out[k, c]
        for c in range(sides):
            out[i, c] /= factor[i, i]
    for i in range(n - 1, -1, -1):
        for k in range(i + 1, n):
            for c in range(sides):
                out[i, c] -= factor[i, k] * out[k, c]
        for c in range(sides):
            out[i, c] /= factor[i, i]
    return out
