"""Depth registered to colour: both cameras' pictures on one undistorted pixel grid.

The depth picture is a surface: its pixels are joined to triangles where they lie on one surface, and these
are drawn into the colour camera behind a z-buffer. So a finer grid gets no holes, and nothing is seen through
nearer surfaces. A pixel joined to no neighbour on a side covers its square to half a pixel.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import cv2
import numba
import numpy as np
from numpy.typing import NDArray

from recon.dense.depth import MAX_STEP
from recon.recording import Intrinsics
from recon.recording.rig import Lens, Rig
from twin.errors import InputError
from twin.geometry import Array

F32 = NDArray[np.float32]

# px, chosen by us: a ray that projects further off its pixel has no solution of the lens model
MAX_BEND = 0.5
FARTHEST = 1e6  # px, far off any picture and well within whole numbers
NEAREST = 1e-3  # m before the colour camera, which shows nothing behind it
MIN_SOLVED = 0.1  # of the pixels, chosen by us: a wide lens bends its corners out, never nearly all
_CRITERIA = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 100, 1e-10)


def rays(lens: Lens) -> Array:
    """(H, W, 2): x/z and y/z of each pixel's ray; NaN where the lens model has no solution."""
    k = lens.camera
    pixels = np.stack(np.meshgrid(np.arange(k.width), np.arange(k.height)), axis=-1).astype(np.float64)
    if lens.is_pinhole:
        return np.asarray(k.backproject(pixels, np.ones(pixels.shape[:2]))[..., :2])
    flat, bent = pixels.reshape(-1, 1, 2), np.asarray(lens.distortion)
    found = cv2.undistortPoints(flat, k.matrix, bent, criteria=_CRITERIA).reshape(-1, 2)
    again, _ = cv2.projectPoints(
        np.column_stack([found, np.ones(len(found))]), np.zeros(3), np.zeros(3), k.matrix, bent
    )
    off = np.linalg.norm(again.reshape(-1, 2) - flat[:, 0], axis=1)
    found[~(off < MAX_BEND)] = np.nan  # also where the iteration did not end
    return np.asarray(found.reshape(k.height, k.width, 2), dtype=np.float64)


def moved_lens(image: NDArray[np.uint8], own: Intrinsics, camera: Intrinsics) -> NDArray[np.uint8]:
    """A picture (H, W, 3) of its own focal lengths and centre, as `camera` there takes it; else black."""
    x, y = camera.fx / own.fx, camera.fy / own.fy
    place = np.array([[x, 0.0, camera.cx - x * own.cx], [0.0, y, camera.cy - y * own.cy]])
    return np.asarray(cv2.warpAffine(image, place, (camera.width, camera.height)), dtype=np.uint8)


class ColorGrid:
    """Brings colour pictures (H, W, 3) of a lens to the pixel grid of a pinhole camera in the same place."""

    def __init__(self, lens: Lens, grid: Intrinsics) -> None:
        k = lens.camera
        self._size = (grid.width, grid.height)
        self._scaled = self._size != (k.width, k.height)
        self._maps: tuple[Any, Any] | None = None
        self._seen: NDArray[np.bool_] | None = None
        if not lens.is_pinhole:
            bent = np.asarray(lens.distortion)
            self._maps = cv2.initUndistortRectifyMap(
                k.matrix, bent, np.eye(3), k.matrix, (k.width, k.height), cv2.CV_32FC1
            )
            x, y = self._maps
            inside = (x > -0.5) & (x < k.width - 0.5) & (y > -0.5) & (y < k.height - 0.5)
            whole = cv2.resize(inside.astype(np.float32), self._size, interpolation=cv2.INTER_AREA)
            self._seen = whole > 0.5

    def __call__(self, image: NDArray[np.uint8]) -> NDArray[np.uint8]:
        if self._maps is not None:
            image = np.asarray(cv2.remap(image, *self._maps, cv2.INTER_LINEAR), dtype=np.uint8)
        if self._scaled:
            image = np.asarray(cv2.resize(image, self._size, interpolation=cv2.INTER_AREA), dtype=np.uint8)
        return image

    def where_seen(self, depth: F32) -> F32:
        """Depth (H, W) m on the grid, 0 where the stored colour picture shows nothing."""
        return depth if self._seen is None else np.where(self._seen, depth, np.float32(0.0))


class DepthGrid:
    """Brings a rig's depth pictures (h, w) m to the pixels of a pinhole in the colour camera's place."""

    def __init__(self, rig: Rig, grid: Intrinsics) -> None:
        self._grid = grid
        self._rays = rays(rig.depth)
        share = float(np.mean(~np.isnan(self._rays[..., 0])))
        if share < MIN_SOLVED:
            raise InputError(
                f"the depth camera's distortion {rig.depth.distortion} leaves {share:.0%} of its pixels a ray",
                "give the coefficients in OpenCV's order k1 k2 p1 p2 k3 ...",
            )
        self._T = np.ascontiguousarray(rig.T_color_depth, dtype=np.float64)
        length = np.sqrt(1.0 + (self._rays**2).sum(axis=-1))
        self._along = 1.0 / length if rig.along_ray else np.ones_like(length)

    def __call__(self, depth: F32) -> F32:
        k = self._grid
        z = np.where(np.isnan(self._rays[..., 0]), 0.0, depth * self._along)
        p = self._on_grid(z)
        surface = _Surface.of(z, p[..., 2] > 0.0)
        nearest = np.full((k.height, k.width), np.inf, dtype=np.float32)
        _draw_triangles(p, surface.upper, surface.lower, nearest)
        squares = np.full_like(nearest, np.inf)
        _draw_squares(*surface.squares(p), squares)
        # squares end a surface by half a pixel: they count where nothing is drawn, or before it
        nearest = np.where(squares < nearest * np.float32(1.0 - MAX_STEP), squares, nearest)
        return np.where(np.isfinite(nearest), nearest, np.float32(0.0))

    def _on_grid(self, z: Array) -> Array:
        """(h, w, 3): column and row on the grid and 1/z there of each depth pixel; 1/z = 0 where unknown."""
        k, T = self._grid, self._T
        x, y = self._rays[..., 0] * z, self._rays[..., 1] * z
        cx, cy, cz = (T[i, 0] * x + T[i, 1] * y + T[i, 2] * z + T[i, 3] for i in range(3))
        known = (z > 0.0) & (cz > NEAREST)
        inverse = 1.0 / np.where(known, cz, 1.0)
        column, row = cx * inverse * k.fx + k.cx, cy * inverse * k.fy + k.cy
        known &= np.maximum(np.abs(column), np.abs(row)) < FARTHEST
        return np.stack([np.where(known, column, 0.0), np.where(known, row, 0.0), inverse * known], axis=-1)


class _Surface(NamedTuple):
    """How depth pixels (h, w) are joined.

    right, down: with the next one in the row, in the column (False in the last one). upper, lower: whether
    the upper left, the lower right triangle of the square to the right and below is part of the surface.
    border: known pixels without triangles all round.
    """

    right: NDArray[np.bool_]
    down: NDArray[np.bool_]
    upper: NDArray[np.bool_]
    lower: NDArray[np.bool_]
    border: NDArray[np.bool_]

    @classmethod
    def of(cls, z: Array, known: NDArray[np.bool_]) -> _Surface:
        """z (h, w): depth in m. Neighbours are joined where both are known and lie on one surface."""

        def joined(one: tuple[slice, slice], other: tuple[slice, slice]) -> NDArray[np.bool_]:
            a, b = z[one], z[other]
            near = np.abs(a - b) <= MAX_STEP * np.minimum(a, b)
            return np.asarray(known[one] & known[other] & near)

        all_but_last, all_but_first, whole = slice(None, -1), slice(1, None), slice(None)
        right, down, upper, lower, inner = np.zeros((5, *z.shape), dtype=np.bool_)
        right[:, :-1] = joined((whole, all_but_last), (whole, all_but_first))
        down[:-1] = joined((all_but_last, whole), (all_but_first, whole))
        # the diagonal that both triangles of a square share
        diagonal = joined((all_but_last, all_but_first), (all_but_first, all_but_last))
        upper[:-1, :-1] = diagonal & right[:-1, :-1] & down[:-1, :-1]
        lower[:-1, :-1] = diagonal & right[1:, :-1] & down[:-1, 1:]
        both = upper & lower
        inner[1:, 1:] = upper[1:, 1:] & lower[:-1, :-1] & both[:-1, 1:] & both[1:, :-1]
        return cls(right, down, upper, lower, known & ~inner)

    def squares(self, p: Array) -> tuple[Array, Array, Array]:
        """(n, 3) each, on the grid: the border pixels, and half of the way to the next pixel in the row and
        in the column, by the neighbour after, else the one before, else level and of the usual length."""
        row, column = np.nonzero(self.border)
        steps = []
        for axis, joined in ((1, self.right), (0, self.down)):
            # -1 is the last one, which is never joined
            back = (row, column - 1) if axis else (row - 1, column)
            next_ = (
                (row, np.minimum(column + 1, p.shape[1] - 1))
                if axis
                else (np.minimum(row + 1, p.shape[0] - 1), column)
            )
            usual = np.zeros(3)
            usual[1 - axis] = 0.5 * self._pitch(p, axis)
            after, before = 0.5 * (p[next_] - p[row, column]), 0.5 * (p[row, column] - p[back])
            has_after, has_before = joined[row, column][:, None], joined[back][:, None]
            steps.append(np.where(has_after, after, np.where(has_before, before, usual)))
        return p[row, column], steps[0], steps[1]

    def _pitch(self, p: Array, axis: int) -> float:
        """Median distance on the grid, px, of joined neighbours along an axis; 1 without any."""
        some = (slice(None, -1, 8), slice(None, -1, 8))
        after = p[some[0], 1::8] if axis else p[1::8, some[1]]
        lengths = np.abs(after[..., 1 - axis] - p[some][..., 1 - axis])[
            (self.right if axis else self.down)[some]
        ]
        return float(np.median(lengths)) if len(lengths) else 1.0


@numba.njit(cache=True)
def _triangle(a: Array, b: Array, c: Array, out: F32) -> None:
    """Draw one triangle of (column, row, 1/z), nearest first; 1/z is linear over the picture of a plane."""
    h, w = out.shape
    area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
    if abs(area) < 1e-12:
        return
    first_x = max(0, int(np.ceil(min(a[0], b[0], c[0]) - 1e-9)))
    last_x = min(w - 1, int(np.floor(max(a[0], b[0], c[0]) + 1e-9)))
    first_y = max(0, int(np.ceil(min(a[1], b[1], c[1]) - 1e-9)))
    last_y = min(h - 1, int(np.floor(max(a[1], b[1], c[1]) + 1e-9)))
    for y in range(first_y, last_y + 1):
        for x in range(first_x, last_x + 1):
            s = ((b[0] - x) * (c[1] - y) - (b[1] - y) * (c[0] - x)) / area
            t = ((c[0] - x) * (a[1] - y) - (c[1] - y) * (a[0] - x)) / area
            u = 1.0 - s - t
            if s >= -1e-6 and t >= -1e-6 and u >= -1e-6:
                q = s * a[2] + t * b[2] + u * c[2]
                if q > 0.0 and 1.0 / q < out[y, x]:
                    out[y, x] = np.float32(1.0 / q)


@numba.njit(cache=True)
def _draw_triangles(p: Array, upper: NDArray[np.bool_], lower: NDArray[np.bool_], out: F32) -> None:
    for i in range(p.shape[0] - 1):
        for j in range(p.shape[1] - 1):
            if upper[i, j]:
                _triangle(p[i, j], p[i, j + 1], p[i + 1, j], out)
            if lower[i, j]:
                _triangle(p[i + 1, j + 1], p[i + 1, j], p[i, j + 1], out)


@numba.njit(cache=True)
def _draw_squares(centres: Array, right: Array, down: Array, out: F32) -> None:
    for k in range(len(centres)):
        a, r, d = centres[k], right[k], down[k]
        _triangle(a - r - d, a + r - d, a + r + d, out)
        _triangle(a - r - d, a + r + d, a - r + d, out)
