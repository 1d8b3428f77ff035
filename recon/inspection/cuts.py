"""Cuts in the video: most of the picture and its depth change at once, unlike the frames before and after.

A screen with a new picture changes no depth; an arm that appears changes less than half of the picture.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import cv2
import numpy as np
from numpy.typing import NDArray

from recon.recording import Frame
from twin.geometry import Array

F32 = NDArray[np.float32]

# px: of a picture this small little moves by more than a pixel from frame to frame
_SIZE = (80, 60)
_BLUR = 1.5  # px of it
# Grey levels: pictures of less contrast are not enhanced, which would make their noise a change
_CONTRAST = 4.0
# Blocks down and across; of their changes the median counts
_BLOCKS = (3, 4)
# Least relative change of depth of a changed pixel
_FARTHER = 0.2
# Least share of pixels with depth in both frames
_KNOWN = 0.1
# Of the contrast, and relative to depth: what noise and a steady camera change
_NOISE = 0.003
# Frames on either side to compare with: two, as videos of doubled frames change in every second
_NEIGHBOURS = 2
# How many times a cut changes colour and depth more than its neighbours do. 64 recordings without a cut, 59
# of them random: 2.9 and 1.2 at most, but for colour where an arm appears at once (4.9) and on two screens
# (19, 72). Beyond both are 62 of 63 joins of two recordings, and 45, 55 and 56 of 64 with 20, 40 frames or
# all but the ends cut out; in the others the camera hardly moves over the cut
_MORE_COLOUR = 8.0
_MORE_DEPTH = 2.0


@dataclass(frozen=True, eq=False)
class Thumbnail:
    """A small grey picture (h, w) of mean 0 and contrast 1 (no overall light), and its depth (h, w) m."""

    grey: F32
    depth: F32


@dataclass(frozen=True, eq=False)
class Shown:
    """Thumbnails of frames that follow each other, and their numbers (n,) in the recording."""

    frames: NDArray[np.int64]
    thumbnails: list[Thumbnail]


def thumbnail(frame: Frame) -> Thumbnail:
    """A frame, small."""
    small = cv2.resize(frame.color, _SIZE, interpolation=cv2.INTER_AREA)
    grey = cv2.cvtColor(np.asarray(small), cv2.COLOR_RGB2GRAY).astype(np.float32)
    soft = np.asarray(cv2.GaussianBlur(grey, (0, 0), _BLUR))
    even = (soft - soft.mean()) / max(float(soft.std()), _CONTRAST)
    depth = cv2.resize(frame.depth, _SIZE, interpolation=cv2.INTER_NEAREST_EXACT)
    return Thumbnail(np.asarray(even, dtype=np.float32), np.asarray(depth, dtype=np.float32))


def cuts(thumbnails: list[Thumbnail]) -> NDArray[np.int64]:
    """Places k at which the video is cut between picture k and the one after, of consecutive pictures."""
    color, depth = (
        np.array([change(a, b) for a, b in pairwise(thumbnails)]) for change in (_of_color, _of_depth)
    )
    return np.flatnonzero((_beyond(color) > _MORE_COLOUR) & (_beyond(depth) > _MORE_DEPTH))


def largest_change(thumbnails: list[Thumbnail]) -> int:
    """The place of the largest change between neighbours."""
    return int(np.argmax([_of_color(a, b) for a, b in pairwise(thumbnails)]))


def _of_color(before: Thumbnail, after: Thumbnail) -> float:
    rows, columns = _BLOCKS
    squares = (before.grey - after.grey) ** 2
    blocks = squares.reshape(rows, _SIZE[1] // rows, columns, _SIZE[0] // columns)
    return 0.5 * float(np.median(blocks.mean(axis=(1, 3))))


def _of_depth(before: Thumbnail, after: Thumbnail) -> float:
    a, b = before.depth, after.depth
    both = (a > 0) & (b > 0)
    if both.mean() < _KNOWN:
        return 0.0
    return float(np.minimum(np.abs(a - b)[both] / np.minimum(a, b)[both], _FARTHER).mean())


def _beyond(change: Array) -> Array:
    """Each change over the greatest of its neighbours."""
    out = np.zeros(len(change))
    for k in range(len(change)):
        near = change[max(0, k - _NEIGHBOURS) : k + _NEIGHBOURS + 1]
        others = np.delete(near, min(k, _NEIGHBOURS))
        out[k] = change[k] / (float(others.max(initial=0.0)) + _NOISE)
    return out
