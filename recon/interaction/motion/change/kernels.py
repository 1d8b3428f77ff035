"""How well a moved surface agrees with depth images, frame by frame and over all of them: compiled."""

from __future__ import annotations

import numpy as np
from numba import njit

# What a pixel sees: surface that was there at rest, that was not, or that could not be seen at rest.
OLD, FRESH, BARED = 0, 1, 2


@njit(cache=True, nogil=True)
def _agreement(points, tint, T_cam_world, pose, depth, colour, new, itself, lens, gates):  # type: ignore[no-untyped-def]
    """Shares of points (n, 3) at a pose (4, 4) that agree with a depth image (h, w) and are seen through.

    A moved point at a pixel that is OLD in `new` (h, w) says nothing: the surface there was always there. The
    exception is a surface that may lie there `itself`, such as a panel that slides in its own plane. Hidden
    points and points out of view say nothing either. At a BARED pixel another surface may have been there all
    the time: the point counts a quarter, and for a like colour only. tint (n, 3), colour (h, w, 3): Lab.
    lens: fx, fy, cx, cy. gates: depths that differ by less than the first + the second z^2 m agree.
    """
    h, w = depth.shape
    fx, fy, cx, cy = lens
    least, slope = gates
    m = np.zeros((3, 4))
    for a in range(3):
        for b in range(4):
            for c in range(4):
                m[a, b] += T_cam_world[a, c] * pose[c, b]
    good, through = 0.0, 0.0
    spread = np.array([30.0, 8.0, 8.0])  # of one surface's Lab colour as it turns in the light; chosen by us
    for i in range(len(points)):
        p0, p1, p2 = points[i, 0], points[i, 1], points[i, 2]
        z = m[2, 0] * p0 + m[2, 1] * p1 + m[2, 2] * p2 + m[2, 3]
        if z < 0.1:
            continue
        u = int(np.rint((m[0, 0] * p0 + m[0, 1] * p1 + m[0, 2] * p2 + m[0, 3]) / z * fx + cx))
        v = int(np.rint((m[1, 0] * p0 + m[1, 1] * p1 + m[1, 2] * p2 + m[1, 3]) / z * fy + cy))
        if u < 0 or v < 0 or u >= w or v >= h or depth[v, u] <= 0.0:
            continue
        gate = least + slope * z * z
        off = (depth[v, u] - z) / gate
        if off > 1.0:
            through += 1.0
        elif off > -1.0:
            d0 = pose[0, 0] * p0 + pose[0, 1] * p1 + pose[0, 2] * p2 + pose[0, 3] - p0
            d1 = pose[1, 0] * p0 + pose[1, 1] * p1 + pose[1, 2] * p2 + pose[1, 3] - p1
            d2 = pose[2, 0] * p0 + pose[2, 1] * p1 + pose[2, 2] * p2 + pose[2, 3] - p2
            fresh = new[v, u]
            onto = fresh == OLD and d0 * d0 + d1 * d1 + d2 * d2 > 4.0 * gate * gate
            if onto and not itself:
                continue
            off2 = 0.0
            for c in range(3):
                shade = (float(colour[v, u, c]) - tint[i, c]) / spread[c]
                off2 += shade * shade
            like = 1.0 / (1.0 + off2)
            if fresh == FRESH or onto:
                like = 0.5 + 0.5 * like
            elif fresh == BARED:
                like *= 0.25
            else:
                like = 1.0
            good += (1.0 - off * off) * like
    return good / len(points), through / len(points)


@njit(cache=True, nogil=True)
def agreements(points, tint, T_cam_world, poses, depth, colour, new, itself, lens, gates):  # type: ignore[no-untyped-def]
    """`_agreement` of points (n, 3) with depth images (T, h, w) at poses (T, Q, 4, 4): two arrays (T, Q)."""
    good, through = np.zeros(poses.shape[:2]), np.zeros(poses.shape[:2])
    for t in range(len(depth)):
        for q in range(poses.shape[1]):
            good[t, q], through[t, q] = _agreement(
                points, tint, T_cam_world[t], poses[t, q], depth[t], colour[t], new[t], itself, lens, gates
            )
    return good, through


@njit(cache=True, nogil=True)
def best_path(score, most, price):  # type: ignore[no-untyped-def]
    """The best path of states (T,) through scores (T, Q), and its score (dynamic programming, Viterbi 1967).

    The state changes by at most `most` (T,) per frame, at a `price` per step.
    """
    frames, count = score.shape
    total, new = score[0].astype(np.float64), np.zeros(count)
    back = np.zeros((frames, count), np.int32)
    for t in range(1, frames):
        for q in range(count):
            best, at = -np.inf, q
            for r in range(max(0, q - most[t]), min(count, q + most[t] + 1)):
                c = total[r] - price * abs(q - r)
                if c > best:
                    best, at = c, r
            back[t, q], new[q] = at, best + score[t, q]
        total, new = new, total
    path = np.zeros(frames, np.int64)
    path[frames - 1] = np.argmax(total)
    for t in range(frames - 1, 0, -1):
        path[t - 1] = back[t, path[t]]
    return path, total.max()
