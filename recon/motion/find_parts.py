"""Which parts move, by which joints: tracks in, one `PartTracks` per part out.

The first fit looks at the tracks that travel far, the hand's among them. It tells roughly when the part is at rest, and with
that which tracks lie on the hand (they are in view and move while the part rests, or have the hand's colour). The next one
looks at the far ones of the others, and tells which tracks merely slip along edges: they move while the part rests. The
last ones use all that remain, near or far. Parts are found one after the other among the tracks that no earlier part explains.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from recon.joints.fit_tracks import MotionFit, fit_motion
from recon.joints.inliers import track_support
from recon.joints.observations import Model, Observations
from recon.joints.type_selection import TypeHint
from recon.motion.config import MotionConfig
from recon.motion.hand_tracks import hand_tracks
from recon.motion.intervals import Movers, find_movers, state_intervals
from recon.motion.part_matching import is_another_part, same_part
from recon.motion.static_spans import known_rest_spans, rest_spans, restless
from recon.moving_part import MovingPart
from recon.recording import Recording
from recon.tracking.tracks import Tracks
from twin import geometry as geo
from twin.errors import ReconstructionError
from twin.geometry import Array
from twin.scene import FIRST_PART_ID, Motion, Revolute, Trajectory

_DEFAULT = MotionConfig()
_AS_WELL = 0.9  # a fit to more tracks is kept when the tracks follow it nearly as well; wrong ones have a quarter or less
_CALM_ROUNDS = (
    2  # of telling restless tracks by the fit and fitting the others; more change nothing we measured
)


@dataclass(frozen=True, eq=False)
class PartTracks:
    """A moving part, the tracks (K,) that are rigid with it, and why its joint has this type."""

    part: MovingPart
    members: NDArray[np.bool_]
    type_source: str


@dataclass(frozen=True, eq=False)
class FoundParts:
    """The movers, the tracks (K,) that lie on the hand, and all parts."""

    movers: Movers
    hand: NDArray[np.bool_]
    parts: tuple[PartTracks, ...]


def find_parts(
    recording: Recording,
    tracks: Tracks,
    cameras: Trajectory,
    config: MotionConfig = _DEFAULT,
    hints: Sequence[TypeHint] = (),
) -> FoundParts:
    """Find every part that moves by a joint. hints: joint types that somebody expects; see `recon.joints.type_selection`.

    Raises ReconstructionError when nothing moves or no joint explains what moves.
    """
    movers = find_movers(recording, tracks, cameras, config.interval)
    if movers.moving.sum() < config.joint.min_tracks:
        raise ReconstructionError(
            f"nothing moves in {recording.source}: {int(movers.moving.sum())} of {len(tracks)} tracked points leave "
            f"their place by more than {config.interval.min_displacement} m",
            "record a part being opened, from rest to rest",
        )
    travel = _travel(movers)
    hand = np.zeros(len(tracks), dtype=bool)
    free = movers.moving.copy()
    found: list[PartTracks] = []
    fits: list[MotionFit] = []
    while len(found) < config.max_parts:
        try:
            fit, members, hand = _fit_one(
                recording, tracks, cameras, movers, travel, free, hand, config, hints
            )
        except ReconstructionError:
            if not found:
                raise
            break
        known = same_part(fit, members, movers, [f.part for f in found], config)
        if known is not None:
            both = found[known].members | members
            fits[known] = _fit_of_both(fits[known], both, movers, config)
            part = _moving_part(found[known].part.id, fits[known], recording, cameras, config)
            found[known] = replace(found[known], part=part, members=both)
        elif found and not is_another_part(fit, members, movers, fits[0], found[0].members, config):
            break
        else:
            circling = members | (free & ~hand & _on_course(fit, movers, config))
            fit = _fit_of_both(fit, circling, movers, config)
            members = circling & (_support(fit, circling, movers, config) > 0)
            part = _moving_part(FIRST_PART_ID + len(found), fit, recording, cameras, config)
            found.append(PartTracks(part, members, fit.type_source))
            fits.append(fit)
        free &= ~members & ~hand
    return FoundParts(movers, hand, tuple(found))


def _fit_one(
    recording: Recording,
    tracks: Tracks,
    cameras: Trajectory,
    movers: Movers,
    travel: Array,
    free: NDArray[np.bool_],
    hand: NDArray[np.bool_],
    config: MotionConfig,
    hints: Sequence[TypeHint] = (),
) -> tuple[MotionFit, NDArray[np.bool_], NDArray[np.bool_]]:
    """One part: the fit, its members (K,) and the tracks on the hand (K,)."""
    first, frames = bool((free == movers.moving).all()), len(recording)
    free = free & ~hand
    best = _fit_first((_far(free, travel, config), free), free, movers, config, hints)
    hand = hand | hand_tracks(recording, cameras, tracks, rest_spans(best.fit, frames, config), config.hand)
    free = free & ~hand
    try:
        best = _fit_first((_far(free, travel, config), free), free, movers, config, hints)
        for _ in range(_CALM_ROUNDS):
            calm = free & ~restless(movers, free, known_rest_spans(best.fit, frames, config), config)
            every = _fit_first((calm,), free, movers, config, hints)
            if every.support < _AS_WELL * best.support:  # led astray by what slips along edges
                break
            best = every
    except ReconstructionError as e:
        if first:
            warnings.warn(
                f"the joint rests on tracks that may lie on the hand or slip along edges ({e.problem})",
                stacklevel=3,
            )
    members = np.zeros_like(free)
    members[np.flatnonzero(best.chosen)[best.fit.track_inliers]] = True
    return best.fit, members, hand


@dataclass(frozen=True, eq=False)
class _Candidate:
    """A fit to the chosen tracks (K,) and how many free ones follow it, each counted by how well."""

    fit: MotionFit
    chosen: NDArray[np.bool_]
    support: float


def _fit_first(
    choices: Sequence[NDArray[np.bool_]],
    free: NDArray[np.bool_],
    movers: Movers,
    config: MotionConfig,
    hints: Sequence[TypeHint] = (),
) -> _Candidate:
    """The fit to the first choice of tracks that has one.

    Raises ReconstructionError when none has.
    """
    failed: list[ReconstructionError] = []
    for chosen in choices:
        try:
            points, visible = movers.points_world[:, chosen], movers.visible[:, chosen]
            fit = fit_motion(points, visible, config=config.joint, hints=hints)
        except ReconstructionError as e:
            failed.append(e)
        else:
            return _Candidate(fit, chosen, float(_support(fit, free, movers, config).sum()))
    raise failed[0]


def _support(fit: MotionFit, asked: NDArray[np.bool_], movers: Movers, config: MotionConfig) -> Array:
    """How much better each track (K,) follows a fit than standing still, 0..1; 0 for those not asked for.

    Past its known frames the part is held still.
    """
    obs = Observations.of(movers.points_world[:, asked], movers.visible[:, asked])
    state = np.interp(np.arange(len(movers.visible)), fit.frames, fit.state)
    pivot = fit.joint.pivot if isinstance(fit.joint, Revolute) else np.zeros(3)
    model = Model(fit.joint.kind, fit.joint.axis, pivot, state)
    out = np.zeros(len(asked))
    out[asked] = track_support(obs, model, config.joint.search_sigma, config.joint)
    return out


def _travel(movers: Movers) -> Array:
    """Distance (K,) between the median points of the first and of the farthest five observations of each mover."""
    out = np.zeros(movers.visible.shape[1])
    for k in np.flatnonzero(movers.moving):
        p = movers.points_world[movers.visible[:, k], k]
        d = np.linalg.norm(p - np.median(p[:5], axis=0), axis=1)
        out[k] = np.sort(d)[-min(5, len(d))]
    return out


def _far(free: NDArray[np.bool_], travel: Array, config: MotionConfig) -> NDArray[np.bool_]:
    if not free.any():
        raise ReconstructionError("no moving tracks are left")
    reach = float(np.quantile(travel[free], 0.95))
    return free & (travel > max(config.interval.min_displacement, config.far_share * reach))


def _on_course(fit: MotionFit, movers: Movers, config: MotionConfig) -> NDArray[np.bool_]:
    """Tracks (K,) that keep their distance from the fitted joint's axis and their place along it, or move along the slide.

    That needs no state, so it finds the part's points in frames of which the fit knows none.
    """
    joint, out = fit.joint, np.zeros(movers.moving.shape, bool)
    basis = geo.orthogonal_basis(joint.axis)
    for k in np.flatnonzero(movers.moving):
        p = movers.points_world[movers.visible[:, k], k]
        if isinstance(joint, Revolute):
            q = (p - joint.pivot) @ basis
            course = np.stack([np.hypot(q[:, 0], q[:, 1]), q[:, 2]], axis=1)
        else:
            course = p @ basis[:, :2]
        off = np.linalg.norm(course - np.median(course, axis=0), axis=1)
        out[k] = np.quantile(off, 0.9) < config.rest_tolerance
    return out


def _fit_of_both(
    fit: MotionFit, members: NDArray[np.bool_], movers: Movers, config: MotionConfig
) -> MotionFit:
    """The fit to all tracks of a part that was found in two pieces, when it knows the state of more frames.

    A door that crosses edge-on loses the tracks on its front before those on its inside begin.
    """
    points, visible = movers.points_world[:, members], movers.visible[:, members]
    try:
        both = fit_motion(points, visible, config=config.joint, joint_type=fit.joint.kind)
    except ReconstructionError:
        return fit
    better = len(both.frames) > len(fit.frames) and both.residual <= config.max_residual
    before, after = (float(_support(f, members, movers, config).sum()) for f in (fit, both))
    # its type was handed on, not given by anybody: what decided the first fit's type still does
    return replace(both, type_source=fit.type_source) if better and after >= _AS_WELL * before else fit


def _moving_part(
    number: int, fit: MotionFit, recording: Recording, cameras: Trajectory, config: MotionConfig
) -> MovingPart:
    """A state for every posed frame; frames without an estimate lie between their neighbours for now."""
    state = np.interp(cameras.frames, fit.frames, fit.state)
    intervals = state_intervals(
        cameras.frames, state, fit.joint.sigma.state if fit.joint.sigma else 0.0, config.interval
    )
    spans = tuple((i.first, i.last) for i in intervals)
    motion = Motion(cameras.frames, recording.times[cameras.frames], state, spans, fit.residual, fit.inliers)
    return MovingPart(number, fit.joint, motion)
