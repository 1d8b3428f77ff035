"""Surfaces that left their place, and surfaces that came to it: where boards are sought.

A surface that a row at rest sees and other rows see through was not there at all times. Surfaces of the
first row leave later; surfaces of the last row came before.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from recon.dense.depth import depth_normals
from recon.dense.looks import THROUGH
from recon.interaction.boards.arms import is_arm
from recon.observation.origins import AMID
from recon.observation.pictures import Pictures
from twin import geometry as geo
from twin.geometry import Array

# All chosen by us. Least gap in standard deviations of noise.
_SIGMAS = 5.0
# Least gap, m.
_GAP_M = 0.02
# A surface that left is gone in at least so many spans of rows: single rows are noise.
_SPANS = 2
# Rows of such a span.
_LONG = 3
# Least share of the picture that a part's surface has.
_SHARE = 0.004
# The same of one seen between the ends alone, where arms are: a front of 22 by 11 cm at 1.2 m.
_SHARE_BETWEEN = 0.015
# Most surfaces of each end of the recording.
_MOST = 4
# Most surfaces amid the recording that are asked whether they are an arm.
_ASKED = 40
# Share of a surface that an equal one of another row covers.
_COVERED = 0.5
# m from a plane, and cosine of the slope, within which pixels are of it; how many planes are tried.
_ON_PLANE_M, _ALONG_PLANE, _PLANES = 0.02, 0.85, 50
# px of the window about a pixel of unknown depth, most of whose known pixels left.
_AMONG = 5
# Least jump of depth (m) per pixel where a surface ends before another one.
_JUMP_M = 0.04
# Least ratio of that jump to the slope on the other side.
_STEEPER = 2.0
# Most pixels over which coarse sensors smear the jump.
_SMEARED = 2
# px about a pixel that is pointed at, and fewest with depth.
_ABOUT, _FEWEST = 6, 12
_CROSS = cv2.getStructuringElement(cv2.MORPH_CROSS, (3, 3))


@dataclass(frozen=True, eq=False)
class Seed:
    """A surface at rest in row `rest` of pictures: pixels (h, w), points (n, 3) m, Lab colours (n, 3).

    bounded: share of its outline, 0..1, at which an edge or the end of its plane was seen; 1 if not asked.
    """

    rest: int
    mask: NDArray[np.bool_]
    points: Array
    tint: Array
    bounded: float = 1.0

    @staticmethod
    def of(pictures: Pictures, rest: int, mask: NDArray[np.bool_], bounded: float = 1.0) -> Seed:
        points, tint = pictures.points(rest)[mask], pictures.colour[rest][mask].astype(np.float64)
        return Seed(rest, mask, points, tint, bounded)


def seeds(pictures: Pictures, rest: int) -> list[Seed]:
    """Pieces of surface that row `rest` sees and several others see through, largest first, without arms."""
    depth = pictures.depth[rest]
    known = depth > 0
    points = pictures.points(rest)[known]
    gone = np.stack(
        [pictures.look(points, t, _SIGMAS, _GAP_M) == THROUGH for t in range(len(pictures.frames))]
    )
    spans = np.logical_and.reduce([gone[k : len(gone) - _LONG + 1 + k] for k in range(_LONG)]).sum(axis=0)
    left = np.zeros(known.shape, np.uint8)
    left[known] = spans >= _SPANS
    pieces = _pieces(left, depth)
    found = [Seed.of(pictures, rest, pieces == k) for k in _large(pieces)]
    return [s for s in found if not _on_arm(s, pictures)]


def _pieces(left: NDArray[np.uint8], depth: NDArray[np.float32]) -> NDArray[np.int32]:
    """Numbers (h, w) of the pieces of surface of a mask, 0 elsewhere; jumps of depth part them."""
    solid = _filled(left, depth) & ~_torn(depth)
    opened = cv2.morphologyEx(solid, cv2.MORPH_OPEN, np.ones((3, 3), np.uint8))
    return np.where(left > 0, cv2.connectedComponents(opened, connectivity=4)[1], 0).astype(np.int32)


def _large(pieces: NDArray[np.int32]) -> list[int]:
    """The numbers of the largest pieces that may be a part's surface."""
    area = np.bincount(pieces.ravel())[1:]
    most = np.argsort(-area, kind="stable")[:_MOST]
    return [int(k) + 1 for k in most if area[k] >= _SHARE * pieces.size]


def came_and_went(pictures: Pictures, origin: NDArray[np.uint8]) -> list[Seed]:
    """The largest flat surfaces that are AMID by `origin` (T, h, w), each in one row: a part that is opened
    and closed again rests in the first and the last row alike."""
    masks = []
    for row in range(1, len(pictures.frames) - 1):
        pieces = _pieces((origin[row] == AMID).astype(np.uint8), pictures.depth[row])
        masks += [(row, pieces == k) for k in _large(pieces)]
    largest = sorted(masks, key=lambda m: -np.count_nonzero(m[1]))[:_ASKED]
    found: list[Seed] = []
    for flat in sorted((_flat(mask, row, pictures) for row, mask in largest), key=lambda s: -len(s.points)):
        again = any((s.mask & flat.mask).sum() > _COVERED * len(flat.points) for s in found)
        large = len(flat.points) >= _SHARE_BETWEEN * flat.mask.size
        if len(found) < _MOST and large and not again and not _on_arm(flat, pictures):
            found.append(flat)
    return found


def _on_arm(seed: Seed, pictures: Pictures) -> bool:
    return is_arm(seed.mask, pictures.depth[seed.rest], seed.points)


def _flat(mask: NDArray[np.bool_], row: int, pictures: Pictures) -> Seed:
    """The largest piece of a mask that lies on one plane by place and slope: a hand that holds a front is of
    one piece with it, and planes through both hold a strip of each."""
    depth, points = pictures.depth[row], pictures.points(row)
    normals = geo.rotate(
        pictures.T_world_cam[row], depth_normals(depth, pictures.camera, float(depth.max()) + 1.0)
    )
    sloped = mask & np.isfinite(normals[..., 0])
    flat = np.zeros_like(mask)
    p, n = points[sloped], normals[sloped]
    tried = np.random.default_rng(0).choice(len(p), min(_PLANES, len(p)), replace=False)
    on = [(np.abs((p - p[k]) @ n[k]) < _ON_PLANE_M) & (n @ n[k] > _ALONG_PLANE) for k in tried]
    if on:
        flat[sloped] = max(on, key=np.count_nonzero)
    pieces = _pieces(flat.astype(np.uint8), depth)
    return Seed.of(pictures, row, pieces == next(iter(_large(pieces)), -1))


def seed_at(pictures: Pictures, row: int, x: int, y: int) -> Seed | None:
    """The surface about a pixel of a row that goes on without a jump of depth; None where none is known."""
    depth = pictures.depth[row]
    v, u = np.mgrid[: depth.shape[0], : depth.shape[1]]
    about = (np.hypot(u - x, v - y) <= _ABOUT) & (depth > 0)
    if about.sum() < _FEWEST:
        return None
    nearest = np.argmin(np.where(about, np.hypot(u - x, v - y), np.inf))
    piece = cv2.connectedComponents((about & (_torn(depth) == 0)).astype(np.uint8), connectivity=4)[1]
    mask = (piece == piece.ravel()[nearest]) & about
    return Seed.of(pictures, row, mask) if mask.sum() >= _FEWEST else None


def _filled(left: NDArray[np.uint8], depth: NDArray[np.float32]) -> NDArray[np.uint8]:
    """Pixels (h, w) that left, with those of unknown depth among them: dark surfaces are seen in spots.

    Beside a jump of depth no pixel is added: there unknown pixels separate two surfaces.
    """
    known, window = depth > 0, np.ones((_AMONG, _AMONG), np.uint8)
    left_here, known_here = (cv2.blur(m.astype(np.float32), window.shape) for m in (left, known))
    nearest = cv2.erode(np.where(known, depth, np.inf).astype(np.float32), window)
    level = cv2.dilate(depth, window) - nearest < _AMONG * _JUMP_M
    return np.asarray((left > 0) | (~known & level & (left_here > 0.5 * known_here)), np.uint8)


def _torn(depth: NDArray[np.float32]) -> NDArray[np.uint8]:
    """Pixels (h, w), 1 or 0, at which a depth image jumps: an arm and what it covers are two surfaces."""
    known = np.where(depth > 0, depth, np.inf).astype(np.float32)
    torn = np.zeros(depth.shape, bool)
    for px in range(1, _SMEARED + 1):
        near = depth - cv2.erode(known, _CROSS, iterations=px)
        far = cv2.dilate(depth, _CROSS, iterations=px) - depth
        # a slanted surface has the same slope on both sides
        torn |= (near > px * _JUMP_M) & (near > _STEEPER * far)
    return np.asarray(torn & (depth > 0), np.uint8)


def informative_rows(origin: NDArray[np.uint8], count: int) -> NDArray[np.int64]:
    """At most `count` rows with the first and the last: half of them evenly spread, half where much is amid
    its motion by `origin` (T, h, w), as parts and hands are."""
    rows = len(origin)
    even = np.unique(np.linspace(0, rows - 1, min(count - count // 2, rows)).round().astype(np.int64))
    others = np.setdiff1d(np.arange(rows), even)
    if not len(others):
        return even
    under_way = (origin == AMID).mean(axis=(1, 2))[others] + 1e-6
    gone = np.cumsum(under_way) / under_way.sum()
    busy = np.searchsorted(gone, (np.arange(count // 2) + 0.5) / (count // 2))
    return np.unique(np.concatenate([even, others[np.minimum(busy, len(others) - 1)]]))
