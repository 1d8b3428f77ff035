"""Texture coordinates of primitives and cube maps, as MuJoCo 4's `render_context.c`, `render_gl3.c` have.

URDF says nothing of how a picture lies on a primitive; the same coordinates are taken there.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from twin import geometry as geo
from twin.geometry import Array

# Across, down and out of each side of a cube map, +x -x +y -y +z -z (OpenGL 4.6, table 8.19).
CUBE = np.array(
    [
        [[0, 0, -1], [0, -1, 0], [1, 0, 0]],
        [[0, 0, 1], [0, -1, 0], [-1, 0, 0]],
        [[1, 0, 0], [0, 0, 1], [0, 1, 0]],
        [[1, 0, 0], [0, 0, -1], [0, -1, 0]],
        [[1, 0, 0], [0, -1, 0], [0, 0, 1]],
        [[-1, 0, 0], [0, -1, 0], [0, 0, -1]],
    ]
)


def box_uv(corners: Array) -> Array:
    """Coordinates (F, 3, 2), u and v down, of faces (F, 3, 3) of a box from -1 to 1: a picture a side."""
    axis = np.abs(geo.vector_areas(corners)).argmax(axis=1)
    across, up = np.array([1, 0, 0])[axis], np.array([2, 2, 1])[axis]
    face = np.arange(len(corners))[:, None]
    point = np.arange(3)[None]
    return np.stack(
        [(corners[face, point, across[:, None]] + 1) / 2, (1 - corners[face, point, up[:, None]]) / 2],
        axis=-1,
    )


def cylinder_uv(corners: Array) -> Array:
    """As `box_uv`, of a cylinder of radius 1 from z = -1 to 1: once around its side, ends from above."""
    side = np.stack([around(corners), (1 - corners[..., 2]) / 2], axis=-1)
    end = np.abs(geo.triangle_normals(corners)[0][:, 2]) > 0.5
    return np.where(end[:, None, None], (corners[..., :2] + 1) / 2, side)


def sphere_uv(corners: Array) -> Array:
    """As `box_uv`, of the unit sphere: longitude and latitude."""
    return np.stack([around(corners), 0.5 - _latitude(corners[..., 2]) / np.pi], axis=-1)


def capsule_uv(corners: Array, half: float) -> Array:
    """As `box_uv`, of a cylinder of radius 1 from z = -half to half with half spheres, a picture on each."""
    z = corners[..., 2]
    side = (1 - z / half) / 2
    high, low = _latitude(z - half), _latitude(z + half)
    middle = z.mean(axis=1)[:, None]
    v = np.where(middle > half, 1 - 2 * high / np.pi, np.where(middle < -half, -2 * low / np.pi, side))
    return np.stack([around(corners), v], axis=-1)


def around(corners: Array) -> Array:
    """Turns (F, 3) of 0..1 about z from x without jumps in a face; a corner on the axis has its face's."""
    x, y = corners[..., 0], corners[..., 1]
    middle = np.arctan2(y.mean(axis=1), x.mean(axis=1))[:, None] % (2 * np.pi)
    apart = np.angle(np.exp(1j * (np.arctan2(y, x) - middle)))
    off = np.hypot(x, y) > 1e-9
    return np.asarray((middle + np.where(off, apart, 0.0)) / (2 * np.pi))


def _latitude(sine: Array) -> Array:
    return np.asarray(np.arcsin(np.clip(sine, -1.0, 1.0)))


def sides_of(directions: Array) -> NDArray[np.int64]:
    """The side (...) of a cube map that directions (..., 3) meet, in OpenGL's order +x -x +y -y +z -z."""
    axis = np.abs(directions).argmax(axis=-1)
    behind = np.take_along_axis(directions, axis[..., None], axis=-1)[..., 0] < 0
    return np.asarray(2 * axis + behind)


def on_sides(directions: Array, sides: NDArray[np.int64]) -> Array:
    """Where directions (..., 3) meet the planes of sides (...) of a cube map: across and down (..., 2), -1 to
    1 on the side itself and beyond it outside; infinite where they go away from it."""
    turned = np.empty(directions.shape)
    for side, T in enumerate(CUBE):
        own = np.broadcast_to(sides == side, directions.shape[:-1])
        turned[own] = directions[own] @ T.T
    across, down, out = np.moveaxis(turned, -1, 0)
    away = out <= 1e-9 * np.abs(directions).max(axis=-1)
    place = np.stack([across, down], axis=-1) / np.where(away, 1.0, out)[..., None]
    return np.where(away[..., None], np.inf, place)


def cube_colors(strip: NDArray[np.uint8], directions: Array) -> NDArray[np.uint8]:
    """Colours (..., 3) of a cube map in directions (..., 3); strip (6 n, n, 3), or (n, n, 3) for all."""
    texels = strip.shape[1]
    flat = directions.reshape(-1, 3)
    sides, colors = sides_of(flat), np.empty(flat.shape, np.uint8)
    for side, T in enumerate(CUBE):
        own = np.flatnonzero(sides == side)
        across, down, out = T @ flat[own].T
        half = texels / (2 * np.where(out > 0, out, 1.0))
        column, row = ((x * half + texels / 2).astype(np.int64).clip(0, texels - 1) for x in (across, down))
        colors[own] = strip[row + (side * texels if len(strip) > texels else 0), column]
    return colors.reshape(directions.shape)
