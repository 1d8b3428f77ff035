"""Baselines written from their papers, on the same clips.

What a paper leaves open, and what is given to a baseline that its paper gives it too, stands with each.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import open3d as o3d
from numpy.typing import NDArray

from benchmarks.paper.chain import Answer, Seen, part_of
from benchmarks.paper.poses import Fitted, by_bic, by_residual, by_screws, poses_of_tracks
from recon.evaluation.truth import Truth, TruthPart
from recon.interaction.motion.movers import find_movers
from twin import geometry as geo
from twin.geometry import Array
from twin.scene import Trajectory

# m: travel of a track that moves; FunREC leaves its baselines' threshold open, and at its own 1 cm tracks
# that drift along edges outnumber the part's. Then the farthest pair of an ICP
_MOVES, _PAIR = 0.05, 0.03
# points that a frame's part is thinned to, m
_VOXEL = 0.005
_FEWEST = 50


def icp(seen: Seen, truth: Truth) -> Answer:
    """Frame-to-frame ICP, point to plane, on true masks and true cameras, then a line or a circle by random
    samples. FunREC gives BundleSDF the same masks and cameras (supplement 3.1)."""
    part = truth.parts[0]
    frames, poses, middle = _chained(seen, truth, part)
    if len(frames) < 4:
        return Answer((), None, _true_cameras(truth))
    fit = by_residual(poses, middle)
    return Answer((part_of(fit, frames, seen),), None, _true_cameras(truth), (frames, poses))


def screws(seen: Seen, truth: Truth) -> Answer:
    """Tracks that move by 5 cm or more, the free pose of each frame by random samples, and the screw that
    most pairs of frames agree on. It is told the type, as FunREC is by its model."""
    kind = truth.parts[0].joint.kind
    return _by_tracks(seen, lambda poses, point: by_screws(poses, point, kind))


def sturm(seen: Seen, truth: Truth) -> Answer:  # noqa: ARG001
    """The same poses, and rigid, prismatic or rotational by the least BIC (Sturm et al. 2011)."""
    return _by_tracks(seen, by_bic)


BASELINES: dict[str, Callable[[Seen, Truth], Answer]] = {
    "ICP on true masks, true cameras": icp,
    "tracks, screws of pairs, true type": screws,
    "tracks, line or circle by BIC (Sturm)": sturm,
}


def _by_tracks(seen: Seen, fitted: Callable[[Array, Array], Fitted]) -> Answer:
    movers = find_movers(seen.tracks, seen.cameras, seen.recording.times)
    moving = movers.moving & (movers.travel > _MOVES)
    nothing = Answer((), None, seen.cameras)
    if moving.sum() < 4:
        return nothing
    frames, poses, middle = poses_of_tracks(movers, moving)
    if len(frames) < 4:
        return nothing
    fit = fitted(poses, middle)
    return Answer((part_of(fit, frames, seen),), None, seen.cameras, (frames, poses))


def _true_cameras(truth: Truth) -> Trajectory:
    assert truth.cameras is not None
    return truth.cameras


def _chained(seen: Seen, truth: Truth, part: TruthPart) -> tuple[NDArray[np.int64], Array, Array]:
    """Frames (n,), poses (n, 4, 4) against the first of them, and the part's middle (3,) in that."""
    frames: list[int] = []
    poses: list[Array] = []
    middle, last = np.zeros(3), None
    for k in range(len(seen.recording)):
        cloud = _cloud(seen, truth, part, k)
        if cloud is None:
            continue
        if last is None:
            middle, pose = np.asarray(cloud.points).mean(axis=0), np.eye(4)
        else:
            step = o3d.pipelines.registration.registration_icp(
                last,
                cloud,
                _PAIR,
                np.eye(4),
                o3d.pipelines.registration.TransformationEstimationPointToPlane(),
            )
            pose = step.transformation @ poses[-1]
        frames.append(k)
        poses.append(np.asarray(pose))
        last = cloud
    return np.array(frames, np.int64), np.array(poses).reshape(-1, 4, 4), middle


def _cloud(seen: Seen, truth: Truth, part: TruthPart, frame: int) -> o3d.geometry.PointCloud | None:
    """The part's points in the world, with normals; None of fewer than 50 pixels."""
    depth = seen.recording.depth(frame)
    y, x = np.nonzero((truth.labels[frame] == part.id) & (depth > 0))
    pose = _true_cameras(truth).pose(frame)
    if len(y) < _FEWEST or pose is None:
        return None
    camera = seen.recording.intrinsics
    points = camera.backproject(np.stack([x, y], axis=1), depth[y, x].astype(np.float64))
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(geo.transform(pose, points)))
    cloud = cloud.voxel_down_sample(_VOXEL)
    cloud.estimate_normals(o3d.geometry.KDTreeSearchParamHybrid(0.03, 30))
    return cloud if len(cloud.points) >= _FEWEST else None
