"""Compiled kernels of camera poses: comparing poses, and the bundle's landmarks, residuals and equations."""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True, nogil=True)
def best_pose(poses, source, target, variance, most):  # type: ignore[no-untyped-def]
    """The pose with the least sum of squared errors, each at most `most`: MSAC (Torr and Zisserman 2000)."""
    best, least = 0, np.inf
    for k in range(len(poses)):
        t, cost = poses[k], 0.0
        for n in range(len(source)):
            x, y, z = source[n, 0], source[n, 1], source[n, 2]
            dx = t[0, 0] * x + t[0, 1] * y + t[0, 2] * z + t[0, 3] - target[n, 0]
            dy = t[1, 0] * x + t[1, 1] * y + t[1, 2] * z + t[1, 3] - target[n, 1]
            dz = t[2, 0] * x + t[2, 1] * y + t[2, 2] * z + t[2, 3] - target[n, 2]
            cost += min((dx * dx + dy * dy + dz * dz) / variance[n], most)
            if cost >= least:
                break
        if cost < least:
            best, least = k, cost
    return best


@njit(cache=True, nogil=True)
def landmarks_of(poses, frame, track, points, info, weights, count):  # type: ignore[no-untyped-def]
    """Weighted means (count, 3) in the world with each observation's anisotropic information."""
    a = np.zeros((count, 6))  # xx xy xz yy yz zz
    b = np.zeros((count, 3))
    out = np.zeros((count, 3))
    for o in range(len(frame)):
        t = poses[frame[o]]
        k = track[o]
        px, py, pz = points[o, 0], points[o, 1], points[o, 2]
        x = t[0, 0] * px + t[0, 1] * py + t[0, 2] * pz + t[0, 3]
        y = t[1, 0] * px + t[1, 1] * py + t[1, 2] * pz + t[1, 3]
        z = t[2, 0] * px + t[2, 1] * py + t[2, 2] * pz + t[2, 3]
        wl = weights[o] * info[o, 0]
        wd = weights[o] * (info[o, 1] - info[o, 0])
        # R diag(l, l, d) R^T = l I + (d - l) r3 r3^T with r3 the viewing direction
        xx, xy, xz = wl + wd * t[0, 2] * t[0, 2], wd * t[0, 2] * t[1, 2], wd * t[0, 2] * t[2, 2]
        yy, yz, zz = wl + wd * t[1, 2] * t[1, 2], wd * t[1, 2] * t[2, 2], wl + wd * t[2, 2] * t[2, 2]
        a[k, 0] += xx
        a[k, 1] += xy
        a[k, 2] += xz
        a[k, 3] += yy
        a[k, 4] += yz
        a[k, 5] += zz
        b[k, 0] += xx * x + xy * y + xz * z
        b[k, 1] += xy * x + yy * y + yz * z
        b[k, 2] += xz * x + yz * y + zz * z
    for k in range(count):
        m = np.array([[a[k, 0], a[k, 1], a[k, 2]], [a[k, 1], a[k, 3], a[k, 4]], [a[k, 2], a[k, 4], a[k, 5]]])
        solved = np.linalg.solve(m + 1e-9 * np.eye(3), b[k])
        for i in range(3):  # an array put into a row takes seconds to compile
            out[k, i] = solved[i]
    return out


@njit(cache=True, nogil=True)
def chi_squares(poses, frame, track, points, info, landmarks):  # type: ignore[no-untyped-def]
    out = np.empty(len(frame))
    for o in range(len(frame)):
        t = poses[frame[o]]
        k = track[o]
        dx, dy, dz = landmarks[k, 0] - t[0, 3], landmarks[k, 1] - t[1, 3], landmarks[k, 2] - t[2, 3]
        ex = points[o, 0] - (t[0, 0] * dx + t[1, 0] * dy + t[2, 0] * dz)
        ey = points[o, 1] - (t[0, 1] * dx + t[1, 1] * dy + t[2, 1] * dz)
        ez = points[o, 2] - (t[0, 2] * dx + t[1, 2] * dy + t[2, 2] * dz)
        out[o] = info[o, 0] * (ex * ex + ey * ey) + info[o, 1] * ez * ez
    return out


@njit(cache=True, nogil=True)
def pose_systems(poses, frame, track, points, info, weights, landmarks):  # type: ignore[no-untyped-def]
    """Normal equations per frame for T <- T exp(d), residual e = x - T^-1 X in the camera, d = (v, w).

    T exp(d) moves the predicted point p to p - v - w x p, so de/dd = [I, -[p]x].
    """
    n = len(poses)
    h = np.zeros((n, 6, 6))
    g = np.zeros((n, 6))
    j = np.zeros((3, 6))
    j[0, 0] = j[1, 1] = j[2, 2] = 1.0
    for o in range(len(frame)):
        f = frame[o]
        t = poses[f]
        k = track[o]
        dx, dy, dz = landmarks[k, 0] - t[0, 3], landmarks[k, 1] - t[1, 3], landmarks[k, 2] - t[2, 3]
        px = t[0, 0] * dx + t[1, 0] * dy + t[2, 0] * dz
        py = t[0, 1] * dx + t[1, 1] * dy + t[2, 1] * dz
        pz = t[0, 2] * dx + t[1, 2] * dy + t[2, 2] * dz
        j[0, 4], j[0, 5] = pz, -py
        j[1, 3], j[1, 5] = -pz, px
        j[2, 3], j[2, 4] = py, -px
        for c in range(3):
            e = points[o, c] - (px if c == 0 else (py if c == 1 else pz))
            w = weights[o] * (info[o, 1] if c == 2 else info[o, 0])
            for i in range(6):
                if j[c, i] != 0.0:
                    g[f, i] += w * j[c, i] * e
                    for m in range(i, 6):
                        h[f, i, m] += w * j[c, i] * j[c, m]
    for f in range(n):
        for i in range(6):
            for m in range(i):
                h[f, i, m] = h[f, m, i]
    return h, g
