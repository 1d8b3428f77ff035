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
    """Area mean (h, w) of depth over cells almost all known, else 0; `size` is (width, height)."""
    known = cv2.resize((depth > 0).astype(np.float32), size, interpolation=cv2.INTER_AREA)
    total = cv2.resize(depth.astype(np.float32), size, interpolation=cv2.INTER_AREA)
    return np.where(known > 0.9, total / np.maximum(known, 1e-6), 0.0).astype(np.float32)


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
    v, u = np.mgrid[0 : camera.height, 0 : camera.width]
    points = camera.backproject(np.stack([u, v], axis=-1).astype(float), depth.astype(np.float64))
    valid = (depth > 0) & (depth < max_depth)
    out = np.full(points.shape, np.nan)
    du = points[2:-2, 4:] - points[2:-2, :-4]
    dv = points[4:, 2:-2] - points[:-4, 2:-2]
    n = np.cross(dv, du)
    length = np.linalg.norm(n, axis=-1)
    z = depth[2:-2, 2:-2]
    ok = valid[2:-2, 2:-2] & valid[2:-2, 4:] & valid[2:-2, :-4] & valid[4:, 2:-2] & valid[:-4, 2:-2]
    ok &= (np.abs(du[..., 2]) < 0.15 * z) & (np.abs(dv[..., 2]) < 0.15 * z) & (length > 0)
    # A plane's two one-sided slopes agree; at creases they don't.
    bend_u = np.abs(depth[2:-2, 4:] + depth[2:-2, :-4] - 2 * z)
    bend_v = np.abs(depth[4:, 2:-2] + depth[:-4, 2:-2] - 2 * z)
    ok &= (bend_u < 0.01 * z) & (bend_v < 0.01 * z)
    inner = out[2:-2, 2:-2]
    inner[ok] = n[ok] / length[ok][:, None]
    inner[(inner * points[2:-2, 2:-2]).sum(axis=-1) > 0] *= -1
    return out
