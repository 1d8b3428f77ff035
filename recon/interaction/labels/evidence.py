"""Compiled kernels that compare the pixels of one frame with reference frames under a rigid motion each."""

from __future__ import annotations

from typing import Any, NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

from recon.dense.depth import F32, pixel_sigma

ENOUGH = 2.0  # supporting references; more make nothing surer
# Cosine between normal and ray below which a surface is seen edge-on. Chosen by us.
_EDGE_ON = np.float32(0.15)
# Cosine above which a surface is seen well. Chosen by us.
_FACING = np.float32(0.35)


class Pixels(NamedTuple):
    """A frame whose pixels are compared: depth (h, w) m, color (h, w, 3), normals (h, w, 3), 0 where unknown,
    the pixels wanted (h, w), camera (fx, fy, cx, cy)."""

    depth: F32
    color: F32
    normals: F32
    wanted: NDArray[np.bool_]
    camera: F32


class Others(NamedTuple):
    """What it is compared with: moves (R, 3, 4) from its camera to those of the references, whose NaN rows
    are skipped, their depth (R, h, w), color (R, h, w, 3) and the range of their depth (`depth_range`); those
    without can_support (R,) may only violate; side (R,) is -1 for those that show the part at a clearly lower
    state, 1 at a higher one, else 0."""

    moves: F32
    depth: F32
    color: F32
    range: tuple[F32, F32]
    can_support: NDArray[np.bool_]
    side: NDArray[np.int8]


class Errors(NamedTuple):
    """color: of colours. slack: m, of depth by errors of poses. noise (2,): for `pixel_sigma`. spread: seen
    through is so many times as far behind."""

    color: float
    slack: float
    noise: F32
    spread: float


@numba.njit(cache=True, nogil=True)
def median_depth(depth: F32, factor: int) -> F32:
    """Depth (h // factor, w // factor): lower median of each block's known readings, 0 without.

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
def _row(
    depth: F32, wanted: NDArray[np.bool_], y: int, camera: F32, slack: float, noise: F32,
    column: NDArray[np.int32], points: F32, variance: F32,
) -> Any:  # fmt: skip
    """Number of a row's wanted, known pixels: `column`, `points` (3, w) in the camera, depth `variance`."""
    n, slack2 = 0, np.float32(slack * slack)
    for x in range(depth.shape[1]):
        z = depth[y, x]
        if z > 0 and wanted[y, x]:
            points[0, n] = (np.float32(x) - camera[2]) / camera[0] * z
            points[1, n] = (np.float32(y) - camera[3]) / camera[1] * z
            points[2, n] = z
            sigma = pixel_sigma(z, noise)
            column[n], variance[n] = x, sigma * sigma + slack2
            n += 1
    return n


@numba.njit(cache=True, inline="always")
def _landings(m: F32, r: int, points: F32, n: int, camera: F32, noise: F32, variance: F32, out: F32) -> None:
    """Where n points of a row (3, w) lie in reference camera r: `out` (4, w) takes pixel x, y, depth m and
    the inverse variance of a difference in depth; `variance` (w,) is that of the points."""
    for i in range(n):
        px, py, z = points[0, i], points[1, i], points[2, i]
        qz = m[r, 2, 0] * px + m[r, 2, 1] * py + m[r, 2, 2] * z + m[r, 2, 3]
        out[0, i] = (m[r, 0, 0] * px + m[r, 0, 1] * py + m[r, 0, 2] * z + m[r, 0, 3]) / qz * camera[
            0
        ] + camera[2]
        out[1, i] = (m[r, 1, 0] * px + m[r, 1, 1] * py + m[r, 1, 2] * z + m[r, 1, 3]) / qz * camera[
            1
        ] + camera[3]
        out[2, i] = qz
        sigma = pixel_sigma(qz, noise)
        out[3, i] = np.float32(1.0) / (variance[i] + sigma * sigma)


@numba.njit(cache=True, nogil=True)
def depth_range(depth: F32) -> tuple[F32, F32]:
    """Least and greatest known depth (h, w) of each 3x3; least 0 if under 6 are known."""
    h, w = depth.shape
    near, far = np.zeros((h, w), np.float32), np.zeros((h, w), np.float32)
    for y in range(1, h - 1):
        for x in range(1, w - 1):
            known = 0
            low, high = np.float32(np.inf), np.float32(0)
            for b in range(y - 1, y + 2):
                for a in range(x - 1, x + 2):
                    z = depth[b, a]
                    if z > 0:
                        known += 1
                        low, high = min(low, z), max(high, z)
            far[y, x] = high
            if known >= 6:
                near[y, x] = low
    return near, far


@numba.njit(cache=True, inline="always")
def _agreement(
    ref_depth: F32, ref_color: F32, r: int, ui: Any, vi: Any, qz: float, tint: tuple[Any, Any, Any],
    inv_var: float, inv_color: np.float32,
) -> Any:  # fmt: skip
    """How well the best of 3x3 pixels of reference frame r agrees with a point of depth qz and a colour,
    0..1."""
    one, none = np.float32(1.0), np.float32(np.inf)
    c0, c1, c2 = tint
    least = none  # the inverse of the agreement
    for b in range(vi - 1, vi + 2):
        for a in range(ui - 1, ui + 2):
            zr = ref_depth[r, b, a]
            gap = zr - qz
            t2 = gap * gap * inv_var
            d0, d1, d2 = c0 - ref_color[r, b, a, 0], c1 - ref_color[r, b, a, 1], c2 - ref_color[r, b, a, 2]
            off = (one + np.float32(0.15) * t2) * (one + (d0 * d0 + d1 * d1 + d2 * d2) * inv_color)
            # no branches: measured
            least = min(least, off if t2 < np.float32(9) and zr > np.float32(0) else none)
    return one / least


@numba.njit(cache=True, inline="always")
def _seen_through(t: float, move: F32, points: F32, i: int, normal: F32) -> Any:
    """How surely point i of a row (3, w), normal (3,), is seen through, 0..1, if read t sigmas behind.

    Less where it is seen edge-on, as a board is then thinner than the error of its place.
    """
    one, dot, length2 = np.float32(1.0), np.float32(0), np.float32(0)
    surely = min(max((t - one) / np.float32(1.5), np.float32(0)), one)
    if surely == 0 or (normal[0] == 0 and normal[1] == 0 and normal[2] == 0):
        return surely
    for k in range(3):
        # from the reference camera's centre, -R^T t
        way = points[k, i] + move[0, k] * move[0, 3] + move[1, k] * move[1, 3] + move[2, k] * move[2, 3]
        dot += way * normal[k]
        length2 += way * way
    cosine = abs(dot) / np.sqrt(max(length2, np.float32(1e-12)))
    return surely * min(max((cosine - _EDGE_ON) / (_FACING - _EDGE_ON), np.float32(0)), one)


@numba.njit(
    cache=True,
    nogil=True,
    error_model="numpy",  # what lands in the plane of a camera is infinitely far aside, and no error
    fastmath={"nsz", "arcp", "contract", "afn", "reassoc"},
)
def compare(seen: Pixels, others: Others, errors: Errors, out: F32) -> None:
    """Sum over reference frames how far each supports and violates one rigid motion at each pixel.

    A pixel's point is moved into a reference camera. A reading that agrees in depth supports (by likeness of
    colour, best of 3x3); readings behind in all of 3x3 violate, as the point would have hidden them, less so
    seen edge-on (`_seen_through`); those in front say nothing. `out` (4, h, w) takes weights: support (once
    `ENOUGH`, by a side only), violation, lower's, higher's.
    """
    depth, color, normals, wanted, camera = seen
    moves, ref_depth, ref_color, ref_range, can_support, side = others
    color_sigma, slack, noise, spread = errors
    h, w = depth.shape
    one, (near, far), narrow = np.float32(1.0), ref_range, np.float32(1.0 / spread)
    inv_color = one / np.float32(color_sigma * color_sigma)
    column, points = np.empty(w, np.int32), np.empty((3, w), np.float32)
    variance, landed = np.empty(w, np.float32), np.empty((4, w), np.float32)
    for y in range(h):
        n = _row(depth, wanted, y, camera, slack, noise, column, points, variance)
        for r in range(moves.shape[0]):
            if np.isnan(moves[r, 0, 0]):
                continue
            _landings(moves, r, points, n, camera, noise, variance, landed)
            for i in range(n):
                u, v, qz, inv_var = landed[0, i], landed[1, i], landed[2, i], landed[3, i]
                if not (qz >= 0.05 and u >= 0.5 and v >= 0.5 and u <= w - 1.6 and v <= h - 1.6):
                    continue  # its 3x3 are not all in view
                x, ui, vi = column[i], np.uint32(u + np.float32(0.5)), np.uint32(v + np.float32(0.5))
                nearest = near[r, vi, ui] - qz
                apart = max(nearest, qz - far[r, vi, ui])  # where positive, no reading is nearer to the point
                asked = side[r] != 0 or (can_support[r] and out[0, y, x] < ENOUGH)
                if asked and (apart <= 0 or apart * apart * inv_var < 9):
                    tint = color[y, x, 0], color[y, x, 1], color[y, x, 2]
                    best = _agreement(ref_depth, ref_color, r, ui, vi, qz, tint, inv_var, inv_color)
                    if can_support[r]:
                        out[0, y, x] += best
                    if side[r] != 0:
                        out[2 if side[r] < 0 else 3, y, x] += best
                if nearest > 0:
                    t = nearest * np.sqrt(inv_var) * narrow
                    out[1, y, x] += _seen_through(t, moves[r], points, i, normals[y, x])
