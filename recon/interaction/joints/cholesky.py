"""Small positive definite systems."""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True, nogil=True)
def solve_positive(matrix, right):  # type: ignore[no-untyped-def]
    """Solution (n, c) of a positive definite system (n, n), right sides (n, c), by Cholesky.

    The systems are small: LAPACK's threads cost more than they save, hundredfold on a busy machine.
    """
    n = len(matrix)
    low = np.zeros((n, n))
    for i in range(n):
        for j in range(i + 1):
            total = matrix[i, j]
            for k in range(j):
                total -= low[i, k] * low[j, k]
            low[i, j] = np.sqrt(max(total, 1e-300)) if i == j else total / low[j, j]
    out = right.copy()
    for c in range(out.shape[1]):
        for i in range(n):
            for k in range(i):
                out[i, c] -= low[i, k] * out[k, c]
            out[i, c] /= low[i, i]
        for i in range(n - 1, -1, -1):
            for k in range(i + 1, n):
                out[i, c] -= low[k, i] * out[k, c]
            out[i, c] /= low[i, i]
    return out
