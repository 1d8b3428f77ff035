"""Whether a part ends at an edge: the border of its labels at rest, against colour and depth.

A part is cut off from what is beside it by a gap, by another colour or by a step or crease in depth. Labels
that end in the middle of an even face have lost a piece of the part, or hold a piece of the room, and the
joint was fitted to that outline.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from recon.interaction.parts.moving_part import MovingPart
from recon.verdict.posed import PosedTwin
from twin.geometry import Array
from twin.scene import STATIC_LABEL

# All chosen by us.
# px, width of the pictures looked at
_WIDTH = 320
# Label images of the rest at either end
_FRAMES = 4
# Share of its usual pixels that a part has where it is in view
_IN_VIEW = 0.5
# px that a profile across the border goes to either side
_REACH = 9
# px: what is nearer to the border may be either side
_BESIDE = 3
# Fewest pixels of a border
_FEWEST = 40
# Fewest pixels with depth on either side of a profile
_FEWEST_KNOWN = 2
# Grey levels that an edge changes by within 3 px, at least
_LEVELS = 6.0
# Times what the part itself changes by, which an edge exceeds
_TIMES = 3.0
# Grey levels that this asks for at most: with a strong pattern any border has an edge
_MOST_LEVELS = 30.0
# m that depth leaves the face by
_OFF_M = 0.02
# px over which a step of colour is measured
_ACROSS = 3
# Share of a profile's pixels that must be of its side
_MOSTLY = 0.8

Bits = NDArray[np.bool_]
F32 = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class _Profiles:
    """Across a border: positions t px, outwards positive; picture (n, t, 3), depth (n, t) m, 0 unknown."""

    t: Array
    color: F32
    depth: F32


def bare_border(
    twin: PosedTwin, part: MovingPart, labels: Mapping[int, NDArray[np.uint8]]
) -> tuple[int, float] | None:
    """Of the rests before and after a part's motion the one where less of its border with the static scene
    shows no edge: its middle label image, and the share. None without enough border.

    A front that closes flush has a gap that no picture may show; where it stands open its border is a step in
    depth. Labels that have lost a piece of the part, or hold a piece of the room, end nowhere in either.
    """
    first, last = part.motion.intervals[0][0], part.motion.intervals[-1][1]
    size = {f: int(np.count_nonzero(labels[f] == part.id)) for f in sorted(labels)}
    usual = float(np.median([n for n in size.values() if n] or [0]))
    frames = [f for f, n in size.items() if n >= _IN_VIEW * usual]  # else it has left the picture
    rests = [f for f in frames if f < first][:_FRAMES], [f for f in frames if f > last][-_FRAMES:]
    told = [
        _middle([(f, s) for f in rest if (s := _bare(twin, part.id, f, labels[f])) is not None])
        for rest in rests
    ]
    return min((t for t in told if t is not None), key=lambda t: t[1], default=None)


def _bare(twin: PosedTwin, part_id: int, frame: int, image: NDArray[np.uint8]) -> float | None:
    """Share of the border in a label image (H, W) without an edge in colour or depth; None if too short."""
    profiles = _profiles(twin, part_id, frame, image)
    if profiles is None:
        return None
    return float(np.mean(~_colored(profiles) & _carried_on(profiles)))


def _profiles(twin: PosedTwin, part_id: int, frame: int, image: NDArray[np.uint8]) -> _Profiles | None:
    """Profiles across the border between a part and the static scene, where those lie on its sides."""
    step = max(1, twin.recording.intrinsics.width // _WIDTH)
    label = image[::step, ::step]
    mine = (label == part_id).astype(np.uint8)
    y, x = np.nonzero(mine & cv2.dilate((label == STATIC_LABEL).astype(np.uint8), np.ones((3, 3), np.uint8)))
    if len(x) < _FEWEST:
        return None
    soft = cv2.GaussianBlur(mine.astype(np.float32), (0, 0), _BESIDE)
    out = -np.stack([cv2.Sobel(soft, cv2.CV_32F, *way)[y, x] for way in ((1, 0), (0, 1))], axis=-1)
    out /= np.maximum(np.linalg.norm(out, axis=-1, keepdims=True), np.float32(1e-9))
    t = np.arange(-_REACH, _REACH + 1)
    at_x, at_y = ((c[:, None] + out[:, k, None] * t).astype(np.float32) for k, c in enumerate((x, y)))
    crossed = cv2.remap(label, at_x, at_y, cv2.INTER_NEAREST, borderValue=0)
    whole = ((crossed[:, t < -_BESIDE] == part_id).mean(axis=1) > _MOSTLY) & (
        (crossed[:, t > _BESIDE] == STATIC_LABEL).mean(axis=1) > _MOSTLY
    )
    if whole.sum() < _FEWEST:
        return None
    height, width = label.shape
    picture = cv2.resize(twin.recording.color(frame), (width, height), interpolation=cv2.INTER_AREA)
    picture = cv2.GaussianBlur(picture.astype(np.float32), (0, 0), 0.8)
    depth = np.ascontiguousarray(twin.recording.depth(frame)[::step, ::step], dtype=np.float32)
    at = at_x[whole], at_y[whole]
    return _Profiles(
        t.astype(np.float64),
        np.asarray(cv2.remap(picture, *at, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE), np.float32),
        np.asarray(cv2.remap(depth, *at, cv2.INTER_NEAREST, borderValue=0), np.float32),
    )


def _colored(p: _Profiles) -> Bits:
    """Which profiles (n,) have an edge in colour at the border: a step, or a gap's line."""
    steps = np.abs(p.color[:, _ACROSS:] - p.color[:, :-_ACROSS]).max(axis=-1)
    middle = p.t[:-_ACROSS] + 0.5 * _ACROSS
    own = float(np.median(steps[:, middle < -_BESIDE - _ACROSS]))
    enough = float(np.clip(_TIMES * own, _LEVELS, _MOST_LEVELS))
    return np.asarray(steps[:, np.abs(middle) < _BESIDE + 1].max(axis=1) > enough)


def _carried_on(p: _Profiles) -> Bits:
    """Beyond which profiles (n,) the part's face goes on in depth; of what has no depth that isn't known. A
    plane's inverse depth is affine in the picture."""
    sides = p.t <= -_BESIDE, p.t >= _BESIDE
    known = p.depth > 0
    out = np.all([known[:, side].sum(axis=1) >= _FEWEST_KNOWN for side in sides], axis=0)
    inverse = np.where(known, 1.0 / np.where(known, p.depth, 1.0), np.nan)[out]
    if not len(inverse):
        return out
    t = np.where(known, p.t, np.nan)[out]
    (own_t, own), (far_t, far) = ((t[:, side], inverse[:, side]) for side in sides)
    own_t, middle = own_t - np.nanmean(own_t, axis=1, keepdims=True), np.nanmean(own_t, axis=1)
    level = np.nanmean(own, axis=1)
    slope = np.nansum(own_t * (own - level[:, None]), axis=1) / np.nansum(own_t**2, axis=1)
    ahead = level + slope * (np.nanmean(far_t, axis=1) - middle)
    off = np.abs(1.0 / np.nanmedian(far, axis=1) - 1.0 / np.maximum(ahead, 1e-3))
    out[out] = off <= _OFF_M
    return np.asarray(out)


def _middle(shares: list[tuple[int, float]]) -> tuple[int, float] | None:
    """Of frames and their shares the median by share, the lower of two middles. None of none."""
    return sorted(shares, key=lambda share: share[1])[(len(shares) - 1) // 2] if shares else None
