"""The joint fitted to the first half of a motion, by travel, against the one fitted to the second half."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recon.joints.bundle import ROUGHLY, Bundle, refine
from recon.joints.observations import Model, Observations
from recon.motion.movers import Movers
from recon.parts.find_parts import PartTracks
from recon.parts.moving_part import MovingPart
from recon.verdict.in_motion import moving_rows, travel_at
from twin import geometry as geo
from twin.joint import JointSigma
from twin.scene import Revolute

# Frames of a half and tracks that are looked at, of each at most and at least; a track must be seen in this share of the frames. The
# start of the noise scale (m), which the fit finds itself, and how many steps it takes at most. All chosen by us
_MOST_FRAMES, _MOST_TRACKS, _FEWEST_FRAMES, _FEWEST_TRACKS, _SEEN = 40, 150, 4, 6, 1 / 3
_NOISE_M, _STEPS = 0.003, 30


@dataclass(frozen=True)
class Halves:
    """How far the two joints are from each other, with one standard deviation of that: axes in rad; the hinges' distance beside the
    part in m, None of a slide. off: by how much the axis of the half that is nearer to it differs from the part's, rad."""

    axis: float
    axis_sigma: float
    pivot: float | None
    pivot_sigma: float | None
    off: float = 0.0


def halves(movers: Movers, part: MovingPart, tracks: PartTracks) -> Halves | None:
    """The joints of the two halves of the motion; None where one of them has too few frames or tracks for a fit."""
    rows = moving_rows(part)
    if not len(rows):
        return None
    travel = travel_at(part, rows)
    middle = 0.5 * (travel[0] + travel[-1])
    fits = [_fit(movers, part, tracks, half) for half in (rows[travel <= middle], rows[travel >= middle])]
    first, second = fits
    if first is None or second is None:
        return None
    a, b = _sigma(first), _sigma(second)
    angle = float(geo.line_angle(first.model.axis, second.model.axis))
    sigma = float(np.hypot(a.axis, b.axis))
    off = min(float(geo.line_angle(fit.model.axis, part.joint.axis)) for fit in (first, second))
    if a.pivot is None or b.pivot is None:
        return Halves(angle, sigma, None, None, off)
    centre = 0.5 * (first.landmarks.mean(axis=0) + second.landmarks.mean(axis=0))
    here = geo.nearest_point_on_line(centre, first.model.pivot, first.model.axis)
    there = geo.nearest_point_on_line(here, second.model.pivot, second.model.axis)
    return Halves(angle, sigma, float(np.linalg.norm(here - there)), float(np.hypot(a.pivot, b.pivot)), off)


def _fit(movers: Movers, part: MovingPart, tracks: PartTracks, rows: NDArray[np.int64]) -> Bundle | None:
    """The joint by the part's tracks in these rows of its motion alone."""
    rows = _thinned(rows, _MOST_FRAMES)
    frames = part.motion.frames[rows]
    members = np.flatnonzero(tracks.members)
    often = movers.visible[np.ix_(frames, members)].sum(axis=0) >= max(_FEWEST_FRAMES, _SEEN * len(frames))
    members = _thinned(members[often], _MOST_TRACKS)
    if len(members) < _FEWEST_TRACKS or len(frames) < _FEWEST_FRAMES:
        return None
    chosen = np.ix_(frames, members)
    seen = Observations.of(movers.points_world[chosen], movers.visible[chosen])
    joint, state = part.joint, part.motion.state[rows]
    pivot = joint.pivot if isinstance(joint, Revolute) else np.zeros(3)
    start = Model(joint.kind, joint.axis, pivot, state - state.mean())
    return refine(seen, start, _NOISE_M, _STEPS, ROUGHLY)


def _thinned(indices: NDArray[np.int64], most: int) -> NDArray[np.int64]:
    """At most so many of them, evenly spread."""
    if len(indices) <= most:
        return indices
    return np.asarray(indices[np.linspace(0, len(indices) - 1, most).round().astype(int)])


def _sigma(fit: Bundle) -> JointSigma:
    count = len(fit.covariance) - len(fit.model.state)
    return JointSigma.of(fit.covariance[:count, :count], 0.0)
