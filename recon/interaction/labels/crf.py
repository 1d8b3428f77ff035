"""Compiled kernels that let neighbouring pixels of one surface agree on a label.

FunREC, supplement 1.3: likeness of pixels in place of semantic groups.
"""

from __future__ import annotations

from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

from recon.dense.depth import F32

_EDGE_COST = 50.0  # px


@numba.njit(cache=True, inline="always")
def _softmax(scores: F32, y: int, x: int, belief: F32) -> None:
    n = scores.shape[0]
    top = scores[0, y, x]
    for k in range(1, n):
        top = max(top, scores[k, y, x])
    total = np.float32(0.0)
    for k in range(n):
        belief[k, y, x] = np.exp(scores[k, y, x] - top)
        total += belief[k, y, x]
    for k in range(n):
        belief[k, y, x] /= total


@numba.njit(cache=True, nogil=True)
def _settled(belief: F32, radius: int) -> NDArray[np.bool_]:
    """Pixels (h, w) around which all pixels within `radius` surely hold the same label."""
    n, h, w = belief.shape
    sure = np.zeros((h, w), np.int16)
    for k in range(n):
        for y in range(h):
            for x in range(w):
                if belief[k, y, x] > np.float32(0.95):
                    sure[y, x] = k + 1
    rows = np.zeros((h, w), np.int16)  # the label that all pixels within radius in the row hold, else 0
    for y in range(h):
        run = 0
        for x in range(w + radius):
            last = min(x, w - 1)
            if x < w:
                run = run + 1 if x > 0 and sure[y, x] == sure[y, x - 1] else 1
            if x >= radius and run > last - max(0, x - 2 * radius):
                rows[y, x - radius] = sure[y, last]
    out = np.zeros((h, w), np.bool_)
    runs = np.zeros(w, np.int64)  # rows up to this one that hold the same label
    for y in range(h + radius):
        last = min(y, h - 1)
        for x in range(w):
            if y < h:
                runs[x] = runs[x] + 1 if y > 0 and rows[y, x] == rows[y - 1, x] else 1
            if y >= radius:
                out[y - radius, x] = rows[last, x] > 0 and runs[x] > last - max(0, y - 2 * radius)
    return out


@numba.njit(cache=True, inline="always")
def _unlikeness(
    color: F32, y: int, x: int, other: F32, b: int, a: int, z: float, zn: float, inv_c: Any
) -> Any:
    d0 = color[y, x, 0] - other[b, a, 0]
    d1 = color[y, x, 1] - other[b, a, 1]
    d2 = color[y, x, 2] - other[b, a, 2]
    e = (d0 * d0 + d1 * d1 + d2 * d2) * inv_c
    if z > 0 and zn > 0:
        t = (z - zn) / (np.float32(0.01) + np.float32(0.01) * z)
        e += np.float32(0.5) * t * t
    return e


@numba.njit(cache=True, nogil=True)
def agree(
    scores: F32, color: F32, depth: F32, color_scale: float, radius: int, rounds: int, pull: float
) -> F32:
    """Belief (K, h, w) after mean-field rounds of a local conditional random field (Potts, Gaussian).

    Args:
        scores: (K, h, w) log scores.
        color: (h, w, 3).
        depth: (h, w) m, 0 unknown.
        color_scale: standard deviation of colour within a surface.
        radius: px, of the square neighbourhood.
        pull: log score of full agreement of all neighbours.
    """
    n, h, w = scores.shape
    now, belief = scores.copy(), np.empty((n, h, w), np.float32)
    inv_c = np.float32(0.5 / (color_scale * color_scale))
    # Likeness of each pixel's neighbours, found when first asked; pages of settled pixels are never touched.
    likeness = np.empty((h * w, (2 * radius + 1) ** 2), np.float32)
    masses = np.zeros(h * w, np.float32)
    vote, settled = np.empty(n, np.float32), np.zeros((h, w), np.bool_)
    for turn in range(rounds + 1):
        for y in range(h):
            for x in range(w):
                if not settled[y, x]:  # else it is as it was
                    _softmax(now, y, x, belief)
        if turn == rounds:
            break
        settled = _settled(belief, radius)
        for y in range(h):
            for x in range(w):
                if settled[y, x]:
                    continue
                own = likeness[y * w + x]
                if masses[y * w + x] == 0:
                    masses[y * w + x] = _likeness(color, depth, y, x, radius, inv_c, own)
                mass, i = masses[y * w + x], 0
                vote[:] = 0.0
                for b in range(max(0, y - radius), min(h, y + radius + 1)):
                    for a in range(max(0, x - radius), min(w, x + radius + 1)):
                        for k in range(n):
                            vote[k] += own[i] * belief[k, b, a]
                        i += 1
                share = min(mass / np.float32(0.25 * (2 * radius + 1) ** 2), np.float32(1.0))
                for k in range(n):
                    now[k, y, x] = scores[k, y, x] + np.float32(pull) * share * vote[k] / mass
    return belief


@numba.njit(cache=True, nogil=True)
def _likeness(color: F32, depth: F32, y: int, x: int, radius: int, inv_c: Any, out: F32) -> Any:
    """Fill `out` with the likeness of the neighbours in view, in row order, and return its sum."""
    h, w = depth.shape
    mass, i = np.float32(1e-6), 0
    for b in range(max(0, y - radius), min(h, y + radius + 1)):
        for a in range(max(0, x - radius), min(w, x + radius + 1)):
            e = _unlikeness(color, y, x, color, b, a, depth[y, x], depth[b, a], inv_c)
            alike = e <= 6.0 and not (a == x and b == y)
            out[i] = np.exp(-np.float32(e)) if alike else np.float32(0)
            mass += out[i]
            i += 1
    return mass


@numba.njit(cache=True, nogil=True)
def upsample_labels(
    belief: F32,
    small_color: F32,
    small_depth: F32,
    color: F32,
    depth: F32,
    factor: int,
    color_scale: float,
    ids: NDArray[np.uint8],
) -> NDArray[np.uint8]:
    """Labels (H, W) on the full grid: each pixel follows the small pixels (5x5 around it) that look like it.

    Joint bilateral upsampling (Kopf et al. 2007) of belief. ids: (K,) label of each belief plane (K, h, w).
    """
    n, h, w = belief.shape
    rows, cols = depth.shape
    out = np.zeros((rows, cols), np.uint8)
    inv_c = np.float32(0.5 / (color_scale * color_scale))
    settled, vote = _settled(belief, 2), np.empty(n, np.float32)
    for y in range(rows):
        fy = np.float32((y + 0.5) / factor - 0.5)
        cy = min(max(round(fy), 0), h - 1)
        for x in range(cols):
            fx = np.float32((x + 0.5) / factor - 0.5)
            cx = min(max(round(fx), 0), w - 1)
            for k in range(n):
                vote[k] = belief[k, cy, cx] if settled[cy, cx] else np.float32(0)
            if not settled[cy, cx]:
                for b in range(max(0, cy - 2), min(h, cy + 3)):
                    for a in range(max(0, cx - 2), min(w, cx + 3)):
                        e = _unlikeness(color, y, x, small_color, b, a, depth[y, x], small_depth[b, a], inv_c)
                        e += np.float32(0.5) * ((fx - a) * (fx - a) + (fy - b) * (fy - b))
                        g = np.exp(-np.float32(min(e, 30.0)))
                        for k in range(n):
                            vote[k] += g * belief[k, b, a]
            out[y, x] = ids[np.argmax(vote)]
    return out


@numba.njit(cache=True, nogil=True)
def geodesic(seeds: NDArray[np.bool_], color: F32, depth: F32, color_scale: float, sweeps: int) -> F32:
    """Length (h, w) of the shortest way along surfaces from the nearest seed pixel; px, edges count for many.

    A step costs 1, more where colour changes, and a step over a depth edge as much as `_EDGE_COST`. Raster
    sweeps in both directions (Toivanen 1996), `sweeps` times; unreached pixels hold a large number.
    """
    h, w = depth.shape
    out = np.where(seeds, np.float32(0), np.float32(1e4))
    inv_c = np.float32(1.0 / (color_scale * color_scale))
    for _ in range(sweeps):
        for turn in range(2):
            step = 1 if turn == 0 else -1
            first_y, first_x = (0, 0) if turn == 0 else (h - 1, w - 1)
            for i in range(h):
                y = first_y + step * i
                for j in range(w):
                    x = first_x + step * j
                    best = out[y, x]
                    for k in range(4):
                        b = y - step if k < 3 else y
                        a = x + (k - 1) if k < 3 else x - step
                        if b < 0 or a < 0 or b >= h or a >= w or out[b, a] + 1 >= best:
                            continue
                        best = min(best, out[b, a] + _step_cost(color, depth, y, x, b, a, inv_c))
                    out[y, x] = best
    return out


@numba.njit(cache=True, inline="always")
def _step_cost(color: F32, depth: F32, y: int, x: int, b: int, a: int, inv_c: Any) -> Any:
    cost = np.float32(1.0) if b == y or a == x else np.float32(1.4)
    z, zn = depth[y, x], depth[b, a]
    if z > 0 and zn > 0:
        jump = abs(z - zn) / (np.float32(0.01) + np.float32(0.01) * z) - np.float32(1)
        cost += min(max(jump, np.float32(0)) * np.float32(5), np.float32(_EDGE_COST))
    else:
        cost += np.float32(2)
    d0 = color[y, x, 0] - color[b, a, 0]
    d1 = color[y, x, 1] - color[b, a, 1]
    d2 = color[y, x, 2] - color[b, a, 2]
    return cost + min((d0 * d0 + d1 * d1 + d2 * d2) * inv_c, np.float32(10))
