"""Covers a triangle surface with convex pieces. Made for reconstructed surfaces: open, noisy, one or two-sided.

The surface is split by planes until the hull of every piece stays within a tolerance of the surface it covers ("bulge"), so
no hull fills free space such as the gap behind a handle. Splitting works on the surface itself, without making it
watertight first, and is deterministic.
"""

from __future__ import annotations

import heapq
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, QhullError, cKDTree

from twin import geometry as geo
from twin.geometry import Array
from twin.scene import Box, Mesh

_BOARD = 0.02  # m: a usual board is thinner than this
_TOO_SMALL = 1e-9  # m^2: triangles below it carry no surface


@dataclass(frozen=True, eq=False)
class Hull:
    """Convex body: vertices (V, 3), outward faces (F, 3), volume m^3."""

    vertices: Array
    faces: NDArray[np.int64]
    volume: float

    @property
    def mesh(self) -> Mesh:
        return Mesh(self.vertices, self.faces.astype(np.int32))


def triangles_of(mesh: Mesh) -> Array:
    """Corner positions (F, 3, 3) of the faces that have an area."""
    corners = mesh.vertices[mesh.faces]
    return np.asarray(corners[areas(corners) > _TOO_SMALL])


def areas(triangles: Array) -> Array:
    """Areas (F,) of triangles (F, 3, 3)."""
    edges = triangles[:, 1:] - triangles[:, :1]
    return np.asarray(0.5 * np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1))


def hull_of(points: Array) -> Hull | None:
    """Convex hull of points (n, 3); None when they are (nearly) coplanar."""
    try:
        q = ConvexHull(points)
    except (QhullError, ValueError):
        return None
    used, index = np.unique(q.simplices, return_inverse=True)
    vertices, faces = points[used], index.reshape(-1, 3)
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    inward = np.einsum("ij,ij->i", np.cross(b - a, c - a), q.equations[:, :3]) < 0
    faces[inward] = faces[inward][:, ::-1]
    return Hull(vertices, faces, float(q.volume))


def thick_hull(triangles: Array, thickness: float) -> Hull | None:
    """Hull of triangles (n, 3, 3); a flatter surface is given `thickness` (m) against its normals."""
    points = triangles.reshape(-1, 3)
    center = points.mean(axis=0)
    _, _, axes = np.linalg.svd(points - center, full_matrices=False)
    along = (points - center) @ axes[2]
    if np.ptp(along) < thickness:
        normal = (
            np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]).sum(0) @ axes[2]
        )
        missing = (thickness - np.ptp(along)) * axes[2]
        seen = 2.0 * areas(triangles).sum()
        if abs(normal) > 0.3 * seen:  # mostly one side was seen: the material is behind it
            points = np.concatenate([points, points - np.sign(normal) * missing])
        else:
            points = np.concatenate([points - missing / 2, points + missing / 2])
    return hull_of(points)


def cut(triangles: Array, normal: Array, offset: float) -> tuple[Array, Array]:
    """Split triangles (n, 3, 3) exactly by the plane normal . x = offset into those below and those above it."""
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


def _with_area(triangles: Array) -> Array:
    return triangles[areas(triangles) > _TOO_SMALL]


def sample(triangles: Array, spacing: float) -> Array:
    """Points (m, 3) on triangles, no part of them further than about `spacing` from one; corners included."""
    longest = np.linalg.norm(triangles - np.roll(triangles, 1, axis=1), axis=2).max(axis=1)
    steps = np.clip(np.ceil(longest / spacing).astype(int), 1, 200)
    out = []
    for n in np.unique(steps):
        i, j = np.meshgrid(np.arange(n + 1), np.arange(n + 1))
        keep = i + j <= n
        u, v = i[keep] / n, j[keep] / n
        weights = np.stack([1 - u - v, u, v], axis=1)
        out.append(np.einsum("wk,tkx->twx", weights, triangles[steps == n]).reshape(-1, 3))
    return np.concatenate(out) if out else np.zeros((0, 3))


def bulge(hull: Hull, triangles: Array, tolerance: float) -> float:
    """Greatest distance (m) of the hull's surface from the triangles it covers, good to about half the tolerance."""
    shell = hull.vertices[hull.faces]
    spacing = max(tolerance / 2, float(np.sqrt(areas(shell).sum() / 2000.0)))
    tree = cKDTree(
        _thinned(sample(triangles, spacing), spacing / 4), balanced_tree=False, compact_nodes=False
    )
    near, _ = tree.query(_thinned(sample(shell, spacing), spacing / 4))
    return max(0.0, float(near.max()) - spacing / 2)


def _thinned(points: Array, cell: float) -> Array:
    """One point (m, 3) of each grid cell; many equal points would make nearest-neighbour search slow."""
    key = np.floor((points - points.min(axis=0)) / cell).astype(np.int64) @ np.array([1, 1 << 20, 1 << 40])
    return points[np.unique(key, return_index=True)[1]]


def main_axes(triangles: Array) -> Array:
    """Rotation (3, 3), columns = the directions that most of the surface faces (boards have three)."""
    n = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    weight = np.linalg.norm(n, axis=1)
    n = n[weight > 0] / weight[weight > 0, None]
    first = _mode(n, weight[weight > 0])
    side = n - np.outer(n @ first, first)
    lengths = np.linalg.norm(side, axis=1)
    good = lengths > 0.7
    if not good.any():
        return geo.orthogonal_basis(first)[:, [2, 0, 1]]
    second = _mode(side[good] / lengths[good, None], weight[weight > 0][good])
    second = geo.unit(second - first * (second @ first))
    return np.stack([first, second, np.cross(first, second)], axis=1)


def outline_axes(triangles: Array) -> Array:
    """Main axes (3, 3) of one part, the last two turned by up to 5 degrees so that its outline fits the smallest rectangle.

    The narrow edges of a board face poorly known directions in a scan; its outline is long and says it better.
    """
    axes = main_axes(triangles)
    points = triangles.reshape(-1, 3) @ axes

    def size(angle: float) -> float:
        c, s = np.cos(angle), np.sin(angle)
        return float(
            np.ptp(points[:, 1] * c + points[:, 2] * s) * np.ptp(points[:, 2] * c - points[:, 1] * s)
        )

    angles = np.deg2rad(np.linspace(-5.0, 5.0, 81))
    best = float(angles[int(np.argmin([size(float(a)) for a in angles]))])
    return np.asarray(axes @ geo.exp_so3([best, 0.0, 0.0]))


def _mode(directions: Array, weight: Array) -> Array:
    """The line direction with the most weight within 15 degrees, refined as their principal axis."""
    order = np.argsort(-weight, kind="stable")[:200]
    near = np.abs(directions[order] @ directions.T) > np.cos(np.deg2rad(15.0))
    best = order[int(np.argmax(near @ weight))]
    axis = directions[best]
    for _ in range(12):  # mean shift: single faces of a scan are 10 degrees off
        inside = np.abs(directions @ axis) > np.cos(np.deg2rad(25.0))
        d = directions[inside]
        axis = np.linalg.eigh((d * weight[inside, None]).T @ d)[1][:, 2]
    return np.asarray(axis * (1.0 if axis[np.argmax(np.abs(axis))] > 0 else -1.0))


def decompose(
    triangles: Array, tolerance: Callable[[Array], float], thickness: float, max_pieces: int
) -> list[Array]:
    """Split triangles (n, 3, 3) into pieces whose hulls stay within tolerance(piece) metres of the surface.

    The worst piece is split first, until all are good or there are `max_pieces`.
    """
    axes = main_axes(triangles)
    heap: list[tuple[float, int, Array]] = []
    done: list[tuple[int, Array]] = []
    count = 0

    def put(piece: Array) -> None:
        nonlocal count
        count += 1
        allowed = tolerance(piece)
        hull = thick_hull(piece, thickness)
        excess = bulge(hull, piece, allowed) / allowed if hull is not None else 0.0
        if excess <= 1.0:
            done.append((count, piece))
        else:
            heapq.heappush(heap, (-excess, count, piece))

    put(triangles)
    while heap and len(heap) + len(done) < max_pieces:
        _, number, piece = heapq.heappop(heap)
        parts = _best_split(piece, axes, thickness)
        if parts is None:
            done.append((number, piece))
        else:
            for part in parts:
                put(part)
    return [piece for _, piece in sorted([*done, *((k, p) for _, k, p in heap)], key=lambda row: row[0])]


def merge(pieces: list[Array], tolerance: Callable[[Array], float], thickness: float) -> list[Array]:
    """Join neighbouring pieces wherever the joint hull still keeps within the tolerance, small pieces first."""
    pieces = sorted(pieces, key=lambda p: float(areas(p).sum()))
    hulls = [thick_hull(p, thickness) for p in pieces]
    k = 0
    while k < len(pieces):
        low, high = pieces[k].min(axis=(0, 1)) - thickness, pieces[k].max(axis=(0, 1)) + thickness
        for other in range(len(pieces) - 1, k, -1):
            if np.any(pieces[other].min(axis=(0, 1)) > high) or np.any(pieces[other].max(axis=(0, 1)) < low):
                continue
            both = np.concatenate([pieces[k], pieces[other]])
            joint = thick_hull(both, thickness)
            if _keeps_close(joint, both, (hulls[k], hulls[other]), tolerance(both)):
                pieces[other], hulls[other] = both, joint
                del pieces[k], hulls[k]
                k -= 1
                break
        k += 1
    return pieces


def _keeps_close(
    joint: Hull | None, triangles: Array, parts: tuple[Hull | None, Hull | None], allowed: float
) -> bool:  # fmt: skip
    """Whether a joint hull stays within `allowed` of its triangles; the cheap test by volume comes first."""
    if joint is None:
        return True
    apart = sum(h.volume for h in parts if h is not None)
    if joint.volume > apart + allowed * float(areas(joint.vertices[joint.faces]).sum()):
        return False
    return bulge(joint, triangles, allowed) <= allowed


def _best_split(piece: Array, axes: Array, thickness: float) -> tuple[Array, Array] | None:
    """The split by a plane across one of the axes that leaves the least hull volume."""
    best: tuple[float, Array, Array] | None = None
    points = piece.reshape(-1, 3)
    for axis in axes.T:
        along = points @ axis
        for offset in _offsets(piece, axis, float(along.min()), float(along.max()), thickness):
            low, high = cut(piece, axis, offset)
            if len(low) and len(high):
                score = _rough_volume(low) + _rough_volume(high)
                if best is None or score < best[0] * (1 - 1e-9):
                    best = (score, low, high)
    return None if best is None else (best[1], best[2])


def _offsets(piece: Array, axis: Array, low: float, high: float, thickness: float) -> Array:
    """Where to try planes across `axis`: evenly, and on both sides of each plane in which much of the surface lies."""
    if high - low < 2 * thickness:
        return np.zeros(0)
    even = np.linspace(low, high, 9)[1:-1]
    n = np.cross(piece[:, 1] - piece[:, 0], piece[:, 2] - piece[:, 0])
    facing = np.abs(n @ axis) > 0.85 * np.linalg.norm(n, axis=1)
    if not facing.any():
        return even
    where, weight = piece[facing].mean(axis=1) @ axis, areas(piece[facing])
    bins = int(np.clip((high - low) / thickness, 4, 400))
    height, edges = np.histogram(where, bins, (low, high), weights=weight)
    beside = []
    for k in np.argsort(-height, kind="stable")[:4]:
        if height[k] > 0.02 * areas(piece).sum():
            inside = np.abs(where - (edges[k] + edges[k + 1]) / 2) < edges[1] - edges[0]
            mean = np.average(where[inside], weights=weight[inside])
            spread = np.sqrt(np.average((where[inside] - mean) ** 2, weights=weight[inside]))
            beside += [mean - 2.0 * spread - 0.001, mean + 2.0 * spread + 0.001]
    offsets = np.concatenate([even, np.array(beside)])
    return np.unique(offsets[(offsets > low + 1e-3) & (offsets < high - 1e-3)])


_GOLDEN = np.pi * (3.0 - np.sqrt(5.0))
_DIRECTIONS = np.array(
    [[np.cos(_GOLDEN * k) * np.sqrt(1 - z * z), np.sin(_GOLDEN * k) * np.sqrt(1 - z * z), z]
     for k, z in enumerate(np.linspace(1, -1, 60))]
)  # fmt: skip


def _rough_volume(triangles: Array) -> float:
    """Hull volume from the extreme points in 60 directions (from below), plus that of a skin as thick as half a board,
    which keeps the two sides of a board together."""
    points = triangles.reshape(-1, 3)
    points = points[:: max(1, len(points) // 1500)]
    if len(points) > 200:
        points = points[np.unique(np.argmax(points @ _DIRECTIONS.T, axis=0))]
    hull = hull_of(points)
    if hull is None:
        return float(areas(triangles).sum()) * _BOARD
    return hull.volume + 0.5 * _BOARD * float(areas(hull.vertices[hull.faces]).sum())


def fit_box(triangles: Array, hull: Hull, tolerance: float, thickness: float) -> Box | None:
    """The box that a board-like piece is: tight in 99 % of its surface, None if it leaves the hull by > tolerance."""
    points = sample(triangles, 0.01)
    normal = _thin_direction(triangles)
    rotation = _turned_to_rectangle(hull.vertices, normal)
    local = points @ rotation
    low, high = np.quantile(local, 0.005, axis=0), np.quantile(local, 0.995, axis=0)
    outer = hull.vertices @ rotation
    if high[2] - low[2] < thickness:  # the hull was given its thickness where the material is
        low[2], high[2] = outer[:, 2].min(), outer[:, 2].max()
    size = high - low
    if np.any(size < 1e-3):
        return None
    box = Box(geo.make_pose(rotation, rotation @ ((low + high) / 2)), size)
    outside = np.maximum(np.abs(outer - (low + high) / 2) - size / 2, 0.0).max()
    inside = hull_distance(hull, box.corners)
    return box if outside <= tolerance and inside.max() <= tolerance else None


def _thin_direction(triangles: Array) -> Array:
    """Direction (3,) across the board: the mode of its normals."""
    n = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    weight = np.linalg.norm(n, axis=1)
    return _mode(n / weight[:, None], weight)


def _turned_to_rectangle(points: Array, normal: Array) -> Array:
    """Rotation (3, 3) with third column `normal`, turned so that the points' outline has the smallest rectangle."""
    basis = geo.orthogonal_basis(normal)
    flat = points @ basis[:, :2]
    best, angle = np.inf, 0.0
    for a in np.arange(90) * np.deg2rad(1.0):
        turned = flat @ np.array([[np.cos(a), -np.sin(a)], [np.sin(a), np.cos(a)]])
        size = float(np.prod(np.ptp(turned, axis=0)))
        if size < best * (1 - 1e-9):
            best, angle = size, float(a)
    return basis @ geo.exp_so3([0.0, 0.0, angle])


def hull_distance(hull: Hull, points: Array) -> Array:
    """How far points (n, 3) lie outside the faces' planes of a hull (m, negative inside)."""
    a, b, c = (hull.vertices[hull.faces[:, k]] for k in range(3))
    n = np.cross(b - a, c - a)
    n /= np.maximum(np.linalg.norm(n, axis=1), 1e-300)[:, None]
    return np.asarray((points @ n.T - np.einsum("ij,ij->i", a, n)).max(axis=1))


def clip(hull: Hull, normal: Array, offset: float) -> Hull | None:
    """The part of a hull with normal . x >= offset; None when nothing solid is left."""
    _, kept = cut(hull.vertices[hull.faces], normal, offset)
    if not len(kept):
        return None
    return hull_of(np.unique(kept.reshape(-1, 3), axis=0))
