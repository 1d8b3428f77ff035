"""Depth images: noise, other resolutions, look-up, normals."""

from __future__ import annotations

from typing import Any, NamedTuple

import cv2
import numba
import numpy as np
from numpy.typing import ArrayLike, NDArray

from recon.recording import Intrinsics
from twin import geometry as geo
from twin.geometry import Array

F32 = NDArray[np.float32]

# Axial noise of structured-light sensors, Nguyen, Izadi and Lovell 2012 (there 1.2 mm + 1.9 mm (z - 0.4)^2
# for a Kinect at small angles); widened by us to cover grazing angles and time-of-flight sensors.
DEPTH_SIGMA_M = 0.002
DEPTH_SIGMA_SLOPE = 0.003
NEAR_M = 0.4
# m, chosen by us: what drift of the cameras leaves between what two frames saw of one surface
_MARGIN = 0.03
# Shares of a cell's pixels: almost all, and what a mean needs where they lie on one surface. Chosen by us
_ALL, _SPOTS = 0.9, 0.2
_CELL = np.ones((3, 3), np.uint8)
MAX_STEP = 0.02  # chosen by us: neighbours further apart than 2 % of their depth lie on two surfaces


def depth_sigma(z: ArrayLike) -> Array:
    """Axial standard deviation in metres of a consumer depth camera at depth z: 2 mm + 3 mm (z - 0.4)^2.

    The form is that of Nguyen, Izadi and Lovell 2012; constants chosen by us for ToF and structured light.
    """
    return np.asarray(DEPTH_SIGMA_M + DEPTH_SIGMA_SLOPE * (np.asarray(z) - NEAR_M) ** 2)


@numba.njit(cache=True, inline="always")
def pixel_sigma(z: float, noise: F32) -> Any:
    """`recon.dense.noise.DepthNoise.sigma` of one pixel, for compiled kernels; noise (2,): its `curve`."""
    d = z - np.float32(NEAR_M)
    good = np.float32(DEPTH_SIGMA_M) + np.float32(DEPTH_SIGMA_SLOPE) * d * d
    return max(good, noise[0] + noise[1] * z * z)


def mean_depth(depth: NDArray[np.float32], size: tuple[int, int]) -> NDArray[np.float32]:
    """Area mean (h, w) of depth over cells almost all known, or in part on one surface, else 0.

    A dark front returns depth in spots: there a cell has the mean of what is known. size: width, height.
    """
    known = cv2.resize((depth > 0).astype(np.float32), size, interpolation=cv2.INTER_AREA)
    total = cv2.resize(depth.astype(np.float32), size, interpolation=cv2.INTER_AREA)
    near = cv2.erode(np.where(depth > 0, depth, np.float32(np.inf)), _CELL)
    one = (cv2.dilate(depth, _CELL) - near < 2.0 * MAX_STEP * near).astype(np.float32)
    spotted = (known > _SPOTS) & (cv2.resize(one, size, interpolation=cv2.INTER_AREA) > _ALL)
    return np.where((known > _ALL) | spotted, total / np.maximum(known, 1e-6), 0.0).astype(np.float32)


def in_mid_air(depth: F32, sigma: Array, step: float) -> NDArray[np.bool_]:
    """Pixels (h, w) that may lie between two surfaces (flying pixels, smeared edges), or on one seen edge-on.

    sigma (h, w): standard deviation, m. Within 5x5, depths must differ by six of them and by `step` of the
    depth, and the pixel be nearer than a quarter of that to neither end (chosen by us).
    """
    window = np.ones((5, 5), np.uint8)
    near = cv2.erode(np.where(depth > 0, depth, np.float32(np.inf)), window)
    far = cv2.dilate(depth, window)
    gap = far - near
    between = (depth - near > 0.25 * gap) & (far - depth > 0.25 * gap)
    return np.asarray((depth > 0) & between & (gap > step * depth + 6.0 * sigma))


class Readings(NamedTuple):
    """What a depth image says at points (n,): whether each is in view (`inside`), the nearest pixel `x`, `y`
    (0, 0 where it is not), and the depth `z` m read there, 0 = unknown."""

    inside: NDArray[np.bool_]
    x: NDArray[np.int64]
    y: NDArray[np.int64]
    z: Array


def look_up(
    depth: NDArray[np.floating], camera: Intrinsics, points_cam: Array, near: float = 0.1
) -> Readings:
    """Project points (n, 3) m into a depth image (H, W) m and read the nearest pixel; in view are those over
    `near` m ahead, and the others read 0, as where depth is unknown.

    Nearest and never between pixels: a mean over a depth edge lies on neither surface.
    """
    ahead = points_cam[:, 2] > near
    at = np.rint(camera.project(np.where(ahead[:, None], points_cam, [0.0, 0.0, 1.0]))).astype(np.int64)
    inside = ahead & (at >= 0).all(axis=1) & (at[:, 0] < camera.width) & (at[:, 1] < camera.height)
    x, y = np.where(inside, at.T, 0)
    return Readings(inside, x, y, np.where(inside, depth[y, x], 0.0))


def in_front(depth: Array, seen: Array, camera: Intrinsics, T_seen_depth: Array) -> NDArray[np.bool_]:
    """Mask (h, w) of the pixels of a depth image m that float in front of what another one, `seen` (h, w) m,
    shows behind them, by the pose of the camera of the one in the other.

    By less than `_MARGIN` and four standard deviations of depth is noise, or drift of the cameras.
    """
    nearest = cv2.erode(seen, np.ones((3, 3)))  # 0 where a neighbour is unknown
    v, u = np.mgrid[0 : camera.height, 0 : camera.width]
    points = camera.backproject(np.stack([u, v], axis=-1).astype(float), depth).reshape(-1, 3)
    p = geo.transform(T_seen_depth, points)
    inside, _, _, surface = look_up(np.asarray(nearest), camera, p)
    mask = inside & (depth.ravel() > 0) & (surface - p[:, 2] > _MARGIN + 4.0 * depth_sigma(surface))
    opened = cv2.morphologyEx(
        mask.reshape(depth.shape).astype(np.uint8), cv2.MORPH_OPEN, np.ones((3, 3), np.uint8)
    )
    return np.asarray(opened, dtype=bool)


def depth_normals(depth: NDArray[np.float32], camera: Intrinsics, max_depth: float) -> Array:
    """Camera-facing unit normals (H, W, 3) from depth (H, W) m; NaN at holes, edges, beyond `max_depth`."""
    return np.asarray(_normals(np.asarray(depth, np.float32), camera.vector, np.float32(max_depth)))


@numba.njit(cache=True, nogil=True)
def _normals(depth: F32, camera: Array, most: np.float32) -> Array:
    h, w = depth.shape
    fx, fy, cx, cy = camera[0], camera[1], camera[2], camera[3]
    out = np.full((h, w, 3), np.nan)
    step, bend, none = np.float32(0.15), np.float32(0.01), np.float32(0)
    for y in range(2, h - 2):
        for x in range(2, w - 2):
            z, left, right = depth[y, x], depth[y, x - 2], depth[y, x + 2]
            above, below = depth[y - 2, x], depth[y + 2, x]
            if not (none < min(z, left, right, above, below) and max(z, left, right, above, below) < most):
                continue
            # A plane's two one-sided slopes agree; at creases they don't.
            twice = np.float32(2) * z
            if not (abs(right + left - twice) < bend * z and abs(below + above - twice) < bend * z):
                continue
            p, q, a, b = np.float64(left), np.float64(right), np.float64(above), np.float64(below)
            du0 = (x + 2 - cx) / fx * q - (x - 2 - cx) / fx * p
            du1 = (y - cy) / fy * q - (y - cy) / fy * p
            du2 = q - p
            dv0 = (x - cx) / fx * b - (x - cx) / fx * a
            dv1 = (y + 2 - cy) / fy * b - (y - 2 - cy) / fy * a
            dv2 = b - a
            if not (abs(du2) < step * z and abs(dv2) < step * z):
                continue
            n0, n1, n2 = dv1 * du2 - dv2 * du1, dv2 * du0 - dv0 * du2, dv0 * du1 - dv1 * du0
            length = np.sqrt(n0 * n0 + n1 * n1 + n2 * n2)
            if not length > 0:
                continue
            n0, n1, n2 = n0 / length, n1 / length, n2 / length
            z64 = np.float64(z)
            away = n0 * ((x - cx) / fx * z64) + n1 * ((y - cy) / fy * z64) + n2 * z64
            turn = -1.0 if away > 0 else 1.0
            out[y, x, 0], out[y, x, 1], out[y, x, 2] = turn * n0, turn * n1, turn * n2
    return out
