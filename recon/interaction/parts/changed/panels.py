"""Panels that slide in their own plane: strips leave and come, a panel's width apart.

A strip at the panel's trailing edge leaves, and a strip at its leading edge comes. The panel covers the place
between them before and after, so depth sees rest there. Carried by itself, the first strip would go all the
way to the second one; together they are the panel. If the panel is closed again in the end, nothing came: the
second strip is then looked for in between, while the first one is away.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby, product

import cv2
import numpy as np

from recon.dense.looks import SAME, THROUGH
from recon.interaction.motion.change.depths import Depths
from recon.interaction.motion.change.surfaces import GAP_M, SIGMAS, Changed, changed_surfaces
from recon.interaction.parts.changed.proposals import plane_of
from twin.geometry import Array

# All chosen by us. Least ratio of the widths of a panel's two strips, along the way.
_AS_WIDE = 0.6
# Least share of the shorter strip's length that both have, across the way.
_BESIDE = 0.5
# The same of the longer strip's length, part of which may be hidden.
_HIDDEN = 0.25
# Least share of the seen plane between the strips that is covered, at both ends of the recording.
_COVERED = 0.85
# Least share of that plane that is seen.
_SEEN = 0.25
# m from a plane within which points lie on the plane, at least.
_ON_M = 0.02
# Points along each side of the plane between the strips that are looked up.
_GRID = 24
# Quantiles of a strip's points that are its ends.
_ENDS = (0.02, 0.98)
# Sine by which the way may leave a side of the strips' rectangle, as an arm may hide a piece of a strip.
_ASIDE = 0.5
# Share of a strip that is where it was, or away.
_BACK = 0.5


@dataclass(frozen=True, eq=False)
class _Way:
    """A plane by a point and the directions (3, 2) along and across the way; spans (2,) m along the way of
    the strip that left and of the strip that came, and their span across."""

    origin: Array
    basis: Array
    left: Array
    came: Array
    across: Array


def with_panels(
    depths: Depths, left: Sequence[Changed], came: Sequence[Changed]
) -> list[tuple[Changed, bool]]:
    """All surfaces that left or came, and whether each is a panel: a panel at rest replaces its strips."""
    panels: dict[int, Changed] = {}
    for a, b in product(left, came):
        way = None if id(a) in panels or id(b) in panels else _way_of_panel(depths, a, b)
        if way is not None:
            panels[id(a)] = _panel(depths, way, a.rest, way.left[0], way.came[0])
            panels[id(b)] = _panel(depths, way, b.rest, way.left[1], way.came[1])
    between: dict[int, list[Changed]] = {}
    for a in (*left, *came):
        row = None if id(a) in panels else _away(depths, a)
        if row is None:
            continue
        if row not in between:
            between[row] = changed_surfaces(depths, row)
        way = next((w for c in between[row] if (w := _way_of_panel(depths, a, c)) is not None), None)
        if way is not None:
            panels[id(a)] = _panel(depths, way, a.rest, way.left[0], way.came[0])
    return [(panels.get(id(c), c), id(c) in panels) for c in (*left, *came)]


def _away(depths: Depths, strip: Changed) -> int | None:
    """A row amid the longest absence of a strip that is back at the recording's other end, or None."""
    other = len(depths.frames) - 1 - strip.rest
    if (depths.look(strip.points, other, SIGMAS / 2.0, GAP_M / 2.0) == SAME).mean() < _BACK:
        return None
    rows = range(len(depths.frames))
    away = [(depths.look(strip.points, t, SIGMAS, GAP_M) == THROUGH).mean() >= _BACK for t in rows]
    longest = max((list(g) for gone, g in groupby(rows, key=lambda t: away[t]) if gone), key=len, default=[])
    return longest[len(longest) // 2] if longest else None


def _way_of_panel(depths: Depths, left: Changed, came: Changed) -> _Way | None:
    """The way from one strip of a panel to the other, if the panel covers the place between at both ends."""
    way = _way(depths, left, came)
    return way if way is not None and all(_covered(depths, way, s.rest) for s in (left, came)) else None


def _way(depths: Depths, left: Changed, came: Changed) -> _Way | None:
    """The way from one strip to another; None if they are no strips of one panel."""
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
    alike = min(wide) >= _AS_WIDE * max(wide) and across[1] - across[0] >= max(
        _BESIDE * min(long), _HIDDEN * max(long)
    )
    if not alike or b[0] <= a[1]:
        return None
    return _Way(origin, basis, a, b, np.array([min(across_a[0], across_b[0]), max(across_a[1], across_b[1])]))


def _covered(depths: Depths, way: _Way, row: int) -> bool:
    """Whether a row sees surface all over the plane between the strips, unless hidden."""
    u = np.linspace(way.left[1], way.came[0], _GRID + 2)[1:-1]
    v = np.linspace(way.across[0], way.across[1], _GRID + 2)[1:-1]
    at = np.stack(np.meshgrid(u, v), axis=-1).reshape(-1, 2)
    seen = depths.look(way.origin + at @ way.basis.T, row, SIGMAS / 2.0, GAP_M / 2.0)
    same, through = float(np.mean(seen == SAME)), float(np.mean(seen == THROUGH))
    return same >= _SEEN and same >= _COVERED * (same + through)


def _panel(depths: Depths, way: _Way, row: int, first: float, last: float) -> Changed:
    """All that a row sees on the plane from `first` to `last` m along the way."""
    points = depths.points(row)
    at = (points - way.origin) @ way.basis
    normal = np.cross(way.basis[:, 0], way.basis[:, 1])
    mask = (depths.depth[row] > 0) & (np.abs((points - way.origin) @ normal) < _on(depths))
    mask &= (at[..., 0] >= first) & (at[..., 0] <= last)
    mask &= (at[..., 1] >= way.across[0]) & (at[..., 1] <= way.across[1])
    return Changed(row, mask, points[mask], depths.colour[row][mask].astype(np.float64))


def _on(depths: Depths) -> float:
    """m from a plane within which depth lies on the plane."""
    return max(_ON_M, SIGMAS / 2.0 * depths.noise.base)
