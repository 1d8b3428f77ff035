"""How likely a moved surface makes what pictures show, against what they show without it: compiled.

Counted per pixel of the picture: a point of the surface stands for as many pixels as its share of the surface
covers where it lies. Units are those of one pixel that moves and is explained wholly.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from recon.observation.origins import NEW, STATIC, UNKNOWN

# All chosen by us. What a pixel seen through costs: nothing excuses free space.
THROUGH = 2.0
# What a pixel costs that sees the surface still where it rested, though it is said to be elsewhere.
STILL = 1.0
# Share of a pixel of unknown origin, and only for a like colour: any surface may have been there.
_UNKNOWN_SHARE = 0.25
# Share of a pixel that moves and has another colour.
_OTHER_COLOUR = 0.5
# Standard deviation of one surface's 8-bit Lab colour as it turns in the light.
_SHADE, _CHROMA = 30.0, 8.0
# m by which a board's other face may lie behind the one that rest shows.
_THICK_M = 0.04


@njit(cache=True, nogil=True)
def log_odds(surface, still, rows, poses, T_cam_world, pictures, origin, rest, lens, gates):  # type: ignore[no-untyped-def]
    """Evidence (R, Q), px, for a surface at poses (R, Q, 4, 4) in these rows (R,) of pictures (T, h, w).

    surface: points (n, 3) at its rest, the normal (3,) of the side it is seen from there, Lab colours (n, 3),
    and the px m^2 (n,) that each point covers at 1 m, face on. still (T, n): points that a picture sees where
    they rest. pictures: near, far and colour. rest: the surface's outline (h, w), near and far of its own
    picture, and that camera (4, 4). lens: fx, fy, cx, cy. gates: depths that differ by less than the first +
    the second z^2 m agree.
    """
    points, normal, tint, size = surface
    near, far, colour = pictures
    out = np.zeros(poses.shape[:2])
    h, w = near.shape[1:]
    m, back = np.zeros((3, 4)), np.zeros((3, 4))
    for r in range(len(rows)):
        t = rows[r]
        stays = still[t].any()
        for q in range(poses.shape[1]):
            _product(T_cam_world[t], poses[r, q], m)
            if stays:
                _product(rest[3], _inverse(poses[r, q]), back)
            n0, n1, n2 = _moved(m, normal, 0.0)
            total = 0.0
            for i in range(len(points)):
                if still[t, i] and not _covered(points[i], back, rest, lens, gates):
                    total -= STILL * size[i] / max(_moved(T_cam_world[t], points[i], 1.0)[2] ** 2, 0.01)
                x, y, z = _moved(m, points[i], 1.0)
                u, v = _pixel(x, y, z, lens, h, w)
                if u < 0 or near[t, v, u] <= 0.0:
                    continue
                facing = -(n0 * x + n1 * y + n2 * z) / np.sqrt(x * x + y * y + z * z)
                covers = size[i] * abs(facing) / (z * z)
                gate = gates[0] + gates[1] * z * z
                behind, before = near[t, v, u] - z, z - far[t, v, u]
                if facing < 0.0:
                    before -= min(_THICK_M / max(-facing, 0.2), 0.1)
                if behind > gate:
                    total -= THROUGH * covers
                elif before <= gate and origin[t, v, u] != STATIC:
                    off = max(behind, before, 0.0) / gate
                    total += (1.0 - off * off) * _like(colour[t, v, u], tint[i], origin[t, v, u]) * covers
            out[r, q] = total
    return out


@njit(cache=True, nogil=True)
def explained(points, T_cam_world, poses, near, far, origin, lens, gates):  # type: ignore[no-untyped-def]
    """Turn STATIC the pixels that move of `origin` (T, h, w) and that a surface (n, 3) at poses (T, 4, 4)
    lies on, with those about them: what a part explains is no evidence for another one."""
    h, w = near.shape[1:]
    m = np.zeros((3, 4))
    for t in range(len(poses)):
        _product(T_cam_world[t], poses[t], m)
        for i in range(len(points)):
            x, y, z = _moved(m, points[i], 1.0)
            u, v = _pixel(x, y, z, lens, h, w)
            if u < 0:
                continue
            gate = gates[0] + gates[1] * z * z
            for b in range(max(v - 1, 0), min(v + 2, h)):
                for a in range(max(u - 1, 0), min(u + 2, w)):
                    behind, before = near[t, b, a] - z, z - far[t, b, a]
                    if origin[t, b, a] >= NEW and behind <= gate and before <= gate + _THICK_M:
                        origin[t, b, a] = STATIC


@njit(cache=True, nogil=True)
def _like(seen, tint, comes):  # type: ignore[no-untyped-def]
    """Share of a pixel that a surface of this Lab colour explains, by the pixel's colour and origin."""
    d0, d1, d2 = (seen[0] - tint[0]) / _SHADE, (seen[1] - tint[1]) / _CHROMA, (seen[2] - tint[2]) / _CHROMA
    like = 1.0 / (1.0 + d0 * d0 + d1 * d1 + d2 * d2)
    return _UNKNOWN_SHARE * like if comes == UNKNOWN else _OTHER_COLOUR + (1.0 - _OTHER_COLOUR) * like


@njit(cache=True, nogil=True)
def _covered(point, back, rest, lens, gates):  # type: ignore[no-untyped-def]
    """Whether a world point lies on the moved surface: carried back, it lies on the surface at rest; also
    where the picture at rest does not reach."""
    outline, near, far, _ = rest
    x, y, z = _moved(back, point, 1.0)
    u, v = _pixel(x, y, z, lens, outline.shape[0], outline.shape[1])
    if u < 0 or near[v, u] <= 0.0:
        return True
    gate = gates[0] + gates[1] * z * z
    return bool(outline[v, u]) and near[v, u] - z <= gate and z - far[v, u] <= gate


@njit(cache=True, nogil=True)
def _moved(m, p, one):  # type: ignore[no-untyped-def]
    """A point p (3,), `one` 1, or a direction, `one` 0, by the upper rows of a pose."""
    return (
        m[0, 0] * p[0] + m[0, 1] * p[1] + m[0, 2] * p[2] + m[0, 3] * one,
        m[1, 0] * p[0] + m[1, 1] * p[1] + m[1, 2] * p[2] + m[1, 3] * one,
        m[2, 0] * p[0] + m[2, 1] * p[1] + m[2, 2] * p[2] + m[2, 3] * one,
    )


@njit(cache=True, nogil=True)
def _pixel(x, y, z, lens, h, w):  # type: ignore[no-untyped-def]
    """Column and row of a point in the camera; -1, -1 out of the picture."""
    if z < 0.1:
        return -1, -1
    u, v = int(np.rint(x / z * lens[0] + lens[2])), int(np.rint(y / z * lens[1] + lens[3]))
    return (u, v) if 0 <= u < w and 0 <= v < h else (-1, -1)


@njit(cache=True, nogil=True)
def _product(a, b, out):  # type: ignore[no-untyped-def]
    """The upper rows (3, 4) of a product of poses (4, 4)."""
    for r in range(3):
        for c in range(4):
            out[r, c] = (
                a[r, 0] * b[0, c] + a[r, 1] * b[1, c] + a[r, 2] * b[2, c] + (a[r, 3] if c == 3 else 0.0)
            )


@njit(cache=True, nogil=True)
def _inverse(pose):  # type: ignore[no-untyped-def]
    """The inverse of a pose (4, 4)."""
    out = np.zeros((4, 4))
    out[3, 3] = 1.0
    for r in range(3):
        for c in range(3):
            out[r, c] = pose[c, r]
            out[r, 3] -= pose[c, r] * pose[c, 3]
    return out
