"""How much of each lamp and of the room a surface sees: shadow and ambient rays from a grid of pixels."""

# Numba compiles the kernels; they are plain loops because that is what it makes fast. Arrays are float32.
from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

FloatArray = Any  # numba sees the concrete types
F32 = NDArray[np.float32]

AMBIENT_REACH = 0.6  # metres; chosen by us: corners of cupboards darken, whole rooms do not
LIFT = 1e-3  # metres that a ray starts off its surface
ALIKE = 0.9  # cosine between normals within which light is shared
DEPTH_STEP = 0.02  # share of the depth a pixel within which light is shared
# Steps between the taps of the smoothing passes, in pixels: à-trous wavelets (Dammertz et al. 2010)
PASSES = (1, 2, 4)


@dataclass(frozen=True)
class Seen:
    """Pixels: `rays` (H W, 6), `depth` (H, W) m, `normals` (H, W, 3), `body` (H, W), -1 for nothing."""

    rays: F32
    depth: F32
    normals: F32
    body: NDArray[np.int32]


@dataclass(frozen=True)
class LightRays:
    """How the light is traced: shadow rays a light, ambient rays, and the `pitch` (px) of their grid."""

    shadow: int
    ambient: int
    pitch: int = 2


def received(
    seen: Seen, lamps: F32, rays: LightRays, free: Callable[[F32], F32], rng: np.random.Generator
) -> F32:
    """Visibility of each light and ambient openness (H, W, L + 1), smoothed along surfaces.

    Rays start from every `pitch`-th pixel of every `pitch`-th row. Passes of smoothing reach equally far at
    any pitch; other pixels get the mean of the grid's around them on their surface, else trace rays.

    Args:
        seen: what the pixel centres see.
        lamps: rectangular lights (L, 3, 3): centre and two half edges.
        rays: how many, and from where.
        free: 1 for segments (n, 6) = start and vector that meet nothing, else 0.
        rng: shifts the quasi-random points, once a frame.
    """
    height, width = seen.depth.shape
    shifts = rng.random((2, len(lamps) + 1, 2))
    rows, columns = np.mgrid[0 : height : rays.pitch, 0 : width : rays.pitch]
    grid = np.zeros((*rows.shape, len(lamps) + 1), np.float32)
    there = seen.body[rows, columns] >= 0
    pixels = (rows * width + columns)[there]
    order = morton(rows[there] // rays.pitch, columns[there] // rays.pitch)
    grid[there] = _traced(seen, pixels, order, lamps, rays, free, shifts[0])
    at = (slice(None, None, rays.pitch), slice(None, None, rays.pitch))
    depth, normals, body = (np.ascontiguousarray(a[at]) for a in (seen.depth, seen.normals, seen.body))
    for step in (p // rays.pitch for p in PASSES if p >= rays.pitch):
        grid = smooth_light(grid, depth, normals, body, step, rays.pitch)
    if rays.pitch == 1:
        return grid
    light, alone = spread_light(grid, seen.depth, seen.normals, seen.body, rays.pitch)
    row, column = np.nonzero(alone)
    light[row, column] = _traced(
        seen, row * width + column, morton(row, column), lamps, rays, free, shifts[1]
    )
    return np.asarray(light)


def _traced(
    seen: Seen,
    pixels: NDArray[np.int64],
    order: NDArray[np.int64],
    lamps: F32,
    rays: LightRays,
    free: Callable[[F32], F32],
    shifts: NDArray[np.float64],
) -> F32:
    """Visibility (n, L + 1) at `pixels` (n,): means over their own rays; `order` (n,) along the Z curve."""
    out = np.zeros((len(pixels), len(lamps) + 1), np.float32)
    if not len(pixels):
        return out
    normals = seen.normals.reshape(-1, 3)[pixels]
    starts = ray_starts(seen.rays, seen.depth.reshape(-1), seen.normals.reshape(-1, 3), pixels)
    for j, lamp in enumerate(lamps):
        for k in range(rays.shadow):
            out[:, j] += free(light_rays(starts, lamp, order * rays.shadow + k, shifts[j]))
        out[:, j] /= rays.shadow
    for k in range(rays.ambient):
        out[:, -1] += free(ambient_rays(starts, normals, AMBIENT_REACH, order * rays.ambient + k, shifts[-1]))
    out[:, -1] /= rays.ambient
    return out


def morton(rows: NDArray[np.int64], columns: NDArray[np.int64]) -> NDArray[np.int64]:
    """Place (n,) of pixels along the Z curve: the bits of row and column in turn."""
    out = np.zeros(len(rows), np.int64)
    for bit in range(12):  # images have fewer than 4096 rows and columns
        out |= ((columns >> bit) & 1) << (2 * bit) | ((rows >> bit) & 1) << (2 * bit + 1)
    return out


@numba.njit(cache=True, nogil=True)
def _point(index: int, shift: FloatArray) -> tuple[float, float]:
    """Point `index` of the R2 sequence (Roberts 2018) in the unit square, shifted: neighbours along the Z
    curve get points that lie apart, so the mean over a few pixels needs fewer rays than with random ones.
    """
    u = index * 0.7548776662466927 + shift[0]
    v = index * 0.5698402909980532 + shift[1]
    return u - math.floor(u), v - math.floor(v)


@numba.njit(cache=True, fastmath=True, nogil=True)
def ray_starts(rays: FloatArray, depth: FloatArray, normals: FloatArray, pixels: FloatArray) -> FloatArray:
    """Points (n, 3) a little above what `pixels` (n,) see."""
    out = np.empty((len(pixels), 3), np.float32)
    for i in range(len(pixels)):
        p = pixels[i]
        for k in range(3):
            out[i, k] = rays[p, k] + depth[p] * rays[p, 3 + k] + LIFT * normals[p, k]
    return out


@numba.njit(cache=True, fastmath=True, nogil=True)
def light_rays(starts: FloatArray, light: FloatArray, index: FloatArray, shift: FloatArray) -> FloatArray:
    """Rays (n, 6) from `starts` (n, 3) to points of a rectangular light (centre, half edges: (3, 3))."""
    out = np.empty((len(starts), 6), np.float32)
    for i in range(len(starts)):
        u, v = _point(index[i], shift)
        a, b = 2.0 * u - 1.0, 2.0 * v - 1.0
        for k in range(3):
            out[i, k] = starts[i, k]
            out[i, 3 + k] = light[0, k] + a * light[1, k] + b * light[2, k] - starts[i, k]
    return out


@numba.njit(cache=True, fastmath=True, nogil=True)
def ambient_rays(
    starts: FloatArray, normals: FloatArray, reach: float, index: FloatArray, shift: FloatArray
) -> FloatArray:
    """Rays (n, 6) of length `reach` from `starts` in cosine-weighted directions about the normals (n, 3)."""
    out = np.empty((len(starts), 6), np.float32)
    for i in range(len(starts)):
        u, v = _point(index[i], shift)
        z = 2.0 * u - 1.0
        r = math.sqrt(max(0.0, 1.0 - z * z))
        x = normals[i, 0] + r * math.cos(2.0 * math.pi * v)
        y = normals[i, 1] + r * math.sin(2.0 * math.pi * v)
        w = normals[i, 2] + z
        scale = reach / (math.sqrt(x * x + y * y + w * w) + 1e-6)
        for k in range(3):
            out[i, k] = starts[i, k]
        out[i, 3], out[i, 4], out[i, 5] = scale * x, scale * y, scale * w
    return out


@numba.njit(cache=True, fastmath=True, nogil=True)
def _alike(a: FloatArray, b: FloatArray, depth_a: float, depth_b: float, pixels: float) -> bool:
    """Whether two points `pixels` apart face the same way at a like depth."""
    turn = a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
    return turn >= ALIKE and abs(depth_a - depth_b) <= DEPTH_STEP * depth_b * pixels


@numba.njit(cache=True, fastmath=True, nogil=True)
def smooth_light(
    light: FloatArray, depth: FloatArray, normals: FloatArray, body: FloatArray, step: int, pitch: int
) -> FloatArray:
    """One edge-keeping pass over visibility (height, width, channels): neighbours `step` places apart that
    lie on the same body, face the same way and have a like depth. Places are `pitch` pixels apart.
    """
    height, width, channels = light.shape
    out = np.empty_like(light)
    for v in range(height):
        for u in range(width):
            total = 0.0
            for c in range(channels):
                out[v, u, c] = 0.0
            for dv in range(-2, 3):
                y = v + dv * step
                for du in range(-2, 3):
                    x = np.int64(u) + du * step
                    if y < 0 or x < 0 or y >= height or x >= width or body[y, x] != body[v, u]:
                        continue
                    if not _alike(normals[y, x], normals[v, u], depth[y, x], depth[v, u], step * pitch):
                        continue
                    weight = (3.0 - abs(dv)) * (3.0 - abs(du))
                    total += weight
                    for c in range(channels):
                        out[v, u, c] += weight * light[y, x, c]
            for c in range(channels):
                out[v, u, c] = out[v, u, c] / total if total > 0.0 else light[v, u, c]
    return out


@numba.njit(cache=True, fastmath=True, nogil=True)
def spread_light(
    grid: FloatArray, depth: FloatArray, normals: FloatArray, body: FloatArray, pitch: int
) -> tuple[FloatArray, FloatArray]:
    """Visibility (H, W, channels) from that at every `pitch`-th pixel: bilinear between those of the four
    around that lie on the same surface. Where none does, the second array (H, W) is true.
    """
    height, width = depth.shape
    rows, columns, channels = grid.shape
    out = np.zeros((height, width, channels), np.float32)
    alone = np.zeros((height, width), np.bool_)
    for v in range(height):
        i, fv = v // pitch, (v % pitch) / pitch
        for u in range(width):
            if body[v, u] < 0:
                continue
            j, fu = u // pitch, (u % pitch) / pitch
            total = 0.0
            for y in range(i, min(i + 2, rows)):
                for x in range(j, min(j + 2, columns)):
                    weight = (fv if y > i else 1.0 - fv) * (fu if x > j else 1.0 - fu)
                    q, r = y * pitch, x * pitch
                    if weight <= 0.0 or body[q, r] != body[v, u]:
                        continue
                    if not _alike(normals[q, r], normals[v, u], depth[q, r], depth[v, u], pitch):
                        continue
                    total += weight
                    for c in range(channels):
                        out[v, u, c] += weight * grid[y, x, c]
            if total > 0.0:
                for c in range(channels):
                    out[v, u, c] /= total
            alone[v, u] = total <= 0.0
    return out, alone
