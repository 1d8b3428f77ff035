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
        x, y, z = T_cam_world[0, 3], T_cam_world[1, 3], T_cam_world[2, 3]
        for k in range(3):
            x += T_cam_world[0, k] * points[i, k]
            y += T_cam_world[1, k] * points[i, k]
            z += T_cam_world[2, k] * points[i, k]
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
def inside(depth, labels, wanted, every, T_box_cam, camera, low, high):  # type: ignore[no-untyped-def]
    """Rows, columns (n,) and points (n, 3) of a depth image's pixels, each `every`th of both, that lie in a
    box from low to high (3,), in the box's frame. labels (h, w): of the pixels, of which those with
    wanted[label] (256,) are asked. camera: fx, fy, cx, cy."""
    h, w = depth.shape
    fx, fy, cx, cy = camera
    most = ((h + every - 1) // every) * ((w + every - 1) // every)
    rows, columns = np.empty(most, np.int64), np.empty(most, np.int64)
    points, n = np.empty((most, 3), np.float32), 0
    p = np.empty(3)
    for v in range(0, h, every):
        for u in range(0, w, every):
            z = depth[v, u]
            if z <= 0.0 or not wanted[labels[v, u]]:
                continue
            x, y = (u - cx) / fx * z, (v - cy) / fy * z
            for k in range(3):
                p[k] = T_box_cam[k, 0] * x + T_box_cam[k, 1] * y + T_box_cam[k, 2] * z + T_box_cam[k, 3]
                if p[k] <= low[k] or p[k] >= high[k]:
                    break
            else:
                rows[n], columns[n] = v, u
                points[n] = p
                n += 1
    return rows[:n], columns[:n], points[:n]
