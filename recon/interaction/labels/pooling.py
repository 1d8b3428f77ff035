"""Evidence pooled over space and colour: what all frames say about a voxel, a hull and a colour.

Scores are log scores (1 + P + 1, h, w) of static, parts and hand for each view; they are changed in place.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from recon.dense.depth import F32
from recon.dense.noise import DepthNoise
from recon.dense.voxels import distinct, largest_piece, mean_evidence, near_piece
from recon.interaction.labels.reference_frames import View
from recon.interaction.parts.moving_part import MovingPart
from recon.recording import Intrinsics
from twin import geometry as geo
from twin.geometry import Array
from twin.runs.threads import each
from twin.scene import Revolute, Trajectory
from twin.voxels import voxel_centres, voxel_keys

# Chosen by us and the same for every recording.
# Weight of a voxel's mean score in each of its pixels
_VOXEL_GAIN = 1.5
# Pixels of score 0 that a voxel's mean starts from
_VOXEL_PRIOR = 2.0
# Largest score that a pixel gives
_CLIP = 2.0
_NEAR_M = 0.1  # what lies so near to a part's piece may be of it, seen in spots
_Evidence = tuple[F32, NDArray[np.int64], F32]
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
    """The voxels of the world and of each part's own frame, and which of them pixels fall into.

    A part is its heaviest connected piece and what is near. A floor below a door turns within itself.
    """

    def __init__(
        self,
        views: list[View],
        cameras: Trajectory,
        parts: Sequence[MovingPart],
        camera: Intrinsics,
        noise: DepthNoise,
    ) -> None:
        self._size = size = voxel_size(views, noise)
        self._known = [v.depth > 0 for v in views]
        self._turns = [isinstance(p.joint, Revolute) for p in parts]
        self._frames = [_Voxels.of(views, None, cameras, camera, size)]
        self._frames += [_Voxels.of(views, part, cameras, camera, size) for part in parts]

    def add_to(self, scores: list[F32], settled: bool = False) -> None:
        """Add to scores what all views say of the pixel's voxel, in the world and in each part's own frame.
        settled: beliefs have spread; what lies far from a turning part is none of it."""
        every = range(len(self._frames))
        found = list(each(lambda k: self._evidence(k, scores), every))
        pieces = {k: self._piece(k, found[k]) for k in every[1:]}
        turning = [k for k in every[1:] if settled and self._turns[k - 1] and len(pieces[k])]
        for k in turning:
            self._leave(k, pieces[k], scores)
        if turning:
            found = list(each(lambda k: self._evidence(k, scores), every))
        gains = list(each(lambda k: self._gains(k, found[k], pieces.get(k)), every))
        for k, (voxels, gain) in enumerate(zip(self._frames, gains, strict=True)):
            for v, g in zip(voxels.rows, gain, strict=True):
                if len(g):
                    scores[v][k][self._known[v]] += g

    def _piece(self, k: int, found: _Evidence) -> NDArray[np.int64]:
        """Keys (m,) of the voxels of the connected piece that is part k."""
        keys, (mean, n, _) = self._frames[k].keys, found
        strong = np.flatnonzero((mean > 0.4) & (n >= 2))
        return keys[strong[largest_piece(keys[strong], (mean * n)[strong])]]

    def _leave(self, k: int, piece: NDArray[np.int64], scores: list[F32]) -> None:
        """What lies far from the piece that is part k, and is not seen to have moved, is rather static. Of
        what slides only the edges are sure to move, which may be far from what else it is."""
        voxels = self._frames[k]
        away, _ = cKDTree(voxel_centres(piece, self._size)).query(
            voxel_centres(voxels.keys, self._size), distance_upper_bound=_NEAR_M
        )
        for v, far in zip(voxels.rows, self._by_view(np.isinf(away)[voxels.of_pixel], voxels), strict=True):
            known = self._known[v]
            mine, static = scores[v][k][known], scores[v][0][known]
            mine[far & (static > -SURE)] = np.minimum(mine, static - SURE)[far & (static > -SURE)]
            scores[v][k][known] = mine

    def _gains(self, k: int, found: _Evidence, piece: NDArray[np.int64] | None) -> list[NDArray[Any]]:
        """What hypothesis k gains at its views' known pixels. piece: of part k; None for static scene."""
        voxels, (mean, _, ahead) = self._frames[k], found
        gain = _VOXEL_GAIN * mean[voxels.of_pixel]
        if piece is not None:
            lost = ~near_piece(voxels.keys, piece)[voxels.of_pixel]
            gain[lost] = np.minimum(gain[lost], -np.maximum(ahead[lost], 0))
        return self._by_view(gain, voxels)

    def _by_view(self, flat: NDArray[Any], voxels: _Voxels) -> list[NDArray[Any]]:
        return np.split(flat, np.cumsum([np.count_nonzero(self._known[v]) for v in voxels.rows])[:-1])

    def _evidence(self, k: int, scores: list[F32]) -> _Evidence:
        """Mean lead of hypothesis k and pixels (m,) per voxel; the lead of each known pixel."""
        voxels = self._frames[k]
        ahead = np.concatenate([lead_of(scores[v], k)[self._known[v]] for v in voxels.rows])
        mean, n = mean_evidence(
            voxels.of_pixel, np.clip(ahead, -_CLIP, _CLIP), len(voxels.keys), _VOXEL_PRIOR
        )
        return mean, n, ahead


@dataclass(frozen=True, eq=False)
class _Voxels:
    """keys (m,): sorted, of the filled voxels. of_pixel (n,): each known pixel's voxel in views `rows`."""

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
