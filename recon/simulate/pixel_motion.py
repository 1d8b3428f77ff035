"""Compiled kernels of the shutter: how pixels move, where they are at a row's time, their sources."""

# Numba compiles these functions; they are plain loops because that is what it makes fast. Sums are taken in
# the order they are written in (no fastmath), so that a still pixel comes back to exactly its own place.
from __future__ import annotations

import math
from typing import Any

import numba
import numpy as np

FloatArray = Any  # numba sees the concrete types


@numba.njit(cache=True, nogil=True)
def motion(
    depth: FloatArray, body: FloatArray, focal: float, cx: float, cy: float, moves: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Velocity and acceleration (H, W, 2), px per frame (^2), of the parabola through three frames' places.

    `body` (H, W) is the index of what is seen at `depth` (H, W), -1 or 0 m for nothing, which stays; `moves`
    (bodies, 2, 3, 4) takes the points of a body from the camera now to the camera before and after. What
    comes behind the camera stays as well.
    """
    height, width = depth.shape
    velocity = np.zeros((height, width, 2))
    acceleration = np.zeros((height, width, 2))
    for v in range(height):
        for u in range(width):
            k, z = body[v, u], np.float64(depth[v, u])
            if k < 0 or not z > 0.0:
                continue
            x, y = (u - cx) / focal * z, (v - cy) / focal * z
            before_x, before_y = _seen(moves[k, 0], x, y, z, u, v, focal, cx, cy)
            after_x, after_y = _seen(moves[k, 1], x, y, z, u, v, focal, cx, cy)
            velocity[v, u, 0], velocity[v, u, 1] = 0.5 * (after_x - before_x), 0.5 * (after_y - before_y)
            acceleration[v, u, 0] = after_x + before_x - 2.0 * u
            acceleration[v, u, 1] = after_y + before_y - 2.0 * v
    return velocity, acceleration


@numba.njit(cache=True, nogil=True)
def _seen(
    move: FloatArray, x: float, y: float, z: float, u: int, v: int, focal: float, cx: float, cy: float
) -> tuple[float, float]:
    """Pixel of a camera point after `move` (3, 4); (u, v) where that is behind the camera."""
    far = move[2, 0] * x + move[2, 1] * y + move[2, 2] * z + move[2, 3]
    if not far > 1e-6:
        return np.float64(u), np.float64(v)
    right = move[0, 0] * x + move[0, 1] * y + move[0, 2] * z + move[0, 3]
    down = move[1, 0] * x + move[1, 1] * y + move[1, 2] * z + move[1, 3]
    return right / far * focal + cx, down / far * focal + cy


@numba.njit(cache=True, nogil=True)
def led(
    velocity: FloatArray,
    acceleration: FloatArray,
    depth: FloatArray,
    nearest: FloatArray,
    edge: float,
    still: float,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Motion and depth (H, W), inf for nothing, float32, of the pixel that leads each: its own, or the
    nearest neighbour's beside an edge, a relative step in depth of more than `edge`. What is less than
    `still` is none. `nearest` (H, W) is the least depth of a pixel and its neighbours.
    """
    height, width = depth.shape
    out_velocity = np.zeros((height, width, 2), np.float32)
    out_acceleration = np.zeros((height, width, 2), np.float32)
    near = np.empty((height, width), np.float32)
    kept = np.float32(1.0 - edge)
    for v in range(height):
        for u in range(width):
            row, column, best = v, u, depth[v, u]
            if nearest[v, u] < kept * best:
                for y in range(max(v - 1, 0), min(v + 2, height)):
                    for x in range(max(u - 1, 0), min(u + 2, width)):
                        if depth[y, x] < best:
                            row, column, best = y, x, depth[y, x]
            near[v, u] = best
            for a in range(2):
                if abs(velocity[row, column, a]) >= still:
                    out_velocity[v, u, a] = velocity[row, column, a]
                if abs(acceleration[row, column, a]) >= still:
                    out_acceleration[v, u, a] = acceleration[row, column, a]
    return out_velocity, out_acceleration, near


@numba.njit(cache=True, nogil=True)
def ways(velocity: FloatArray, acceleration: FloatArray, offsets: FloatArray, rounds: int) -> FloatArray:
    """Way (H, W, 2) in pixels of each pixel to the time at which it is seen: `offsets` (H,) in frames of the
    row that it has come to, found in so many `rounds`.
    """
    height, width = velocity.shape[:2]
    out = np.empty((height, width, 2))
    for v in range(height):
        for u in range(width):
            across, down = np.float64(velocity[v, u, 0]), np.float64(velocity[v, u, 1])
            bend, fall = np.float64(acceleration[v, u, 0]), np.float64(acceleration[v, u, 1])
            t = offsets[v]
            for _ in range(rounds):
                former, t = t, _between(v + t * (down + 0.5 * t * fall), offsets)
                if t == former:
                    break
            out[v, u, 0], out[v, u, 1] = t * (across + 0.5 * t * bend), t * (down + 0.5 * t * fall)
    return out


@numba.njit(cache=True, nogil=True)
def _between(row: float, offsets: FloatArray) -> float:
    """Linear between the offsets of rows; the first and the last go on."""
    last = len(offsets) - 1
    if row <= 0.0:
        return offsets[0]
    if row >= last:
        return offsets[last]
    k = int(row)
    return (offsets[k + 1] - offsets[k]) * (row - k) + offsets[k]


@numba.njit(cache=True, nogil=True)
def carried(way: FloatArray, depth: FloatArray) -> FloatArray:
    """Which pixel (H, W), counted along rows, each pixel of the result stems from, -1 for none, where pixels
    go `way` (H, W, 2): each covers four places about its own, so that approaching surface has no cracks; the
    nearest stays."""
    height, width = depth.shape
    source = np.full((height, width), -1, np.int64)
    front = np.full((height, width), np.inf, np.float32)
    for v in range(height):
        for u in range(width):
            x, y, far = u + way[v, u, 0], v + way[v, u, 1], depth[v, u]
            for row in range(math.floor(y), math.ceil(y) + 1):
                for column in range(math.floor(x), math.ceil(x) + 1):
                    if row < 0 or column < 0 or row >= height or column >= width:
                        continue
                    if far <= front[row, column]:
                        front[row, column] = far
                        source[row, column] = v * width + u
    return source


@numba.njit(cache=True, nogil=True)
def origins(source: FloatArray, opened: FloatArray, way: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Places x and y (H, W), float32, in the rendered picture that each pixel of the result shows: back along
    the way of its `source`. Where ground has come into the open, going back would lead to what covered it:
    the source's own place instead.
    """
    height, width = source.shape
    x, y = np.empty((height, width), np.float32), np.empty((height, width), np.float32)
    for v in range(height):
        for u in range(width):
            row, column = source[v, u] // width, source[v, u] % width
            if opened[v, u]:
                x[v, u], y[v, u] = column, row
            else:
                x[v, u], y[v, u] = u - way[row, column, 0], v - way[row, column, 1]
    return x, y
