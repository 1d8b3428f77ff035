"""Evidence gathered in sparse voxels, and its connected pieces."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, QhullError, cKDTree

from recon.dense.depth import F32
from twin.voxels import NEIGHBOURS, voxel_centres, voxel_keys, voxel_pieces

_LARGE = 0.05  # share of the heaviest piece's weight


def mean_evidence(
    inverse: NDArray[np.integer], evidence: F32, count: int, prior: float
) -> tuple[F32, NDArray[np.int64]]:
    """Mean evidence and number of readings for each of `count` voxels, shrunk as by `prior` readings."""
    n = np.bincount(inverse, minlength=count)
    total = np.bincount(inverse, weights=evidence, minlength=count)
    return (total / (n + prior)).astype(np.float32), n


def largest_piece(keys: NDArray[np.int64], weight: F32) -> NDArray[np.bool_]:
    """Which voxels are in the heaviest 26-connected piece. keys: sorted unique (n,); weight: (n,), > 0."""
    if not len(keys):
        return np.zeros(0, bool)
    piece = voxel_pieces(keys)
    return np.asarray(piece == np.argmax(np.bincount(piece, weights=weight)))


def near_piece(keys: NDArray[np.int64], piece: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Which of the voxels (n,) are in a piece (m,) or touch it by a face, an edge or a corner."""
    return np.isin(keys, np.unique(piece[:, None] + NEIGHBOURS))


def solid_core(clouds: Sequence[F32], size: float, views: int = 3, reach: float = 0.1) -> F32:
    """Centres (m, 3) of the voxels that hold points of at least `views` of the clouds (n, 3), have such a
    neighbour, and lie within `reach` m of a large piece: at least a twentieth of the heaviest.

    Noise seldom falls twice into one voxel, but what belongs to the pixel does, again and again: in small
    pieces anywhere in the room (0.37 m from the part and more in a recording where they drew the hull over a
    quarter of the room; a door's own edges lay within
    0.06 m). Figures chosen by us.
    """
    if not clouds:
        return np.zeros((0, 3), np.float32)
    seen = np.concatenate([np.unique(voxel_keys(c, size)) for c in clouds])
    keys, n = np.unique(seen, return_counts=True)
    keys, n = keys[n >= views], n[n >= views]
    if not len(keys):
        return np.zeros((0, 3), np.float32)
    piece, centres = voxel_pieces(keys), voxel_centres(keys, size)
    weight = np.bincount(piece, weights=n)
    large = (weight >= _LARGE * weight.max())[piece]
    near = cKDTree(centres[large]).query(centres, distance_upper_bound=reach)[0] < np.inf
    return np.asarray(centres[near & (np.bincount(piece)[piece] > 1)])


def in_hull_of(shell: F32) -> Callable[[F32], NDArray[np.bool_]]:
    """A test whether points (n, 3) lie inside the convex hull of a shell (m, 3); none if it is flat."""
    try:
        planes = ConvexHull(shell).equations.astype(np.float32)
    except (QhullError, ValueError):
        return lambda points: np.zeros(len(points), bool)
    low, high = shell.min(axis=0), shell.max(axis=0)

    def inside(points: F32) -> NDArray[np.bool_]:
        box = ((points >= low) & (points <= high)).all(axis=1)
        box[box] = (points[box] @ planes[:, :3].T + planes[:, 3]).max(axis=1) <= 0
        return np.asarray(box)

    return inside


def distinct(keys: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int32]]:
    """Sorted unique keys (m,) and the place (n,) of each: `np.unique` with its inverse, by hashing."""
    found, number = _numbered(keys)
    order = np.argsort(found)
    place = np.empty(len(order), np.int32)
    place[order] = np.arange(len(order), dtype=np.int32)
    return found[order], place[number]


@numba.njit(cache=True, nogil=True)
def _numbered(keys: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int32]]:
    """Unique keys (m,) as they come, and the number (n,) of each key. Open addressing, at most half full."""
    size, count = 1 << 12, 0
    slots = np.full(size, -1, np.int32)
    found = np.empty(size >> 1, np.int64)
    number = np.empty(len(keys), np.int32)
    for n in range(len(keys)):
        key = keys[n]
        if n and key == keys[n - 1]:  # neighbouring pixels often share a voxel
            number[n] = number[n - 1]
            continue
        if count == size >> 1:
            size *= 2
            slots, found = np.full(size, -1, np.int32), np.concatenate((found, np.empty(count, np.int64)))
            for k in range(count):
                slots[_slot(found[k], found, slots)] = k
        at = _slot(key, found, slots)
        if slots[at] < 0:
            slots[at], found[count] = count, key
            count += 1
        number[n] = slots[at]
    return found[:count].copy(), number


@numba.njit(cache=True, inline="always")
def _slot(key: int, found: NDArray[np.int64], slots: NDArray[np.int32]) -> Any:
    """Where a key is, or where it would go."""
    mask = np.uint64(len(slots) - 1)
    at = np.int64(((np.uint64(key) * np.uint64(0x9E3779B97F4A7C15)) >> np.uint64(32)) & mask)
    while slots[at] >= 0 and found[slots[at]] != key:
        at = np.int64(np.uint64(at + 1) & mask)
    return at
