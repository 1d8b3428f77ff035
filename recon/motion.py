"""Which parts move, by which joints: tracks in, one `PartTracks` per part out.

The first fit looks at the tracks that travel far, the hand's among them. It tells roughly when the part is at rest, and with
that which tracks lie on the hand (they are in view and move while the part rests, or have the hand's colour). The next one
looks at the far ones of the others, and tells which tracks merely slip along edges: they move while the part rests. The
last ones use all that remain, near or far. Parts are found one after the other among the tracks that no earlier part explains.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from recon.hand_color import HandColorConfig, hand_tracks
from recon.intervals import Interval, IntervalConfig, Movers, find_movers, state_intervals
from recon.joint_type import TypeHint
from recon.joints import JointConfig, MotionFit, fit_motion
from recon.parts import MovingPart
from recon.recording import Recording
from recon.track_bundle import Model, Observations
from recon.track_start import track_support
from recon.tracks import Tracks
from twin import geometry as geo
from twin.errors import ConfigError, ReconstructionError
from twin.geometry import Array
from twin.scene import FIRST_PART_ID, Motion, Revolute, Trajectory

REST_MARGIN = 3  # frames between motion and what surely is rest; chosen by us
_AS_WELL = 0.9  # a fit to more tracks is kept when the tracks follow it nearly as well; wrong ones have a quarter or less
_CALM_ROUNDS = (
    2  # of telling restless tracks by the fit and fitting the others; more change nothing we measured
)


@dataclass(frozen=True)
class MotionConfig:
    """Finding parts among tracks. Chosen by us unless the comment says otherwise.

    far_share: tracks that travel less than this share of the farthest travelling ones (95th percentile) wait for the
    last fits. rest_tolerance: m, a track of the part stays within it while the part rests. min_tracks, min_share: a
    further part needs that many tracks, and that share of the first part's. min_travel: m, its tracks' median path.
    max_residual: m, RMS that its fit may leave. max_looseness: most times the RMS of the first part, which the same camera
    sees. max_moving_share: of the frames that see it, those in which it moves.
    max_axis_sigma: rad, uncertainty of its axis. same_axis, same_pivot: rad and m, two fits nearer than this that move
    at the same time are two faces of one part.
    """

    far_share: float = 0.3
    rest_tolerance: float = 0.012
    max_parts: int = 8
    min_tracks: int = 15
    min_share: float = 0.1
    min_travel: float = 0.04
    max_residual: float = 0.008
    max_looseness: float = 2.5
    max_moving_share: float = 0.8
    max_axis_sigma: float = float(np.radians(2.0))
    same_axis: float = float(np.radians(10.0))
    same_pivot: float = 0.06
    joint: JointConfig = field(default_factory=JointConfig)
    interval: IntervalConfig = field(default_factory=IntervalConfig)
    hand: HandColorConfig = field(default_factory=HandColorConfig)

    def __post_init__(self) -> None:
        if (
            not 0 < self.far_share < 1
            or self.rest_tolerance <= 0
            or self.max_parts < 1
            or self.min_tracks < 3
        ):
            raise ConfigError(
                f"motion: far_share in 0..1, positive rest_tolerance, max_parts >= 1, min_tracks >= 3 are needed: {self}"
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
    config: MotionConfig = MotionConfig(),
    hints: Sequence[TypeHint] = (),
) -> FoundParts:
    """Find every part that moves by a joint. hints: joint types that somebody expects; see `recon.joint_type`.

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
        known = _same_part(fit, members, movers, found, config)
        if known is not None:
            both = found[known].members | members
            fits[known] = _fit_of_both(fits[known], both, movers, config)
            part = _moving_part(found[known].part.id, fits[known], recording, cameras, config)
            found[known] = replace(found[known], part=part, members=both)
        elif found and not _is_another_part(fit, members, movers, fits[0], found[0].members, config):
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
    hand = hand | hand_tracks(recording, cameras, tracks, _rests(best.fit, frames, config), config.hand)
    free = free & ~hand
    try:
        best = _fit_first((_far(free, travel, config), free), free, movers, config, hints)
        for _ in range(_CALM_ROUNDS):
            calm = free & ~_restless(movers, free, _known_rests(best.fit, frames, config), config)
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


def _rests(fit: MotionFit, frames: int, config: MotionConfig) -> list[tuple[int, int]]:
    """Spans of frames in which the fitted part rests, a few frames away from its motion."""
    spans, start = [], 0
    for interval in (*_spans(fit, config), Interval(frames + 1, frames + 2)):
        first, last = start, min(interval.first - REST_MARGIN, frames - 1)
        if last - first >= REST_MARGIN:
            spans.append((first, last))
        start = interval.last + REST_MARGIN
    return spans


def _known_rests(fit: MotionFit, frames: int, config: MotionConfig) -> list[tuple[int, int]]:
    """Spans of rest cut to the frames whose state is known: past the last of these the part may well move on."""
    spans = []
    for first, last in _rests(fit, frames, config):
        known = fit.frames[(fit.frames >= first) & (fit.frames <= last)]
        if len(known) and known[-1] - known[0] >= REST_MARGIN:
            spans.append((int(known[0]), int(known[-1])))
    return spans


def _restless(
    movers: Movers, chosen: NDArray[np.bool_], rests: Sequence[tuple[int, int]], config: MotionConfig
) -> NDArray[np.bool_]:
    """Tracks (K,) that move while the part rests: on the hand, or slipping along an edge."""
    out = np.zeros_like(chosen)
    for k in np.flatnonzero(chosen):
        for first, last in rests:
            p = movers.points_world[first : last + 1, k][movers.visible[first : last + 1, k]]
            if len(p) >= 6:
                d = np.linalg.norm(p - np.median(p, axis=0), axis=1)
                out[k] |= bool(np.quantile(d, 0.9) > config.rest_tolerance)
    return out


def _same_part(
    fit: MotionFit,
    members: NDArray[np.bool_],
    movers: Movers,
    found: Sequence[PartTracks],
    config: MotionConfig,
) -> int | None:
    """Index of the found part that the new tracks belong to, if there is one: its joint and states carry most of them,
    or the new fit found its joint again at the same time (from the tracks on its other face)."""
    for number, other in enumerate(found):
        T_part_world = geo.invert_pose(other.part.joint.poses(other.part.motion.state))
        frames = other.part.motion.frames
        rigid = 0
        for k in np.flatnonzero(members):
            seen = movers.visible[frames, k]
            back = geo.transform(T_part_world[seen], movers.points_world[frames[seen], k][:, None])[:, 0]
            spread = np.linalg.norm(back - np.median(back, axis=0), axis=1)
            rigid += bool(np.median(spread) < 2.0 * config.rest_tolerance)
        if rigid > 0.5 * int(members.sum()) or _same_joint(fit, other, config):
            return number
    return None


def _same_joint(fit: MotionFit, other: PartTracks, config: MotionConfig) -> bool:
    """Whether a fit has the joint of a found part and moves together with it, or right before or after it."""
    joint, known = fit.joint, other.part.joint
    if joint.kind != known.kind or geo.line_angle(joint.axis, known.axis) > config.same_axis:
        return False
    if isinstance(joint, Revolute) and isinstance(known, Revolute):
        centre = np.nanmedian(fit.landmarks, axis=0)
        feet = [geo.nearest_point_on_line(centre, j.pivot, j.axis) for j in (joint, known)]
        if np.linalg.norm(feet[0] - feet[1]) > config.same_pivot:
            return False
    gap = 2 * REST_MARGIN
    spans = _spans(fit, config)
    return any(
        i.first <= last + gap and first <= i.last + gap
        for i in spans
        for first, last in other.part.motion.intervals
    )


def _spans(fit: MotionFit, config: MotionConfig) -> tuple[Interval, ...]:
    """When the fitted part surely moves: its slow starts and ends count as rest."""
    # Each frame's own uncertainty would call slow starts rest; 5 % of the range is well above both.
    careful = replace(config.interval, rest_share=0.05)
    noise = fit.joint.sigma.state if fit.joint.sigma else 0.0
    return state_intervals(fit.frames, fit.state, noise, careful)


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


def _is_another_part(
    fit: MotionFit,
    members: NDArray[np.bool_],
    movers: Movers,
    first: MotionFit,
    of_first: NDArray[np.bool_],
    config: MotionConfig,
) -> bool:
    """A further part must move as a part does: from rest to rest, rigidly, far, and seen by enough tracks.

    Points that slip along edges while the camera sways also follow some joint, but loosely and without ever resting.
    """
    enough = int(members.sum()) >= max(config.min_tracks, config.min_share * int(of_first.sum()))
    lever = np.linalg.norm(fit.joint.velocity(0.0, np.nanmedian(fit.landmarks, axis=0)))
    far = float(fit.joint.upper * lever) >= config.min_travel
    moving = sum(i.last - i.first + 1 for i in _spans(fit, config))
    rests = 0 < moving <= config.max_moving_share * len(fit.frames) and bool(np.any(members & movers.rested))
    sure = fit.joint.sigma is not None and fit.joint.sigma.axis <= config.max_axis_sigma
    loose = fit.residual > min(config.max_residual, config.max_looseness * first.residual)
    return enough and far and rests and sure and not loose


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
