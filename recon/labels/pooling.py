"""Evidence pooled over space and colour: what all frames say about a voxel, a hull and a colour.

Scores are log scores (1 + P + 1, h, w) of static, parts and hand for each view; they are changed in place.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from recon.depth import F32, depth_sigma
from recon.labels.reference_frames import View
from recon.parts.moving_part import MovingPart
from recon.recording import Intrinsics
from recon.voxels import in_hull, largest_piece, mean_evidence, near_piece, solid_core
from twin import geometry as geo
from twin.geometry import Array
from twin.scene import Trajectory
from twin.voxels import voxel_keys

# Chosen by us and the same for every recording.
_VOXEL_GAIN, _VOXEL_PRIOR, _CLIP = 1.5, 2.0, 2.0
SURE = 1.0  # lead of a log score that counts as certain


def world_points(seen: View, camera: Intrinsics, T: Array | None) -> F32:
    """World points (n, 3) of the pixels with known depth, in row order."""
    pose = np.eye(4) if T is None else T
    y, x = np.nonzero(seen.depth > 0)
    p = camera.backproject(np.stack([x, y], axis=1), seen.depth[y, x].astype(np.float64))
    out: F32 = (p @ pose[:3, :3].T + pose[:3, 3]).astype(np.float32)
    return out


def lead_of(score: F32, k: int) -> F32:
    """How far hypothesis k leads the best other one."""
    others = np.delete(score, k, axis=0).max(axis=0)
    return np.asarray(score[k] - others)


def _voxel_size(views: list[View]) -> float:
    """m; two standard deviations of typical depth."""
    typical = float(np.median(np.concatenate([v.depth[v.depth > 0][::97] for v in views])))
    return float(np.clip(2.0 * depth_sigma(typical), 0.006, 0.02))


def pool_voxels(
    views: list[View], scores: list[F32], cameras: Trajectory, parts: Sequence[MovingPart], camera: Intrinsics
) -> None:
    """Add to each score what all frames say about the pixel's voxel, in the world and in each part's own frame."""
    size = _voxel_size(views)
    worlds = [world_points(v, camera, cameras.pose(v.frame)) for v in views]
    gains: list[list[F32]] = []
    for k in range(1 + len(parts)):
        rows = [v for v in range(len(views)) if k == 0 or parts[k - 1].pose(views[v].frame) is not None]
        points = []
        for v in rows:
            pose = None if k == 0 else parts[k - 1].pose(views[v].frame)
            inv = np.eye(4) if pose is None else geo.invert_pose(pose)
            points.append((worlds[v] @ inv[:3, :3].T + inv[:3, 3]).astype(np.float32))
        keys, inverse = np.unique(voxel_keys(np.concatenate(points), size), return_inverse=True)
        ahead = np.concatenate([lead_of(scores[v], k)[views[v].depth > 0] for v in rows])
        lead = np.clip(ahead, -_CLIP, _CLIP)
        mean, n = mean_evidence(inverse, lead, len(keys), _VOXEL_PRIOR)
        if k > 0:
            strong = np.flatnonzero((mean > 0.4) & (n >= 2))
            piece = keys[strong[largest_piece(keys[strong], (mean * n)[strong])]]
            lost = ~near_piece(keys, piece)[inverse]
        gain = _VOXEL_GAIN * mean[inverse]
        if k > 0:
            gain[lost] = np.minimum(gain[lost], -np.maximum(ahead[lost], 0))
        cuts = np.cumsum([len(p) for p in points])[:-1]
        per_view: list[F32] = [np.zeros(0, np.float32)] * len(views)
        for v, g in zip(rows, np.split(gain, cuts), strict=True):
            per_view[v] = g
        gains.append(per_view)
    for k, per_view in enumerate(gains):
        for v, g in enumerate(per_view):
            if len(g):
                scores[v][k][views[v].depth > 0] += g


def enclosed_by_parts(
    views: list[View],
    scores: list[F32],
    sure: list[NDArray[np.bool_]],
    cameras: Trajectory,
    parts: Sequence[MovingPart],
    camera: Intrinsics,
) -> list[NDArray[np.bool_]]:
    """Masks (2, P, h, w) of what lies inside the convex hull, and inside the box, of what surely is a part, in its frame.

    Between the walls of a drawer that slides there is no room for anything static. Sure is what references at rest see
    through where it is now and see again where it was; scores are those of the references alone, before any pooling.
    """
    size = _voxel_size(views)
    out = [np.zeros((len(parts), *v.depth.shape), bool) for v in views]
    near = [np.zeros_like(o) for o in out]
    for k, part in enumerate(parts):
        points: dict[int, F32] = {}
        certain: list[F32] = []
        for v, (seen, score, moved) in enumerate(zip(views, scores, sure, strict=True)):
            pose = part.pose(seen.frame)
            if pose is None:
                continue
            inv = geo.invert_pose(pose)
            points[v] = geo.transform(inv, world_points(seen, camera, cameras.pose(seen.frame))).astype(
                np.float32
            )
            mine = (lead_of(score, k + 1) > SURE) & moved[0]
            certain.append(points[v][mine[seen.depth > 0]])
        shell = solid_core(certain, size)
        for v, p in points.items():
            out[v][k][views[v].depth > 0] = in_hull(p, shell)
            if len(shell):
                box = (p >= shell.min(axis=0) - size) & (p <= shell.max(axis=0) + size)
                near[v][k][views[v].depth > 0] = box.all(axis=1)
    return [np.stack(pair) for pair in zip(out, near, strict=True)]


_BINS = 16


def _color_bins(color: F32) -> NDArray[np.intp]:
    low, high = np.array([0.0, -60.0, -60.0]), np.array([50.0, 60.0, 60.0])
    b = np.clip((color - low) / (high - low) * _BINS, 0, _BINS - 1).astype(np.intp)
    return np.asarray((b[..., 0] * _BINS + b[..., 1]) * _BINS + b[..., 2])


def pool_color(views: list[View], scores: list[F32]) -> None:
    """Colours seen mostly on the sure hand speak for the hand, and the other way round; a weak voice."""
    hand, rest = np.zeros(_BINS**3), np.zeros(_BINS**3)
    bins = [_color_bins(v.color) for v in views]
    for b, s in zip(bins, scores, strict=True):
        lead = s[-1] - s[:-1].max(axis=0)
        hand += np.bincount(b[lead > 1.0], minlength=_BINS**3)
        rest += np.bincount(b[lead < -1.0], minlength=_BINS**3)
    if hand.sum() < 100 or rest.sum() < 100:
        return
    ratio = np.log((hand / hand.sum() + 1e-4) / (rest / rest.sum() + 1e-4))
    for b, s in zip(bins, scores, strict=True):
        s[-1] += np.clip(0.5 * ratio, -1.0, 1.0)[b].astype(np.float32)
