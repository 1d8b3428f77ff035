"""Charts: a mesh cut into nearly flat pieces, each projected onto its own plane, packed into one square.

A chart grows over neighbouring faces that turn no more than `MAX_TURN` from its first face, the largest that
is left: decimation leaves the largest faces where a surface is flat. Where two sheets of one chart would lie
on the same texel, the one behind gets a chart of its own. xatlas packs them (Young 2018,
https://github.com/jpcy/xatlas); its own cutting takes 18 s for 60,000 faces, this one tenths of a second.
"""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np
from numpy.typing import NDArray

from recon.texture.raster import within
from twin import geometry as geo
from twin.geometry import Array
from twin.mesh import edges
from twin.scene import Mesh

# Chosen by us and the same for every mesh.
MAX_TURN = float(np.cos(np.deg2rad(50.0)))  # a texel stretches by no more than 1 / cos = 1.6 along a chart
# for crumbs, which would cost more border than they have area
MAX_TURN_SMALL = float(np.cos(np.deg2rad(72.0)))
TURNED = 0.05  # share of a chart's area that may turn farther from it than its texels are made for
CRUMB = 12  # faces: a chart of fewer joins one beside it where it can
ROUNDS = 4  # of cutting sheets apart; what still lies on another then gets a chart a face
PADDING = 8  # texels between two charts, so that each has four of its own around it
_TILE = 2  # texels a side, in whole numbers of which charts are packed: 4 times fewer places to try
# texels a cell, in which sheets are told apart
_CELL = 2.0
# cells that a centre lies within two faces, from which on it is on both
_INSIDE = 0.1
_ROW = 8192.0  # texels: charts stand in rows of so many before they are packed

I32 = NDArray[np.int32]


@dataclass(frozen=True, eq=False)
class Layout:
    """Where the faces of a mesh lie in its texture: `uv` (F, 3, 2) in texels, v up, of an image of `size` =
    (height, width) texels; `stretch` (F,): metres a texel on the face, along the direction in which it is
    squeezed most, over what was asked for."""

    uv: Array
    size: tuple[int, int]
    stretch: Array


def lay_out(mesh: Mesh, texel: Array) -> Layout:
    """Charts of a mesh and their places.

    Args:
        mesh: at least one face.
        texel: (F,) m, size of a texel wanted on each face; faces of one chart take that of its first.
    """
    corners = mesh.vertices[mesh.faces]
    normals, area = geo.triangle_normals(corners)
    charts, first = _cut(corners, normals, area, texel, _neighbours(mesh.faces))
    turn = np.clip(np.einsum("ij,ij->i", normals, normals[first][charts]), MAX_TURN_SMALL, 1.0)
    finer = _low_turn(turn, area, charts)
    flat = _on_planes(corners, normals[first], charts) / (texel[first] * finer)[charts][:, None, None]
    uv, size = _packed(flat, mesh.faces, charts)
    return Layout(uv, size, finer[charts] / turn)


def _low_turn(turn: Array, area: Array, charts: I32) -> Array:
    """The cosine (C,) that all but `TURNED` of a chart's area exceeds: so much finer are its texels."""
    order = np.lexsort((turn, charts))
    last = np.flatnonzero(np.diff(charts[order], append=-1))
    total = np.cumsum(area[order])
    before = np.concatenate([[0.0], total[last][:-1]])
    at = np.searchsorted(total, before + TURNED * (total[last] - before))
    return np.asarray(turn[order][np.minimum(at, last)])


def _neighbours(faces: NDArray[np.int32]) -> I32:
    """(F, 3): the face across each edge, -1 where there is none or more than one."""
    ends = edges(faces)
    key = ends[:, 0] * (int(faces.max()) + 1) + ends[:, 1]
    order = np.argsort(key, kind="stable")
    same = np.diff(key[order]) == 0
    alone = np.ones(len(order), dtype=bool)  # no third edge before or after the pair
    alone[1:-1] = ~(same[:-1] & same[1:])
    pair = np.flatnonzero(same & alone[:-1] & alone[1:])
    out = np.full(len(key), -1, np.int32)
    a, b = order[pair], order[pair + 1]
    out[a], out[b] = b // 3, a // 3
    return out.reshape(-1, 3)


def _cut(
    corners: Array, normals: Array, area: Array, texel: Array, beside: I32
) -> tuple[I32, NDArray[np.int64]]:
    """The chart (F,) of each face, and the first face (C,) of each chart."""
    seeds = np.argsort(-area, kind="stable").astype(np.int32)
    chart = np.full(len(area), -1, np.int32)
    first = np.zeros(0, np.int32)
    for k in range(ROUNDS + 1):
        for turn in (MAX_TURN, MAX_TURN_SMALL) if k < ROUNDS else (2.0,):  # the last: charts of a face
            first = np.concatenate([first, _grow(chart, seeds, beside, normals, texel, turn, len(first))])
            if turn == MAX_TURN:
                chart[np.bincount(chart, minlength=len(first))[chart] < CRUMB] = -1
        _join_crumbs(chart, first, beside, normals, texel)
        flat = _on_planes(corners, normals[first], chart) / texel[first][chart][:, None, None]
        if k < ROUNDS and not _drop_sheets(chart, flat, _height(corners, normals[first], chart)):
            break
    used, number = np.unique(chart, return_inverse=True)
    return number.astype(np.int32), first[used].astype(np.int64)


@numba.njit(cache=True, nogil=True)
def _grow(
    chart: I32, seeds: I32, beside: I32, normals: Array, texel: Array, turn: float, count: int
) -> I32:  # pragma: no cover - compiled
    """Give every face without a chart one, numbered from `count` on; the first face of each new one."""
    first = np.empty(len(seeds), np.int32)
    queue = np.empty(len(seeds), np.int32)
    new = 0
    for seed in seeds:
        if chart[seed] >= 0:
            continue
        first[new] = seed
        chart[seed] = count + new
        queue[0] = seed
        head, tail = 0, 1
        while head < tail:
            face = queue[head]
            head += 1
            for e in range(3):
                other = beside[face, e]
                if other < 0 or chart[other] >= 0 or texel[other] != texel[seed]:
                    continue
                if np.dot(normals[other], normals[seed]) > turn:
                    chart[other] = count + new
                    queue[tail] = other
                    tail += 1
        new += 1
    return first[:new]


@numba.njit(cache=True, nogil=True)
def _join_crumbs(
    chart: I32, first: I32, beside: I32, normals: Array, texel: Array
) -> None:  # pragma: no cover - compiled
    """Faces of charts with few faces join a larger one beside them that they do not turn away from."""
    size = np.zeros(len(first), np.int64)
    for c in chart:
        size[c] += 1
    crumb = size < CRUMB
    for _ in range(3):
        for face in range(len(chart)):
            if not crumb[chart[face]]:
                continue
            best, most = -1, MAX_TURN_SMALL
            for e in range(3):
                other = beside[face, e]
                if other < 0 or crumb[chart[other]]:
                    continue
                seed = first[chart[other]]
                turn = np.dot(normals[face], normals[seed])
                if turn > most and texel[face] == texel[seed]:
                    best, most = chart[other], turn
            if best >= 0:
                chart[face] = best


def _axes(normals: Array) -> tuple[Array, Array]:
    """Two unit vectors (C, 3) across each normal, the second as upright as can be."""
    up = np.where(np.abs(normals[:, 2:]) < 0.9, [[0.0, 0.0, 1.0]], [[0.0, 1.0, 0.0]])
    right = np.cross(up, normals)
    right /= np.linalg.norm(right, axis=1, keepdims=True)
    return right, np.cross(normals, right)


def _on_planes(corners: Array, normals: Array, chart: I32) -> Array:
    """Corners (F, 3, 2) m of the faces on the planes of their charts, whose normals are (C, 3)."""
    right, up = (a[chart] for a in _axes(normals))
    return np.stack([np.einsum("fkd,fd->fk", corners, right), np.einsum("fkd,fd->fk", corners, up)], axis=-1)


def _height(corners: Array, normals: Array, chart: I32) -> Array:
    """How far (F,) the middle of each face stands out of its chart, m."""
    return np.asarray(np.einsum("fd,fd->f", corners.mean(axis=1), normals[chart]))


def _boxes(flat: Array, chart: I32) -> tuple[Array, NDArray[np.int64]]:
    """Lower corner (C, 2) and whole texels (C, 2) of each chart's bounding box."""
    count = int(chart.max()) + 1
    low, high = np.full((count, 2), np.inf), np.full((count, 2), -np.inf)
    np.minimum.at(low, chart, flat.min(axis=1))
    np.maximum.at(high, chart, flat.max(axis=1))
    used = np.isfinite(low)
    low, high = np.where(used, low, 0.0), np.where(used, high, 0.0)
    return low, np.ceil(high - low).astype(np.int64) + 1


def _drop_sheets(chart: I32, flat: Array, height: Array) -> bool:
    """Take faces that lie behind others of their chart out of it (chart -1); whether there were any."""
    flat = flat / _CELL
    low, size = _boxes(flat, chart)
    start = np.concatenate([[0], np.cumsum(size[:, 0] * size[:, 1])])
    front_first = np.lexsort((np.arange(len(chart)), -height))
    behind = _behind(flat - low[chart][:, None], chart, start, np.ascontiguousarray(size[:, 0]), front_first)
    chart[behind] = -1
    return bool(behind.any())


@numba.njit(cache=True, nogil=True)
def _behind(
    flat: Array, chart: I32, start: NDArray[np.int64], width: NDArray[np.int64], order: NDArray[np.int64]
) -> NDArray[np.bool_]:  # pragma: no cover - compiled
    """Faces that hold the centre of a cell which a face before them in `order` holds."""
    taken = np.zeros(start[-1], np.bool_)
    out = np.zeros(len(chart), np.bool_)
    for face in order:
        ax, ay, bx, by, cx, cy = flat[face].ravel()
        first = start[chart[face]]
        across = width[chart[face]]
        for mark in range(2):  # looked at, then taken: a face that has to go takes nothing
            for y in range(int(min(ay, by, cy)), int(max(ay, by, cy)) + 1):
                for x in range(int(min(ax, bx, cx)), int(max(ax, bx, cx)) + 1):
                    if within(ax, ay, bx, by, cx, cy, x + 0.5, y + 0.5) > _INSIDE:
                        cell = first + y * across + x
                        out[face] = out[face] or (mark == 0 and taken[cell])
                        taken[cell] = taken[cell] or mark == 1
            if out[face]:
                break
    return out


def _packed(flat: Array, faces: NDArray[np.int32], chart: I32) -> tuple[Array, tuple[int, int]]:
    """Places (F, 3, 2) of the corners in the image, in texels, and its height and width."""
    import xatlas

    low, size = _boxes(flat, chart)
    end = np.cumsum(size[:, 0] + PADDING)
    row = (end // _ROW).astype(np.int64)
    shift = np.stack([end % _ROW, row * float(size[:, 1].max() + PADDING)], axis=1)
    apart = flat - low[chart][:, None] + shift[chart][:, None]
    corner = np.stack([np.repeat(chart, 3), faces.ravel()], axis=1).astype(np.int64)
    at, index = geo.unique_rows(corner)  # a vertex on two charts has a place on each
    triangles = index.reshape(-1, 3)
    atlas = xatlas.Atlas()
    atlas.add_uv_mesh((apart.reshape(-1, 2)[at] / _TILE).astype(np.float32), triangles.astype(np.uint32))
    options = xatlas.PackOptions()
    options.padding, options.texels_per_unit, options.bilinear = PADDING // _TILE, 1.0, True
    atlas.generate(xatlas.ChartOptions(), options)
    source, _, uv = atlas[0]
    places = np.zeros((len(at), 2))
    places[source] = uv * [_TILE * atlas.width, _TILE * atlas.height]
    return places[triangles], (_TILE * atlas.height, _TILE * atlas.width)
