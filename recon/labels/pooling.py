"""Evidence pooled over space and colour: what all frames say about a voxel, a hull and a colour.

Scores are log scores (1 + P + 1, h, w) of static, parts and hand for each view; they are changed in place.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recon.dense.depth import F32
from recon.dense.noise import DepthNoise
from recon.dense.voxels import distinct, largest_piece, mean_evidence, near_piece
from recon.labels.reference_frames import View
from recon.parts.moving_part import MovingPart
from recon.recording import Intrinsics
from twin import geometry as geo
from twin.geometry import Array
from twin.runs.threads import each
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


def voxel_size(views: list[View], noise: DepthNoise) -> float:
    """m; two standard deviations of typical depth."""
    typical = float(np.median(np.concatenate([v.depth[v.depth > 0][::97] for v in views])))
    return float(np.clip(2.0 * noise.sigma(typical), 0.006, 0.02))


class VoxelPool:
    """The voxels of the world and of each part's own frame, and which of them the pixels of the views fall into."""

    def __init__(
        self,
        views: list[View],
        cameras: Trajectory,
        parts: Sequence[MovingPart],
        camera: Intrinsics,
        noise: DepthNoise,
    ) -> None:
        size = voxel_size(views, noise)
        self._known = [v.depth > 0 for v in views]
        self._frames = [_Voxels.of(views, None, cameras, camera, size)]
        self._frames += [_Voxels.of(views, part, cameras, camera, size) for part in parts]

    def add_to(self, scores: list[F32]) -> None:
        """Add to each score what all views say about the pixel's voxel, in the world and in each part's own frame."""
        gains = list(each(lambda k: self._gains(k, scores), range(len(self._frames))))
        for k, (voxels, gain) in enumerate(zip(self._frames, gains, strict=True)):
            for v, g in zip(voxels.rows, gain, strict=True):
                if len(g):
                    scores[v][k][self._known[v]] += g

    def _gains(self, k: int, scores: list[F32]) -> list[F32]:
        """What hypothesis k gains at the known pixels of each of its views."""
        keys, inverse, rows = self._frames[k].keys, self._frames[k].of_pixel, self._frames[k].rows
        ahead = np.concatenate([lead_of(scores[v], k)[self._known[v]] for v in rows])
        mean, n = mean_evidence(inverse, np.clip(ahead, -_CLIP, _CLIP), len(keys), _VOXEL_PRIOR)
        gain = _VOXEL_GAIN * mean[inverse]
        if k > 0:
            strong = np.flatnonzero((mean > 0.4) & (n >= 2))
            piece = keys[strong[largest_piece(keys[strong], (mean * n)[strong])]]
            lost = ~near_piece(keys, piece)[inverse]
            gain[lost] = np.minimum(gain[lost], -np.maximum(ahead[lost], 0))
        cuts = np.cumsum([np.count_nonzero(self._known[v]) for v in rows])[:-1]
        return np.split(gain, cuts)


@dataclass(frozen=True, eq=False)
class _Voxels:
    """keys (m,): sorted, of the voxels that hold points. of_pixel (n,): the voxel of each known pixel of the views `rows`."""

    keys: NDArray[np.int64]
    of_pixel: NDArray[np.int32]
    rows: list[int]

    @classmethod
    def of(
        cls,
        views: list[View],
        part: MovingPart | None,
        cameras: Trajectory,
        camera: Intrinsics,
        size: float,
    ) -> _Voxels:
        """Voxels of the world, or of a part's frame in those views that know its pose."""
        poses = [None if part is None else part.pose(v.frame) for v in views]
        rows = [k for k, pose in enumerate(poses) if part is None or pose is not None]

        def keys_of(row: int) -> NDArray[np.int64]:
            world = world_points(views[row], camera, cameras.pose(views[row].frame))
            pose = poses[row]
            inv = np.eye(4) if pose is None else geo.invert_pose(pose)
            return voxel_keys((world @ inv[:3, :3].T + inv[:3, 3]).astype(np.float32), size)

        keys, of_pixel = distinct(np.concatenate(list(each(keys_of, rows))))
        return cls(keys, of_pixel, rows)


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
