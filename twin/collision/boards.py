"""Finds boards in a triangle surface: flat regions, with their thickness, covered by few boxes.

Furniture is made of boards, and a box is the best collision shape. The surface is searched along its three
main directions for planes that hold much of it; each plane's region is covered by rectangles of even
thickness. That comes from the board's back if seen, else from the depth of its edges, else from a table.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from twin import geometry as geo
from twin.collision.convex import sample
from twin.geometry import Array
from twin.scene import Box

_FACING = np.cos(np.deg2rad(25.0))  # chosen by us: noisy faces still belong to their plane
_THINNEST = 0.003  # m
_ENOUGH = 0.15  # share of a rectangle whose back was seen that speaks for the rest
_CELLS = 2000  # along a surface, chosen by us: 12 m of a part; a mesh in millimetres would fill the memory
_EDGE = 0.3  # share of an edge whose depth was seen that speaks for the rest


@dataclass(frozen=True)
class BoardSearch:
    """What counts as a board; lengths in m.

    Attributes:
        deepest: front and back of one board are no further apart.
        thickness: of a board whose back and edges were not seen.
        cell: side of the grid on a board, finer than the smallest gap to keep.
        smallest: m^2; a plane or rectangle with less surface is left for other shapes.
        noise: unevenness of a flat surface.
        most: boards.
        fill: least share of a rectangle that is surface.
        narrowest: least width of a board.
    """

    deepest: float
    thickness: float
    cell: float
    smallest: float
    noise: float
    most: int
    fill: float = 0.9
    narrowest: float = 0.015


@dataclass(frozen=True, eq=False)
class Slab:
    """A box and the source of its thickness: the back that was seen, the depth of its edges, or the table."""

    box: Box
    back: Literal["seen", "edge", "table"]


@dataclass(frozen=True, eq=False)
class _Plane:
    """One side of a board: points with normal . x = offset, in a frame with columns u, v, normal."""

    frame: Array
    offset: float
    key: tuple[int, int, int]

    def local(self, points: Array) -> Array:
        """Along u, along v, and how far behind the plane (..., 3)."""
        out = points @ self.frame
        out[..., 2] = self.offset - out[..., 2]
        return np.asarray(out)


def find_boards(triangles: Array, axes: Array, search: BoardSearch) -> tuple[list[Slab], Array]:
    """Boards of a surface (n, 3, 3) along the columns of `axes`, and the surface they leave."""
    if len(triangles):
        size = float(np.ptp(triangles.reshape(-1, 3), axis=0).max())
        search = replace(search, cell=max(search.cell, size / _CELLS))
    boards: list[Slab] = []
    skip: set[tuple[int, int, int]] = set()
    while len(triangles) and len(boards) < search.most:
        plane = _strongest_plane(triangles, axes, search, skip)
        if plane is None:
            break
        new = _cover(triangles, plane, search)[: search.most - len(boards)]
        skip.add(plane.key)
        if new:
            boards += new
            triangles = beyond(triangles, [b.box for b in new], 2 * search.noise)
    return boards, triangles


def _strongest_plane(
    triangles: Array, axes: Array, search: BoardSearch, skip: set[tuple[int, int, int]]
) -> _Plane | None:
    """The plane with the most surface that faces one way along one of the axes."""
    normal = geo.vector_areas(triangles)
    length = np.linalg.norm(normal, axis=1)
    best: tuple[float, int, int, int] | None = None
    for k in range(3):
        cos = normal @ axes[:, k] / length
        along = triangles.mean(axis=1) @ axes[:, k]
        for sign in (-1, 1):
            facing = sign * cos > _FACING
            if not facing.any():
                continue
            bins: NDArray[np.int64] = np.floor(along[facing] / search.noise).astype(np.int64)
            held = np.bincount(bins - bins.min(), weights=length[facing])
            weight = np.convolve(held, [1.0, 1.0, 1.0])[1:-1]  # a plane between two bins is one plane
            for b in np.argsort(-weight, kind="stable")[:30]:
                if (k, sign, int(b + bins.min())) not in skip:
                    if weight[b] > search.smallest and (best is None or weight[b] > best[0]):
                        best = (float(weight[b]), k, sign, int(b + bins.min()))
                    break
    if best is None:
        return None
    _, k, sign, row = best
    along = triangles.mean(axis=1) @ axes[:, k]
    near = np.abs(along - (row + 0.5) * search.noise) < 2 * search.noise
    front = near & (sign * (normal @ axes[:, k]) > _FACING * length)
    offset = sign * float(np.average(along[front], weights=length[front]))
    across = [axes[:, (k + 1) % 3], axes[:, (k + 2) % 3]][::sign]  # right-handed for either side
    frame = np.stack([*across, sign * axes[:, k]], axis=1)
    return _Plane(frame, offset, (k, sign, row))


def _cover(triangles: Array, plane: _Plane, search: BoardSearch) -> list[Slab]:
    """Boards behind the surface that lies in a plane and faces its way."""
    local = plane.local(triangles)
    normal = geo.vector_areas(triangles) @ plane.frame
    normal /= np.maximum(np.linalg.norm(normal, axis=1), 1e-300)[:, None]
    depth = local[:, :, 2].mean(axis=1)
    front = local[(normal[:, 2] > _FACING) & (np.abs(depth) < 2 * search.noise)]
    if geo.triangle_areas(front).sum() < search.smallest:
        return []
    points = sample(front, search.cell * 0.7)
    origin = points[:, :2].min(axis=0)
    index = np.floor((points[:, :2] - origin) / search.cell).astype(np.int64)
    grid = np.zeros(index.max(axis=0) + 1, bool)
    grid[index[:, 0], index[:, 1]] = True
    behind = (depth > search.noise) & (depth < search.deepest)
    back = _nearest(local[(normal[:, 2] < -_FACING) & behind], origin, grid.shape, search.cell)
    again = (normal[:, 2] > _FACING) & behind & (depth > 2.5 * search.noise)
    hidden = _nearest(local[again], origin, grid.shape, search.cell)
    thick = np.where(back < hidden, back, np.inf)  # behind another front there is another board
    edges = local[np.abs(normal[:, 2]) < 0.5], normal[np.abs(normal[:, 2]) < 0.5]
    boards = []
    for i0, i1, j0, j1 in _rectangles(grid, thick, search):
        inside = geo.every((index >= (i0, j0)) & (index < (i1, j1)))
        if not inside.any():  # where large gaps were closed
            continue
        low, high = np.quantile(points[inside], 0.005, axis=0), np.quantile(points[inside], 0.995, axis=0)
        seen = thick[i0:i1, j0:j1][np.isfinite(thick[i0:i1, j0:j1]) & grid[i0:i1, j0:j1]]
        source: Literal["seen", "edge", "table"] = "seen"
        if len(seen) > _ENOUGH * (i1 - i0) * (j1 - j0):
            far = float(np.median(seen))
        else:
            rim = _edge_depth(*edges, low, high, search)
            source, far = ("edge", rim) if rim is not None else ("table", search.thickness)
        low[2] = float(np.median(points[inside, 2]))
        high[2] = low[2] + max(_THINNEST, far - low[2] if source == "seen" else far)
        if np.all((high - low)[:2] > search.narrowest):
            middle = (low + high) / 2
            middle[2] = plane.offset - middle[2]
            boards.append(Slab(Box(geo.make_pose(plane.frame, plane.frame @ middle), high - low), source))
    return boards


def _nearest(local: Array, origin: Array, shape: tuple[int, ...], cell: float) -> Array:
    """For each grid cell how far behind the plane the first triangle of (n, 3, 3) lies; inf without."""
    out = np.full(shape, np.inf)
    points = sample(local, cell * 0.7)
    index = np.floor((points[:, :2] - origin) / cell).astype(np.int64)
    inside = geo.every((index >= 0) & (index < shape))
    np.minimum.at(out, (index[inside, 0], index[inside, 1]), points[inside, 2])
    return out


def _edge_depth(local: Array, normal: Array, low: Array, high: Array, search: BoardSearch) -> float | None:
    """How far (m) a rectangle's edges run back from its front, from triangles across it (n, 3, 3), or None.

    An edge faces outward at the rectangle's border. What runs back further than a board is thick is a wall,
    and further than the rectangle is wide a board seen from its narrow side.
    """
    middle = local.mean(axis=1)
    found = []
    for k in (0, 1):
        for sign, border in ((-1.0, low[k]), (1.0, high[k])):
            at = (sign * normal[:, k] > 0.7) & (np.abs(middle[:, k] - border) < 4 * search.noise)
            at &= (middle[:, 1 - k] > low[1 - k]) & (middle[:, 1 - k] < high[1 - k])
            at &= middle[:, 2] > -search.noise
            count = max(1, int((high[1 - k] - low[1 - k]) / (2 * search.cell)))
            row = ((middle[at, 1 - k] - low[1 - k]) / (high[1 - k] - low[1 - k]) * count).astype(np.int64)
            reach = np.zeros(count)
            np.maximum.at(reach, np.clip(row, 0, count - 1), middle[at, 2])
            seen = reach[reach > 2 * search.noise]
            if len(seen) >= _EDGE * count:
                found.append(seen)
    depth = float(np.median(np.concatenate(found))) if found else np.inf
    return depth if depth <= min(search.deepest, *(high - low)[:2]) else None


def _rectangles(
    grid: NDArray[np.bool_], thick: Array, search: BoardSearch
) -> list[tuple[int, int, int, int]]:
    """Cover true cells with rectangles i0, i1, j0, j1 mostly true and of even thickness (inf: unknown).

    One that is not is split by the line that saves most area; if thickness is the fault, where that changes.
    """
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
        part, depth = grid[i0:i1, j0:j1], np.where(grid[i0:i1, j0:j1], thick[i0:i1, j0:j1], np.inf)
        if part.mean() < search.fill:
            (along_i, cost_i), (along_j, cost_j) = _best_line(part), _best_line(part.T)
        elif _unevenness(depth, search) > _ENOUGH * part.size:
            (along_i, cost_i), (along_j, cost_j) = _step_line(depth, search), _step_line(depth.T, search)
        else:
            out.append((i0, i1, j0, j1))
            continue
        if not np.isfinite(min(cost_i, cost_j)):
            out.append((i0, i1, j0, j1))
        elif cost_i <= cost_j:
            todo += [(i0, i0 + along_i, j0, j1), (i0 + along_i, i1, j0, j1)]
        else:
            todo += [(i0, i1, j0, j0 + along_j), (i0, i1, j0 + along_j, j1)]
    return sorted(out)


def _unevenness(depth: Array, search: BoardSearch) -> float:
    """Number of cells of known depth that are off their median by more than the noise of two sides."""
    known = depth[np.isfinite(depth)]
    return float((np.abs(known - np.median(known)) > 2 * search.noise).sum()) if len(known) else 0.0


def _step_line(depth: Array, search: BoardSearch) -> tuple[int, float]:
    """Row at which to split so that fewest cells are off the median of their half, and their number."""
    lines = np.unique(np.linspace(0, len(depth), 34).astype(int))[1:-1]
    costs = [_unevenness(depth[:n], search) + _unevenness(depth[n:], search) for n in lines]
    return (int(lines[int(np.argmin(costs))]), float(min(costs))) if len(lines) else (0, np.inf)


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
        inside = geo.every(geo.every(np.abs(local) <= box.size / 2 + margin).reshape(-1, 3))
        keep[np.flatnonzero(keep)[inside]] = False
    return triangles[keep]
