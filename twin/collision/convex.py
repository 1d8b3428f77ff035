"""Triangles and convex bodies: areas, samples, exact cuts, hulls, and the box that a hull is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, QhullError

from twin import geometry as geo
from twin.geometry import Array
from twin.mesh import compact
from twin.scene import Box, Mesh

_TOO_SMALL = 1e-9  # m^2: triangles below it carry no surface


@dataclass(frozen=True, eq=False)
class Hull:
    """Convex body: vertices (V, 3), outward faces (F, 3), volume m^3."""

    vertices: Array
    faces: NDArray[np.int32]
    volume: float

    @property
    def mesh(self) -> Mesh:
        return Mesh(self.vertices, self.faces)


def triangles_of(mesh: Mesh) -> Array:
    """Corner positions (F, 3, 3) of the faces that have an area."""
    corners = mesh.vertices[mesh.faces]
    return np.asarray(corners[geo.triangle_areas(corners) > _TOO_SMALL])


def hull_of(points: Array) -> Hull | None:
    """Convex hull of points (n, 3); None when they are (nearly) coplanar."""
    try:
        q = ConvexHull(points)
    except (QhullError, ValueError):
        return None
    used, faces = compact(q.simplices)
    vertices = points[used]
    inward = np.einsum("ij,ij->i", geo.vector_areas(vertices[faces]), q.equations[:, :3]) < 0
    faces[inward] = faces[inward][:, ::-1]
    return Hull(vertices, faces, float(q.volume))


def thick_hull(triangles: Array, thickness: float) -> Hull | None:
    """Hull of triangles (n, 3, 3); a flatter surface is given `thickness` (m) against its normals."""
    points = triangles.reshape(-1, 3)
    center = points.mean(axis=0)
    _, _, axes = np.linalg.svd(points - center, full_matrices=False)
    along = (points - center) @ axes[2]
    if np.ptp(along) < thickness:
        directed = geo.vector_areas(triangles)
        normal = directed.sum(0) @ axes[2]
        missing = (thickness - np.ptp(along)) * axes[2]
        # mostly one side was seen: the material is behind it
        if abs(normal) > 0.3 * np.linalg.norm(directed, axis=1).sum():
            points = np.concatenate([points, points - np.sign(normal) * missing])
        else:
            points = np.concatenate([points - missing / 2, points + missing / 2])
    return hull_of(points)


def cut(triangles: Array, normal: Array, offset: float) -> tuple[Array, Array]:
    """Split triangles (n, 3, 3) exactly by the plane normal . x = offset into those below and above it."""
    d = triangles @ normal - offset
    below, above = np.all(d <= 0, axis=1), np.all(d > 0, axis=1)
    low, high = [triangles[below]], [triangles[above]]
    across = ~below & ~above
    t, d = triangles[across], d[across]
    if len(t):
        lone_above = (d > 0).sum(axis=1) == 1  # one corner is alone on its side: turn it to the front
        alone = np.where(lone_above, np.argmax(d > 0, axis=1), np.argmax(d <= 0, axis=1))
        turn = (alone[:, None] + np.arange(3)) % 3
        rows = np.arange(len(t))[:, None]
        t, d = t[rows, turn], d[rows, turn]
        ab = t[:, 0] + (t[:, 1] - t[:, 0]) * (d[:, 0] / (d[:, 0] - d[:, 1]))[:, None]
        ac = t[:, 0] + (t[:, 2] - t[:, 0]) * (d[:, 0] / (d[:, 0] - d[:, 2]))[:, None]
        tip = np.stack([t[:, 0], ab, ac], axis=1)
        rest = np.concatenate([np.stack([ab, t[:, 1], t[:, 2]], 1), np.stack([ab, t[:, 2], ac], 1)])
        twice = np.concatenate([lone_above, lone_above])
        low += [tip[~lone_above], rest[twice]]
        high += [tip[lone_above], rest[~twice]]
    return _with_area(np.concatenate(low)), _with_area(np.concatenate(high))


def within(triangles: Array, low: Array, high: Array) -> Array:
    """The part of triangles (n, 3, 3) inside the box from corner low (3,) to high (3,)."""
    for k, axis in enumerate(np.eye(3)):
        _, above = cut(triangles, axis, float(low[k]))
        triangles, _ = cut(above, axis, float(high[k]))
    return triangles


def _with_area(triangles: Array) -> Array:
    return triangles[geo.triangle_areas(triangles) > _TOO_SMALL]


def sample(triangles: Array, spacing: float) -> Array:
    """Points (m, 3) on triangles, no part of them further than about `spacing` from one; corners included."""
    return sample_of(triangles, spacing)[0]


def sample_of(triangles: Array, spacing: float) -> tuple[Array, NDArray[np.int64]]:
    """Points (m, 3) as `sample` gives them, and the triangle (m,) that each lies on."""
    longest = np.linalg.norm(triangles - np.roll(triangles, 1, axis=1), axis=2).max(axis=1)
    steps = np.clip(np.ceil(longest / spacing).astype(int), 1, 200)
    points, owners = [np.zeros((0, 3))], [np.zeros(0, np.int64)]
    for n in np.unique(steps):
        i, j = np.meshgrid(np.arange(n + 1), np.arange(n + 1))
        keep = i + j <= n
        u, v = i[keep] / n, j[keep] / n
        weights = np.stack([1 - u - v, u, v], axis=1)
        points.append(np.einsum("wk,tkx->twx", weights, triangles[steps == n]).reshape(-1, 3))
        owners.append(np.repeat(np.flatnonzero(steps == n), len(weights)))
    return np.concatenate(points), np.concatenate(owners)


def clip(hull: Hull, normal: Array, offset: float) -> Hull | None:
    """The part of a hull with normal . x >= offset; None when nothing solid is left."""
    _, kept = cut(hull.vertices[hull.faces], normal, offset)
    if not len(kept):
        return None
    return hull_of(np.unique(kept.reshape(-1, 3), axis=0))


def box_of(hull: Hull, slack: float = 0.005) -> Box | None:
    """The box that a hull is; None if the smallest one around it holds over `slack` (a share) beside it."""
    normals, area = geo.triangle_normals(hull.vertices[hull.faces])
    normal = normals[int(np.argmax(area))]
    basis = geo.orthogonal_basis(normal)
    best: tuple[float, Array] | None = None
    along = (hull.vertices[hull.faces] - hull.vertices[np.roll(hull.faces, 1, axis=1)]).reshape(-1, 3)
    flat = along[np.abs(along @ normal) < 1e-3 * np.linalg.norm(along, axis=1)] @ basis[:, :2]
    for angle in np.unique(np.round(np.arctan2(flat[:, 1], flat[:, 0]) % (np.pi / 2), 9)):
        turned = basis @ geo.exp_so3([0.0, 0.0, float(angle)])
        size = np.ptp(hull.vertices @ turned, axis=0)
        if best is None or np.prod(size) < best[0]:
            best = (float(np.prod(size)), turned)
    if best is None or best[0] > (1 + slack) * hull.volume:
        return None
    local = hull.vertices @ best[1]
    low, high = local.min(axis=0), local.max(axis=0)
    return Box(geo.make_pose(best[1], best[1] @ ((low + high) / 2)), high - low)
