"""Which part is mounted on which: a basket in a drawer goes along when the drawer closes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from recon.interaction.parts.moving_part import MovingPart
from recon.merge.same_part import OVERLAP, Surface
from recon.merge.standing import SAME
from twin import geometry as geo
from twin.geometry import Array

# m that a carrier takes a part along: less is its labels' border. Chosen by us.
_FAR_M = 0.05


def on_carriers(
    parts: Sequence[MovingPart], surfaces: Sequence[Surface]
) -> tuple[tuple[MovingPart, ...], tuple[Surface, ...]]:
    """The parts, each on the part that carries it, and their surfaces, in the frames of their carriers.

    A part is carried by another where its surface, as it is when it is handled, lies on what the other takes
    along: what moved with the drawer when it was opened was labelled as the drawer. surfaces: cells at state
    0, in the world.
    """
    order = sorted(range(len(parts)), key=lambda k: -len(surfaces[k].points))
    moved, cells = list(parts), list(surfaces)
    for k in order:
        on = [
            j
            for j in order
            if j != k and moved[j].carrier is None and _carries(parts[j], surfaces[j], parts[k], surfaces[k])
        ]
        if not on or any(p.carrier is not None and p.carrier.id == parts[k].id for p in moved):
            continue
        T = parts[on[0]].pose(parts[k].handled_first)
        assert T is not None
        back = geo.invert_pose(T)
        moved[k] = replace(parts[k], joint=parts[k].joint.transformed(back), carrier=parts[on[0]])
        cells[k] = Surface(geo.transform(back, surfaces[k].points))
    return tuple(moved), tuple(cells)


def _carries(carrier: MovingPart, its: Surface, part: MovingPart, surface: Surface) -> bool:
    """Whether a part's surface, as it is handled, lies on that of a larger one that takes it along."""
    frame = part.handled_first
    T, own = carrier.pose(frame), part.pose(frame)
    if T is None or own is None or len(surface.points) >= len(its.points) or not _rests(carrier, part):
        return False
    there = geo.invert_pose(T) @ own
    far = _goes(carrier, geo.transform(there, surface.points)) if len(surface.points) else 0.0
    return far >= _FAR_M and surface.covered_by(its, there) >= OVERLAP


def _rests(carrier: MovingPart, part: MovingPart) -> bool:
    """Whether a carrier is known to stand still while a part is moved: else the part may be the carrier
    itself, in an interaction that was solved wrong."""
    for first, last in part.motion.intervals:
        inside = (carrier.motion.frames >= first) & (carrier.motion.frames <= last)
        if inside.sum() <= last - first or np.ptp(carrier.motion.state[inside]) > SAME[carrier.joint.kind]:
            return False
    return True


def _goes(carrier: MovingPart, points: Array) -> float:
    """How far (m) its motion takes points (n, 3) of its frame."""
    state = carrier.motion.state
    ends = (geo.transform(carrier.joint.pose(float(s)), points) for s in (state.min(), state.max()))
    return float(np.linalg.norm(np.subtract(*ends), axis=1).mean())
