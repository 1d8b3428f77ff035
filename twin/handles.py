"""What stands off a flat face, as a bar or knob: the finder of handles of reconstruction, robots, simulation.

A face is the outermost layer along a direction that is filled with surface; what stands off it, is connected
and not so tall that it is the part itself may be held. Whom it is near to (a hand, a contact, nobody) is for
the caller to say. Lengths were chosen by us and measured on the recordings of benchmarks/reconstruct.md.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from twin import geometry as geo
from twin.geometry import Array
from twin.robust import mad_sigma
from twin.voxels import voxel_keys, voxel_pieces

STANDS_OFF = 0.012  # m; what stands off less is noise or moulding; about half of a slim bar's clearance
TALLEST = 0.13  # m; no handle stands off more; less than a hand reaches around it
CELL = 0.012  # m; surface points closer than this are one piece, above the voxel of a fused mesh
CONE = float(np.cos(np.radians(20.0)))  # between normals of one flat face, noise included
_ELONGATED = 1.6  # length over width from which a handle is a bar
_LAYER = 0.005  # m, thickness of a layer, the voxel of a fused part
_FILLED = 0.3  # share of the fullest layer that makes the outermost one a face: doubled fronts, inner walls


@dataclass(frozen=True, eq=False)
class Face:
    """A flat face: unit normal (3,) out of the part, normal @ x == offset, points (n, 3), noise (m)."""

    normal: Array
    offset: float
    points: Array
    noise: float

    def height(self, points: Array) -> Array:
        """Height (n,) m of points (n, 3) before the face."""
        return np.asarray(points @ self.normal - self.offset)

    @property
    def skin(self) -> float:
        """m within which points are on the face or its noise."""
        return max(STANDS_OFF, 3.0 * self.noise)

    def stands_off(self, points: Array) -> NDArray[np.bool_]:
        """Which points (n, 3) lie before the face and its noise."""
        return np.asarray(self.height(points) > self.skin)

    def low_enough(self, piece: Array) -> bool:
        """Whether a piece (n, 3) can be a handle: what rises farther is the part itself, seen from a narrow
        face such as a door's edge, or a wall of it."""
        return bool(self.height(piece).max() < TALLEST)

    def outer_half(self, piece: Array) -> tuple[Array, float]:
        """The outer half (m, 3) of a piece, without the posts of a bar, and how far (m) the piece reaches."""
        height = self.height(piece)
        top = float(np.quantile(height, 0.97))
        return piece[height > 0.5 * top], top


def outermost_face(flat: Array, normal: Array, one_sided: bool = False) -> Face:
    """The outermost well-filled layer of points (n, 3) along a normal, its plane fitted.

    Args:
        one_sided: all points are of surface that faces the normal. Then the fullest layer within four is the
            face and its noise is seen out to four layers, as 5 mm of it ask for; otherwise the back of a thin
            panel may lie there.
    """
    behind, wide = (4, 4) if one_sided else (1, 2)
    height = flat @ normal
    bins = np.arange(height.min() - _LAYER, height.max() + 2 * _LAYER, _LAYER)
    filled = np.convolve(np.histogram(height, bins)[0], np.ones(3), mode="same")
    k = int(np.flatnonzero(filled >= _FILLED * filled.max())[-1])
    peak = max(range(max(k - behind, 0), k + 1), key=lambda i: filled[i])
    offset = float(bins[peak] + 0.5 * _LAYER)
    for _ in range(3):
        near = np.abs(flat @ normal - offset) < 2 * _LAYER
        centre = flat[near].mean(axis=0)
        _, vectors = np.linalg.eigh(np.cov((flat[near] - centre).T))
        fitted = vectors[:, 0] * np.sign(vectors[:, 0] @ normal)
        if fitted @ normal > CONE:
            normal = fitted
        offset = float(np.median(flat[near] @ normal))
    height = np.abs(flat @ normal - offset)
    return Face(normal, offset, flat[height < 2 * _LAYER], mad_sigma(height[height < wide * _LAYER]))


@dataclass(frozen=True, eq=False)
class Pieces:
    """Points in voxels of CELL. cell: (n,) the voxel of each point. middle: (c, 3) mean point of each voxel.
    piece: (c,) which connected piece the voxel is in."""

    cell: NDArray[np.intp]
    middle: Array
    piece: NDArray[np.intp]

    @property
    def of_points(self) -> NDArray[np.intp]:
        """The piece (n,) of each point."""
        return self.piece[self.cell]


def pieces_of(points: Array) -> Pieces:
    """The connected pieces of points (n, 3), n > 0."""
    keys, cell = np.unique(voxel_keys(points.astype(np.float32), CELL), return_inverse=True)
    middle = np.stack([np.bincount(cell, c) / np.bincount(cell) for c in points.T], axis=1)
    return Pieces(cell, middle, voxel_pieces(keys))


def split(points: Array) -> list[Array]:
    """The points (m, 3) of each connected piece of points (n, 3), those of the first point first."""
    if not len(points):
        return []
    of = pieces_of(points).of_points
    order = np.argsort(of, kind="stable")
    return np.split(points[order], np.flatnonzero(np.diff(of[order])) + 1)


def long_side(points: Array, normal: Array, outliers: float = 0.02) -> tuple[Array, float, float]:
    """Direction (3,) across the normal in which points (n, 3) reach farthest, their length and width (m).

    Of both ends of either the share `outliers` is left out.
    """
    flat = points - np.outer(points @ normal, normal)
    _, vectors = np.linalg.eigh(np.cov(flat.T))
    along = geo.unit(vectors[:, 2] - normal * (vectors[:, 2] @ normal))
    length, width = (
        float(np.ptp(np.quantile(points @ d, [outliers, 1 - outliers])))
        for d in (along, np.cross(along, normal))
    )
    return along, length, width


def is_bar(length: float, width: float) -> bool:
    """Whether what is so long and wide is held across, as a bar, or any way round, as a knob."""
    return length > _ELONGATED * width


def upright(normal: Array, hinge: Array | None = None) -> Array:
    """Direction (3,) across a normal along which a hand holds a knob: the hinge's axis, else upright."""
    options = [] if hinge is None else [hinge]
    for option in (*options, np.array([0.0, 0.0, 1.0]), np.array([1.0, 0.0, 0.0])):
        flat = option - (option @ normal) * normal
        if np.linalg.norm(flat) > 0.5:
            return geo.unit(flat)
    return geo.orthogonal_basis(normal)[:, 0]


def frame_of(along: Array, normal: Array) -> Array:
    """Columns (3, 3) as a contact has them: closing direction, along the handle, out of the part."""
    return np.stack([np.cross(along, normal), along, normal], axis=1)
