"""A sparse truncated signed distance field: 8x8x8 blocks of voxels, found through a dense index of blocks."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import islice
from typing import NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

from recon.dense.depth import F32, pixel_sigma
from recon.fusion.observation import Observation
from twin.errors import ReconstructionError
from twin.geometry import Array
from twin.runs.threads import each

BLOCK = 8
_AT_ONCE = 64  # frames in memory, 200 MB of 640x480
_CHUNK = 512  # blocks of a thread's task, for each of which all frames are averaged in turn
_MAX_INDEX = 64_000_000  # blocks in the dense index, 256 MB; a hall of 30 m at 1 cm has fewer
_MAX_WEIGHT = 1000.0


@dataclass(eq=False)
class Field:
    """Signed distances in units of the truncation, positive outside.

    origin: (3,) m, corner of the index. voxel: m. index: (X, Y, Z) block number, -1 where empty. blocks: (n,
    3) place in the index. distance, weight: (n, 8, 8, 8).
    """

    origin: Array
    voxel: float
    index: NDArray[np.int32]
    blocks: NDArray[np.int32]
    distance: F32
    weight: F32


def allocate(low: Array, high: Array, clouds: Iterable[Array], voxel: float, margin: float) -> Field:
    """An empty field with every block that comes within `margin` m of a point.

    low, high: corners (3,) m of the box around all points. clouds: the points, (n, 3) each.
    """
    edge = BLOCK * voxel
    low = low - margin - edge
    size = np.ceil((high + margin + edge - low) / edge).astype(np.int64) + 1
    if np.prod(size) > _MAX_INDEX:
        raise ReconstructionError(
            f"the scene spans {np.round(size * edge, 1).tolist()} m, too much for voxels of {voxel} m",
            "raise the voxel size or lower the greatest depth",
        )
    touched = np.zeros(size, bool)
    for points in clouds:
        _touch(touched, points, low, margin, edge)
    blocks = np.ascontiguousarray(np.argwhere(touched), np.int32)
    index = np.full(size, -1, np.int32)
    index[touched] = np.arange(len(blocks), dtype=np.int32)
    shape = (len(blocks), BLOCK, BLOCK, BLOCK)
    return Field(low, voxel, index, blocks, np.zeros(shape, np.float32), np.zeros(shape, np.float32))


@numba.njit(cache=True, nogil=True)
def _touch(touched: NDArray[np.bool_], points: Array, low: Array, margin: float, edge: float) -> None:
    """Mark the blocks that hold a corner of the cube of +-margin about a point (n, 3)."""
    for n in range(len(points)):
        x0, x1 = int((points[n, 0] - margin - low[0]) / edge), int((points[n, 0] + margin - low[0]) / edge)
        y0, y1 = int((points[n, 1] - margin - low[1]) / edge), int((points[n, 1] + margin - low[1]) / edge)
        z0, z1 = int((points[n, 2] - margin - low[2]) / edge), int((points[n, 2] + margin - low[2]) / edge)
        for x in (x0, x1):
            for y in (y0, y1):
                touched[x, y, z0] = touched[x, y, z1] = True


def integrate(
    field: Field, seen: Iterable[Observation], truncation: float, carve_weight: float, noise: F32
) -> None:
    """Average frames into the field (Curless and Levoy 1996), with distances taken along the surface normal.

    noise (2,): curve of depth noise (`recon.dense.depth.pixel_sigma`).
    """
    left = iter(seen)
    while views := [
        _View(o.depth, o.own, o.cosine, o.camera.vector, np.ascontiguousarray(o.T_cam_body))
        for o in islice(left, _AT_ONCE)
    ]:
        _average(field, views, truncation, carve_weight, noise)


def _average(
    field: Field, views: Sequence[_View], truncation: float, carve_weight: float, noise: F32
) -> None:
    def some(blocks: slice) -> None:
        for view in views:
            _integrate(
                field.origin, field.voxel, field.blocks[blocks], field.distance[blocks], field.weight[blocks],
                view, truncation, carve_weight, noise,
            )  # fmt: skip

    starts = range(0, len(field.blocks), _CHUNK)
    for _ in each(some, [slice(k, k + _CHUNK) for k in starts]):
        pass


class _View(NamedTuple):
    """An `Observation` as the compiled code takes it."""

    depth: F32
    own: NDArray[np.bool_]
    cosine: F32
    camera: Array
    T: Array


@numba.njit(cache=True, nogil=True)
def _integrate(
    origin: Array, voxel: float, blocks: NDArray[np.int32], distance: F32, weight: F32, view: _View,
    truncation: float, carve_weight: float, noise: F32,
) -> None:  # fmt: skip
    depth, own, cosine, camera, T = view
    h, w = depth.shape
    fx, fy, cx, cy = camera[0], camera[1], camera[2], camera[3]
    half, radius = 0.5 * BLOCK * voxel, BLOCK * voxel * 0.87  # of a block: half its side, and its diagonal
    for n in range(blocks.shape[0]):
        bx = origin[0] + blocks[n, 0] * BLOCK * voxel
        by = origin[1] + blocks[n, 1] * BLOCK * voxel
        bz = origin[2] + blocks[n, 2] * BLOCK * voxel
        mx, my, mz = bx + half, by + half, bz + half
        qz = T[2, 0] * mx + T[2, 1] * my + T[2, 2] * mz + T[2, 3]
        u = (T[0, 0] * mx + T[0, 1] * my + T[0, 2] * mz + T[0, 3]) / max(qz, radius) * fx + cx
        v = (T[1, 0] * mx + T[1, 1] * my + T[1, 2] * mz + T[1, 3]) / max(qz, radius) * fy + cy
        reach = radius / (max(qz, radius) - 0.99 * radius) * max(fx, fy)
        if qz < radius or u < -reach or v < -reach or u > w + reach or v > h + reach:
            continue
        for i in range(BLOCK):
            for j in range(BLOCK):
                x, y = bx + (i + 0.5) * voxel, by + (j + 0.5) * voxel
                for k in range(BLOCK):
                    z = bz + (k + 0.5) * voxel
                    pz = T[2, 0] * x + T[2, 1] * y + T[2, 2] * z + T[2, 3]
                    if pz < 0.05:
                        continue
                    u = (T[0, 0] * x + T[0, 1] * y + T[0, 2] * z + T[0, 3]) / pz * fx + cx
                    v = (T[1, 0] * x + T[1, 1] * y + T[1, 2] * z + T[1, 3]) / pz * fy + cy
                    if u < 0 or v < 0 or u > w - 1 or v > h - 1:
                        continue
                    a, b = int(u + 0.5), int(v + 0.5)
                    zo = depth[b, a]
                    if zo <= 0:
                        continue
                    gap = (zo - pz) * cosine[b, a]
                    if own[b, a]:
                        if gap < -truncation:
                            continue
                        sigma = pixel_sigma(zo, noise)
                        gain = max(cosine[b, a], 0.05) * 1e-5 / (sigma * sigma)
                        d = min(gap / truncation, 1.0)
                    elif gap > truncation:
                        gain, d = carve_weight * 1e-5 / pixel_sigma(zo, noise) ** 2, 1.0
                    else:
                        continue
                    old = weight[n, i, j, k]
                    distance[n, i, j, k] = (distance[n, i, j, k] * old + d * gain) / (old + gain)
                    weight[n, i, j, k] = min(old + gain, _MAX_WEIGHT)


@numba.njit(cache=True, nogil=True)
def ray_cosine(depth: F32, camera: Array, reach: int, noise: F32) -> F32:
    """Cosine (h, w) of the angle between each pixel's ray and the surface normal, 0 where no plane is found.

    Slopes are central differences over `reach` px of inverse depth, which is linear over an image of a plane,
    each end averaged across three rows or columns. Ends on another surface are left out.
    """
    h, w = depth.shape
    fx, fy, cx, cy = camera[0], camera[1], camera[2], camera[3]
    out = np.zeros((h, w), np.float32)
    for y in range(h):
        for x in range(w):
            z = depth[y, x]
            if z <= 0:
                continue
            du, ok_u = _slope(depth, y, x, 0, reach, noise)
            dv, ok_v = _slope(depth, y, x, 1, reach, noise)
            if not (ok_u and ok_v):
                continue
            rx, ry = (x - cx) / fx, (y - cy) / fy
            # inverse depth of the plane n.p = 1 is n_x (x-cx)/fx + n_y (y-cy)/fy + n_z
            nx, ny = du * fx, dv * fy
            nz = 1.0 / z - nx * rx - ny * ry
            norm = np.sqrt((nx * nx + ny * ny + nz * nz) * (rx * rx + ry * ry + 1.0))
            out[y, x] = min((1.0 / z) / norm, 1.0)
    return out


@numba.njit(cache=True, nogil=True)
def _slope(depth: F32, y: int, x: int, direction: int, reach: int, noise: F32) -> tuple[float, bool]:
    z = depth[y, x]
    before, count_before = _end(depth, y, x, direction, -reach, noise)
    after, count_after = _end(depth, y, x, direction, reach, noise)
    if count_before > 0 and count_after > 0:
        return (after / count_after - before / count_before) / (2.0 * reach), True
    if count_before > 0:
        return (1.0 / z - before / count_before) / reach, True
    if count_after > 0:
        return (after / count_after - 1.0 / z) / reach, True
    return 0.0, False


@numba.njit(cache=True, inline="always")
def _end(depth: F32, y: int, x: int, direction: int, step: int, noise: F32) -> tuple[float, float]:
    """Sum and number of the inverse depths of three pixels across, `step` px along, on the same surface."""
    h, w = depth.shape
    z, total, count = depth[y, x], 0.0, 0.0
    for along in range(-1, 2):
        a = x + (step if direction == 0 else along)
        b = y + (along if direction == 0 else step)
        if not (0 <= a < w and 0 <= b < h) or depth[b, a] <= 0:
            continue
        # a plane at 80 degrees changes its depth by about six times its sideways extent
        if abs(depth[b, a] - z) < 0.015 * abs(step) * z + 6.0 * pixel_sigma(z, noise):
            total += 1.0 / depth[b, a]
            count += 1.0
    return total, count


def surface(field: Field, min_weight: float) -> tuple[Array, NDArray[np.int32]]:
    """Zero level as vertices (v, 3) in field coordinates and faces (f, 3) (chunked marching cubes)."""
    from skimage.measure import marching_cubes

    chunk = 8
    vertices, faces, count = [], [], 0
    places = np.unique(field.blocks // chunk, axis=0)
    for place in places:
        dense, valid = _dense(field, place * chunk, chunk + 1, min_weight)
        edge = slice(0, chunk * BLOCK + 1)
        dense = dense[edge, edge, edge]
        valid = valid[edge, edge, edge]
        cells = valid[:-1, :-1, :-1].copy()
        for i, j, k in np.ndindex(2, 2, 2):
            n = chunk * BLOCK
            cells &= valid[i : i + n, j : j + n, k : k + n]
        inner = dense[:-1, :-1, :-1][cells]
        if not len(inner) or not (dense[valid].min() < 0 < dense[valid].max()):
            continue
        mask = np.zeros(dense.shape, bool)
        mask[1:, 1:, 1:] = cells
        try:
            v, f, _, _ = marching_cubes(dense, 0.0, mask=mask)
        except (RuntimeError, ValueError):  # no cell of the mask holds the level
            continue
        vertices.append(v + place * chunk * BLOCK)
        faces.append(f + count)
        count += len(v)
    if not vertices:
        return np.zeros((0, 3)), np.zeros((0, 3), np.int32)
    return _weld(field.origin, field.voxel, np.concatenate(vertices), np.concatenate(faces))


def _dense(
    field: Field, start: NDArray[np.int64], blocks: int, min_weight: float
) -> tuple[F32, NDArray[np.bool_]]:
    """Distances of a cube of blocks and where they are known."""
    n = blocks * BLOCK
    dense, valid = np.ones((n, n, n), np.float32), np.zeros((n, n, n), bool)
    stop = np.minimum(start + blocks, field.index.shape)
    part = field.index[start[0] : stop[0], start[1] : stop[1], start[2] : stop[2]]
    for at in np.argwhere(part >= 0):
        b = part[tuple(at)]
        where = tuple(slice(c * BLOCK, (c + 1) * BLOCK) for c in at)
        dense[where] = field.distance[b]
        valid[where] = field.weight[b] >= min_weight
    return dense, valid


def _weld(
    origin: Array, voxel: float, grid: Array, faces: NDArray[np.int64]
) -> tuple[Array, NDArray[np.int32]]:
    """Join the vertices that chunks share, drop faces that collapse."""
    keys = np.round(grid * 1024).astype(np.int64)
    _, first, inverse = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    f = inverse.reshape(-1)[faces].astype(np.int32)
    f = f[(f[:, 0] != f[:, 1]) & (f[:, 1] != f[:, 2]) & (f[:, 0] != f[:, 2])]
    return origin + (grid[first].astype(np.float64) + 0.5) * voxel, f
