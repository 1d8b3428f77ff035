"""What a depth image says of points in the world: compiled."""

from __future__ import annotations

import numpy as np
from numba import njit

UNKNOWN, SAME, THROUGH, HIDDEN = 0, 1, 2, 3


@njit(cache=True, nogil=True)
def look(points, T_cam_world, depth, fx, fy, cx, cy, least, slope):  # type: ignore[no-untyped-def]
    """What a depth image (h, w) says of points (n, 3): one of its 3x3 pixels has their depth (SAME), all lie
    behind (THROUGH: the camera sees through where they were) or in front (HIDDEN), or none (UNKNOWN).

    least, slope: depths that differ by less than least + slope z^2 m are the same.
    """
    h, w = depth.shape
    out = np.zeros(len(points), np.int8)
    for i in range(len(points)):
        x, y, z = _ahead(T_cam_world, points[i])
        if z < 0.1:
            continue
        u, v = int(np.rint(x / z * fx + cx)), int(np.rint(y / z * fy + cy))
        if u < 1 or v < 1 or u >= w - 1 or v >= h - 1:
            continue
        gate = least + slope * z * z
        near, far, known, same = np.inf, 0.0, 0, False
        for a in range(v - 1, v + 2):
            for b in range(u - 1, u + 2):
                d = depth[a, b]
                if d > 0.0:
                    known += 1
                    near, far = min(near, d), max(far, d)
                    same |= abs(d - z) <= gate
        if known < 5:
            continue
        if same:
            out[i] = SAME
        elif near > z + gate:
            out[i] = THROUGH
        elif far < z - gate:
            out[i] = HIDDEN
    return out


@njit(cache=True, nogil=True)
def count(points, poses, depth, fx, fy, cx, cy, gate):  # type: ignore[no-untyped-def]
    """How many of points (n, 3) are UNKNOWN, SAME, THROUGH and HIDDEN: (m, 4), for each of poses (m, 4, 4)
    into the camera. See `look`."""
    out = np.zeros((len(poses), 4), np.int64)
    for m in range(len(poses)):
        for seen in look(points, poses[m], depth, fx, fy, cx, cy, gate, 0.0):
            out[m, seen] += 1
    return out


@njit(cache=True, nogil=True)
def drawn(points, side, T_cam_world, shape, every, camera):  # type: ignore[no-untyped-def]
    """Depth (h, w) m of the nearest of cells with centres (n, 3) and a side in m, at each `every`th pixel of
    a picture of this shape; infinite where there is none. camera: fx, fy, cx, cy."""
    h, w = (shape[0] + every - 1) // every, (shape[1] + every - 1) // every
    fx, fy, cx, cy = camera
    out = np.full((h, w), np.float32(np.inf))
    for i in range(len(points)):
        x, y, z = _ahead(T_cam_world, points[i])
        if z < 0.1:
            continue
        u, v, half = x / z * fx + cx, y / z * fy + cy, 0.5 * side / z * max(fx, fy)
        for b in range(max(int(np.ceil((v - half) / every)), 0), min(int((v + half) / every) + 1, h)):
            for a in range(max(int(np.ceil((u - half) / every)), 0), min(int((u + half) / every) + 1, w)):
                out[b, a] = min(out[b, a], z)
    return out


@njit(cache=True, nogil=True)
def _ahead(T_cam_world, point):  # type: ignore[no-untyped-def]
    """A world point (3,) in the camera."""
    x, y, z = T_cam_world[0, 3], T_cam_world[1, 3], T_cam_world[2, 3]
    for k in range(3):
        x += T_cam_world[0, k] * point[k]
        y += T_cam_world[1, k] * point[k]
        z += T_cam_world[2, k] * point[k]
    return x, y, z
