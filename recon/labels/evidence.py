"""Compiled kernels that compare the pixels of one frame with reference frames under a rigid motion each."""

from __future__ import annotations

from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

from recon.depth import F32, pixel_sigma


@numba.njit(cache=True)
def median_depth(depth: F32, factor: int) -> F32:
    """Depth (h // factor, w // factor): the lower median of the known readings of each block, 0 where none is known.

    A median of actual readings never invents a surface between two others.
    """
    h, w = depth.shape[0] // factor, depth.shape[1] // factor
    out = np.zeros((h, w), np.float32)
    block = np.empty(factor * factor, np.float32)
    for y in range(h):
        for x in range(w):
            n = 0
            for dy in range(factor):
                for dx in range(factor):
                    z = depth[y * factor + dy, x * factor + dx]
                    if z > 0:
                        k = n
                        while k > 0 and block[k - 1] > z:
                            block[k] = block[k - 1]
                            k -= 1
                        block[k] = z
                        n += 1
            if n > 0:
                out[y, x] = block[(n - 1) // 2]
    return out


@numba.njit(cache=True, inline="always")
def _landing(m: F32, px: float, py: float, z: float, camera: F32, h: int, w: int) -> Any:
    """Nearest pixel (u, v) and depth (m) of a point in a reference camera; u is -1 where its 3x3 are not all in view."""
    ui, vi = -1, -1
    qz = m[2, 0] * px + m[2, 1] * py + m[2, 2] * z + m[2, 3]
    if qz >= np.float32(0.05):
        u = (m[0, 0] * px + m[0, 1] * py + m[0, 2] * z + m[0, 3]) / qz * camera[0] + camera[2]
        v = (m[1, 0] * px + m[1, 1] * py + m[1, 2] * z + m[1, 3]) / qz * camera[1] + camera[3]
        if not (u < 0.5 or v < 0.5 or u > w - 1.6 or v > h - 1.6):
            ui, vi = int(u + np.float32(0.5)), int(v + np.float32(0.5))
    return ui, vi, qz


@numba.njit(cache=True, inline="always")
def _neighbourhood(
    ref_depth: F32, ref_color: F32, r: int, ui: int, vi: int, qz: float, c0: float, c1: float, c2: float,
    inv_var: float, inv_color: np.float32,
) -> Any:  # fmt: skip
    """What 3x3 pixels of reference frame r say of a point with depth qz and colour c: how far behind it the nearest
    reading lies (m), how well the best one agrees (0..1), how many are known."""
    one = np.float32(1.0)
    nearest, best, known = np.float32(1e9), np.float32(0), 0
    for b in range(vi - 1, vi + 2):
        for a in range(ui - 1, ui + 2):
            zr = ref_depth[r, b, a]
            if zr <= 0:
                continue
            known += 1
            gap = zr - qz
            nearest = min(nearest, gap)
            t2 = gap * gap * inv_var
            if t2 < 9:
                d0, d1, d2 = (
                    c0 - ref_color[r, b, a, 0],
                    c1 - ref_color[r, b, a, 1],
                    c2 - ref_color[r, b, a, 2],
                )
                like = (d0 * d0 + d1 * d1 + d2 * d2) * inv_color
                best = max(best, one / ((one + np.float32(0.15) * t2) * (one + like)))
    return nearest, best, known


@numba.njit(cache=True, parallel=True, fastmath={"nsz", "arcp", "contract", "afn", "reassoc"})
def compare(
    depth: F32,
    color: F32,
    wanted: NDArray[np.bool_],
    camera: F32,
    moves: F32,
    ref_depth: F32,
    ref_color: F32,
    can_support: NDArray[np.bool_],
    side: NDArray[np.int8],
    color_sigma: float,
    slack: float,
    out: F32,
) -> None:
    """Sum over reference frames how far each supports and violates one rigid motion at each pixel.

    A pixel's point is moved into a reference camera. A reading there that agrees in depth supports (weighted by the
    likeness of colour, best of 3x3); readings behind the point in all of 3x3 violate, for then the point would have
    hidden them; readings in front say nothing.

    The frame has `depth` (h, w) m, 0 unknown, `color` (h, w, 3) and a `camera` (fx, fy, cx, cy); `wanted` (h, w) are the pixels to look
    at. The references have `ref_depth` (R, h, w) and `ref_color` (R, h, w, 3); `moves` (R, 3, 4) takes the frame's camera to theirs, NaN
    rows are skipped; those without `can_support` (R,) may only violate; `side` (R,) is -1 for those that show the part at a clearly
    lower state, 1 at a higher one, else 0: only the sides tell a part from static scene. `color_sigma` is one standard deviation of
    colour, `slack` (m) the depth error that poses may cause.

    `out` (4, h, w) takes the sums of weights 0..1: support, violation, support by frames at lower and at higher states.
    """
    h, w = depth.shape
    fx, fy, cx, cy = camera[0], camera[1], camera[2], camera[3]
    one = np.float32(1.0)
    inv_color = one / np.float32(color_sigma * color_sigma)
    slack2 = np.float32(slack * slack)
    for y in numba.prange(h):
        for x in range(w):
            z = depth[y, x]
            if z <= 0 or not wanted[y, x]:
                continue
            px, py = (np.float32(x) - cx) / fx * z, (np.float32(y) - cy) / fy * z
            s1 = pixel_sigma(z)
            var = s1 * s1 + slack2
            c0, c1, c2 = color[y, x, 0], color[y, x, 1], color[y, x, 2]
            for r in range(moves.shape[0]):
                if np.isnan(moves[r, 0, 0]):
                    continue
                ui, vi, qz = _landing(moves[r], px, py, z, camera, h, w)
                if ui < 0:
                    continue
                s2 = pixel_sigma(qz)
                inv_var = one / (var + s2 * s2)
                nearest, best, known = _neighbourhood(
                    ref_depth, ref_color, r, ui, vi, qz, c0, c1, c2, inv_var, inv_color
                )
                if can_support[r]:
                    out[0, y, x] += best
                if side[r] != 0:
                    out[2 if side[r] < 0 else 3, y, x] += best
                if known >= 6 and nearest > 0:
                    t = nearest * np.sqrt(inv_var)
                    out[1, y, x] += min(max((t - one) / np.float32(1.5), np.float32(0)), one)
