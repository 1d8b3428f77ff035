"""Which changed surfaces are arms: a hand in view at the recording's end leaves as a part does."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from twin.geometry import Array

# An arm is no wider than this (m), has this much (m) of free depth behind this share of its outline, and
# comes from the viewer: the fifth of it next to the picture's border is nearer than the fifth farthest from
# it, by this ratio; or it is no longer than wide, as a fist. In 34 open recordings 12 surfaces of 15 on hands
# are so, and none of 62 on parts: boards are wider, or as far at both ends, or stand off from little. Chosen
# by us
WIDEST, BEHIND, OUTLINE, NEARER, _END = 0.15, 0.06, 1 / 3, 0.8, 5
AT_VIEWER = 0.4  # the same ratio of what starts at the viewer, however wide a coarse sensor smears it; by us
# How wide (m) a coarse sensor smears an arm, which then comes clearly from the viewer (the ratio) and stands
# off from so much of its outline: four of six that are wider than an arm in 41 open recordings, .16 to .30,
# and none of their parts, which stand off from .59 at most. By us
SMEARED, CLEARLY, ALL_ROUND = 0.3, 0.75, 0.75


def is_arm(mask: NDArray[np.bool_], depth: NDArray[np.float32], points: Array) -> bool:
    """Whether a surface of a depth image (h, w), m, 0 unknown, with world points (n, 3) in the order of the
    mask's pixels, is an arm or a fist."""
    (length, width), nearer, off = _extents(points), _border_over_far(mask, depth), _stands_off(mask, depth)
    narrow = width <= WIDEST and nearer < NEARER
    smeared = width <= SMEARED and nearer < CLEARLY and off >= ALL_ROUND
    return smeared or (off >= OUTLINE and (narrow or length <= WIDEST or nearer < AT_VIEWER))


def has_shape_of_arm(mask: NDArray[np.bool_], depth: NDArray[np.float32], points: Array) -> bool:
    """Whether it is narrow, stands off and comes nearer towards the border; a fist may look like a part."""
    narrow = _extents(points)[1] <= WIDEST and _border_over_far(mask, depth) < NEARER
    return narrow and _stands_off(mask, depth) >= OUTLINE


def _border_over_far(mask: NDArray[np.bool_], depth: NDArray[np.float32]) -> float:
    """Its depth next to the border of the picture over that farthest from the border."""
    h, w = mask.shape
    y, x = np.nonzero(mask)
    order = np.argsort(np.minimum.reduce([y, x, h - 1 - y, w - 1 - x]), kind="stable")
    z, end = depth[y, x][order], max(len(order) // _END, 1)
    return float(np.median(z[:end]) / max(float(np.median(z[-end:])), 1e-6))


def _extents(points: Array) -> tuple[float, float]:
    """Length and width (m) along the first two of its principal axes, of a strip as scattered."""
    spread = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    length, width = spread[:2] / np.sqrt(len(points)) * np.sqrt(12.0)
    return float(length), float(width)


def _stands_off(mask: NDArray[np.bool_], depth: NDArray[np.float32]) -> float:
    """Share of its known outline, two pixels wide, that lies behind it."""
    wide = np.ones((5, 5), np.uint8)
    around = (cv2.dilate(mask.astype(np.uint8), wide) > 0) & ~mask & (depth > 0)
    nearby = cv2.dilate(np.where(mask, depth, 0.0).astype(np.float32), wide)
    return float((depth[around] > nearby[around] + BEHIND).mean()) if around.any() else 0.0
