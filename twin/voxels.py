"""Points in sparse voxels, and which of these are connected."""

from __future__ import annotations

from itertools import product

import numpy as np
from numpy.typing import NDArray

_BITS = 21
_OFFSET = 1 << (_BITS - 1)
# added to a voxel's key: itself and the 26 around it
NEIGHBOURS = np.array([(x << (2 * _BITS)) + (y << _BITS) + z for x, y, z in product((-1, 0, 1), repeat=3)])


def voxel_keys(points: NDArray[np.float32], size: float) -> NDArray[np.int64]:
    """One integer (n,) for the voxel of edge `size` m of each point (n, 3); up to a million voxels a side."""
    c = np.floor(points / size).astype(np.int64) + _OFFSET
    return np.asarray((c[:, 0] << (2 * _BITS)) | (c[:, 1] << _BITS) | c[:, 2])


def voxel_centres(keys: NDArray[np.int64], size: float) -> NDArray[np.float32]:
    """Centres (n, 3) of voxels; the inverse of `voxel_keys`."""
    mask = (1 << _BITS) - 1
    c = np.stack([keys >> (2 * _BITS), (keys >> _BITS) & mask, keys & mask], axis=1) - _OFFSET
    return np.asarray((c + 0.5) * size, dtype=np.float32)


def voxel_pieces(keys: NDArray[np.int64]) -> NDArray[np.intp]:
    """Number of the 26-connected piece of each voxel (n,). keys: sorted unique."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    rows, cols = [], []
    for step in NEIGHBOURS[NEIGHBOURS > 0]:
        at = np.searchsorted(keys, keys + step)
        at[at == len(keys)] = 0
        hit = np.flatnonzero(keys[at] == keys + step)
        rows.append(hit)
        cols.append(at[hit])
    r, c = np.concatenate(rows), np.concatenate(cols)
    graph = coo_matrix((np.ones(len(r), np.int8), (r, c)), shape=(len(keys), len(keys)))
    _, piece = connected_components(graph, directed=False)
    return np.asarray(piece, dtype=np.intp)
