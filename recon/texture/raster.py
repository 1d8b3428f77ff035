"""Texels of a mesh: which face each shows, and the point of the face that lies there."""

from __future__ import annotations

import numba
import numpy as np
from numpy.typing import NDArray

from twin import geometry as geo
from twin.geometry import Array

I32 = NDArray[np.int32]

MARGIN = 1.5  # texels around a chart that its faces run on over: what cubic sampling reads beside its border


@numba.njit(cache=True, nogil=True, inline="always")
def within(
    ax: float, ay: float, bx: float, by: float, cx: float, cy: float, x: float, y: float
) -> float:  # pragma: no cover - compiled
    """How far a point lies within an anticlockwise triangle; negative outside: distance to a line beyond."""
    ab, bc, ca = np.hypot(bx - ax, by - ay), np.hypot(cx - bx, cy - by), np.hypot(ax - cx, ay - cy)
    if min(ab, bc, ca) < 1e-9:
        return -np.inf
    first = ((bx - ax) * (y - ay) - (by - ay) * (x - ax)) / ab
    second = ((cx - bx) * (y - by) - (cy - by) * (x - bx)) / bc
    third = ((ax - cx) * (y - cy) - (ay - cy) * (x - cx)) / ca
    return min(first, second, third)


@numba.njit(cache=True, nogil=True)
def faces_at(uv: Array, first: int, end: int, width: int) -> I32:  # pragma: no cover - compiled
    """The face of each texel's centre, the nearest within `MARGIN`, or -1: rows first..end, lowest first."""
    owner = np.full((end - first, width), -1, np.int32)
    depth = np.full((end - first, width), -MARGIN, np.float32)
    for face in range(len(uv)):
        ax, ay, bx, by, cx, cy = uv[face].ravel()
        if (bx - ax) * (cy - ay) < (by - ay) * (cx - ax):  # packing mirrors charts
            bx, by, cx, cy = cx, cy, bx, by
        x0, x1 = int(max(min(ax, bx, cx) - MARGIN, 0)), int(min(max(ax, bx, cx) + MARGIN, width - 1))
        y0, y1 = int(max(min(ay, by, cy) - MARGIN, first)), int(min(max(ay, by, cy) + MARGIN, end - 1))
        for y in range(y0, y1 + 1):
            for x in range(x0, x1 + 1):
                d = within(ax, ay, bx, by, cx, cy, x + 0.5, y + 0.5)
                if d > depth[y - first, x]:
                    depth[y - first, x] = d
                    owner[y - first, x] = face
    return owner


@numba.njit(cache=True, nogil=True)
def surface_at(
    uv: Array,
    face: I32,
    y: NDArray[np.int64],
    x: NDArray[np.int64],
    vertices: Array,
    faces: I32,
    normals: Array,
) -> tuple[Array, Array, Array]:  # pragma: no cover - compiled
    """Points (n, 3), normals (n, 3) and weights (n, 3) of the corners of `face` (n,) at the centres of the
    texels in rows y from below and columns x. Outside of the face points run on over its plane, while normals
    and weights are those within it."""
    count = len(face)
    points, ahead, weights = np.zeros((count, 3)), np.zeros((count, 3)), np.empty((count, 3))
    for n in range(count):
        f = face[n]
        ax, ay = uv[f, 0, 0], uv[f, 0, 1]
        bx, by = uv[f, 1, 0] - ax, uv[f, 1, 1] - ay
        cx, cy = uv[f, 2, 0] - ax, uv[f, 2, 1] - ay
        px, py = x[n] + 0.5 - ax, y[n] + 0.5 - ay
        double = bx * cy - by * cx
        if abs(double) < 1e-9:
            double = 1.0
        v, w = (px * cy - py * cx) / double, (bx * py - by * px) / double
        at = (1.0 - v - w, v, w)
        total = 0.0
        for k in range(3):
            weights[n, k] = min(max(at[k], 0.0), 1.0)
            total += weights[n, k]
        for k in range(3):
            weights[n, k] /= total
            for d in range(3):
                points[n, d] += at[k] * vertices[faces[f, k], d]
                ahead[n, d] += weights[n, k] * normals[faces[f, k], d]
    return points, ahead, weights


def vertex_normals(vertices: Array, faces: I32) -> Array:
    """Unit normals (V, 3), faces weighing their area; (0, 0, 1) where there is none."""
    areas = geo.vector_areas(vertices[faces])
    total = np.stack(
        [np.bincount(faces.ravel(), np.repeat(a, 3), minlength=len(vertices)) for a in areas.T], axis=1
    )
    length = np.linalg.norm(total, axis=1, keepdims=True)
    return np.where(length > 1e-15, total / np.maximum(length, 1e-300), [0.0, 0.0, 1.0])
