"""Evidence gathered in sparse voxels, and its connected pieces."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, QhullError

from recon.depth import F32
from twin.voxels import NEIGHBOURS, voxel_centres, voxel_keys, voxel_pieces


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
    piece = voxel_pieces(keys)
    return np.asarray(piece == np.argmax(np.bincount(piece, weights=weight)))


def near_piece(keys: NDArray[np.int64], piece: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Which of the voxels (n,) are in a piece (m,) or touch it by a face, an edge or a corner."""
    return np.isin(keys, np.unique(piece[:, None] + NEIGHBOURS))


def solid_core(clouds: Sequence[F32], size: float, views: int = 3) -> F32:
    """Centres (m, 3) of the voxels that hold points of at least `views` of the clouds (n, 3) and have such a neighbour.

    Noise seldom falls twice into one voxel; three views and a neighbour are asked for (chosen by us).
    """
    if not clouds:
        return np.zeros((0, 3), np.float32)
    seen = np.concatenate([np.unique(voxel_keys(c, size)) for c in clouds])
    keys, n = np.unique(seen, return_counts=True)
    keys = keys[n >= views]
    if not len(keys):
        return np.zeros((0, 3), np.float32)
    piece = voxel_pieces(keys)
    return voxel_centres(keys[np.bincount(piece)[piece] > 1], size)


def in_hull(points: F32, shell: F32) -> NDArray[np.bool_]:
    """Which points (n, 3) lie inside the convex hull of others (m, 3); none when these span no volume."""
    try:
        hull = ConvexHull(shell)
    except (QhullError, ValueError):
        return np.zeros(len(points), bool)
    box = ((points >= shell.min(axis=0)) & (points <= shell.max(axis=0))).all(axis=1)
    planes = hull.equations.astype(np.float32)
    box[box] = (points[box] @ planes[:, :3].T + planes[:, 3]).max(axis=1) <= 0
    return np.asarray(box)
