"""Edges of the part-pose graph: relative part motions between frames, measured on poses or on tracks.

An edge is named by what it holds: T_parti_partj maps part coordinates at frame j to part coordinates at frame
i, so that with true poses T_parti_partj = T_world_parti^-1 T_world_partj, and the residual
log(T_parti_partj^-1 T_i^-1 T_j) is zero. (Written with the inverse measurement, as log(T_i^-1 T_j
T_partj_parti), the sum reads differently; mixing both leaves twice the motion.) All motions of one joint
commute, so T_i^-1 T_j = T_j T_i^-1 depends on the joint and on the difference of the states alone.

FunREC, supplement 1.4, below eq. 3: the residual with the measurement the other way round.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recon.interaction.joints.hypotheses import best_rigid_inliers
from twin import geometry as geo
from twin.errors import InputError
from twin.geometry import Array


@dataclass(frozen=True, eq=False)
class PoseEdges:
    """E edges: frames `first` (E,) and `second` (E,), measured T_parti_partj (E, 4, 4), information (E, 6, 6)
    of the error twist (v, w), loop (E,): a loop closure, else an edge of consecutive frames."""

    first: NDArray[np.int64]
    second: NDArray[np.int64]
    T_parti_partj: Array
    information: Array
    loop: NDArray[np.bool_]

    def __post_init__(self) -> None:
        n = len(self.first)
        shapes = (self.second.shape, self.T_parti_partj.shape, self.information.shape, self.loop.shape)
        if shapes != ((n,), (n, 4, 4), (n, 6, 6), (n,)):
            raise InputError(f"edges need shapes (E,), (E, 4, 4), (E, 6, 6), (E,), got {shapes}")
        if np.any(self.first == self.second):
            raise InputError("an edge must join two different frames")

    def __len__(self) -> int:
        return len(self.first)

    def take(self, keep: NDArray[np.bool_]) -> PoseEdges:
        """The edges of a mask (E,)."""
        return PoseEdges(
            self.first[keep],
            self.second[keep],
            self.T_parti_partj[keep],
            self.information[keep],
            self.loop[keep],
        )


def graph_pairs(frames: int, loops_per_frame: int, seed: int = 0) -> NDArray[np.int64]:
    """Frame pairs (E, 2), i < j: all consecutive ones, then loop closures, random ones if not all."""
    consecutive = np.stack([np.arange(frames - 1), np.arange(1, frames)], axis=1)
    i, j = np.triu_indices(frames, k=2)
    wanted = loops_per_frame * frames
    if len(i) > wanted:
        chosen = np.sort(np.random.default_rng(seed).choice(len(i), wanted, replace=False))
        i, j = i[chosen], j[chosen]
    return np.concatenate([consecutive, np.stack([i, j], axis=1)]).astype(np.int64)


def edges_from_poses(
    T_world_part: Array, pairs: NDArray[np.int64], sigma: float, sigma_rad: float
) -> PoseEdges:
    """Edges between poses (N, 4, 4), in part coordinates; sigma (m), sigma_rad: noise at the origin."""
    i, j = np.ascontiguousarray(pairs.T)
    relative = geo.invert_pose(T_world_part[i]) @ T_world_part[j]
    omega = np.diag([sigma**-2.0] * 3 + [sigma_rad**-2.0] * 3)
    return PoseEdges(i, j, relative, np.broadcast_to(omega, (len(pairs), 6, 6)).copy(), np.abs(j - i) > 1)


def edges_from_tracks(
    points: Array,
    visible: NDArray[np.bool_],
    pairs: NDArray[np.int64],
    sigma: float,
    *,
    samples: int = 64,
    least: int = 6,
    seed: int = 0,
) -> PoseEdges:
    """Edges from tracks (T, K, 3) of one part, part coordinates = world at state 0.

    Each pair is fitted by triples, truncated squares and least squares; the information is that of its
    correspondences, sum of J^T J / (2 sigma^2) with J = [I, -skew(x)] (both ends carry the noise). Pairs with
    fewer than `least` common tracks are left out.
    """
    rng = np.random.default_rng(seed)
    kept: list[int] = []
    poses: list[Array] = []
    informations: list[Array] = []
    tau2 = (3.0 * np.sqrt(2.0) * sigma) ** 2 * 1.5
    for row, (i, j) in enumerate(pairs):
        both = visible[i] & visible[j]
        if both.sum() < least:
            continue
        a, b = points[i, both], points[j, both]
        inlier = best_rigid_inliers(a, b, samples, tau2, rng)
        if inlier.sum() < least:
            continue
        # y_j = (T_j T_i^-1) y_i, and T_j T_i^-1 = T_i^-1 T_j for one joint
        poses.append(geo.fit_rigid(a[inlier], b[inlier]))
        jac = np.concatenate(
            [np.broadcast_to(np.eye(3), (int(inlier.sum()), 3, 3)), -geo.skew(a[inlier])], axis=2
        )
        informations.append(np.einsum("nki,nkj->ij", jac, jac) / (2.0 * sigma**2))
        kept.append(row)
    i, j = np.ascontiguousarray(pairs[kept].T) if kept else np.zeros((2, 0), dtype=np.int64)
    shape = (len(kept), 4, 4)
    return PoseEdges(
        i, j, np.reshape(poses, shape), np.reshape(informations, (len(kept), 6, 6)), np.abs(j - i) > 1
    )
