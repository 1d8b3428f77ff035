"""How much of each picture moves: surface that frames shortly before or after see through."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from recon.dense.depth import F32
from recon.dense.looks import THROUGH, look
from recon.dense.noise import DepthNoise
from recon.recording import Intrinsics, Recording
from twin import geometry as geo
from twin.geometry import Array
from twin.runs.loop import Loop, untold
from twin.runs.threads import each
from twin.scene import Trajectory

# px to which depth is thinned out: a hand still has hundreds of pixels.
_WIDTH = 160
# s to the frames that each is compared with: a slow part, .08 m/s, goes twice the least gap meanwhile.
_APART_S = 0.7
# Least gap of depth, m, and in standard deviations of noise, by which a surface is seen through.
_GAP_M = 0.02
_SIGMAS = 5.0
# Frames of a span in which what moves is looked for. Chosen by us.
_LOOKS = 8
# m before a camera, within which nothing is in view.
_NEAR_M = 0.1
# px; narrower strips are outlines whose depth is mixed.
_STRIP = 3


@dataclass(frozen=True, eq=False)
class Thin:
    """A frame's depth (h, w) m, thinned out, and its T_world_cam (4, 4)."""

    depth: F32
    T_world_cam: Array


def activity(recording: Recording, cameras: Trajectory, noise: DepthNoise, progress: Loop = untold) -> Array:
    """Share of the picture (T,) that moves, of each frame; NaN without camera."""
    camera = recording.intrinsics.strided(_step(recording))
    times = np.asarray(recording.times)
    out = np.full(len(recording), np.nan)
    known = [int(f) for f in cameras.frames]

    def thin(frame: int) -> Thin:
        return _thin(recording, cameras, frame)

    held: dict[int, Thin] = {}
    loaded = zip(known, each(thin, known), strict=True)
    waiting = iter(loaded)
    for frame in progress(known, "activity"):
        before, after = (_nearest(known, times, times[frame] + s * _APART_S) for s in (-1.0, 1.0))
        while after not in held:
            number, seen = next(waiting)
            held[number] = seen
        for old in [f for f in held if f < before]:
            del held[old]
        moving = _moving(held, frame, before, camera, noise) | _moving(held, frame, after, camera, noise)
        out[frame] = moving.mean()
    return out


def moved_points(
    recording: Recording, cameras: Trajectory, noise: DepthNoise, span: tuple[int, int]
) -> Array:
    """Points (n, 3) of the world at which something moves from the first to the last frame of a span."""
    camera, times = recording.intrinsics.strided(_step(recording)), np.asarray(recording.times)
    known = [int(f) for f in cameras.frames]
    inside = [f for f in known if span[0] <= f <= span[1]]
    some = [
        inside[k] for k in np.unique(np.linspace(0, max(len(inside) - 1, 0), _LOOKS).astype(int)) if inside
    ]

    def of(frame: int) -> Array:
        others = {_nearest(known, times, times[frame] + s * _APART_S) for s in (-1.0, 1.0)}
        held = {f: _thin(recording, cameras, f) for f in {frame, *others}}
        moving = np.logical_or.reduce([_moving(held, frame, o, camera, noise) for o in others])
        y, x = np.nonzero(moving)
        z = held[frame].depth[y, x].astype(float)
        points = camera.backproject(np.stack([x, y], axis=-1).astype(float), z)
        return np.asarray(geo.transform(held[frame].T_world_cam, points))

    return np.concatenate([np.zeros((0, 3)), *each(of, some)])


def share_in_view(points: Array, recording: Recording, cameras: Trajectory) -> Array:
    """Share (T,) of world points (n, 3) that lie before each frame's camera and within its picture; 0 without
    a pose."""
    camera, out = recording.intrinsics, np.zeros(len(recording))
    for frame, pose in zip(cameras.frames.tolist(), cameras.T_world_cam, strict=True):
        p = geo.transform(geo.invert_pose(pose), points)
        x, y = camera.project(np.where(p[:, 2:] > _NEAR_M, p, [0.0, 0.0, 1.0])).T
        inside = (x >= 0) & (y >= 0) & (x <= camera.width - 1) & (y <= camera.height - 1)
        out[frame] = np.mean(inside & (p[:, 2] > _NEAR_M)) if len(points) else 0.0
    return out


def _step(recording: Recording) -> int:
    """Every so many pixels are looked at."""
    return max(1, recording.intrinsics.width // _WIDTH)


def _thin(recording: Recording, cameras: Trajectory, frame: int) -> Thin:
    step, pose = _step(recording), cameras.pose(frame)
    assert pose is not None
    return Thin(np.ascontiguousarray(recording.depth(frame)[::step, ::step], np.float32), pose)


def _nearest(known: list[int], times: Array, at: float) -> int:
    """The posed frame whose time is nearest."""
    seconds = times[known]
    k = int(np.searchsorted(seconds, at))
    near = [j for j in (k - 1, k) if 0 <= j < len(known)]
    return known[min(near, key=lambda j: abs(seconds[j] - at))]


def _moving(
    held: Mapping[int, Thin], frame: int, other: int, camera: Intrinsics, noise: DepthNoise
) -> NDArray[np.bool_]:
    """Pixels (h, w) of a frame whose surface another frame sees through."""
    here, there = held[frame], held[other]
    known = here.depth > 0
    y, x = np.nonzero(known)
    points = camera.backproject(np.stack([x, y], axis=-1).astype(float), here.depth[y, x].astype(float))
    points = geo.transform(here.T_world_cam, points)
    lens = (camera.fx, camera.fy, camera.cx, camera.cy)
    gate = max(_GAP_M, _SIGMAS * noise.base)
    seen = look(points, geo.invert_pose(there.T_world_cam), there.depth, *lens, gate, _SIGMAS * noise.slope)
    out = np.zeros(known.shape, np.uint8)
    out[y, x] = seen == THROUGH
    return np.asarray(cv2.morphologyEx(out, cv2.MORPH_OPEN, np.ones((_STRIP, _STRIP), np.uint8)) > 0)
