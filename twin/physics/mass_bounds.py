"""How far a part's centre of mass and inertia can be off when the pieces' weights are intervals."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product

import numpy as np

from twin.geometry import Array

# Axes about which moments are compared, in the principal frame: edges, face and space diagonals of a cube.
_AXES = np.array([a for a in product((-1, 0, 1), repeat=3) if a > (0, 0, 0)], dtype=np.float64)
_AXES /= np.linalg.norm(_AXES, axis=1)[:, None]
_ROUNDS = 3  # of moving the centre to the lightest spread's own; later ones move it by less than a millimetre


def shape_bounds(
    points: Sequence[Array], mass: tuple[Array, Array, Array], com: Array, tensor: Array
) -> tuple[tuple[float, float], Array]:
    """Bounds over all spreads of weight in which every piece weighs between its least and its most.

    Args:
        points: each (F, 3) m, where the pieces can be; their own extent counts little. The middle one belongs
            to `com`.
        mass: least, usual and greatest weight (F,) kg of the pieces.
        com: (3,) m, centre of the pieces with their usual weight.
        tensor: (3, 3) kg m^2 about it.

    Returns:
        (low, high): factors on the moment about any axis through the centre, at an unchanged total mass.
        (2, 3) m: lower and upper corner of the box in which the centre lies.
    """
    light, usual, heavy = mass
    reach = np.stack(points)
    least, most = reach.min(axis=0), reach.max(axis=0)
    box = np.array([
        [-_extreme_mean(-least[:, k], light, heavy) for k in range(3)],
        [_extreme_mean(most[:, k], light, heavy) for k in range(3)],
    ])  # fmt: skip
    frame = np.linalg.eigh(tensor)[1]
    offset = points[len(points) // 2] - com
    low, high = 1.0, 1.0
    for axis in _AXES @ frame.T:
        flat = offset - np.outer(offset @ axis, axis)
        square = np.einsum("fi,fi->f", flat, flat)
        expected = float(usual @ square) / float(usual.sum())
        if expected < 1e-12:  # on the axis: no spread of weight turns this into a moment
            continue
        high = max(high, _extreme_mean(square, light, heavy) / expected)
        low = min(low, _least_spread(flat, light, heavy) / expected)
    return (low, high), np.stack([np.minimum(box[0], com), np.maximum(box[1], com)])


def _extreme_mean(value: Array, light: Array, heavy: Array) -> float:
    """Greatest weighted mean of value (F,): heavy above some threshold, light below (linear-fractional)."""
    order = np.argsort(-value)
    v, a, b = value[order], light[order], heavy[order]
    weight = np.concatenate([[0.0], np.cumsum(b - a)]) + a.sum()
    moment = np.concatenate([[0.0], np.cumsum((b - a) * v)]) + float(a @ v)
    return float((moment / weight).max())


def _least_spread(flat: Array, light: Array, heavy: Array) -> float:
    """Least mean squared distance of points (F, 3) from their own weighted mean: both found in turns."""
    centre, best = np.zeros(3), np.inf
    for _ in range(_ROUNDS):
        square = np.einsum("fi,fi->f", flat - centre, flat - centre)
        best = min(best, -_extreme_mean(-square, light, heavy))
        weight = np.where(square < best, heavy, light)
        centre = weight @ flat / weight.sum()
    return float(best)
