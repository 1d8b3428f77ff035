"""Finds boards in a triangle surface: flat regions, with the back side where it was seen, covered by few boxes.

Furniture is made of boards, and a box is the best collision shape for one. The surface is searched along its three main
directions for planes that hold much of it; each plane's region is covered by rectangles.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from twin import geometry as geo
from twin.convex import areas, cut, sample
from twin.geometry import Array
from twin.scene import Box

_FACING = np.cos(np.deg2rad(25.0))  # chosen by us: noisy faces still belong to their plane


@dataclass(frozen=True)
class BoardSearch:
    """What counts as a board. Lengths in metres, areas in square metres; all chosen by us.

    deepest: front and back of one board are no further apart. thickness: given to a side whose back was not seen.
    cell: grid on the board, finer than the smallest gap to keep. fill: least share of a rectangle that is surface.
    smallest: a plane or rectangle with less surface is left for other shapes. noise: unevenness of a flat surface.
    """

    deepest: float = 0.045
    thickness: float = 0.006
    cell: float = 0.006
    fill: float = 0.9
    smallest: float = 0.006
    noise: float = 0.003
    most: int = 40


def find_boards(triangles: Array, axes: Array, search: BoardSearch) -> tuple[list[Box], Array]:
    """Boxes that cover the boards of a surface (n, 3, 3) along the columns of `axes`, and the surface they leave."""
    boxes: list[Box] = []
    skip: set[tuple[int, int]] = set()
    while len(triangles) and len(boxes) < search.most:
        found = _strongest_plane(triangles, axes, search, skip)
        if found is None:
            break
        k, low, high, key = found
        below, rest = cut(triangles, axes[:, k], low)
        slab, above = cut(rest, axes[:, k], high)
        new = _cover(slab, axes, k, search)
        skip.add(key)
        if new:
            boxes += new
            triangles = beyond(np.concatenate([below, slab, above]), new, 2 * search.noise)
    return boxes, triangles


def _strongest_plane(
    triangles: Array, axes: Array, search: BoardSearch, skip: set[tuple[int, int]]
) -> tuple[int, float, float, tuple[int, int]] | None:
    """Axis number and slab low..high (m) of the plane with the most surface, and a key to skip it by."""
    normal = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    length = np.linalg.norm(normal, axis=1)
    best: tuple[float, int, float] | None = None
    for k in range(3):
        cos = normal @ axes[:, k] / length
        facing = np.abs(cos) > _FACING
        where = triangles[facing].mean(axis=1) @ axes[:, k]
        bins: NDArray[np.int64] = np.floor(where / search.noise).astype(np.int64)
        if not len(bins):
            continue
        held = np.bincount(bins - bins.min(), weights=length[facing] / 2)
        weight = np.convolve(held, [1.0, 1.0, 1.0], "same")  # a plane between two bins is one plane
        for b in np.argsort(-weight, kind="stable")[:30]:
            if (k, int(b + bins.min())) not in skip:
                if weight[b] > search.smallest and (best is None or weight[b] > best[0]):
                    best = (float(weight[b]), k, float((b + bins.min() + 0.5) * search.noise))
                break
    if best is None:
        return None
    _, k, plane = best
    key = (k, int(np.floor(plane / search.noise)))
    cos = normal @ axes[:, k] / length
    where = triangles.mean(axis=1) @ axes[:, k]
    near = np.abs(where - plane) < 2 * search.noise
    front = near & (np.abs(cos) > _FACING)
    sign = np.sign((cos * length)[front].sum()) or 1.0
    plane = float(np.average(where[front], weights=length[front]))
    behind = (plane - where) * sign
    back = (cos * sign < -_FACING) & (behind > search.noise) & (behind < search.deepest)
    depth = search.noise
    if length[back].sum() > 0.15 * length[front].sum():
        depth = float(np.average(behind[back], weights=length[back])) + search.noise
    ends = (plane + sign * search.noise, plane - sign * depth)
    return k, min(ends), max(ends), key


def _cover(slab: Array, axes: Array, k: int, search: BoardSearch) -> list[Box]:
    """Boxes over the part of a slab that is surface facing along axis k."""
    normal = np.cross(slab[:, 1] - slab[:, 0], slab[:, 2] - slab[:, 0])
    cos = normal @ axes[:, k] / np.maximum(np.linalg.norm(normal, axis=1), 1e-300)
    flat = slab[np.abs(cos) > _FACING]
    if areas(flat).sum() < search.smallest:
        return []
    u, v = axes[:, (k + 1) % 3], axes[:, (k + 2) % 3]
    points = sample(flat, search.cell * 0.7)
    plane = points @ np.stack([u, v], axis=1)
    origin = plane.min(axis=0)
    index = np.floor((plane - origin) / search.cell).astype(np.int64)
    grid = np.zeros(index.max(axis=0) + 1, bool)
    grid[index[:, 0], index[:, 1]] = True
    sign = float(np.sign((cos * areas(slab))[np.abs(cos) > _FACING].sum()) or 1.0)
    depth = points @ axes[:, k]
    boxes = []
    for i0, i1, j0, j1 in _rectangles(grid, search):
        inside = (index >= (i0, j0)).all(axis=1) & (index < (i1, j1)).all(axis=1)
        local = np.concatenate([plane[inside], depth[inside, None]], axis=1)
        low, high = np.quantile(local, 0.005, axis=0), np.quantile(local, 0.995, axis=0)
        low[2], high[2] = _sides(depth[inside], search, sign)
        frame = np.stack([u, v, axes[:, k]], axis=1)
        if np.all(high - low > 1e-3):
            boxes.append(Box(geo.make_pose(frame, frame @ ((low + high) / 2)), high - low))
    return boxes


def _sides(depth: Array, search: BoardSearch, sign: float) -> tuple[float, float]:
    """Front and back of a board: the middles of its two clusters of depth, or one of them and the default thickness."""
    low, high = float(np.quantile(depth, 0.1)), float(np.quantile(depth, 0.9))
    if high - low > 1.5 * search.noise:
        middle = (low + high) / 2
        low, high = float(np.median(depth[depth < middle])), float(np.median(depth[depth >= middle]))
    else:
        low = high = float(np.median(depth))
    missing = max(0.0, search.thickness - (high - low))
    return (low - missing, high) if sign > 0 else (low, high + missing)


def _rectangles(grid: NDArray[np.bool_], search: BoardSearch) -> list[tuple[int, int, int, int]]:
    """Cover the true cells with rectangles i0, i1, j0, j1 that are mostly true, by splitting where it saves most area."""
    from scipy.ndimage import binary_closing, binary_opening

    grid = binary_closing(np.pad(grid, 2), np.ones((3, 3)))[2:-2, 2:-2] | grid
    grid = binary_opening(grid, np.ones((2, 2)))
    least = search.smallest / search.cell**2 / 2
    out = []
    todo = [(0, grid.shape[0], 0, grid.shape[1])]
    while todo:
        i0, i1, j0, j1 = todo.pop()
        part = grid[i0:i1, j0:j1]
        if part.sum() < least:
            continue
        rows, columns = np.flatnonzero(part.any(axis=1)), np.flatnonzero(part.any(axis=0))
        i0, i1 = i0 + int(rows[0]), i0 + int(rows[-1]) + 1
        j0, j1 = j0 + int(columns[0]), j0 + int(columns[-1]) + 1
        part = grid[i0:i1, j0:j1]
        if part.mean() >= search.fill:
            out.append((i0, i1, j0, j1))
            continue
        along_i, cost_i = _best_line(part)
        along_j, cost_j = _best_line(part.T)
        if cost_i <= cost_j:
            todo += [(i0, i0 + along_i, j0, j1), (i0 + along_i, i1, j0, j1)]
        else:
            todo += [(i0, i1, j0, j0 + along_j), (i0, i1, j0 + along_j, j1)]
    return sorted(out)


def _best_line(part: NDArray[np.bool_]) -> tuple[int, float]:
    """Row at which to split so that the bounding boxes of the halves have the least area, and that area."""
    n = len(part)
    if n < 2:
        return 0, np.inf
    first, last = _span_areas(part), _span_areas(part[::-1])[::-1]
    total = first[:-1] + last[1:]
    k = int(np.argmin(total + 1e-3 * np.abs(np.arange(n - 1) - (n - 2) / 2) / n))
    return k + 1, float(total[k])


def _span_areas(part: NDArray[np.bool_]) -> Array:
    """Area of the bounding box of rows 0..k, for every k."""
    n, m = part.shape
    column = np.arange(m)
    left = np.minimum.accumulate(np.where(part, column, m).min(axis=1))
    right = np.maximum.accumulate(np.where(part, column, -1).max(axis=1))
    filled = part.any(axis=1)
    top = np.where(filled.any(), np.argmax(filled), n)
    bottom = np.maximum.accumulate(np.where(filled, np.arange(n), -1))
    return np.maximum(right - left + 1, 0) * np.maximum(bottom - top + 1, 0).astype(np.float64)


def beyond(triangles: Array, boxes: list[Box], margin: float) -> Array:
    """The triangles that don't lie within `margin` of one of the boxes as a whole."""
    keep = np.ones(len(triangles), bool)
    for box in boxes:
        local = geo.transform(geo.invert_pose(box.T_world_box), triangles[keep].reshape(-1, 3))
        inside = (np.abs(local) <= box.size / 2 + margin).all(axis=1).reshape(-1, 3).all(axis=1)
        keep[np.flatnonzero(keep)[inside]] = False
    return triangles[keep]
