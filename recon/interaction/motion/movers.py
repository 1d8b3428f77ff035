"""What moves: tracks in the world that leave their place."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numba import njit
from numpy.typing import NDArray

from recon.dense.depth import depth_sigma
from recon.dense.order import median
from recon.interaction.motion.intervals import MIN_DISPLACEMENT, MOVER_SIGMAS, REST_SECONDS
from recon.tracking.tracks import Tracks
from twin import geometry as geo
from twin.geometry import Array
from twin.scene import Trajectory


@dataclass(frozen=True, eq=False)
class Movers:
    """Tracks in the world: points (T, K, 3) m, visible (T, K), and masks (K,) of the tracks that leave their
    place and of those that also were seen at rest before or after."""

    points_world: Array
    visible: NDArray[np.bool_]
    moving: NDArray[np.bool_]
    rested: NDArray[np.bool_]

    @cached_property
    def travel(self) -> Array:
        """Distance (K,) m of the medians of each mover's first and farthest five observations; else 0."""
        out = np.zeros(self.visible.shape[1])
        for k in np.flatnonzero(self.moving):
            p = self.points_world[self.visible[:, k], k]
            d = np.linalg.norm(p - np.median(p[:5], axis=0), axis=1)
            out[k] = np.sort(d)[-min(5, len(d))]
        return out


def find_movers(tracks: Tracks, cameras: Trajectory, times: Array) -> Movers:
    """Bring tracks to the world and tell which of them move. times (T,): seconds of the frames."""
    visible = np.zeros_like(tracks.visible)
    points = np.full(tracks.points_cam.shape, np.nan)
    points[cameras.frames] = geo.transform(cameras.T_world_cam, tracks.points_cam[cameras.frames])
    visible[cameras.frames] = tracks.visible[cameras.frames]
    points[~visible] = np.nan
    seconds = float(np.median(np.diff(times)))
    rest = max(3, round(REST_SECONDS / seconds))
    count = len(tracks)
    moving, rested = np.zeros(count, dtype=bool), np.zeros(count, dtype=bool)
    high = np.where(visible[..., None], points, -np.inf).max(axis=0)
    low = np.where(visible[..., None], points, np.inf).min(axis=0)
    extent = np.linalg.norm(np.maximum(high - low, 0.0), axis=1)
    asked = np.flatnonzero((extent > MIN_DISPLACEMENT) & (visible.sum(axis=0) >= 2 * rest))
    depth = np.where(visible[:, asked], tracks.points_cam[:, asked, 2], np.nan)
    sigma = depth_sigma(np.nanmedian(depth, axis=0)) if len(asked) else np.zeros(0)
    tolerance = np.maximum(MIN_DISPLACEMENT, MOVER_SIGMAS * sigma)
    moving[asked], rested[asked] = _left(
        np.ascontiguousarray(points[:, asked].swapaxes(0, 1)), visible[:, asked].T.copy(), tolerance, 2 * rest
    )
    return Movers(points, visible, moving, rested)


@njit(cache=True, nogil=True)
def _left(points, visible, tolerance, rest):  # type: ignore[no-untyped-def]
    """Which tracks (K, T, 3) leave their first place by more than `tolerance` (K,) m in three observations or
    more, and which of them stayed at their first or last place for `rest` observations: the tolerance itself
    takes a few frames to cross.
    """
    moving, rested = np.zeros(len(points), np.bool_), np.zeros(len(points), np.bool_)
    for k in range(len(points)):
        p = _running_median(points[k][visible[k]])
        n, away, at_start, at_end = len(p), 0, len(p), len(p)
        for i in range(n):
            if np.sqrt(((p[i] - p[0]) ** 2).sum()) > tolerance[k]:
                away += 1
                at_start = min(at_start, i)
            if np.sqrt(((p[n - 1 - i] - p[n - 1]) ** 2).sum()) > tolerance[k]:
                at_end = min(at_end, i)
        moving[k] = away >= 3
        rested[k] = moving[k] and max(at_start, at_end) >= rest
    return moving, rested


@njit(cache=True, nogil=True)
def _running_median(p):  # type: ignore[no-untyped-def]
    """Median over five successive observations (n, 3), ends repeated."""
    out = np.empty_like(p)
    window = np.empty(5)
    for i in range(len(p)):
        for axis in range(3):
            for j in range(5):
                window[j] = p[min(max(i + j - 2, 0), len(p) - 1), axis]
            out[i, axis] = median(window, 5)
    return out
