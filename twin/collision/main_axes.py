"""The directions in which furniture lies: those that most of its surface faces."""

from __future__ import annotations

import numpy as np

from twin import geometry as geo
from twin.geometry import Array


def main_axes(triangles: Array) -> Array:
    """Rotation (3, 3), columns = the directions that most of the surface faces (boards have three)."""
    n = geo.vector_areas(triangles)
    weight = np.linalg.norm(n, axis=1)
    n = n[weight > 0] / weight[weight > 0, None]
    first = _mode(n, weight[weight > 0])
    side = n - np.outer(n @ first, first)
    lengths = np.linalg.norm(side, axis=1)
    good = lengths > 0.7
    if not good.any():
        return geo.orthogonal_basis(first)[:, [2, 0, 1]]
    second = _mode(side[good] / lengths[good, None], weight[weight > 0][good])
    second = geo.unit(second - first * (second @ first))
    return np.stack([first, second, np.cross(first, second)], axis=1)


def outline_axes(triangles: Array) -> Array:
    """Main axes (3, 3) of one part, the last two turned by up to 5 degrees to its outline's least rectangle.

    The narrow edges of a board face poorly known directions in a scan; its long outline says it better.
    """
    axes = main_axes(triangles)
    points = triangles.reshape(-1, 3) @ axes

    def size(angle: float) -> float:
        c, s = np.cos(angle), np.sin(angle)
        return float(
            np.ptp(points[:, 1] * c + points[:, 2] * s) * np.ptp(points[:, 2] * c - points[:, 1] * s)
        )

    angles = np.deg2rad(np.linspace(-5.0, 5.0, 81))
    best = float(angles[int(np.argmin([size(float(a)) for a in angles]))])
    return np.asarray(axes @ geo.exp_so3([best, 0.0, 0.0]))


def _mode(directions: Array, weight: Array) -> Array:
    """The line direction with the most weight within 15 degrees, refined as their principal axis."""
    order = np.argsort(-weight, kind="stable")[:200]
    near = np.abs(directions[order] @ directions.T) > np.cos(np.deg2rad(15.0))
    best = order[int(np.argmax(near @ weight))]
    axis = directions[best]
    for _ in range(12):  # mean shift: single faces of a scan are 10 degrees off
        inside = np.abs(directions @ axis) > np.cos(np.deg2rad(25.0))
        d = directions[inside]
        axis = np.linalg.eigh((d * weight[inside, None]).T @ d)[1][:, 2]
    return np.asarray(axis * (1.0 if axis[np.argmax(np.abs(axis))] > 0 else -1.0))
