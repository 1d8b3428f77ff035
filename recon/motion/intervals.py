"""What moves, and when: tracks that leave their place, spans of activity, and the interval of a joint's state."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recon.depth import depth_sigma
from recon.recording import Recording
from recon.tracking.tracks import Tracks
from twin import geometry as geo
from twin.errors import ConfigError, SceneError
from twin.geometry import Array
from twin.scene import Trajectory


@dataclass(frozen=True)
class IntervalConfig:
    """Detection of movement. Lengths in metres, times in frames unless the name says otherwise."""

    min_displacement: float = 0.01  # eps_s of the paper
    sigmas: float = 5.0  # a mover leaves its place by this many standard deviations of its depth
    rest_seconds: float = 0.33  # a track that stays this long is at rest; chosen by us
    rest_share: float = (
        0.02  # share of the travelled range that still counts as rest; the metric's definition
    )

    def __post_init__(self) -> None:
        if self.min_displacement <= 0 or self.sigmas <= 0 or not 0 < self.rest_share < 0.5:
            raise ConfigError(
                f"intervals: positive thresholds and rest_share in 0..0.5 are needed, got {self}"
            )


@dataclass(frozen=True)
class Interval:
    """First and last moving frame, inclusive, and the joint kind when something other than motion hints at it."""

    first: int
    last: int
    hint: str | None = None

    def __post_init__(self) -> None:
        if self.first >= self.last:
            raise SceneError(f"an interval must have first < last, got {self.first}..{self.last}")


@dataclass(frozen=True, eq=False)
class Movers:
    """Tracks in the world: points (T, K, 3) m, visible (T, K), and masks (K,) of the tracks that leave their place
    and of those that also were seen at rest before or after."""

    points_world: Array
    visible: NDArray[np.bool_]
    moving: NDArray[np.bool_]
    rested: NDArray[np.bool_]


def find_movers(
    recording: Recording, tracks: Tracks, cameras: Trajectory, config: IntervalConfig = IntervalConfig()
) -> Movers:
    """Bring tracks to the world and tell which of them move."""
    visible = np.zeros_like(tracks.visible)
    points = np.full(tracks.points_cam.shape, np.nan)
    points[cameras.frames] = geo.transform(cameras.T_world_cam, tracks.points_cam[cameras.frames])
    visible[cameras.frames] = tracks.visible[cameras.frames]
    points[~visible] = np.nan
    seconds = float(np.median(np.diff(recording.times)))
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
    return np.median(np.lib.stride_tricks.sliding_window_view(padded, 5, axis=0), axis=-1)


def state_intervals(
    frames: NDArray[np.int64], state: Array, noise: float, config: IntervalConfig = IntervalConfig()
) -> tuple[Interval, ...]:
    """Intervals of a joint from its smoothed state.

    A frame is at rest while the state stays within `rest_share` of the travelled range (or 3 `noise`, if larger) of a
    plateau. Plateaus are spans at least ten frames long at both ends or in between; what lies between two is motion.
    """
    span = float(np.quantile(state, 0.98) - np.quantile(state, 0.02))
    tolerance = max(config.rest_share * span, 3.0 * noise)
    found: list[Interval] = []
    k, n = 0, len(state)
    while k < n - 1:
        away = np.flatnonzero(np.abs(state[k:] - np.median(state[k : k + 3])) > tolerance)
        if not len(away):
            break
        first = k + int(away[0])
        last = _next_plateau(state, first, tolerance)
        if last > first:
            found.append(Interval(int(frames[first]), int(frames[last])))
        k = last + 1
    return tuple(found)


def _next_plateau(state: Array, start: int, tolerance: float, length: int = 10) -> int:
    """Last moving index before the state stays within `tolerance` of one value for `length` frames, or for good."""
    n = len(state)
    for k in range(start + 1, n):
        rest = state[k : min(n, k + length)]
        settled = float(np.median(rest))
        if np.all(np.abs(rest - settled) <= tolerance):
            return k - 1
    return n - 1
