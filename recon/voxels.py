"""Evidence gathered in sparse voxels, and its connected pieces."""

from __future__ import annotations

from itertools import product

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from recon.warping import F32

_BITS = 21
_OFFSET = 1 << (_BITS - 1)
_STEPS = np.array([(x << (2 * _BITS)) + (y << _BITS) + z for x, y, z in product((-1, 0, 1), repeat=3)])


def voxel_keys(points: F32, size: float) -> NDArray[np.int64]:
    """One integer (n,) for the voxel of edge `size` m that holds each point (n, 3); good to a million voxels a side."""
    c = np.floor(points / size).astype(np.int64) + _OFFSET
    return np.asarray((c[:, 0] << (2 * _BITS)) | (c[:, 1] << _BITS) | c[:, 2])


def mean_evidence(
    inverse: NDArray[np.intp], evidence: F32, count: int, prior: float
) -> tuple[F32, NDArray[np.int64]]:
    """Mean evidence and number of readings for each of `count` voxels, pulled to zero as by `prior` readings."""
    n = np.bincount(inverse, minlength=count)
    total = np.bincount(inverse, weights=evidence, minlength=count)
    return (total / (n + prior)).astype(np.float32), n


def largest_piece(keys: NDArray[np.int64], weight: F32) -> NDArray[np.bool_]:
    """Which voxels belong to the heaviest 26-connected piece. keys: sorted unique (n,); weight: (n,), positive."""
    if not len(keys):
        return np.zeros(0, bool)
    rows, cols = [], []
    for step in _STEPS[_STEPS > 0]:
        at = np.searchsorted(keys, keys + step)
        at[at == len(keys)] = 0
        hit = np.flatnonzero(keys[at] == keys + step)
        rows.append(hit)
        cols.append(at[hit])
    r, c = np.concatenate(rows), np.concatenate(cols)
    graph = coo_matrix((np.ones(len(r), np.int8), (r, c)), shape=(len(keys), len(keys)))
    _, piece = connected_components(graph, directed=False)
    return np.asarray(piece == np.argmax(np.bincount(piece, weights=weight)))


def near_piece(keys: NDArray[np.int64], piece: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Which of the voxels (n,) are in a piece (m,) or touch it by a face, an edge or a corner."""
    return np.isin(keys, np.unique(piece[:, None] + _STEPS))
