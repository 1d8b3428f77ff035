"""A surface as even points in a frame of furniture: side, up, out. Flat layers of it, and where these end."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from twin import geometry as geo
from twin.collision.solid import spread
from twin.geometry import Array
from twin.scene import Mesh

SIDE, UP, OUT = 0, 1, 2
PER_M2 = 60_000  # points: one every 4 mm, the voxel of a fused part
MOST = 240_000  # points of one surface
# noisy faces still belong to their plane, as twin.collision.boards has it
FACING = float(np.cos(np.radians(25.0)))
_BIN = 0.002  # m, half of what a fused surface scatters
_SMOOTH = 5  # bins that one layer of noise fills
_CELL = 0.006  # m, side of the grid in which a layer's outline is found
_ROW = 0.5  # share of a long row that a row must have to tell where the outline runs
Mask = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Cloud:
    """Points (n, 3) and unit normals (n, 3) of a surface in a local frame, each standing for `area` m^2."""

    points: Array
    normals: Array
    area: float

    @staticmethod
    def of(mesh: Mesh, T_world_frame: Array) -> Cloud:
        """Points spread evenly over a mesh; the same every time."""
        total = mesh.area
        if not total > 0:
            return Cloud(np.zeros((0, 3)), np.zeros((0, 3)), 0.0)
        count = min(MOST, max(200.0, PER_M2 * total))
        points, normals = spread(mesh.vertices[mesh.faces], count)
        local = geo.transform(geo.invert_pose(T_world_frame), points)
        return Cloud(local, normals @ T_world_frame[:3, :3], total / len(points))

    def __len__(self) -> int:
        return len(self.points)

    def where(self, keep: Mask) -> Cloud:
        """Some of the points."""
        return Cloud(self.points[keep], self.normals[keep], self.area)

    def facing(self, axis: int, sign: int) -> Mask:
        """Which points (n,) face along an axis."""
        return np.asarray(sign * self.normals[:, axis] > FACING)

    def within(self, low: Array, high: Array) -> Mask:
        """Which points (n,) lie in a box of the frame, from corner low (3,) to high (3,)."""
        return geo.every((self.points >= low) & (self.points <= high))

    @property
    def size(self) -> float:
        """m^2."""
        return self.area * len(self.points)


@dataclass(frozen=True, eq=False)
class Layer:
    """Flat surface that faces along `sign` times `axis` at `offset` (m): points, and axes (u, v) in plane."""

    axis: int
    sign: int
    offset: float
    cloud: Cloud

    @property
    def across(self) -> tuple[int, int]:
        """The two axes in the plane, side before up before out."""
        u, v = (k for k in (SIDE, UP, OUT) if k != self.axis)
        return u, v


def layers(cloud: Cloud, axis: int, sign: int, least: float, reach: float = 0.006) -> list[Layer]:
    """Flat layers of a surface along an axis with at least `least` m^2 each, the largest first.

    reach: m within which points belong to a layer.
    """
    facing = cloud.where(cloud.facing(axis, sign))
    found: list[Layer] = []
    left = facing
    while left.size >= least:
        at = left.points[:, axis]
        bins = np.arange(at.min() - _SMOOTH * _BIN, at.max() + (_SMOOTH + 1) * _BIN, _BIN)
        filled = np.convolve(np.histogram(at, bins)[0], np.ones(_SMOOTH), mode="same")
        k = int(np.argmax(filled))
        offset = float(bins[k] + _BIN / 2)
        offset = float(np.median(at[np.abs(at - offset) < reach]))
        near = np.abs(at - offset) < reach
        own = left.where(near)
        if own.size < least or not near.any():
            break
        found.append(Layer(axis, sign, offset, own))
        left = left.where(~near)
    return found


def outline(points: Array, share: float = _ROW) -> Array | None:
    """Low and high corner (2, 2) of the rectangle that points (n, 2) of a flat surface fill, or None.

    The middle row of a grid says where the surface begins and ends: ragged borders and holes move nothing.
    """
    if len(points) < 10:
        return None
    origin = points.min(axis=0)
    cell = np.floor((points - origin) / _CELL).astype(np.int64)
    corners = np.empty((2, 2))
    for k in (0, 1):
        row = cell[:, 1 - k]
        order = np.argsort(row, kind="stable")
        starts = np.flatnonzero(np.diff(row[order], prepend=-1))
        along = points[order, k]
        low, high = np.minimum.reduceat(along, starts), np.maximum.reduceat(along, starts)
        length = high - low
        long = length >= share * np.quantile(length, 0.9)
        corners[0, k], corners[1, k] = np.median(low[long]), np.median(high[long])
    return corners if np.all(corners[1] > corners[0]) else None


def filled_share(points: Array, corners: Array) -> float:
    """Share of a rectangle (2, 2) that points (n, 2) fill, by cells of a grid."""
    cells = np.maximum(np.ceil((corners[1] - corners[0]) / _CELL), 1).astype(np.int64)
    at = np.floor((points - corners[0]) / _CELL).astype(np.int64)
    at = at[geo.every((at >= 0) & (at < cells))]
    return len(np.unique(at[:, 0] * cells[1] + at[:, 1])) / float(cells.prod())
