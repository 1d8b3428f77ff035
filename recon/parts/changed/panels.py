"""Panels that slide in their own plane: what is seen to leave and to come are strips, a way apart as long as the panel is wide.

A strip at the panel's trailing edge leaves, one at its leading edge comes, and what lies between is covered by the panel before and after: depth
has it rest there. Carried by itself, the strip that left would go all the way to the one that came. Together they are the panel.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import cv2
import numpy as np

from recon.motion.change.depths import Depths
from recon.motion.change.kernels import SAME, THROUGH
from recon.motion.change.surfaces import GAP_M, SIGMAS, Changed
from recon.parts.changed.proposals import plane_of
from twin.geometry import Array

# Strips of one panel are as wide by this ratio at least, along the way, and share so much of their length, across it; so much of what is seen of the
# plane between them is covered at both ends, and so much of it is seen. Chosen by us
_AS_WIDE, _BESIDE, _COVERED, _SEEN = 0.6, 0.5, 0.85, 0.25
_ON_M, _GRID, _ENDS = 0.02, 24, (0.02, 0.98)
# An arm may hide a piece of a strip, so that its middle is aside: how far its way leaves a side of the rectangle about both, sine; by us
_ASIDE = 0.5


@dataclass(frozen=True, eq=False)
class _Way:
    """A plane by a point and the directions (3, 2) along the way and across it; spans (2,) along the way of the strip that left and of the one that
    came, and the span across that both have, m."""

    origin: Array
    basis: Array
    left: Array
    came: Array
    across: Array


def with_panels(
    depths: Depths, left: Sequence[Changed], came: Sequence[Changed]
) -> list[tuple[Changed, bool]]:
    """All surfaces that left their place and that came to it, and whether each is a panel: strips of one are replaced by it, at its rest before and after."""
    panels: dict[int, Changed] = {}
    for a, b in product(left, came):
        way = None if id(a) in panels or id(b) in panels else _way(depths, a, b)
        if way is not None and all(_covered(depths, way, row) for row in (a.rest, b.rest)):
            panels[id(a)] = _panel(depths, way, a.rest, way.left[0], way.came[0])
            panels[id(b)] = _panel(depths, way, b.rest, way.left[1], way.came[1])
    return [(panels.get(id(c), c), id(c) in panels) for c in (*left, *came)]


def _way(depths: Depths, left: Changed, came: Changed) -> _Way | None:
    """The way from one strip to another, None where they are none of one panel."""
    normal, on = plane_of(left.points)
    origin, limit = on.mean(axis=0), _on(depths)
    if np.mean(np.abs((came.points - origin) @ normal) < limit) < _COVERED:
        return None
    both = np.concatenate([on, came.points]) - origin
    flat = np.linalg.svd(normal[None])[2][1:].T
    angle = np.deg2rad(cv2.minAreaRect((both @ flat).astype(np.float32))[2])
    sides = flat @ np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    towards = (came.points - origin).mean(axis=0) @ sides
    k = int(np.argmax(np.abs(towards)))
    if abs(towards[1 - k]) > _ASIDE * abs(towards[k]):
        return None
    basis = np.stack([sides[:, k] * np.sign(towards[k]), sides[:, 1 - k]], axis=1)
    spans = [np.quantile((p - origin) @ basis, _ENDS, axis=0) for p in (on, came.points)]
    (a, across_a), (b, across_b) = spans[0].T, spans[1].T
    across = np.array([max(across_a[0], across_b[0]), min(across_a[1], across_b[1])])
    wide, long = (np.ptp(a), np.ptp(b)), (np.ptp(across_a), np.ptp(across_b))
    alike = min(wide) >= _AS_WIDE * max(wide) and across[1] - across[0] >= _BESIDE * max(long)
    if not alike or b[0] <= a[1]:
        return None
    return _Way(origin, basis, a, b, np.array([min(across_a[0], across_b[0]), max(across_a[1], across_b[1])]))


def _covered(depths: Depths, way: _Way, row: int) -> bool:
    """Whether a row sees a surface on the plane all over between the strips, where nothing hides it."""
    u = np.linspace(way.left[1], way.came[0], _GRID + 2)[1:-1]
    v = np.linspace(way.across[0], way.across[1], _GRID + 2)[1:-1]
    at = np.stack(np.meshgrid(u, v), axis=-1).reshape(-1, 2)
    told = depths.look(way.origin + at @ way.basis.T, row, SIGMAS / 2.0, GAP_M / 2.0)
    same, through = float(np.mean(told == SAME)), float(np.mean(told == THROUGH))
    return same >= _SEEN and same >= _COVERED * (same + through)


def _panel(depths: Depths, way: _Way, row: int, first: float, last: float) -> Changed:
    """All that a row sees on the plane from one place to another along the way."""
    points = depths.points(row)
    at = (points - way.origin) @ way.basis
    normal = np.cross(way.basis[:, 0], way.basis[:, 1])
    mask = (depths.depth[row] > 0) & (np.abs((points - way.origin) @ normal) < _on(depths))
    mask &= (at[..., 0] >= first) & (at[..., 0] <= last)
    mask &= (at[..., 1] >= way.across[0]) & (at[..., 1] <= way.across[1])
    return Changed(row, mask, points[mask], depths.colour[row][mask].astype(np.float64))


def _on(depths: Depths) -> float:
    """How far from a plane (m) depth has what lies on it."""
    return max(_ON_M, SIGMAS / 2.0 * depths.noise.base)
