"""The joint by a part's tracks: of the first half of its motion (by travel), the second half, and all."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from recon.interaction.joints.bundle import ROUGHLY, Bundle, refine
from recon.interaction.joints.hypotheses import Hypothesis
from recon.interaction.joints.initial_states import states_of
from recon.interaction.joints.observations import Model, Observations, noise_sigma, residuals
from recon.interaction.motion.movers import Movers
from recon.interaction.parts.find_parts import PartTracks
from recon.interaction.parts.moving_part import MovingPart
from recon.verdict.in_motion import moving_rows, travel_at
from twin import geometry as geo
from twin.joint import JointSigma
from twin.scene import Revolute

# All chosen by us.
# Frames of a half that are looked at, at most and at least
_MOST_FRAMES = 40
_FEWEST_FRAMES = 4
# Tracks that are looked at, at most and at least
_MOST_TRACKS = 150
_FEWEST_TRACKS = 6
# Share of the frames in which a track must be seen
_SEEN = 1 / 3
# m, start of the noise scale, which the fit finds itself
_NOISE_M = 0.003
# m, least noise scale
_LEAST_M = 1e-5
# Steps that the fit takes at most
_STEPS = 30


@dataclass(frozen=True)
class Halves:
    """How far the two joints are from each other, with one standard deviation of that: axes in rad; the
    hinges' distance beside the part in m, None of a slide. off: by how much the axis of the half that is
    nearer to it differs from the part's, rad. worse: by how much farther the tracks of a half scatter about
    the part's joint than about its own, the larger of two ratios. off_pivot: of the half whose hinge is
    nearer to the part's, its distance from that, m."""

    axis: float
    axis_sigma: float
    pivot: float | None
    pivot_sigma: float | None
    off: float = 0.0
    worse: float = np.inf
    off_pivot: float = 0.0


@dataclass(frozen=True)
class Whole:
    """The axis that the tracks tell over the whole motion: how far from the part's, rad, one standard
    deviation of it, rad, and their scatter about the part's joint over that about their own."""

    off: float
    sigma: float
    worse: float


def whole(movers: Movers, part: MovingPart, tracks: PartTracks) -> Whole | None:
    """The axis by all tracks of the part; None where there are too few frames or tracks for a fit."""
    fit = _fit(movers, part, tracks, moving_rows(part))
    if fit is None:
        return None
    off = float(geo.line_angle(fit.own.model.axis, part.joint.axis))
    return Whole(off, _sigma(fit.own).axis, fit.worse)


def halves(movers: Movers, part: MovingPart, tracks: PartTracks) -> Halves | None:
    """The joints of the two halves of the motion; None with too few frames or tracks."""
    rows = moving_rows(part)
    if not len(rows):
        return None
    travel = travel_at(part, rows)
    middle = 0.5 * (travel[0] + travel[-1])
    first, second = (
        _fit(movers, part, tracks, half) for half in (rows[travel <= middle], rows[travel >= middle])
    )
    if first is None or second is None:
        return None
    a, b = _sigma(first.own), _sigma(second.own)
    one, two = first.own.model, second.own.model
    angle = float(geo.line_angle(one.axis, two.axis))
    sigma = float(np.hypot(a.axis, b.axis))
    off = min(float(geo.line_angle(model.axis, part.joint.axis)) for model in (one, two))
    worse = max(first.worse, second.worse)
    if a.pivot is None or b.pivot is None:
        return Halves(angle, sigma, None, None, off, worse)
    centre = 0.5 * (first.own.landmarks.mean(axis=0) + second.own.landmarks.mean(axis=0))
    here = geo.nearest_point_on_line(centre, one.pivot, one.axis)
    there = geo.nearest_point_on_line(here, two.pivot, two.axis)
    apart = float(np.linalg.norm(here - there))
    of_part = part.joint.pivot if isinstance(part.joint, Revolute) else here
    away = min(
        float(np.linalg.norm(p - geo.nearest_point_on_line(p, of_part, part.joint.axis)))
        for p in (here, there)
    )
    return Halves(angle, sigma, apart, float(np.hypot(a.pivot, b.pivot)), off, worse, away)


@dataclass(frozen=True, eq=False)
class _Half:
    """The joint by the tracks of some frames, and their scatter about the part's own over that."""

    own: Bundle
    worse: float


def _fit(movers: Movers, part: MovingPart, tracks: PartTracks, rows: NDArray[np.int64]) -> _Half | None:
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
    own = refine(seen, start, _NOISE_M, _STEPS, ROUGHLY)
    return _Half(own, _scatter(seen, start, own.sigma) / max(own.sigma, _LEAST_M))


def _scatter(seen: Observations, given: Model, sigma: float) -> float:
    """Noise (m) of tracks about a given joint, at their best states; sigma: about their own."""
    states = states_of(seen, Hypothesis(given.kind, given.axis, given.pivot), max(sigma, _LEAST_M))
    square, _, _ = residuals(seen, replace(given, state=states), max(sigma, _LEAST_M))
    unknowns = 3 * len(seen.points) + int((seen.weight > 0).any(axis=0).sum())
    return noise_sigma(square, seen.weight, unknowns)


def _thinned(indices: NDArray[np.int64], most: int) -> NDArray[np.int64]:
    """At most so many of them, evenly spread."""
    if len(indices) <= most:
        return indices
    return np.asarray(indices[np.linspace(0, len(indices) - 1, most).round().astype(int)])


def _sigma(fit: Bundle) -> JointSigma:
    count = len(fit.covariance) - len(fit.model.state)
    return JointSigma.of(fit.covariance[:count, :count], 0.0)
