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
        _solve3(a[k], b[k], out[k])
    return out


@njit(cache=True, nogil=True)
def _solve3(a, b, out):  # type: ignore[no-untyped-def]
    """Solution (3,) of a positive system, xx xy xz yy yz zz (6,), right side (3,), by Cholesky."""
    e = 1e-9
    l0 = np.sqrt(a[0] + e)
    l1, l2 = a[1] / l0, a[2] / l0
    l3 = np.sqrt(max(a[3] + e - l1 * l1, e * e))
    l4 = (a[4] - l1 * l2) / l3
    l5 = np.sqrt(max(a[5] + e - l2 * l2 - l4 * l4, e * e))
    y0 = b[0] / l0
    y1 = (b[1] - l1 * y0) / l3
    y2 = (b[2] - l2 * y0 - l4 * y1) / l5
    out[2] = y2 / l5
    out[1] = (y1 - l4 * out[2]) / l3
    out[0] = (y0 - l1 * out[1] - l2 * out[2]) / l0


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
    for o in range(len(frame)):
        f = frame[o]
        t, hf, gf = poses[f], h[f], g[f]
        k = track[o]
        dx, dy, dz = landmarks[k, 0] - t[0, 3], landmarks[k, 1] - t[1, 3], landmarks[k, 2] - t[2, 3]
        px = t[0, 0] * dx + t[1, 0] * dy + t[2, 0] * dz
        py = t[0, 1] * dx + t[1, 1] * dy + t[2, 1] * dz
        pz = t[0, 2] * dx + t[1, 2] * dy + t[2, 2] * dz
        lateral, axial = weights[o] * info[o, 0], weights[o] * info[o, 1]
        # row x of de/dd: 1 0 0 | 0 pz -py
        e, x4, x5 = points[o, 0] - px, lateral * pz, lateral * -py
        gf[0] += lateral * e
        gf[4] += x4 * e
        gf[5] += x5 * e
        hf[0, 0] += lateral
        hf[0, 4] += x4
        hf[0, 5] += x5
        hf[4, 4] += x4 * pz
        hf[4, 5] += x4 * -py
        hf[5, 5] += x5 * -py
        # row y: 0 1 0 | -pz 0 px
        e, y3, y5 = points[o, 1] - py, lateral * -pz, lateral * px
        gf[1] += lateral * e
        gf[3] += y3 * e
        gf[5] += y5 * e
        hf[1, 1] += lateral
        hf[1, 3] += y3
        hf[1, 5] += y5
        hf[3, 3] += y3 * -pz
        hf[3, 5] += y3 * px
        hf[5, 5] += y5 * px
        # row z: 0 0 1 | py -px 0
        e, z3, z4 = points[o, 2] - pz, axial * py, axial * -px
        gf[2] += axial * e
        gf[3] += z3 * e
        gf[4] += z4 * e
        hf[2, 2] += axial
        hf[2, 3] += z3
        hf[2, 4] += z4
        hf[3, 3] += z3 * py
        hf[3, 4] += z3 * -px
        hf[4, 4] += z4 * -px
    for f in range(n):
        for i in range(6):
            for m in range(i):
                h[f, i, m] = h[f, m, i]
    return h, g
