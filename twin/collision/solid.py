"""What a surface encloses: volume, signed distance, points of its outside. Measures collision shapes.

A mesh is often several surfaces at once: the boards of a drawer that run into one another, a panel and a
handle, one of them wound inside out. The solid is the union of what each closed piece encloses, whichever way
it is wound. Pieces with an edge of their own (open ones) enclose nothing; they count as surface.
"""

from __future__ import annotations

from collections.abc import Iterable
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from twin import geometry as geo
from twin.collision.convex import Hull, hull_of
from twin.collision.pieces import pieces_of
from twin.geometry import Array
from twin.mesh import on_triangles
from twin.scene import Box, Collision, Mesh

_JUST_OUTSIDE = 2e-4  # m: far more than single precision loses over a few metres, far less than any board
_AT_ONCE = 1 << 20  # lines that faces are tried against at a time: a hundred megabytes
_RAYS = 3  # votes whether a point is inside: a ray may run along an edge
# A grid turned so that no board lies along it: aligned with one, rows of cells would be in or out as a whole.
_TURNED = geo.exp_so3([0.41, -0.33, 0.27])


class Solid:
    """The union of closed surfaces, with the open ones beside it."""

    def __init__(self, closed: Iterable[Mesh], open_pieces: Iterable[Mesh] = ()) -> None:
        self.closed = tuple(m for m in closed if len(m.faces))
        self.open = tuple(m for m in open_pieces if len(m.faces))

    @classmethod
    def of_mesh(cls, mesh: Mesh) -> Solid:
        """The solid of a mesh; faces without area are left out."""
        pieces = pieces_of(mesh)
        return cls((m for m, c in pieces if c), (m for m, c in pieces if not c))

    @classmethod
    def of_shapes(cls, shapes: Iterable[Collision]) -> Solid:
        """The union of collision shapes; a shape without volume is left out."""
        return cls(h.mesh for h in map(hull_of_shape, shapes) if h is not None)

    @cached_property
    def _scenes(self) -> list[_Scene]:
        return [_Scene(m) for m in (*self.closed, *self.open)]

    def signed_distance(self, points: Array) -> Array:
        """Distance (n,) m of points (n, 3) from the solid, negative inside.

        Outside it is exact; inside it is the depth in the deepest piece with the point, less at seams of
        overlapping pieces than that in their union. Open pieces have no inside. Infinite without a surface.
        """
        out = np.full(len(points), np.inf)
        for k, scene in enumerate(self._scenes):
            out = np.minimum(out, scene.distance(points, signed=k < len(self.closed)))
        return out

    def behind(self, points: Array) -> NDArray[np.bool_]:
        """Whether points (n, 3) lie behind the nearest face, or inside closed pieces: in material."""
        nearest = np.full(len(points), np.inf)
        out = np.zeros(len(points), bool)
        for k, scene in enumerate(self._scenes):
            distance = scene.distance(points, signed=k < len(self.closed))
            inside = distance < 0 if k < len(self.closed) else scene.behind(points)
            out, nearest = np.where(distance < nearest, inside, out), np.minimum(distance, nearest)
        return out

    def surface(self, count: int) -> Array:
        """About `count` points even on the outside of the union and on the open pieces; repeatable."""
        total = sum(float(geo.triangle_areas(m.vertices[m.faces]).sum()) for m in (*self.closed, *self.open))
        out = []
        for k, mesh in enumerate((*self.closed, *self.open)):
            corners = mesh.vertices[mesh.faces]
            points, normals = spread(
                corners, count * float(geo.triangle_areas(corners).sum()) / max(total, 1e-12)
            )
            if k < len(self.closed):  # no outside where material is on both sides
                sides = [self._holds(points + d * normals) for d in (_JUST_OUTSIDE, -_JUST_OUTSIDE)]
                points = points[~(sides[0] & sides[1])]
            out.append(points)
        return np.concatenate(out) if out else np.zeros((0, 3))

    def _holds(self, points: Array) -> NDArray[np.bool_]:
        """Whether points (n, 3) lie in one of the closed pieces."""
        out = np.zeros(len(points), bool)
        for scene in self._scenes[: len(self.closed)]:
            out |= scene.holds(points)
        return out

    def volume(self, spacing: float = 0.003) -> float:
        """Volume (m^3) of the union, from parallel lines `spacing` (m) apart: what each has inside, times the
        area it stands for. That is a sum over voxels which along one direction are infinitely short.
        """
        if not self.closed:
            return 0.0
        turned = [m.vertices @ _TURNED.T for m in self.closed]
        low = np.min([v.min(axis=0) for v in turned], axis=0) - spacing
        cells = np.ceil((np.max([v.max(axis=0) for v in turned], axis=0) - low) / spacing).astype(int) + 1
        spans = [
            _inside_spans(v, m.faces, low, spacing, int(cells[1]))
            for v, m in zip(turned, self.closed, strict=True)
        ]
        return _union_length(np.concatenate(spans)) * spacing**2


class _Scene:
    """One piece that answers how far points are from it; single precision about its own centre."""

    def __init__(self, mesh: Mesh) -> None:
        import open3d as o3d

        self._centre = mesh.vertices.mean(axis=0)
        self._low, self._high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
        self._scene: Any = o3d.t.geometry.RaycastingScene(1)
        self._scene.add_triangles(
            o3d.core.Tensor.from_numpy(np.ascontiguousarray(mesh.vertices - self._centre, dtype=np.float32)),
            o3d.core.Tensor.from_numpy(np.ascontiguousarray(mesh.faces, dtype=np.uint32)),
        )

    def distance(self, points: Array, signed: bool) -> Array:
        """Distances (n,) m, negative inside when `signed`."""
        import open3d as o3d

        if not len(points):
            return np.zeros(0)
        query = np.ascontiguousarray(points - self._centre, dtype=np.float32)
        out = self._scene.compute_distance(o3d.core.Tensor.from_numpy(query), 1).numpy().astype(np.float64)
        if signed:
            out = np.where(self.holds(points), -out, out)
        return np.asarray(out)

    def holds(self, points: Array) -> NDArray[np.bool_]:
        """Whether points (n, 3) lie inside, by the parity of crossings."""
        import open3d as o3d

        out = geo.every((points > self._low) & (points < self._high))
        if out.any():
            query = np.ascontiguousarray(points[out] - self._centre, dtype=np.float32)
            out[out] = (
                self._scene.compute_occupancy(o3d.core.Tensor.from_numpy(query), 1, _RAYS).numpy() > 0.5
            )
        return np.asarray(out)

    def behind(self, points: Array) -> NDArray[np.bool_]:
        """Whether points (n, 3) lie behind the nearest face (n,)."""
        import open3d as o3d

        query = np.ascontiguousarray(points - self._centre, dtype=np.float32)
        found = self._scene.compute_closest_points(o3d.core.Tensor.from_numpy(query), 1)
        away = query - found["points"].numpy()
        return np.asarray(np.einsum("ij,ij->i", away, found["primitive_normals"].numpy()) < 0)


def hull_of_shape(shape: Collision) -> Hull | None:
    """The convex body that a collision shape stands for; None when it is flat."""
    return hull_of(shape.corners if isinstance(shape, Box) else shape.vertices)


def spread(corners: Array, count: float) -> tuple[Array, Array]:
    """About `count` points (n, 3) evenly on triangles (F, 3, 3), and the unit normals (n, 3) of those.

    The quasi-random sequence of Roberts (2018, "The unreasonable effectiveness of quasirandom sequences", R3)
    spreads them more evenly than chance and needs no seed.
    """
    normal, size = geo.triangle_normals(corners)
    edge = np.cumsum(size)
    n = max(1, round(count))
    root = 1.2207440846057596  # the real root of x^4 = x + 1
    u = (0.5 + np.arange(1, n + 1)[:, None] / root ** np.arange(1, 4)) % 1.0
    face = np.minimum(np.searchsorted(edge, u[:, 0] * edge[-1], side="right"), len(size) - 1)
    return on_triangles(corners[face], u[:, 1], u[:, 2]), normal[face]


def _inside_spans(
    vertices: Array, faces: NDArray[np.int32], low: Array, spacing: float, columns: int
) -> Array:
    """Spans (n, 3) of number of line, start and end along z (m) that a closed surface has inside it.

    Lines run along z through the middles of a grid of squares from `low` on, `columns` of them in y. A line
    that meets the surface an odd number of times grazes it; it loses its last hit.
    """
    corners = vertices[faces] - low
    xy = corners[:, :, :2] / spacing - 0.5
    first = np.ceil(xy.min(axis=1)).astype(np.int64)
    count = np.maximum(np.floor(xy.max(axis=1)).astype(np.int64) - first + 1, 0)
    cells = count.prod(axis=1)
    edge = xy[:, 1:] - xy[:, :1]
    det = edge[:, 0, 0] * edge[:, 1, 1] - edge[:, 0, 1] * edge[:, 1, 0]
    meets = np.flatnonzero((cells > 0) & (np.abs(det) >= 1e-12))
    line, height = [], []
    for some in np.split(meets, np.flatnonzero(np.diff(np.cumsum(cells[meets]) // _AT_ONCE)) + 1):
        face = np.repeat(some, cells[some])
        k = np.arange(len(face)) - np.repeat(np.cumsum(cells[some]) - cells[some], cells[some])
        at = first[face] + np.stack([k // count[face, 1], k % count[face, 1]], axis=1)
        d, (e1, e2) = at - xy[face, 0], edge[face].transpose(1, 0, 2)
        v = (d[:, 0] * e2[:, 1] - d[:, 1] * e2[:, 0]) / det[face]
        w = (e1[:, 0] * d[:, 1] - e1[:, 1] * d[:, 0]) / det[face]
        hit = (v >= 0) & (w >= 0) & (v + w <= 1)
        z = corners[face, :, 2]
        line.append((at[:, 0] * columns + at[:, 1])[hit])
        height.append((z[:, 0] + v * (z[:, 1] - z[:, 0]) + w * (z[:, 2] - z[:, 0]))[hit])
    lines, heights = np.concatenate(line), np.concatenate(height)
    order = np.lexsort((heights, lines))
    lines, heights = lines[order], heights[order]
    start = np.searchsorted(lines, lines)
    rank, count = np.arange(len(lines)) - start, np.searchsorted(lines, lines, side="right") - start
    enters = np.flatnonzero((rank % 2 == 0) & (rank + 1 < count))
    return np.stack([lines[enters].astype(np.float64), heights[enters], heights[enters + 1]], axis=1)


def _union_length(spans: Array) -> float:
    """Total length (m) of spans (n, 3) of line, start, end, what overlaps counted once."""
    if not len(spans):
        return 0.0
    spans = spans[np.lexsort((spans[:, 1], spans[:, 0]))]
    apart = 2.0 * float(spans[:, 2].max() - spans[:, 1].min()) + 1.0  # puts the lines behind one another
    start, end = spans[:, 1] + apart * spans[:, 0], spans[:, 2] + apart * spans[:, 0]
    reached = np.concatenate([[-np.inf], np.maximum.accumulate(end)[:-1]])
    return float(np.maximum(end - np.maximum(start, reached), 0.0).sum())
