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
# px; narrower strips are outlines whose depth is mixed.
_STRIP = 3


@dataclass(frozen=True, eq=False)
class Thin:
    """A frame's depth (h, w) m, thinned out, and its T_world_cam (4, 4)."""

    depth: F32
    T_world_cam: Array


def activity(recording: Recording, cameras: Trajectory, noise: DepthNoise, progress: Loop = untold) -> Array:
    """Share of the picture (T,) that moves, of each frame; NaN without camera."""
    step = max(1, recording.intrinsics.width // _WIDTH)
    camera = recording.intrinsics.strided(step)
    times = np.asarray(recording.times)
    out = np.full(len(recording), np.nan)
    known = [int(f) for f in cameras.frames]

    def thin(frame: int) -> Thin:
        depth = np.ascontiguousarray(recording.depth(frame)[::step, ::step], np.float32)
        pose = cameras.pose(frame)
        assert pose is not None
        return Thin(depth, pose)

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
