"""How thick a handle is, drawn and to touch, and whether a finger finds room behind it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from benchmarks.completed.asset import Geom, merged
from recon.evaluation.truth import TruthPart
from recon.simulate.ray_caster import Caster
from twin import geometry as geo
from twin.collision.convex import cut
from twin.collision.pieces import pieces_of
from twin.collision.solid import Solid
from twin.geometry import Array
from twin.inferred import Completion
from twin.scene import Mesh

BEHIND = 0.5  # of the free way behind a bar, chosen by us: what is further from it belongs to the front
ASIDE = (
    0.060  # m around the bar's axis in which its section is measured, chosen by us: twice the thickest handle
)
MIDDLE = 0.5  # of a bar's length over which its section is measured, chosen by us: posts stand at its ends
_NEAR = 0.005  # m, chosen by us: the grip lies that near to the box of what it holds
_SLIM = 0.060  # m across the bar, chosen by us: more is a board
_POINTS = 20_000  # in the gap


@dataclass(frozen=True)
class Bar:
    """A true handle at the part's most closed state shown.

    Attributes:
        axes: columns (3, 3): along, across, out of the part.
        low: smallest corner (3,) of the bar in those axes, metres.
        high: its largest corner.
        face: how far out the face of the front behind it lies.
    """

    axes: Array
    low: Array
    high: Array
    face: float


@dataclass(frozen=True)
class Section:
    """Largest extents (m) across the bar's direction, 0 of what isn't there: the true one, what is drawn,
    what collides. gap: share of the free space behind the bar that the colliders leave free, None where there
    truly is none."""

    true: float
    visual: float
    collider: float
    gap: float | None


def true_bar(part: TruthPart, grip: Mapping[str, Any]) -> Bar | None:
    """The slim closed piece of a true part that the hand holds; None where it holds a board's edge, or
    nothing lies behind.

    grip: as truth.json tells it, in the world at state 0.
    """
    along, out = (geo.unit(np.array(grip[k], np.float64)) for k in ("along_world", "outward_world"))
    along = geo.rotate(part.T_world_closed, along)
    out = geo.rotate(part.T_world_closed, out)
    out = geo.unit(out - (out @ along) * along)
    axes = np.stack([along, np.cross(out, along), out], axis=1)
    point = geo.transform(part.T_world_closed, np.array(grip["point_world"], np.float64)[None])[0] @ axes
    slim, rest = [], []
    for mesh, closed in pieces_of(part.closed_mesh):
        local = mesh.vertices @ axes
        low, high = local.min(axis=0), local.max(axis=0)
        held = bool(np.all((point > low - _NEAR) & (point < high + _NEAR)))
        if closed and held and (high - low)[1:].max() <= _SLIM:
            slim.append((low, high))
        elif np.sort((high - low)[:2])[0] > _SLIM:
            rest.append(mesh)
    if not slim or not rest:
        return None
    low, high = max(slim, key=lambda b: float(np.prod(b[1] - b[0])))
    middle = 0.5 * (low + high)
    caster, front = Caster(), merged(rest)
    caster.add(front.vertices, front.faces)
    far = float(caster.first(np.concatenate([axes @ middle, -out])[None]).t[0])
    return Bar(axes, low, high, float(middle[2] - far)) if np.isfinite(far) else None


def section(bar: Bar, part: TruthPart, visuals: Iterable[Geom], colliders: Iterable[Geom]) -> Section:
    """Measure what stands where the true bar is in the same way as the true part."""
    shapes = [g.mesh for g in colliders]
    drawn = merged(g.mesh for g in visuals)
    return Section(
        thickness(bar, part.closed_mesh),
        thickness(bar, drawn),
        thickness(bar, merged(shapes)),
        _gap(bar, Solid.of_mesh(part.closed_mesh), Solid.of_shapes(shapes)),
    )


def thickness(bar: Bar, mesh: Mesh) -> float:
    """Larger of the extents (m) across the bar and out of the part of what a mesh has around the middle of
    the bar, the further half of the way to the front left out."""
    middle, half = 0.5 * (bar.low + bar.high), 0.5 * (bar.high - bar.low)
    reach = np.array([MIDDLE * half[0], ASIDE, ASIDE])
    low, high = middle - reach, middle + reach
    low[2] = bar.low[2] - BEHIND * (bar.low[2] - bar.face)
    triangles = mesh.vertices[mesh.faces] @ bar.axes
    for k in range(3):
        normal = np.eye(3)[k]
        triangles = cut(cut(triangles, normal, float(low[k]))[1], normal, float(high[k]))[0]
    if not len(triangles):
        return 0.0
    return float(np.ptp(triangles.reshape(-1, 3), axis=0)[1:].max())


def called_assumed(bar: Bar, visuals: Iterable[Geom], completion: Completion | None) -> bool:
    """Whether all inferred pieces of a part that stand where `thickness` measures are assumed; posts and
    necks stand elsewhere."""
    basis = {} if completion is None else {p.name: p.basis for p in completion.pieces}
    there = [basis.get(g.inferred) for g in visuals if g.inferred is not None and thickness(bar, g.mesh) > 0]
    return bool(there) and all(b == "assumed" for b in there)


def _gap(bar: Bar, true: Solid, shapes: Solid) -> float | None:
    low, high = bar.low.copy(), bar.high.copy()
    low[2], high[2] = bar.face, bar.low[2]
    size = high - low
    if not np.all(size > 0):
        return None
    spacing = float(np.cbrt(np.prod(size) / _POINTS))
    at = [a + (np.arange(n) + 0.5) * s / n for a, s, n in
          zip(low, size, np.maximum(np.round(size / spacing).astype(int), 1), strict=True)]  # fmt: skip
    points = np.stack(np.meshgrid(*at, indexing="ij"), axis=-1).reshape(-1, 3) @ bar.axes.T
    free = points[true.signed_distance(points) > 0]
    if not len(free):
        return None
    return float(np.mean(shapes.signed_distance(free) > 0))
