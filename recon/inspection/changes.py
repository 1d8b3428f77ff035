"""What other than the camera changes in depth: between neighbouring frames, and against the whole stretch.

With the cameras found from tracks, a point in front of what another frame saw was not there then.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from recon.dense.depth import in_front
from recon.inspection.glance import Stretch
from recon.recording import Intrinsics
from twin import geometry as geo
from twin.geometry import Array
from twin.scene import Trajectory

Mask = NDArray[np.bool_]

_WIDTH = 160  # px, of the depth that is compared
_REFERENCES = 8  # frames, spread over the stretch, that every frame is held against
_BAND = 3  # px: the picture's border, where sensors give less depth
_ARM_M = (0.02, 0.30)  # m: from a thin wrist to a padded sleeve seen aslant
_ASIDE = 4  # px: so far beside a run of pixels lies what is behind it, past a smeared edge
_STEP = 0.02  # m, between neighbouring pixels of one thing; a pixel is 3 to 8 mm wide there
_IN_FRONT = 0.05  # m: an arm floats; what hangs together with the scene behind it is none


@dataclass(frozen=True, eq=False)
class Depths:
    """Depth (n, h, w) m of a stretch at `_WIDTH`, its camera and the poses."""

    depth: Array
    camera: Intrinsics
    cameras: Trajectory

    def in_front(self, frame: int, other: int) -> Mask | None:
        """Mask (h, w) of the pixels of `frame` in front of what `other` saw; None without both poses."""
        there, here = self.cameras.pose(other), self.cameras.pose(frame)
        if there is None or here is None:
            return None
        pose = geo.invert_pose(there) @ here
        return in_front(self.depth[frame], self.depth[other], self.camera, pose)


def depths_of(stretch: Stretch) -> Depths | None:
    """None without cameras."""
    if stretch.cameras is None:
        return None
    k = stretch.small.intrinsics
    size = (_WIDTH, max(1, round(k.height * _WIDTH / k.width)))
    depth = [
        cv2.resize(stretch.small.depth(i), size, interpolation=cv2.INTER_NEAREST_EXACT)
        for i in range(len(stretch.small))
    ]
    return Depths(np.array(depth, dtype=np.float64), k.scaled(*size), stretch.cameras)


def moving_shares(depths: Depths, gap: int, frames: NDArray[np.int64]) -> Array:
    """Share of the picture that changes from each of `frames` to `gap` later; NaN without poses."""
    out = []
    for i in frames.tolist():
        masks = [depths.in_front(i, i + gap), depths.in_front(i + gap, i)]
        out.append(np.nan if masks[0] is None or masks[1] is None else masks[0].mean() + masks[1].mean())
    return np.array(out)


def arm_in_view(depths: Depths, frame: int) -> bool:
    """Whether something like an arm reaches in from the left, the right or below, as the arms of who wears
    the camera do: at the picture's border it is as wide as an arm, floats in front of what is beside it, and
    other frames see through its place."""
    n = len(depths.depth)
    others = np.unique(np.linspace(0, n - 1, _REFERENCES).astype(int))
    masks = [depths.in_front(frame, int(k)) for k in others if k != frame]
    seen_through = np.any([m for m in masks if m is not None], axis=0)
    if seen_through.ndim != 2:
        return False
    line = _border(depths.depth[frame] > 0)
    return _arm_on(seen_through[line], depths.depth[frame][line], depths.camera.fx)


def _border(known: Mask) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """(rows, columns) down the left, along the lower, up the right border of known pixels, `_BAND` in."""
    at = np.argwhere(known)
    (top, left), (bottom, right) = at.min(axis=0) + _BAND, at.max(axis=0) - _BAND
    x, y = np.arange(left, right), np.arange(top, bottom)
    rows = [y, np.full(len(x), bottom), y[::-1]]
    columns = [np.full(len(y), left), x, np.full(len(y), right)]
    return np.concatenate(rows), np.concatenate(columns)


def _arm_on(through: Mask, z: Array, focal: float) -> bool:
    """Whether a run on a line of pixels is an arm. through (n,): seen through, z (n,): m, 0 unknown."""
    joined = cv2.morphologyEx(through.astype(np.uint8)[None], cv2.MORPH_CLOSE, np.ones((1, 3), np.uint8))[0]
    ends = np.flatnonzero(np.diff(np.concatenate([[0], joined.astype(int), [0]])))
    aside = np.concatenate([np.zeros(_ASIDE), z, np.zeros(_ASIDE)])
    for first, end in zip(ends[::2].tolist(), ends[1::2].tolist(), strict=True):
        first, end = _grown(z, first, end)
        known = z[first:end][z[first:end] > 0]
        if not len(known):
            continue
        near = float(np.median(known))
        width = (end - first) * near / focal
        beside = (aside[first], aside[end - 1 + 2 * _ASIDE])
        if _ARM_M[0] <= width <= _ARM_M[1] and all(b == 0 or b > near + _IN_FRONT for b in beside):
            return True
    return False


def _grown(z: Array, first: int, end: int) -> tuple[int, int]:
    """A run with what continues it without a step of depth: others may see through part of an arm only."""
    while first > 0 and z[first - 1] > 0 and abs(z[first - 1] - z[first]) < _STEP:
        first -= 1
    while end < len(z) and z[end] > 0 and abs(z[end] - z[end - 1]) < _STEP:
        end += 1
    return first, end
