"""The hand seen close, as an inset in a corner in which little moves."""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np

from robots.demonstration import Image
from robots.film.viewpoint import View
from twin.geometry import Array

# Sides of the inset by the picture's. Chosen by us: less is too small to tell whether fingers touch.
SHARE = 1 / 3
# m between eye and hand. Chosen by us: a gripper and a handle fill the inset.
_DISTANCE = 0.4
_FRAME = 2  # px, the inset's own frame
_GREY = 235


def near(view: View, hand: Array) -> mujoco.MjvCamera:
    """The camera that sees the hand (3,) m in the same direction from near."""
    camera = view.camera()
    camera.lookat[:] = hand
    camera.distance = min(_DISTANCE, view.distance)
    return camera


def inset_size(size: tuple[int, int]) -> tuple[int, int]:
    """Width and height px of the inset of a picture of this size."""
    return max(round(SHARE * size[0]), 8), max(round(SHARE * size[1]), 8)


def with_insets(images: Sequence[Image], insets: Sequence[Image]) -> list[Image]:
    """The pictures (H, W, 3), each with its inset (h, w, 3) in the corner that changes least over time."""
    h, w = insets[0].shape[:2]
    height, width = images[0].shape[:2]
    corners = [
        (y, x)
        for y in (slice(0, h), slice(height - h, height))
        for x in (slice(0, w), slice(width - w, width))
    ]
    stack = np.stack([image.mean(axis=2, dtype=np.float32) for image in images[:: max(1, len(images) // 24)]])
    changes = np.abs(stack - stack[0]).max(axis=0)
    y, x = min(corners, key=lambda corner: float(changes[corner].mean()))
    out = []
    for image, inset in zip(images, insets, strict=True):
        framed = np.full_like(inset, _GREY)
        framed[_FRAME:-_FRAME, _FRAME:-_FRAME] = inset[_FRAME:-_FRAME, _FRAME:-_FRAME]
        made = image.copy()
        made[y, x] = framed
        out.append(made)
    return out
