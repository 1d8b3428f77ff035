"""Compiled kernels of the renderer: rays, textures, lights. Arrays are float32; poses are rows of 3 x 4."""

# Numba compiles these functions; they are plain loops because that is what it makes fast.
from __future__ import annotations

import math
from typing import Any

import numba
import numpy as np

FloatArray = Any  # numba sees the concrete types


@numba.njit(cache=True, parallel=True, fastmath=True)
def primary_rays(
    height: int, width: int, focal: float, cx: float, cy: float, offsets: FloatArray, pose: FloatArray
) -> FloatArray:
    """Rays (height, width, n, 6) through pixel centres plus `offsets` (n, 2); their parameter is depth along z."""
    n = offsets.shape[0]
    out = np.empty((height, width, n, 6), np.float32)
    for v in numba.prange(height):
        for u in range(width):
            for k in range(n):
                x = (u + offsets[k, 0] - cx) / focal
                y = (v + offsets[k, 1] - cy) / focal
                for a in range(3):
                    out[v, u, k, a] = pose[a, 3]
                    out[v, u, k, 3 + a] = pose[a, 0] * x + pose[a, 1] * y + pose[a, 2]
    return out


@numba.njit(cache=True, fastmath=True)
def _normal(
    face: int, u: float, v: float, corners: FloatArray, pose: FloatArray, direction: FloatArray
) -> tuple[float, float, float]:
    """Interpolated world normal of a hit, turned towards the viewer."""
    w = 1.0 - u - v
    x = w * corners[face, 0, 0] + u * corners[face, 1, 0] + v * corners[face, 2, 0]
    y = w * corners[face, 0, 1] + u * corners[face, 1, 1] + v * corners[face, 2, 1]
    z = w * corners[face, 0, 2] + u * corners[face, 1, 2] + v * corners[face, 2, 2]
    a = pose[0, 0] * x + pose[0, 1] * y + pose[0, 2] * z
    b = pose[1, 0] * x + pose[1, 1] * y + pose[1, 2] * z
    c = pose[2, 0] * x + pose[2, 1] * y + pose[2, 2] * z
    length = math.sqrt(a * a + b * b + c * c) + 1e-20
    if a * direction[0] + b * direction[1] + c * direction[2] > 0.0:
        length = -length
    return a / length, b / length, c / length


@numba.njit(cache=True, parallel=True, fastmath=True)
def pixel_normals(
    rays: FloatArray,
    geometry: FloatArray,
    face: FloatArray,
    uv: FloatArray,
    corners: FloatArray,
    poses: FloatArray,
) -> FloatArray:
    """World normals (n, 3) of hits; zero where a ray met nothing (geometry < 0)."""
    out = np.zeros((rays.shape[0], 3), np.float32)
    for i in numba.prange(rays.shape[0]):
        if geometry[i] >= 0:
            pose = poses[geometry[i]]
            a, b, c = _normal(face[i], uv[i, 0], uv[i, 1], corners, pose, rays[i, 3:6])
            out[i, 0], out[i, 1], out[i, 2] = a, b, c
    return out


@numba.njit(cache=True, parallel=True, fastmath=True)
def light_rays(
    rays: FloatArray, depth: FloatArray, normals: FloatArray, light: FloatArray, random: FloatArray
) -> FloatArray:
    """Rays (n, 6) from hits to random points of a rectangular light (centre, half edge, half edge: (3, 3))."""
    out = np.zeros((rays.shape[0], 6), np.float32)
    for i in numba.prange(rays.shape[0]):
        a, b = 2.0 * random[i, 0] - 1.0, 2.0 * random[i, 1] - 1.0
        for k in range(3):
            start = rays[i, k] + depth[i] * rays[i, 3 + k] + 1e-3 * normals[i, k]
            out[i, k] = start
            out[i, 3 + k] = light[0, k] + a * light[1, k] + b * light[2, k] - start
    return out


@numba.njit(cache=True, parallel=True, fastmath=True)
def ambient_rays(
    rays: FloatArray, depth: FloatArray, normals: FloatArray, reach: float, random: FloatArray
) -> FloatArray:
    """Rays (n, 6) of length `reach` from hits in cosine-distributed directions about the normals."""
    out = np.zeros((rays.shape[0], 6), np.float32)
    for i in numba.prange(rays.shape[0]):
        z = 2.0 * random[i, 0] - 1.0
        r = math.sqrt(max(0.0, 1.0 - z * z))
        phi = 2.0 * math.pi * random[i, 1]
        d = (r * math.cos(phi), r * math.sin(phi), z)
        x, y, w = normals[i, 0] + d[0], normals[i, 1] + d[1], normals[i, 2] + d[2]
        length = math.sqrt(x * x + y * y + w * w) + 1e-6
        for k in range(3):
            out[i, k] = rays[i, k] + depth[i] * rays[i, 3 + k] + 1e-3 * normals[i, k]
        out[i, 3], out[i, 4], out[i, 5] = reach * x / length, reach * y / length, reach * w / length
    return out


@numba.njit(cache=True, parallel=True, fastmath=True)
def smooth_light(
    light: FloatArray, depth: FloatArray, normals: FloatArray, geometry: FloatArray, step: int
) -> FloatArray:
    """One edge-keeping pass over visibility (height, width, channels): neighbours `step` pixels apart that lie
    on the same object, face the same way and have a like depth.
    """
    height, width, channels = light.shape
    out = np.empty_like(light)
    for v in numba.prange(height):
        for u in range(width):
            total = 0.0
            for c in range(channels):
                out[v, u, c] = 0.0
            for dv in range(-2, 3):
                for du in range(-2, 3):
                    y, x = np.int64(v) + dv * step, np.int64(u) + du * step
                    if y < 0 or x < 0 or y >= height or x >= width or geometry[y, x] != geometry[v, u]:
                        continue
                    turn = 0.0
                    for k in range(3):
                        turn += normals[y, x, k] * normals[v, u, k]
                    if turn < 0.9 or abs(depth[y, x] - depth[v, u]) > 0.02 * depth[v, u] * step:
                        continue
                    weight = (3.0 - abs(dv)) * (3.0 - abs(du))
                    total += weight
                    for c in range(channels):
                        out[v, u, c] += weight * light[y, x, c]
            for c in range(channels):
                out[v, u, c] = out[v, u, c] / total if total > 0.0 else light[v, u, c]
    return out


@numba.njit(cache=True, fastmath=True)
def _texel(atlas: FloatArray, start: int, size: int, u: float, v: float, out: FloatArray) -> None:
    x, y = u * size - 0.5, v * size - 0.5
    x0, y0 = math.floor(x), math.floor(y)
    fx, fy = x - x0, y - y0
    x1, y1 = (x0 + 1) % size, (y0 + 1) % size
    x0, y0 = x0 % size, y0 % size
    a, b = start + 3 * (y0 * size + x0), start + 3 * (y0 * size + x1)
    c, d = start + 3 * (y1 * size + x0), start + 3 * (y1 * size + x1)
    for k in range(3):
        top = (1.0 - fx) * atlas[a + k] + fx * atlas[b + k]
        bottom = (1.0 - fx) * atlas[c + k] + fx * atlas[d + k]
        out[k] = (1.0 - fy) * top + fy * bottom


@numba.njit(cache=True, fastmath=True)
def _albedo(
    point: FloatArray,
    normal: FloatArray,
    to_texture: FloatArray,
    tile: float,
    footprint: float,
    atlas: FloatArray,
    starts: FloatArray,
    size: int,
    out: FloatArray,
) -> None:
    """Triplanar lookup: the plane that faces the surface most, mip level by the pixel's footprint in metres."""
    m = to_texture
    a = abs(m[0, 0] * normal[0] + m[0, 1] * normal[1] + m[0, 2] * normal[2])
    b = abs(m[1, 0] * normal[0] + m[1, 1] * normal[1] + m[1, 2] * normal[2])
    c = abs(m[2, 0] * normal[0] + m[2, 1] * normal[1] + m[2, 2] * normal[2])
    x = m[0, 0] * point[0] + m[0, 1] * point[1] + m[0, 2] * point[2] + m[0, 3]
    y = m[1, 0] * point[0] + m[1, 1] * point[1] + m[1, 2] * point[2] + m[1, 3]
    z = m[2, 0] * point[0] + m[2, 1] * point[1] + m[2, 2] * point[2] + m[2, 3]
    if c >= a and c >= b:
        u, v = x, y
    elif b >= a:
        u, v = x, z
    else:
        u, v = y, z
    level = int(max(0.0, math.log2(max(footprint / tile * size, 1e-6)) + 0.3))
    level = min(level, starts.shape[0] - 1)
    _texel(atlas, starts[level], size >> level, u / tile, v / tile, out)


@numba.njit(cache=True, fastmath=True)
def _same_surface(
    pixel_depth: FloatArray, pixel_body: FloatArray, v: int, u: int, depth: float, body: int
) -> tuple[int, int]:
    """The pixel among (v, u) and its neighbours whose centre is on the same body at the nearest depth."""
    height, width = pixel_depth.shape
    best = 1e30
    row, column = v, u
    for y in range(max(0, v - 1), min(height, v + 2)):
        for x in range(max(0, u - 1), min(width, u + 2)):
            cost = abs(pixel_depth[y, x] - depth) + (10.0 if pixel_body[y, x] != body else 0.0)
            if cost < best:
                best = cost
                row, column = y, x
    return row, column


@numba.njit(cache=True, fastmath=True)
def _lit(
    point: FloatArray,
    normal: FloatArray,
    direction: FloatArray,
    albedo: FloatArray,
    gloss: float,
    light: FloatArray,
    lights: FloatArray,
    powers: FloatArray,
    sky: FloatArray,
    out: FloatArray,
) -> None:
    """Add the light that leaves a point to `out` (3,): ambient, lamps with distance fall-off, a weak highlight."""
    up = 0.78 + 0.22 * normal[2]
    length = math.sqrt(direction[0] ** 2 + direction[1] ** 2 + direction[2] ** 2)
    shine = 0.0
    for k in range(3):
        out[k] += (
            albedo[k] * sky[k] * up * (0.12 + 0.88 * light[lights.shape[0]])
        )  # light bounces into corners
    for j in range(lights.shape[0]):
        lx = lights[j, 0, 0] - point[0]
        ly = lights[j, 0, 1] - point[1]
        lz = lights[j, 0, 2] - point[2]
        far = math.sqrt(lx * lx + ly * ly + lz * lz) + 1e-6
        received = light[j] * math.sqrt(max(0.0, lz / far)) / (0.6 + far * far)  # lamps shine downwards
        cosine = max(0.0, (lx * normal[0] + ly * normal[1] + lz * normal[2]) / far)
        for k in range(3):
            out[k] += albedo[k] * powers[j, k] * received * cosine
        hx = lx / far - direction[0] / length
        hy = ly / far - direction[1] / length
        hz = lz / far - direction[2] / length
        half = math.sqrt(hx * hx + hy * hy + hz * hz) + 1e-6
        spec = max(0.0, (hx * normal[0] + hy * normal[1] + hz * normal[2]) / half)
        shine += 0.12 * gloss * received * spec**40 * powers[j, 1]
    for k in range(3):
        out[k] += shine


@numba.njit(cache=True, parallel=True, fastmath=True)
def shade(
    rays: FloatArray,
    hit_depth: FloatArray,
    body: FloatArray,
    face: FloatArray,
    uv: FloatArray,
    corners: FloatArray,
    face_surface: FloatArray,
    poses: FloatArray,
    texture_poses: FloatArray,
    tiles: FloatArray,
    glosses: FloatArray,
    starts: FloatArray,
    atlas: FloatArray,
    size: int,
    lights: FloatArray,
    powers: FloatArray,
    sky: FloatArray,
    light: FloatArray,
    pixel_depth: FloatArray,
    pixel_body: FloatArray,
    pixel_size: float,
) -> FloatArray:
    """Linear colour (height, width, 3), the mean of the samples rays (height, width, n, 6).

    `light` (height, width, lights + 1) holds the visibility of each light, then ambient openness, at pixel
    centres; each sample takes it from the neighbouring centre that lies on the same body at the nearest depth.
    """
    height, width, n, _ = rays.shape
    out = np.zeros((height, width, 3), np.float32)
    for v in numba.prange(height):
        point = np.empty(3, np.float32)
        normal = np.empty(3, np.float32)
        albedo = np.empty(3, np.float32)
        for u in range(width):
            for s in range(n):
                b = body[v, u, s]
                row: Any = np.int64(v)  # the loop index is unsigned, which makes differences floats
                column: Any = np.int64(u)
                if b < 0:
                    continue
                z = hit_depth[v, u, s]
                d = rays[v, u, s, 3:6]
                for k in range(3):
                    point[k] = rays[v, u, s, k] + z * d[k]
                f = face[v, u, s]
                normal[0], normal[1], normal[2] = _normal(
                    f, uv[v, u, s, 0], uv[v, u, s, 1], corners, poses[b], d
                )
                i = face_surface[f]
                length = math.sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2])
                facing = abs(d[0] * normal[0] + d[1] * normal[1] + d[2] * normal[2]) / length
                footprint = z * pixel_size / math.sqrt(max(facing, 0.08))
                _albedo(point, normal, texture_poses[i], tiles[i], footprint, atlas, starts[i], size, albedo)
                y, x = _same_surface(pixel_depth, pixel_body, row, column, z, b)
                _lit(point, normal, d, albedo, glosses[i], light[y, x], lights, powers, sky, out[v, u])
            for k in range(3):
                out[v, u, k] /= n
    return out
