"""What moves: tracks in the world that leave their place."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from recon.dense.depth import depth_sigma
from recon.motion.intervals import IntervalConfig
from recon.tracking.tracks import Tracks
from twin import geometry as geo
from twin.geometry import Array
from twin.scene import Trajectory

_DEFAULT = IntervalConfig()


@dataclass(frozen=True, eq=False)
class Movers:
    """Tracks in the world: points (T, K, 3) m, visible (T, K), and masks (K,) of the tracks that leave their place
    and of those that also were seen at rest before or after."""

    points_world: Array
    visible: NDArray[np.bool_]
    moving: NDArray[np.bool_]
    rested: NDArray[np.bool_]

    @cached_property
    def travel(self) -> Array:
        """Distance (K,) in metres between the median points of the first and of the farthest five observations of each mover;
        0 for the others."""
        out = np.zeros(self.visible.shape[1])
        for k in np.flatnonzero(self.moving):
            p = self.points_world[self.visible[:, k], k]
            d = np.linalg.norm(p - np.median(p[:5], axis=0), axis=1)
            out[k] = np.sort(d)[-min(5, len(d))]
        return out


def find_movers(
    tracks: Tracks, cameras: Trajectory, times: Array, config: IntervalConfig = _DEFAULT
) -> Movers:
    """Bring tracks to the world and tell which of them move. times (T,): seconds of the frames."""
    visible = np.zeros_like(tracks.visible)
    points = np.full(tracks.points_cam.shape, np.nan)
    points[cameras.frames] = geo.transform(cameras.T_world_cam, tracks.points_cam[cameras.frames])
    visible[cameras.frames] = tracks.visible[cameras.frames]
    points[~visible] = np.nan
    seconds = float(np.median(np.diff(times)))
    rest = max(3, round(config.rest_seconds / seconds))
    count = len(tracks)
    moving, rested = np.zeros(count, dtype=bool), np.zeros(count, dtype=bool)
    high = np.where(visible[..., None], points, -np.inf).max(axis=0)
    low = np.where(visible[..., None], points, np.inf).min(axis=0)
    extent = np.linalg.norm(np.maximum(high - low, 0.0), axis=1)
    for k in np.flatnonzero(extent > config.min_displacement):
        frames = np.flatnonzero(visible[:, k])
        if len(frames) < 2 * rest:
            continue
        p = _running_median(points[frames, k])
        tolerance = max(
            config.min_displacement,
            config.sigmas * float(depth_sigma(np.nanmedian(tracks.points_cam[frames, k, 2]))),
        )
        far_from_start = np.linalg.norm(p - p[:1], axis=1) > tolerance
        far_from_end = np.linalg.norm(p - p[-1], axis=1) > tolerance
        moving[k] = far_from_start.sum() >= 3
        at_start = int(np.argmax(far_from_start)) if far_from_start.any() else len(p)
        at_end = int(np.argmax(far_from_end[::-1])) if far_from_end.any() else len(p)
        # The tolerance itself takes a few frames to cross, so a resting span must be longer than that.
        rested[k] = moving[k] and max(at_start, at_end) >= 2 * rest
    return Movers(points, visible, moving, rested)


def _running_median(p: Array) -> Array:
    """Median over five successive observations, ends repeated."""
    padded = np.concatenate([p[:1], p[:1], p, p[-1:], p[-1:]])
    return np.asarray(np.sort(np.lib.stride_tricks.sliding_window_view(padded, 5, axis=0), axis=-1)[..., 2])
