"""Thinned-out depth and colour of the frames whose camera is known, and how far depth scatters there."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray

from recon.dense.depth import F32, look_up
from recon.dense.looks import look
from recon.dense.noise import DepthNoise
from recon.recording import Intrinsics, Recording
from twin import geometry as geo
from twin.geometry import Array
from twin.robust import mad_sigma
from twin.runs.threads import each
from twin.scene import Trajectory

# Chosen by us. Width (px) to which pictures are thinned out: a part still has hundreds of pixels.
WIDTH = 160
# Most frames. In ten minutes they are four seconds apart.
ROWS = 150
# Share of the depth by which a pixel's own neighbours may differ on one slanted surface.
_SLANT = 0.04
# Pairs of frames that are compared for the noise.
_PAIRS = 12
# Bins of depth for the noise.
_BINS = 6
# Fewest differences in a bin.
_FEWEST = 50
# m. No depth camera is better over a whole picture.
_SIGMA_LEAST = 0.0015


@dataclass(frozen=True, eq=False)
class Pictures:
    """Depth (T, h, w) m, 0 unknown, and 8-bit Lab colour (T, h, w, 3) of frames (T,), with their cameras.

    near, far: (T, h, w) m, the range of depth within each thinned pixel; both its own depth at a jump.
    """

    camera: Intrinsics
    frames: NDArray[np.int64]
    depth: F32
    near: F32
    far: F32
    colour: NDArray[np.uint8]
    T_world_cam: Array

    @staticmethod
    def of(recording: Recording, cameras: Trajectory) -> Pictures:
        """Pictures of the posed frames, evenly thinned out in time and space."""
        step = max(1, recording.intrinsics.width // WIDTH)
        count = len(cameras.frames)
        rows = np.unique(np.linspace(0, count - 1, min(count, ROWS)).round().astype(np.int64))
        frames = np.asarray(cameras.frames)[rows]
        found = list(each(lambda f: _thinned(recording, int(f), step), frames))
        depth, near, far, colour = (np.stack(c) for c in zip(*found, strict=True))
        camera = recording.intrinsics.strided(step)
        return Pictures(camera, frames, depth, near, far, colour, cameras.T_world_cam[rows])

    @cached_property
    def T_cam_world(self) -> Array:
        return geo.invert_pose(self.T_world_cam)

    @property
    def lens(self) -> tuple[float, float, float, float]:
        """Focal lengths and principal point, px."""
        return self.camera.fx, self.camera.fy, self.camera.cx, self.camera.cy

    def points(self, row: int) -> Array:
        """World points (h, w, 3) m of a row's pixels; pixels of unknown depth lie at the camera."""
        y, x = np.mgrid[0 : self.camera.height, 0 : self.camera.width]
        ahead = self.camera.backproject(
            np.stack([x, y], axis=-1).astype(float), self.depth[row].astype(float)
        )
        return geo.transform(self.T_world_cam[row], ahead)

    def look(self, points: Array, row: int, sigmas: float, least: float) -> NDArray[np.int8]:
        """What a row says of world points (n, 3): see `recon.dense.looks.look`.

        Depths are equal within `sigmas` standard deviations of noise, and within `least` m.
        """
        gate, slope = self.gates(sigmas, least)
        return np.asarray(look(points, self.T_cam_world[row], self.depth[row], *self.lens, gate, slope))

    def gates(self, sigmas: float, least: float) -> tuple[float, float]:
        """Base (m) and slope (1/m) with z^2 of what counts as an equal depth."""
        return max(least, sigmas * self.noise.base), sigmas * self.noise.slope

    @cached_property
    def noise(self) -> DepthNoise:
        """Base and slope of the scatter, poses included, between frames a sixth of the recording apart.

        Most of what two such frames see rests meanwhile. Slow noise and drop-outs are not measured.
        """
        gap = max(1, len(self.frames) // 6)
        first = np.unique(np.linspace(0, len(self.frames) - 1 - gap, _PAIRS).round().astype(int))
        depth, off = (
            np.concatenate(c) for c in zip(*(self._differences(a, a + gap) for a in first), strict=True)
        )
        if len(depth) < 100 * _BINS:
            return DepthNoise(_SIGMA_LEAST, _SIGMA_LEAST, 0.0, 0.0)
        edges = np.quantile(depth, np.linspace(0, 1, _BINS + 1))
        at = np.clip(np.searchsorted(edges, depth, side="right") - 1, 0, _BINS - 1)
        full = np.flatnonzero(np.bincount(at, minlength=_BINS) >= _FEWEST)
        z = np.array([np.median(depth[at == k]) for k in full])
        sigma = np.array([mad_sigma(off[at == k]) for k in full])
        slope = max(float(np.polyfit(z**2, sigma, 1)[0]), 0.0) if np.ptp(z) > 0.1 else 0.0
        return DepthNoise(max(float(np.median(sigma - slope * z**2)), _SIGMA_LEAST), slope, 0.0, 0.0)

    def _differences(self, a: int, b: int) -> tuple[Array, Array]:
        """Depth (n,) that row b should have where it sees row a's points, and its excess."""
        known = self.depth[a] > 0
        p = geo.transform(self.T_cam_world[b], self.points(a)[known][::3])
        seen, z = look_up(self.depth[b], self.camera, p).z, p[:, 2]
        return z[seen > 0], (seen - z)[seen > 0]


def _thinned(recording: Recording, frame: int, step: int) -> tuple[F32, F32, F32, NDArray[np.uint8]]:
    """Depth, its range near and far, and Lab colour (h, w) of every `step`th pixel of a frame."""
    lab = cv2.cvtColor(cv2.blur(recording.color(frame), (step, step)), cv2.COLOR_RGB2LAB)
    depth, near, far = depth_range(np.asarray(recording.depth(frame), np.float32), step)
    return depth, near, far, np.ascontiguousarray(lab[::step, ::step])


def depth_range(full: F32, step: int) -> tuple[F32, F32, F32]:
    """Every `step`th pixel (h, w) of a depth image, with the least and greatest depth, m, about each."""
    window = np.ones((max(3, step | 1),) * 2, np.uint8)
    nearest, farthest = (
        cv2.erode(np.where(full > 0, full, np.float32(np.inf)), window),
        cv2.dilate(full, window),
    )
    depth, near, far = (
        np.ascontiguousarray(d[::step, ::step], np.float32) for d in (full, nearest, farthest)
    )
    one = (depth > 0) & (far - near < _SLANT * depth)
    return depth, np.where(one, near, depth), np.where(one, far, depth)
