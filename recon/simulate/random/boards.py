"""Furniture made of boxes: boards, shells and handles, axis-parallel, with fronts that look towards -y."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from twin import geometry as geo
from twin.geometry import Array
from twin.scene import Box

BOARD = 0.018  # metres; the usual thickness of chipboard
OUT, RIGHT, UP = np.array([0.0, -1.0, 0.0]), np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0])


def box(centre: ArrayLike, size: ArrayLike) -> Box:
    """Axis-parallel box: centre (3,) and full size (3,), metres."""
    return Box(geo.make_pose(translation=np.asarray(centre, float)), np.asarray(size, float))


def shell(
    width: float, depth: float, height: float, centre: Sequence[float], board: float = BOARD
) -> list[Box]:
    """Open cabinet: the front, at y = centre.y - depth / 2, is missing."""
    x, y, z = centre
    return [
        box([x - width / 2, y, z], [board, depth, height]),
        box([x + width / 2, y, z], [board, depth, height]),
        box([x, y, z - height / 2], [width, depth, board]),
        box([x, y, z + height / 2], [width, depth, board]),
        box([x, y + depth / 2, z], [width, board, height]),
    ]


def bar(
    centre: ArrayLike, length: float, vertical: bool, thickness: float = 0.014, stand_off: float = 0.035
) -> tuple[list[Box], Array]:
    """Bar handle in front (-y) of `centre`, on two posts, and the middle of the bar (3,)."""
    c = np.asarray(centre, float)
    along = UP if vertical else RIGHT
    middle = c + OUT * (stand_off + thickness / 2)
    posts = [
        box(
            c + OUT * stand_off / 2 + s * along * (length / 2 - 0.01),
            np.where(OUT != 0, stand_off, 0.012),
        )
        for s in (-1, 1)
    ]
    return [box(middle, np.where(along > 0, length, thickness)), *posts], middle


def knob(face: ArrayLike, out: Array = OUT) -> tuple[list[Box], Array]:
    """Knob on a short neck in front of the point `face` (3,), and its middle (3,)."""
    c, flat = np.asarray(face, float), np.abs(out)
    middle = c + 0.030 * out
    neck = box(c + 0.012 * out, 0.012 + 0.012 * flat)
    return [neck, box(middle, 0.03 - 0.012 * flat)], middle
