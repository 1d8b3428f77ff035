"""Pose graph: a path bent so that places seen again lie on each other.

Stretches in which something is handled stay rigid: joints depend on local poses. Loops that contradict the
others lose their weight (graduated non-convexity, Yang et al. 2020, of GTSAM).
"""

from __future__ import annotations

from collections.abc import Sequence

import gtsam
import numpy as np
from numpy.typing import NDArray

from recon.cameras.places import Seen
from twin import geometry as geo
from twin.geometry import Array

# Frames of a stretch that bends at its ends only. Chosen by us.
_STRETCH = 30
# Standard deviations of odometry: m and rad in the root of a frame. Measured on a walk of 75 s: 15 mm over
# 16 m.
_ODOMETRY = (0.0006, 0.0003)
# Of a loop, m and rad.
_LOOP = (0.004, 0.003)
# Of the tie of pieces that nothing but loops joins: nothing.


def bent(
    frames: NDArray[np.int64], poses: Array, loops: Sequence[Seen], rigid: Sequence[tuple[int, int]]
) -> Array:
    """Poses (n, 4, 4) of rising frames (n,), the first one held, with loops closed.

    rigid: first and last frames of stretches in which relative poses stay.
    """
    nodes = _nodes(frames, rigid)
    if not loops or len(nodes) < 2:
        return poses
    row = {int(f): k for k, f in enumerate(frames)}
    node_of = np.searchsorted([a for a, _ in nodes], frames, side="right") - 1
    at = np.array([_middle(frames, a, b) for a, b in nodes])
    corrected = _solved(poses, at, loops, row, node_of)
    change = corrected @ geo.invert_pose(poses[at])
    stays = np.array([any(f <= a and b <= g for f, g in rigid) for a, b in nodes])
    return np.asarray(_between(change, at, node_of, stays, len(frames)) @ poses)


def _nodes(frames: NDArray[np.int64], rigid: Sequence[tuple[int, int]]) -> list[tuple[int, int]]:
    """First and last frames of the stretches."""
    out: list[tuple[int, int]] = []
    first = int(frames[0])
    for a, b in [*sorted(rigid), (int(frames[-1]) + 1, int(frames[-1]))]:
        while first < a:
            last = min(first + _STRETCH, a) - 1
            if np.any((frames >= first) & (frames <= last)):
                out.append((first, last))
            first = last + 1
        if a <= b and np.any((frames >= a) & (frames <= b)):
            out.append((a, b))
        first = max(first, b + 1)
    return out


def _middle(frames: NDArray[np.int64], a: int, b: int) -> int:
    """Row of the frame in the middle of a stretch."""
    rows = np.flatnonzero((frames >= a) & (frames <= b))
    return int(rows[len(rows) // 2])


def _solved(
    poses: Array,
    at: NDArray[np.int64],
    loops: Sequence[Seen],
    row: dict[int, int],
    node_of: NDArray[np.int64],
) -> Array:
    """Corrected poses (m, 4, 4) of the nodes' middles, rows `at` (m,)."""
    graph, start = gtsam.NonlinearFactorGraph(), gtsam.Values()
    for k, r in enumerate(at):
        start.insert(k, gtsam.Pose3(poses[r]))
    graph.add(gtsam.PriorFactorPose3(0, gtsam.Pose3(poses[at[0]]), _noise((1e-5, 1e-5))))
    for k in range(len(at) - 1):
        gap = float(np.sqrt(max(at[k + 1] - at[k], 1)))
        step = geo.invert_pose(poses[at[k]]) @ poses[at[k + 1]]
        spread = (_ODOMETRY[0] * gap, _ODOMETRY[1] * gap)
        graph.add(gtsam.BetweenFactorPose3(k, k + 1, gtsam.Pose3(step), _noise(spread)))
    known = list(range(graph.size()))
    for seen in loops:
        a, b = row[seen.a], row[seen.b]
        i, j = int(node_of[a]), int(node_of[b])
        if i == j:
            continue
        step = (
            geo.invert_pose(poses[at[i]]) @ poses[a] @ seen.T_a_b @ geo.invert_pose(poses[b]) @ poses[at[j]]
        )
        graph.add(gtsam.BetweenFactorPose3(i, j, gtsam.Pose3(step), _noise(_LOOP)))
    params = gtsam.GncLMParams()
    params.setKnownInliers(known)
    result = gtsam.GncLMOptimizer(graph, start, params).optimize()
    return np.stack([result.atPose3(k).matrix() for k in range(len(at))])


def _noise(spread: tuple[float, float]) -> gtsam.noiseModel.Diagonal:
    """m and rad; GTSAM's tangent has the turn first."""
    return gtsam.noiseModel.Diagonal.Sigmas(np.array([spread[1]] * 3 + [spread[0]] * 3))


def _between(
    change: Array, at: NDArray[np.int64], node_of: NDArray[np.int64], stays: NDArray[np.bool_], count: int
) -> Array:
    """The change (n, 4, 4) of every row: its node's where that stays rigid, else between the neighbours'."""
    out = np.empty((count, 4, 4))
    for r in range(count):
        k = int(node_of[r])
        if stays[k]:
            out[r] = change[k]
            continue
        other = k + (1 if r >= at[k] else -1)
        if not 0 <= other < len(at):
            out[r] = change[k]
            continue
        # towards a rigid neighbour, up to its border
        border = np.flatnonzero(node_of == other)
        goal = at[other] if not stays[other] else (border[0] if other > k else border[-1])
        share = (r - at[k]) / (goal - at[k]) if goal != at[k] else 0.0
        step = geo.log_se3(geo.invert_pose(change[k]) @ change[other])
        out[r] = change[k] @ geo.exp_se3(np.clip(share, 0.0, 1.0) * step)
    return out
