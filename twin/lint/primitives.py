"""Points that span simple shapes, for their bounds and distances."""

from __future__ import annotations

from itertools import product

import numpy as np
from numpy.typing import ArrayLike

from twin.geometry import Array


def box_points(size: ArrayLike) -> Array:
    """Corners (8, 3) of a box of `size` (3,) about the origin."""
    return np.array(list(product((-0.5, 0.5), repeat=3))) * np.asarray(size, dtype=np.float64)


def cylinder_points(radius: float, length: float, axis: int = 2) -> Array:
    """Points (32, 3) on both rims of a cylinder about `axis`; their hull is up to 2 % of it inside."""
    angle = np.arange(16) * (2 * np.pi / 16)
    rim = np.stack([np.cos(angle), np.sin(angle), np.zeros(16)], axis=1) * radius
    points = np.concatenate([rim - [0, 0, length / 2], rim + [0, 0, length / 2]])
    return np.roll(points, axis - 2, axis=1)
