"""Compiled kernels of the renderer: rays, textures, lights. Arrays are float32; poses are rows of 3 x 4."""

# Numba compiles these functions; they are plain loops because that is what it makes fast.
from __future__ import annotations

import math
from typing import Any

import numba
import numpy as np

FloatArray = Any  # numba sees the concrete types
Triple = tuple[float, float, float]
# face -> surface, then of surfaces: T_texture_world, tile, gloss, mip levels; atlas, SIZE
Surfaces = tuple[Any, ...]
Lamps = tuple[FloatArray, FloatArray, FloatArray]  # shapes, powers, sky: see `Lights`


@numba.njit(cache=True, fastmath=True, nogil=True)
def primary_rays(
    pixels: FloatArray,
    width: int,
    focal: float,
    cx: float,
    cy: float,
    offsets: FloatArray,
    pose: FloatArray,
) -> FloatArray:
    """Rays (m, n, 6) through the centres of `pixels` (m,), counted along rows of `width`, plus `offsets` (n,
    2); their parameter is depth along z.
    """
    n = offsets.shape[0]
    out = np.empty((len(pixels), n, 6), np.float32)
    for i in range(len(pixels)):
        v, u = pixels[i] // width, pixels[i] % width
        for k in range(n):
            x = (u + offsets[k, 0] - cx) / focal
            y = (v + offsets[k, 1] - cy) / focal
            for a in range(3):
                out[i, k, a] = pose[a, 3]
                out[i, k, 3 + a] = pose[a, 0] * x + pose[a, 1] * y + pose[a, 2]
    return out


@numba.njit(cache=True, nogil=True)
def crossed(body: FloatArray, face: FloatArray) -> FloatArray:
    """Pixels (H, W) whose samples may meet another face than their centres: beside another or the rim."""
    height, width = body.shape
    out = np.ones((height, width), np.bool_)
    for row in range(1, height - 1):
        for u in range(1, width - 1):
            one = True
            for y in range(row - 1, row + 2):
                for x in range(u - 1, u + 2):
                    one = one and body[y, x] == body[row, u] and face[y, x] == face[row, u]
            out[row, u] = not one
    return out


@numba.njit(cache=True, fastmath=True, nogil=True)
def _normal(
    face: int, u: float, v: float, corners: FloatArray, pose: FloatArray, direction: Triple
) -> Triple:
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


@numba.njit(cache=True, fastmath=True, nogil=True)
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
    for i in range(rays.shape[0]):
        if geometry[i] >= 0:
            pose = poses[geometry[i]]
            d = (rays[i, 3], rays[i, 4], rays[i, 5])
            out[i, 0], out[i, 1], out[i, 2] = _normal(face[i], uv[i, 0], uv[i, 1], corners, pose, d)
    return out


@numba.njit(cache=True, fastmath=True, nogil=True)
def _texel(atlas: FloatArray, start: int, size: int, u: float, v: float) -> Triple:
    """Bilinear texel at (u, v) tiles of the image at `start`; `size` is a power of two."""
    x, y = u * size - 0.5, v * size - 0.5
    left, top = math.floor(x), math.floor(y)
    fx, fy = x - left, y - top
    x0, y0 = int(left) & (size - 1), int(top) & (size - 1)
    x1, y1 = (x0 + 1) & (size - 1), (y0 + 1) & (size - 1)
    a, b = start + 3 * (y0 * size + x0), start + 3 * (y0 * size + x1)
    c, d = start + 3 * (y1 * size + x0), start + 3 * (y1 * size + x1)
    wa, wb, wc, wd = (1.0 - fx) * (1.0 - fy), fx * (1.0 - fy), (1.0 - fx) * fy, fx * fy
    return (
        wa * atlas[a] + wb * atlas[b] + wc * atlas[c] + wd * atlas[d],
        wa * atlas[a + 1] + wb * atlas[b + 1] + wc * atlas[c + 1] + wd * atlas[d + 1],
        wa * atlas[a + 2] + wb * atlas[b + 2] + wc * atlas[c + 2] + wd * atlas[d + 2],
    )


@numba.njit(cache=True, fastmath=True, nogil=True)
def _plane(m: FloatArray, normal: Triple) -> tuple[int, int]:
    """Triplanar: the texture axes (u, v) of the plane facing the surface most; `m` (3, 4) to texture."""
    a = abs(m[0, 0] * normal[0] + m[0, 1] * normal[1] + m[0, 2] * normal[2])
    b = abs(m[1, 0] * normal[0] + m[1, 1] * normal[1] + m[1, 2] * normal[2])
    c = abs(m[2, 0] * normal[0] + m[2, 1] * normal[1] + m[2, 2] * normal[2])
    if c >= a and c >= b:
        return 0, 1
    return (0, 2) if b >= a else (1, 2)


@numba.njit(cache=True, fastmath=True, nogil=True)
def _level(d: Triple, normal: Triple, depth: float, scale: float, levels: int) -> int:
    """Mip level of what one sample along `d` covers at `depth`; `scale`: texels of level 0 at depth 1."""
    length = math.sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2])
    facing = abs(d[0] * normal[0] + d[1] * normal[1] + d[2] * normal[2]) / length
    texels = depth * scale / math.sqrt(max(facing, 0.08))
    return min(int(max(0.0, math.log2(max(texels, 1e-6)) + 0.3)), levels - 1)


@numba.njit(cache=True, fastmath=True, nogil=True)
def _along(m: FloatArray, axis: int, point: Triple) -> float:
    """Texture coordinate of a point along one of the texture's axes, in metres."""
    return m[axis, 0] * point[0] + m[axis, 1] * point[1] + m[axis, 2] * point[2] + m[axis, 3]


@numba.njit(cache=True, fastmath=True, nogil=True)
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


@numba.njit(cache=True, fastmath=True, nogil=True)
def _lit(
    point: Triple, normal: Triple, d: Triple, albedo: Triple, gloss: float, light: FloatArray, lamps: Lamps
) -> Triple:
    """The light that leaves a point against the ray `d`: ambient, lamps with fall-off, a weak highlight."""
    shapes, powers, sky = lamps
    ambient = (0.78 + 0.22 * normal[2]) * (0.12 + 0.88 * light[len(shapes)])  # light bounces into corners
    r, g, b = sky[0] * ambient, sky[1] * ambient, sky[2] * ambient
    length = math.sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2])
    shine = 0.0
    for j in range(len(shapes)):
        if light[j] <= 0.0:
            continue
        lx, ly, lz = shapes[j, 0, 0] - point[0], shapes[j, 0, 1] - point[1], shapes[j, 0, 2] - point[2]
        far = math.sqrt(lx * lx + ly * ly + lz * lz) + 1e-6
        received = light[j] * math.sqrt(max(0.0, lz / far)) / (0.6 + far * far)  # lamps shine downwards
        direct = received * max(0.0, (lx * normal[0] + ly * normal[1] + lz * normal[2]) / far)
        r, g, b = r + powers[j, 0] * direct, g + powers[j, 1] * direct, b + powers[j, 2] * direct
        hx, hy, hz = lx / far - d[0] / length, ly / far - d[1] / length, lz / far - d[2] / length
        half = math.sqrt(hx * hx + hy * hy + hz * hz) + 1e-6
        spec = max(0.0, (hx * normal[0] + hy * normal[1] + hz * normal[2]) / half)
        shine += 0.12 * gloss * received * spec**40 * powers[j, 1]
    return albedo[0] * r + shine, albedo[1] * g + shine, albedo[2] * b + shine


@numba.njit(cache=True, fastmath=True, nogil=True)
def shade_insides(
    pixels: FloatArray,
    rays: FloatArray,
    hits: tuple[FloatArray, FloatArray, FloatArray],
    normals: FloatArray,
    light: FloatArray,
    surfaces: Surfaces,
    steps: FloatArray,
    pixel_size: float,
    lamps: Lamps,
    out: FloatArray,
) -> None:
    """Write linear colour `out` (H W, 3) of `pixels` (m,) that lie inside one face: the texture is sampled
    where the rays plus `steps` (n, 3) meet the plane of the face, the light is that of the centre.

    `hits` are depth, face and its normal; `light` (H W, lamps + 1): each lamp's visibility, then ambient.
    """
    depth, face, flat = hits
    face_surface, textures, tiles, glosses, starts, atlas, size = surfaces
    n = len(steps)
    for i in range(len(pixels)):
        p = pixels[i]
        j, far = face_surface[face[p]], depth[p]
        m, tile = textures[j], tiles[j]
        x, y, z = rays[p, 0], rays[p, 1], rays[p, 2]
        d = (rays[p, 3], rays[p, 4], rays[p, 5])
        normal = (normals[p, 0], normals[p, 1], normals[p, 2])
        first, second = _plane(m, normal)
        level = _level(d, normal, far, pixel_size / tile * size, starts.shape[1])
        straight = flat[p, 0] * d[0] + flat[p, 1] * d[1] + flat[p, 2] * d[2]
        r, g, b = 0.0, 0.0, 0.0
        for s in range(n):
            across = flat[p, 0] * steps[s, 0] + flat[p, 1] * steps[s, 1] + flat[p, 2] * steps[s, 2]
            t = far * straight / (straight + across)
            point = (x + t * (d[0] + steps[s, 0]), y + t * (d[1] + steps[s, 1]), z + t * (d[2] + steps[s, 2]))
            u, v = _along(m, first, point) / tile, _along(m, second, point) / tile
            texel = _texel(atlas, starts[j, level], size >> level, u, v)
            r, g, b = r + texel[0], g + texel[1], b + texel[2]
        point = (x + far * d[0], y + far * d[1], z + far * d[2])
        colour = _lit(point, normal, d, (r / n, g / n, b / n), glosses[j], light[p], lamps)
        out[p, 0], out[p, 1], out[p, 2] = colour


@numba.njit(cache=True, fastmath=True, nogil=True)
def shade_samples(
    pixels: FloatArray,
    rays: FloatArray,
    hits: tuple[FloatArray, FloatArray, FloatArray, FloatArray],
    shapes: tuple[FloatArray, FloatArray],
    centres: tuple[FloatArray, FloatArray, FloatArray],
    surfaces: Surfaces,
    pixel_size: float,
    lamps: Lamps,
    out: FloatArray,
) -> None:
    """Write linear colour `out` (H W, 3) of `pixels` (m,), the mean of the samples `rays` (m, n, 6).

    `hits` are depth, body, face, (u, v) of the samples, `shapes` corner normals and poses; `centres` are
    depth, body (H, W) and light (H, W, lamps + 1) at pixel centres: each sample takes its light from the
    neighbouring centre that lies on the same body at the nearest depth.
    """
    depth, body, face, uv = hits
    corners, poses = shapes
    pixel_depth, pixel_body, light = centres
    face_surface, textures, tiles, glosses, starts, atlas, size = surfaces
    n, width = rays.shape[1], pixel_depth.shape[1]
    for i in range(len(pixels)):
        p = pixels[i]
        r, g, b = 0.0, 0.0, 0.0
        for s in range(n):
            k, f, far = body[i, s], face[i, s], depth[i, s]
            if k < 0:
                continue
            d = (rays[i, s, 3], rays[i, s, 4], rays[i, s, 5])
            point = (rays[i, s, 0] + far * d[0], rays[i, s, 1] + far * d[1], rays[i, s, 2] + far * d[2])
            normal = _normal(f, uv[i, s, 0], uv[i, s, 1], corners, poses[k], d)
            j = face_surface[f]
            m, tile = textures[j], tiles[j]
            first, second = _plane(m, normal)
            level = _level(d, normal, far, pixel_size / tile * size, starts.shape[1])
            u, v = _along(m, first, point) / tile, _along(m, second, point) / tile
            albedo = _texel(atlas, starts[j, level], size >> level, u, v)
            y, x = _same_surface(pixel_depth, pixel_body, p // width, p % width, far, k)
            colour = _lit(point, normal, d, albedo, glosses[j], light[y, x], lamps)
            r, g, b = r + colour[0], g + colour[1], b + colour[2]
        out[p, 0], out[p, 1], out[p, 2] = r / n, g / n, b / n
