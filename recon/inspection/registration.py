"""Whether depth lies on colour: the shift and scale under which edges of depth fall onto edges of colour.

Both are read from one table: how strong colour's gradient is, on average, some pixels beside the edges of
depth, for each frame, each side of objects and each third of the picture.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from recon.inspection.glance import Stretch
from twin.geometry import Array
from twin.robust import mad_sigma
from twin.runs.threads import each

F32 = NDArray[np.float32]

REACH = 16  # px at the inspected size: how far edges are looked for; 3 % of the picture
# relative step of depth at the outline of an object: over what noise and slanted surfaces give in 5 pixels
_JUMP = 0.05
_FRAMES = 40  # looked at of a stretch
_PER_SIDE = 400  # edge pixels used of a frame, side and third
_MIN_EDGES = 300  # pixels on edges below which a profile is noise
_BLOCKS = 6  # of the jackknife
# noise of the profile by which its peak stands out; one of 33 places exceeds 4 by chance once in 1000
_MIN_PEAK = 6.0
# the same by which none stands out: places of noise reach 2.4 in mirrored depth, which we looked at
_NO_PEAK = 3.5
# px from the peak where objects begin to that where they end: sensors widen objects, by .6 to 2.8 px in nine
# recordings (looked at). Chosen by us
_APART = (-1.0, 6.0)


@dataclass(frozen=True, eq=False)
class EdgeTable:
    """score (n, 2, 2, 2, 3, 2 REACH + 1): sum of colour's gradient beside the edges of depth, by frame, fill
    of holes (what is behind, what is before), axis (x, y), side of the object (begin, end), third of the
    picture along the axis, and distance in px; count: the same without the last."""

    score: Array
    count: Array


def edge_table(stretch: Stretch) -> EdgeTable:
    """Look beside the edges of depth in the frames of a stretch."""
    n = len(stretch.small)
    frames = np.unique(np.linspace(1, n - 2, min(n - 2, _FRAMES)).astype(int)).tolist()
    tables = each(lambda k: _of_frame(*stretch.small.frame(k)), frames)
    score, count = (np.array(t) for t in zip(*tables, strict=True))
    return EdgeTable(score, count)


def _of_frame(color: NDArray[np.uint8], depth: F32) -> tuple[Array, Array]:
    grey = color[..., 0].astype(np.float32)
    rng = np.random.default_rng(0)
    scores, counts = np.zeros((2, 2, 2, 3, 2 * REACH + 1)), np.zeros((2, 2, 2, 3))
    for axis in range(2):
        image, z = (grey, depth) if axis == 0 else (grey.T, depth.T)
        strength = _gradient(np.ascontiguousarray(image))
        for fill, whole in enumerate(filled(np.ascontiguousarray(z))):
            for side, (y, x) in enumerate(_outlines(whole)):
                third = x * 3 // z.shape[1]
                for part in range(3):
                    here = np.flatnonzero(third == part)
                    if len(here) > _PER_SIDE:
                        here = rng.choice(here, _PER_SIDE, replace=False)
                    at = x[here, None] + np.arange(-REACH, REACH + 1)
                    scores[fill, axis, side, part] = strength[y[here, None], at].sum(axis=0)
                    counts[fill, axis, side, part] = len(here)
    return scores, counts


def _gradient(image: F32) -> F32:
    """Gradient along x over its local mean: edges of bright and dark places count alike."""
    size = np.abs(cv2.Sobel(image, cv2.CV_32F, 1, 0, ksize=3, scale=0.125))
    around = cv2.blur(size, (2 * REACH + 1, 2 * REACH + 1))
    return np.asarray(np.minimum(size / (around + 1.0), 8.0), dtype=np.float32)


def filled(depth: F32) -> tuple[F32, F32]:
    """Holes filled in each row with the farther and with the nearer of the depths at their ends.

    Beside an object depth is missing: of the background where one of a sensor's two eyes does not see it, and
    of the object where its rim reflects badly. The outline lies somewhere in the hole.
    """
    columns = np.arange(depth.shape[1])
    has = depth > 0
    last = np.maximum.accumulate(np.where(has, columns, 0), axis=1)
    after = np.minimum.accumulate(np.where(has, columns, depth.shape[1] - 1)[:, ::-1], axis=1)[:, ::-1]
    rows = np.arange(depth.shape[0])[:, None]
    left, right = depth[rows, last], depth[rows, after]
    nearer = np.where((left > 0) & (right > 0), np.minimum(left, right), np.maximum(left, right))
    return np.where(has, depth, np.maximum(left, right)), np.where(has, depth, nearer)


def _outlines(depth: F32) -> tuple[tuple[NDArray[np.int64], NDArray[np.int64]], ...]:
    """(y, x) of the edges where an object begins along x, and of those where it ends.

    An edge is where depth crosses the middle between the nearest and the farthest of 5 pixels, which also
    holds for edges that a sensor or a filter smears."""
    window = np.ones((1, 5), np.uint8)
    low, high = cv2.erode(depth, window), cv2.dilate(depth, window)
    jump = (low > 0) & (high - low > _JUMP * low)
    near = depth < (low + high) / 2
    both = jump[:, 1:] & jump[:, :-1]
    begins = both & near[:, 1:] & ~near[:, :-1]
    ends = both & near[:, :-1] & ~near[:, 1:]
    inner = slice(REACH, depth.shape[1] - REACH - 1)
    found = []
    for mask, first in ((begins, 1), (ends, 0)):
        y, x = np.nonzero(mask[:, inner])
        found.append((y, x + REACH + first))
    return tuple(found)


@dataclass(frozen=True)
class Offset:
    """Where edges of depth meet edges of colour, of which holes leave an interval. shift (2, 2): least and
    greatest mean shift along x and y; border (2,): least and greatest further shift at the left and right
    border, of a scale; px of the inspected size, NaN where no peak stands out. sigma (3,): of the shifts
    and of the border, by a jackknife over times. edges: pixels on edges that were used."""

    shift: Array
    border: Array
    sigma: Array
    edges: int
    nowhere: bool


def offset(table: EdgeTable) -> Offset:
    """Shift and scale between depth and colour."""
    shift = np.array([[_middle(table, f, a, slice(None)) for f in range(2)] for a in range(2)])
    border = np.array([_wider(table, f) for f in range(2)])
    blocks = np.array_split(np.arange(len(table.score)), _BLOCKS)
    parts = []
    for b in blocks:
        rest = EdgeTable(*(np.delete(x, b, axis=0) for x in (table.score, table.count)))
        parts.append([*(_middle(rest, 0, a, slice(None)) for a in range(2)), _wider(rest, 0)])
    sigma = jackknife(np.array(parts))
    edges = int(table.count[:, 0].sum())
    heights = [max(h for f in range(2) for _, h in _peaks(table, f, a, slice(None))) for a in range(2)]
    return Offset(np.sort(shift, axis=1), np.sort(border), sigma, edges, min(heights) < _NO_PEAK)


def _wider(table: EdgeTable, fill: int) -> float:
    """Further shift at the left and right border by those of the outer thirds, whose middles are two thirds
    of the width apart, the borders a whole one, half on each side."""
    left, right = (_middle(table, fill, 0, slice(p, p + 1)) for p in (0, 2))
    return 0.75 * (right - left)


def jackknife(parts: Array) -> Array:
    """Deviation (...) of an estimate by its values (n, ...) without each of n blocks (Tukey 1958)."""
    n = len(parts)
    return np.asarray(np.sqrt((n - 1) / n * ((parts - parts.mean(axis=0)) ** 2).sum(axis=0)))


def _middle(table: EdgeTable, fill: int, axis: int, part: slice) -> float:
    """Mean of the peaks on both sides of objects, in which widening cancels; NaN without two peaks, and where
    these are too far apart to be of the same edges."""
    (begin, high), (end, higher) = _peaks(table, fill, axis, part)
    same = _APART[0] <= end - begin <= _APART[1]
    return 0.5 * (begin + end) if min(high, higher) >= _MIN_PEAK and same else float("nan")


def _peaks(table: EdgeTable, fill: int, axis: int, part: slice) -> list[tuple[float, float]]:
    """Place and height of the peaks where objects begin and where they end; no height of too few edges."""
    out = []
    for side in range(2):
        count = table.count[:, fill, axis, side, part].sum()
        place, height = peak(table.score[:, fill, axis, side, part].sum(axis=(0, 1)) / max(count, 1.0))
        out.append((place, height if count >= _MIN_EDGES else 0.0))
    return out


def peak(profile: Array) -> tuple[float, float]:
    """Place (px, between samples) of a profile's highest value, and its sigmas above the rest."""
    k = int(np.argmax(profile))
    away = np.abs(np.arange(len(profile)) - k) > 3
    rest = profile[away]
    noise = mad_sigma(rest - np.median(rest)) + 1e-9
    place = float(k)
    if 0 < k < len(profile) - 1:
        a, b, c = profile[k - 1 : k + 2]
        place += float((a - c) / (2 * (a - 2 * b + c) - 1e-12)) if a - 2 * b + c < 0 else 0.0
    return place - REACH, float((profile[k] - np.median(rest)) / noise)
