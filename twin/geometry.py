"""Rigid geometry with numpy alone. Poses are 4x4 `T_a_b`: coordinates in b to coordinates in a.

Batches come first: a pose array is (..., 4, 4), a point array (..., 3). Angles are radians, lengths metres.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

_SMALL_ANGLE = 1e-6  # below it the second-order Taylor terms are exact to double precision


def as_float(values: ArrayLike) -> Array:
    """Return `values` as a float64 array."""
    return np.asarray(values, dtype=np.float64)


def unit(vector: ArrayLike) -> Array:
    """Return the vectors (..., 3) scaled to length one. Raises ValueError on a zero or non-finite vector."""
    v = as_float(vector)
    if v.shape == (3,):  # the same to the bit, in a tenth of the time
        x, y, z = v.tolist()
        if 1e-12 <= (length := math.sqrt(x * x + y * y + z * z)) < math.inf:
            return np.array([x / length, y / length, z / length])
    n = np.linalg.norm(v, axis=-1, keepdims=True)
    if not np.all(np.isfinite(n)) or np.any(n < 1e-12):
        raise ValueError(f"a direction must be finite and not zero, got {vector!r}")
    return v / n


def skew(v: ArrayLike) -> Array:
    """Cross-product matrix (..., 3, 3) of vectors (..., 3): skew(a) @ b = a x b."""
    a = as_float(v)
    out = np.zeros((*a.shape[:-1], 3, 3))
    out[..., 0, 1], out[..., 0, 2] = -a[..., 2], a[..., 1]
    out[..., 1, 0], out[..., 1, 2] = a[..., 2], -a[..., 0]
    out[..., 2, 0], out[..., 2, 1] = -a[..., 1], a[..., 0]
    return out


def exp_so3(rotvec: ArrayLike) -> Array:
    """Rotation matrices (..., 3, 3) of rotation vectors (..., 3), Rodrigues' formula."""
    w = as_float(rotvec)
    k = skew(w)
    if w.shape == (3,):  # the same to the bit, in a third of the time
        x, y, z = w.tolist()
        if (length := math.sqrt(x * x + y * y + z * z)) >= _SMALL_ANGLE:
            sin, cos = float(np.sin(length)), float(np.cos(length))
            return np.eye(3) + sin / length * k + (1.0 - cos) / (length * length) * (k @ k)
    angle = np.linalg.norm(w, axis=-1)[..., None, None]
    small = angle < _SMALL_ANGLE
    safe = np.where(small, 1.0, angle)
    a = np.where(small, 1.0 - angle**2 / 6.0, np.sin(safe) / safe)
    b = np.where(small, 0.5 - angle**2 / 24.0, (1.0 - np.cos(safe)) / safe**2)
    return np.eye(3) + a * k + b * (k @ k)


def log_so3(rotation: ArrayLike) -> Array:
    """Rotation vectors (..., 3) of rotation matrices (..., 3, 3), |w| <= pi."""
    q = quat_wxyz_from_matrix(rotation)
    q = np.where(q[..., :1] < 0.0, -q, q)
    sin_half = np.linalg.norm(q[..., 1:], axis=-1, keepdims=True)
    angle = 2.0 * np.arctan2(sin_half, q[..., :1])
    small = sin_half < 1e-9
    scale = np.where(small, 2.0, angle / np.where(small, 1.0, sin_half))
    return scale * q[..., 1:]


def _left_jacobian(w: Array) -> Array:
    angle = np.linalg.norm(w, axis=-1)[..., None, None]
    k = skew(w)
    small = angle < 1e-4
    safe = np.where(small, 1.0, angle)
    b = np.where(small, 0.5 - angle**2 / 24.0, (1.0 - np.cos(safe)) / safe**2)
    c = np.where(small, 1.0 / 6.0 - angle**2 / 120.0, (safe - np.sin(safe)) / safe**3)
    return np.eye(3) + b * k + c * (k @ k)


def exp_se3(twist: ArrayLike) -> Array:
    """Poses (..., 4, 4) of twists (..., 6) = (translational v, rotational w)."""
    x = as_float(twist)
    return make_pose(exp_so3(x[..., 3:]), (_left_jacobian(x[..., 3:]) @ x[..., :3, None])[..., 0])


def log_se3(pose: ArrayLike) -> Array:
    """Twists (..., 6) = (v, w) of poses (..., 4, 4)."""
    t = as_float(pose)
    w = log_so3(t[..., :3, :3])
    v = np.linalg.solve(_left_jacobian(w), t[..., :3, 3, None])[..., 0]
    return np.concatenate([v, w], axis=-1)


def is_rotation(r: Array, tolerance: float = 1e-6) -> bool:
    """Whether matrices (..., 3, 3) are right-handed and orthonormal (tolerance: of a product)."""
    return bool(
        np.allclose(np.swapaxes(r, -1, -2) @ r, np.eye(3), atol=tolerance) and np.all(np.linalg.det(r) > 0)
    )


def make_pose(rotation: ArrayLike | None = None, translation: ArrayLike | None = None) -> Array:
    """Poses (..., 4, 4) from rotations (..., 3, 3) and translations (..., 3); either may be left out."""
    r = np.eye(3) if rotation is None else as_float(rotation)
    t = np.zeros(3) if translation is None else as_float(translation)
    out = np.zeros((*np.broadcast_shapes(r.shape[:-2], t.shape[:-1]), 4, 4))
    out[..., :3, :3], out[..., :3, 3], out[..., 3, 3] = r, t, 1.0
    return out


def invert_pose(pose: ArrayLike) -> Array:
    """Inverse of rigid poses (..., 4, 4)."""
    t = as_float(pose)
    out = np.zeros_like(t)
    rt = np.swapaxes(t[..., :3, :3], -1, -2)
    out[..., :3, :3] = rt
    out[..., :3, 3] = -(rt @ t[..., :3, 3, None])[..., 0]
    out[..., 3, 3] = 1.0
    return out


def transform(pose: ArrayLike, points: ArrayLike) -> Array:
    """Apply a pose (4, 4) or poses (..., 4, 4) to points (..., n, 3)."""
    t, p = as_float(pose), as_float(points)
    return p @ np.swapaxes(t[..., :3, :3], -1, -2) + t[..., None, :3, 3]


def every(mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Whether all columns (..., n) of a row hold: for three, `np.all` takes twenty times as long."""
    return np.asarray(np.logical_and.reduce(np.ascontiguousarray(np.moveaxis(mask, -1, 0)), axis=0))


def rotate(pose: ArrayLike, directions: ArrayLike) -> Array:
    """Apply the rotation of a pose (4, 4) to directions (..., 3)."""
    return as_float(directions) @ as_float(pose)[:3, :3].T


def quat_wxyz_from_matrix(rotation: ArrayLike) -> Array:
    """Unit quaternions (..., 4), order wxyz, of rotation matrices (..., 3, 3) (largest-component method)."""
    r = as_float(rotation)
    m00, m11, m22 = r[..., 0, 0], r[..., 1, 1], r[..., 2, 2]
    sq = np.stack([1 + m00 + m11 + m22, 1 + m00 - m11 - m22, 1 - m00 + m11 - m22, 1 - m00 - m11 + m22], -1)
    k = np.zeros((*r.shape[:-2], 4, 4))
    k[..., 0, 1] = k[..., 1, 0] = r[..., 2, 1] - r[..., 1, 2]
    k[..., 0, 2] = k[..., 2, 0] = r[..., 0, 2] - r[..., 2, 0]
    k[..., 0, 3] = k[..., 3, 0] = r[..., 1, 0] - r[..., 0, 1]
    k[..., 1, 2] = k[..., 2, 1] = r[..., 0, 1] + r[..., 1, 0]
    k[..., 1, 3] = k[..., 3, 1] = r[..., 0, 2] + r[..., 2, 0]
    k[..., 2, 3] = k[..., 3, 2] = r[..., 1, 2] + r[..., 2, 1]
    idx = np.arange(4)
    k[..., idx, idx] = sq
    best = np.argmax(sq, axis=-1)
    q = np.take_along_axis(k, best[..., None, None], axis=-2)[..., 0, :]
    return q / np.linalg.norm(q, axis=-1, keepdims=True)


def matrix_from_quat_wxyz(quat_wxyz: ArrayLike) -> Array:
    """Rotation matrices (..., 3, 3) of quaternions (..., 4), order wxyz; they are normalised first."""
    q = as_float(quat_wxyz)
    n = np.linalg.norm(q, axis=-1, keepdims=True)
    if np.any(n < 1e-9):
        raise ValueError(f"a quaternion must not be zero, got {quat_wxyz!r}")
    w, x, y, z = np.moveaxis(q / n, -1, 0)
    rows = [
        np.stack([1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)], -1),
        np.stack([2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)], -1),
        np.stack([2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)], -1),
    ]
    return np.stack(rows, -2)


def fit_rigid(source: ArrayLike, target: ArrayLike, weights: ArrayLike | None = None) -> Array:
    """Least-squares pose T_target_source (..., 4, 4), target ~ T source (Kabsch 1976, Umeyama 1991, scale 1).

    Args:
        source: points (..., n, 3).
        target: points (..., n, 3).
        weights: (..., n), not negative; default ones.
    """
    a, b = as_float(source), as_float(target)
    w = np.ones(a.shape[:-1]) if weights is None else as_float(weights)
    total = np.maximum(w.sum(-1, keepdims=True), 1e-12)[..., None]
    ca = (w[..., None] * a).sum(-2, keepdims=True) / total
    cb = (w[..., None] * b).sum(-2, keepdims=True) / total
    h = np.swapaxes(w[..., None] * (a - ca), -1, -2) @ (b - cb)
    u, _, vt = np.linalg.svd(h)
    d = np.sign(np.linalg.det(u @ vt))
    s = np.zeros((*h.shape[:-2], 3, 3))
    s[..., 0, 0] = s[..., 1, 1] = 1.0
    s[..., 2, 2] = np.where(d == 0, 1.0, d)
    r = np.swapaxes(u @ s @ vt, -1, -2)
    return make_pose(r, (np.swapaxes(cb, -1, -2) - r @ np.swapaxes(ca, -1, -2))[..., 0])


def rotation_angle(rotation: ArrayLike) -> Any:
    """Angle in radians, 0..pi, of rotations (..., 3, 3); exact near zero."""
    return np.linalg.norm(log_so3(rotation), axis=-1)


def angle_between(a: ArrayLike, b: ArrayLike) -> float:
    """Angle in radians, 0..pi, between two vectors (3,); exact at 0 and pi (atan2 form)."""
    ua, ub = unit(a), unit(b)
    return float(2.0 * np.arctan2(np.linalg.norm(ua - ub), np.linalg.norm(ua + ub)))


def line_angle(a: ArrayLike, b: ArrayLike) -> float:
    """Angle in radians, 0..pi/2, between two undirected lines."""
    angle = angle_between(a, b)
    return min(angle, np.pi - angle)


def nearest_point_on_line(point: ArrayLike, origin: ArrayLike, axis: ArrayLike) -> Array:
    """Foot (3,) of the perpendicular from `point` on the line origin + s axis."""
    o, a = as_float(origin), unit(axis)
    return o + a * float((as_float(point) - o) @ a)


def point_line_distance(point: ArrayLike, origin: ArrayLike, axis: ArrayLike) -> float:
    """Distance in metres of a point from a line."""
    return float(np.linalg.norm(as_float(point) - nearest_point_on_line(point, origin, axis)))


def line_distance(origin_a: ArrayLike, axis_a: ArrayLike, origin_b: ArrayLike, axis_b: ArrayLike) -> float:
    """Shortest distance in metres between two infinite lines, parallel ones included."""
    a, b, d = unit(axis_a), unit(axis_b), as_float(origin_b) - as_float(origin_a)
    n = np.cross(a, b)
    s = float(np.linalg.norm(n))
    return float(np.linalg.norm(d - a * (d @ a)) if s < 1e-9 else abs(d @ n) / s)


def orthogonal_basis(axis: ArrayLike) -> Array:
    """Right-handed rotation (3, 3) whose third column is the unit `axis`."""
    z = unit(axis)
    least = int(np.argmin(np.abs(z)))
    x = unit(cross(np.array([float(k == least) for k in range(3)]), z))
    return np.array([x, cross(z, x), z]).T.copy()


def cross(a: Array, b: Array) -> Array:
    """Cross products of vectors (3,) or of a few rows (n, 3); NumPy's takes ten times as long for these."""
    if a.ndim > 1:
        return np.array([cross(x, y) for x, y in zip(a, b, strict=True)])
    (a0, a1, a2), (b0, b1, b2) = a.tolist(), b.tolist()
    return np.array([a1 * b2 - a2 * b1, a2 * b0 - a0 * b2, a0 * b1 - a1 * b0])


def rotation_between(source: ArrayLike, target: ArrayLike) -> Array:
    """Smallest rotation (3, 3) that turns direction `source` to `target`; antiparallel ones turn by pi."""
    a, b = unit(source), unit(target)
    v = np.cross(a, b)
    s, c = float(np.linalg.norm(v)), float(a @ b)
    if s < 1e-12:
        return np.eye(3) if c > 0 else exp_so3(np.pi * orthogonal_basis(a)[:, 0])
    return exp_so3(v / s * np.arctan2(s, c))


def vector_areas(corners: Array) -> Array:
    """Vector areas (..., 3) m^2 of triangles (..., 3, 3): right-handed normals as long as the area."""
    a, b = corners[..., 1, :] - corners[..., 0, :], corners[..., 2, :] - corners[..., 0, :]
    return np.asarray(0.5 * np.cross(a, b))


def triangle_areas(corners: Array) -> Array:
    """Areas (...,) m^2 of triangles (..., 3, 3)."""
    return np.asarray(np.linalg.norm(vector_areas(corners), axis=-1))


def triangle_normals(corners: Array) -> tuple[Array, Array]:
    """Unit normals (..., 3) of triangles (..., 3, 3), zero without area, and their areas (...,) m^2."""
    directed = vector_areas(corners)
    area = np.linalg.norm(directed, axis=-1)
    return directed / np.maximum(area, 1e-300)[..., None], np.asarray(area)


def unique_rows(rows: NDArray[np.integer[Any]]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Index of the first of each set of equal integer rows (m,), these rising, and the set of each row (n,).

    What np.unique(axis=0) gives, sorting one number a row where that holds all columns: many times as fast.
    """
    if not len(rows):
        return np.zeros(0, np.int64), np.zeros(0, np.int64)
    low = rows.min(axis=0).astype(np.int64)
    span = [int(x) for x in rows.max(axis=0).astype(np.int64) - low + 1]
    if math.prod(span) < 1 << 62:
        key = np.zeros(len(rows), np.int64)
        for column, start, width in zip(rows.T, low, span, strict=True):
            key = key * width + (column - start)
        order = np.argsort(key, kind="stable")
        fresh = np.diff(key[order], prepend=-1) != 0
    else:
        order = np.lexsort(rows.T[::-1])
        ranked = rows[order]
        fresh = np.concatenate([[True], np.any(ranked[1:] != ranked[:-1], axis=1)])
    inverse = np.empty(len(order), np.int64)
    inverse[order] = np.cumsum(fresh) - 1
    return order[fresh], inverse
