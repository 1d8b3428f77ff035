"""Which changed surfaces are arms: a hand in view at the recording's end leaves as a part does."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from twin.geometry import Array

# An arm is narrow, stands off and comes from the viewer; a fist is no longer than wide. In 34 open recordings
# 12 of 15 surfaces on hands are so, and none of 62 on parts: boards are wider, or as far at both ends, or
# stand off from little. All chosen by us. Greatest width, m.
WIDEST = 0.15
# Free depth behind an arm, m.
BEHIND = 0.06
# Least share of the outline with free depth behind.
OUTLINE = 1 / 3
# Greatest ratio of an arm's depth next to the picture's border to that farthest from the border.
NEARER = 0.8
# Both depths are those of one of so many equal shares of the arm.
_END = 5
# The same ratio for a surface that starts at the viewer, however wide a coarse sensor smears an arm.
AT_VIEWER = 0.4
# Greatest width (m) of a smeared arm, which comes clearly from the viewer and stands off all round. In 41
# open recordings four of six arms that are too wide are so (.16 to .30), and no part: parts stand off from
# .59 of their outline at most.
SMEARED = 0.3
# Ratio of depths of a smeared arm.
CLEARLY = 0.75
# Share of the outline of a smeared arm.
ALL_ROUND = 0.75


def is_arm(mask: NDArray[np.bool_], depth: NDArray[np.float32], points: Array) -> bool:
    """Whether a surface of a depth image (h, w) m, 0 unknown, is an arm or a fist.

    points: world points (n, 3) m in the order of the mask's pixels.
    """
    (length, width), nearer, off = _extents(points), _border_over_far(mask, depth), _stands_off(mask, depth)
    narrow = width <= WIDEST and nearer < NEARER
    smeared = width <= SMEARED and nearer < CLEARLY and off >= ALL_ROUND
    return smeared or (off >= OUTLINE and (narrow or length <= WIDEST or nearer < AT_VIEWER))


def has_shape_of_arm(mask: NDArray[np.bool_], depth: NDArray[np.float32], points: Array) -> bool:
    """Whether it is narrow, stands off and comes nearer towards the border; a fist may look like a part."""
    narrow = _extents(points)[1] <= WIDEST and _border_over_far(mask, depth) < NEARER
    return narrow and _stands_off(mask, depth) >= OUTLINE


def _border_over_far(mask: NDArray[np.bool_], depth: NDArray[np.float32]) -> float:
    """The surface's depth next to the picture's border over that farthest from the border."""
    h, w = mask.shape
    y, x = np.nonzero(mask)
    order = np.argsort(np.minimum.reduce([y, x, h - 1 - y, w - 1 - x]), kind="stable")
    z, end = depth[y, x][order], max(len(order) // _END, 1)
    return float(np.median(z[:end]) / max(float(np.median(z[-end:])), 1e-6))


def _extents(points: Array) -> tuple[float, float]:
    """Length and width (m) along the first two principal axes, of a strip as scattered."""
    spread = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    length, width = spread[:2] / np.sqrt(len(points)) * np.sqrt(12.0)
    return float(length), float(width)


def _stands_off(mask: NDArray[np.bool_], depth: NDArray[np.float32]) -> float:
    """Share of the surface's known outline, two pixels wide, that lies behind the surface."""
    wide = np.ones((5, 5), np.uint8)
    around = (cv2.dilate(mask.astype(np.uint8), wide) > 0) & ~mask & (depth > 0)
    nearby = cv2.dilate(np.where(mask, depth, 0.0).astype(np.float32), wide)
    return float((depth[around] > nearby[around] + BEHIND).mean()) if around.any() else 0.0
