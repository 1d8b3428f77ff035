"""Covers a triangle surface with convex pieces. For reconstructed surfaces: open, noisy, one or two-sided.

The surface is split by planes until the hull of every piece stays within a tolerance of the surface it covers
("bulge"), so no hull fills free space such as the gap behind a handle. Splitting works on the surface itself,
without making it watertight first, and is deterministic.
"""

from __future__ import annotations

import heapq

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from twin import geometry as geo
from twin.collision.convex import Hull, cut, hull_of, sample, sample_of, thick_hull
from twin.collision.main_axes import main_axes
from twin.geometry import Array

_BOARD = 0.02  # m: a usual board is thinner than this
# cosine: nearer to the plane of a face, whether a point is before or behind it is the noise of the face
_BEHIND = 0.5


def bulge(hull: Hull, triangles: Array, tolerance: float, filled: float = 0.0) -> float:
    """Greatest distance (m) of the hull's surface from its triangles, good to about half the tolerance.

    Args:
        filled: what lies behind the surface by up to this (m) is the body, whose other side was not seen, and
            no bulge.
    """
    shell = hull.vertices[hull.faces]
    spacing = max(tolerance / 2, float(np.sqrt(geo.triangle_areas(shell).sum() / 2000.0)))
    points, owner = sample_of(triangles, spacing)
    kept = _thinned(points, spacing / 4)
    tree = cKDTree(points[kept], balanced_tree=False, compact_nodes=False)
    outer = sample(shell, spacing)
    outer = outer[_thinned(outer, spacing / 4)]
    distance, near = tree.query(outer)
    if filled > 0:
        normal, _ = geo.triangle_normals(triangles[owner[kept[near]]])
        behind = np.einsum("ij,ij->i", outer - points[kept[near]], normal) < -_BEHIND * distance
        distance = np.where(behind & (distance < filled), 0.0, distance)
    return max(0.0, float(distance.max()) - spacing / 2)


def _thinned(points: Array, cell: float) -> NDArray[np.int64]:
    """Index (m,) of one point of each grid cell; many equal points slow nearest-neighbour search."""
    key = np.floor((points - points.min(axis=0)) / cell).astype(np.int64) @ np.array([1, 1 << 20, 1 << 40])
    return np.asarray(np.unique(key, return_index=True)[1])


def decompose(
    triangles: Array, tolerance: float, thickness: float, max_pieces: int, filled: float = 0.0
) -> list[Array]:
    """Split triangles (n, 3, 3) into pieces with hulls `tolerance` (m) off the surface or `filled` behind it.

    The worst piece is split first, until all are good or there are `max_pieces`.
    """
    axes = main_axes(triangles)
    heap: list[tuple[float, int, Array]] = []
    done: list[tuple[int, Array]] = []
    count = 0

    def put(piece: Array) -> None:
        nonlocal count
        count += 1
        hull = thick_hull(piece, thickness)
        excess = bulge(hull, piece, tolerance, filled) / tolerance if hull is not None else 0.0
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


def merge(pieces: list[Array], tolerance: float, thickness: float, filled: float = 0.0) -> list[Array]:
    """Join neighbouring pieces wherever the joint hull keeps the tolerance, small pieces first."""
    pieces = sorted(pieces, key=lambda p: float(geo.triangle_areas(p).sum()))
    hulls = [thick_hull(p, thickness) for p in pieces]
    k = 0
    while k < len(pieces):
        low, high = pieces[k].min(axis=(0, 1)) - thickness, pieces[k].max(axis=(0, 1)) + thickness
        for other in range(len(pieces) - 1, k, -1):
            if np.any(pieces[other].min(axis=(0, 1)) > high) or np.any(pieces[other].max(axis=(0, 1)) < low):
                continue
            both = np.concatenate([pieces[k], pieces[other]])
            joint = thick_hull(both, thickness)
            if _keeps_close(joint, both, (hulls[k], hulls[other]), tolerance, filled):
                pieces[other], hulls[other] = both, joint
                del pieces[k], hulls[k]
                k -= 1
                break
        k += 1
    return pieces


def _keeps_close(
    joint: Hull | None, triangles: Array, parts: tuple[Hull | None, Hull | None], allowed: float, filled: float
) -> bool:  # fmt: skip
    """Whether a joint hull stays within `allowed` of its triangles; the cheap test by volume comes first."""
    if joint is None:
        return True
    apart = sum(h.volume for h in parts if h is not None)
    if joint.volume > apart + max(allowed, filled) * float(
        geo.triangle_areas(joint.vertices[joint.faces]).sum()
    ):
        return False
    return bulge(joint, triangles, allowed, filled) <= allowed


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
    """Planes across `axis` to try: evenly, and on both sides of each plane that holds much surface."""
    if high - low < 2 * thickness:
        return np.zeros(0)
    even = np.linspace(low, high, 9)[1:-1]
    directed = geo.vector_areas(piece)
    area = np.linalg.norm(directed, axis=1)
    facing = np.abs(directed @ axis) > 0.85 * area
    if not facing.any():
        return even
    where, weight = piece[facing].mean(axis=1) @ axis, area[facing]
    bins = int(np.clip((high - low) / thickness, 4, 400))
    height, edges = np.histogram(where, bins, (low, high), weights=weight)
    beside = []
    for k in np.argsort(-height, kind="stable")[:4]:
        if height[k] > 0.02 * area.sum():
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
    """Hull volume from the extreme points in 60 directions (from below), plus that of a skin as thick as half
    a board, which keeps the two sides of a board together."""
    points = triangles.reshape(-1, 3)
    points = points[:: max(1, len(points) // 1500)]
    if len(points) > 200:
        points = points[np.unique(np.argmax(points @ _DIRECTIONS.T, axis=0))]
    hull = hull_of(points)
    if hull is None:
        return float(geo.triangle_areas(triangles).sum()) * _BOARD
    return hull.volume + 0.5 * _BOARD * float(geo.triangle_areas(hull.vertices[hull.faces]).sum())
