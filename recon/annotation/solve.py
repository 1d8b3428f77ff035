"""The joint and the states of a part, by the marks on it and the corners that move with it.

The marks say which corners are the part's, when they move, and how; the video says where the joint is.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from recon.annotation.marks import PartMarks
from recon.annotation.seen import Seen, filled, shown_in, surface_of
from recon.interaction.joints.fit_tracks import MotionFit, fit_motion
from recon.interaction.motion.movers import Movers, find_movers
from recon.interaction.parts.found import FoundParts, PartTracks
from recon.interaction.parts.moving_part import MovingPart
from recon.interaction.refine.observations import GATES
from recon.interaction.refine.refine_parts import refine_parts
from recon.recording import Recording
from twin import geometry as geo
from twin.errors import InputError, ReconstructionError
from twin.geometry import Array
from twin.scene import FIRST_PART_ID, STATIC_LABEL, Joint, Mesh, Motion, Prismatic, Revolute, Trajectory

# Frames of rest on both sides of a motion that the fit sees; the farther half tells the state. Chosen by us.
_REST = 12
# Share of the travel that may lie outside the marked motions before it is told. Chosen by us.
_OUTSIDE = 0.05
# deg between the axis drawn and the one that the video shows, from which it is told: drawing is no better.
_APART = 5.0


@dataclass(frozen=True, eq=False)
class Annotated:
    """A part as its marks and the video tell it: state 0 closed, opening positive.

    states (N,): m or rad, of every frame. surface: what the outlines show of it, in the world at state 0.
    followed: how many corners tell the motion. off_mm: RMS of these about it. clicked_px: how far the states
    put the point from where it was clicked, by frame. notes: what does not fit, for people.
    """

    marks: PartMarks
    joint: Joint
    states: Array
    surface: Mesh
    followed: int
    off_mm: float
    clicked_px: dict[int, float]
    notes: tuple[str, ...]

    def pose(self, frame: int) -> Array:
        """What takes the surface (4, 4) to a frame."""
        return self.joint.pose(float(self.states[frame]))


def annotated(seen: Seen, part: PartMarks) -> Annotated:
    """Solve one part. Raises InputError that names the mark that is missing, ReconstructionError where the
    corners within the outlines tell no such joint."""
    if not part.outlines:
        raise InputError(f"{part.name} has no outline", "draw one in a frame in which it is seen well")
    if not part.moves:
        raise InputError(f"{part.name} has no motion", "mark the frames in which it moves")
    window = _window(seen, part)
    fit = _fit(window, part)
    joint: Joint = fit.joint
    count = len(seen.recording)
    states = np.interp(np.arange(count), window.first + fit.frames, fit.state)
    for gates in (GATES, GATES[-3:]):  # with masks by the corners, then with masks by what these led to
        joint, states = _refined(seen, window, part, (joint, states, fit.track_inliers), gates)
    notes = _notes(seen, part, joint, states)
    states = _at_rest(part, states)
    anchor = _anchor(seen, part, joint, states)
    if anchor is not None:
        states = _corrected(seen, part, joint, states, anchor)
    joint, states, anchor = _counted_from_closed(part, joint, states, anchor)
    off = {} if anchor is None else _clicked(seen, part, joint, states, anchor)
    return Annotated(
        part, joint, states, surface_of(seen, part, joint, states), int(fit.track_inliers.sum()),
        1e3 * fit.residual, off, tuple(notes),
    )  # fmt: skip


@dataclass(frozen=True, eq=False)
class _Window:
    """The frames from `first` on that tell a part's motion, and the corners there, of which those within its
    outlines (K,) are taken for it."""

    first: int
    recording: Recording
    cameras: Trajectory
    movers: Movers
    within: NDArray[np.bool_]


def _window(seen: Seen, part: PartMarks) -> _Window:
    count = len(seen.recording)
    first = max(min(part.moves[0][0] - _REST, *part.outlines), 0)
    last = min(max(part.moves[-1][1] + _REST, *part.outlines), count - 1)
    tracks = seen.tracks.dense(first, last)
    shape = seen.recording.intrinsics.height, seen.recording.intrinsics.width
    within = np.zeros(len(tracks), bool)
    for frame, corners in part.outlines.items():
        mask, row = filled(corners, shape), frame - first
        shown = np.flatnonzero(tracks.visible[row])
        x, y = np.clip(np.rint(tracks.pixels[row, shown]).astype(int), 0, np.array(shape[::-1]) - 1).T
        within[shown[mask[y, x]]] = True
    cameras = seen.cameras.frames
    rows = (cameras >= first) & (cameras <= last)
    inside = Trajectory(cameras[rows] - first, seen.cameras.times[rows], seen.cameras.T_world_cam[rows])
    recording = seen.recording[first : last + 1]
    return _Window(first, recording, inside, find_movers(tracks, inside, recording.times), within)


def _fit(window: _Window, part: PartMarks) -> MotionFit:
    """The joint of the corners within the outlines."""
    try:
        return fit_motion(window.movers.points_world[:, window.within], joint_type=part.kind)
    except ReconstructionError as e:
        raise ReconstructionError(
            f"{part.name}: {e.problem}", "outline it in more frames, in the middle of its motion too"
        ) from e


def _refined(
    seen: Seen,
    window: _Window,
    part: PartMarks,
    so_far: tuple[Joint, Array, NDArray[np.bool_]],
    gates: Sequence[float],
) -> tuple[Joint, Array]:
    """Joint and states by every pixel that the outlines show. so_far: both, and which of the corners within
    the outlines follow them."""
    joint, states, follow = so_far
    surface = surface_of(seen, part, joint, states)
    frames = window.first + window.cameras.frames
    labels = {}
    for frame in frames:
        shown = shown_in(seen, part, surface, joint.pose(float(states[frame])), int(frame))
        labels[int(frame) - window.first] = np.where(shown, np.uint8(FIRST_PART_ID), np.uint8(STATIC_LABEL))
    members = np.zeros(len(window.within), bool)
    members[np.flatnonzero(window.within)[follow]] = True
    inner = frames - window.first
    spans = tuple((a - window.first, b - window.first) for a, b in part.moves)
    motion = Motion(inner, window.recording.times[inner], states[frames], spans)
    found = PartTracks(MovingPart(FIRST_PART_ID, joint, motion), members, "given")
    parts = FoundParts(window.movers, (found,))
    (end,) = refine_parts(window.recording, window.cameras, labels, parts, seen.noise, gates)
    return end.joint, np.interp(np.arange(len(states)), frames, end.motion.state)


def _rests(part: PartMarks, count: int) -> list[tuple[int, int]]:
    """First and last frames of what lies before, between and after the motions."""
    ends = [0, *(f for move in part.moves for f in move), count - 1]
    return list(zip(ends[::2], ends[1::2], strict=True))


def _at_rest(part: PartMarks, states: Array) -> Array:
    """The states (N,) with one value for each rest: a motion may begin a little before it is marked."""
    out, last = states.copy(), len(states) - 1
    for begin, end in _rests(part, len(states)):
        rest = np.arange(begin, end + 1)
        after = rest - begin if begin else np.full(len(rest), len(states))
        near = np.minimum(after, end - rest if end < last else len(states))
        far = rest[(near <= _REST) & (near >= min(_REST // 2, int(near.max())))]
        out[rest] = np.median(states[far] if len(far) else states[rest])
    return out


def _anchor(seen: Seen, part: PartMarks, joint: Joint, states: Array) -> Array | None:
    """The point (3,) that was chosen, at state 0; None if none was."""
    if not part.points:
        return None
    frame, place = next(iter(part.points.items()))
    point = seen.world(frame, place[None])
    if not np.isfinite(point).all():
        raise InputError(f"the point of {part.name} in frame {frame} has no depth", "choose another one")
    return np.asarray(geo.transform(geo.invert_pose(joint.pose(float(states[frame]))), point)[0])


def _corrected(seen: Seen, part: PartMarks, joint: Joint, states: Array, anchor: Array) -> Array:
    """The states, at the frames of later points such that the chosen one lies there; of a rest in all of it.
    The difference fades from one such place to the next."""
    span = max(float(np.ptp(states)), 1e-3)
    knots: dict[int, float] = {}
    for frame, place in part.points.items():

        def cost(state: float, frame: int = frame, place: Array = place) -> float:
            at = seen.pixels(frame, geo.transform(joint.pose(state), anchor[None]))[0]
            return float(np.sum((at - place) ** 2))

        now = float(states[frame])
        told = minimize_scalar(cost, bounds=(now - 0.3 * span, now + 0.3 * span), method="bounded")
        off = float(told.x) - now if len(knots) else 0.0
        within = [rest for rest in _rests(part, len(states)) if rest[0] <= frame <= rest[1]]
        knots |= dict.fromkeys((frame, *(f for rest in within for f in rest)), off)
    frames = sorted(knots)
    return states + np.interp(np.arange(len(states)), frames, [knots[f] for f in frames])


def _counted_from_closed(
    part: PartMarks, joint: Joint, states: Array, anchor: Array | None
) -> tuple[Joint, Array, Array | None]:
    """State 0 in the closed frame (the first one if none is marked), the far end positive."""
    zero = float(states[part.closed or 0])
    states = states - zero
    sign = -1.0 if abs(float(states.min())) > float(states.max()) else 1.0
    if anchor is not None:
        anchor = np.asarray(geo.transform(joint.pose(zero), anchor[None])[0])
    axis, states = sign * joint.axis, sign * states
    limits = float(min(states.min(), 0.0)), float(states.max())
    told: dict[str, Any] = {"axis": axis, "lower": limits[0], "upper": limits[1]}
    pivot = joint.pivot if isinstance(joint, Revolute) else None
    return (Prismatic(**told) if pivot is None else Revolute(**told, pivot=pivot)), states, anchor


def _clicked(seen: Seen, part: PartMarks, joint: Joint, states: Array, anchor: Array) -> dict[int, float]:
    out = {}
    for frame, place in part.points.items():
        at = seen.pixels(frame, geo.transform(joint.pose(float(states[frame])), anchor[None]))[0]
        out[frame] = float(np.linalg.norm(at - place))
    return out


def _notes(seen: Seen, part: PartMarks, joint: Joint, states: Array) -> list[str]:
    """What does not fit together."""
    out = []
    inside = np.zeros(len(states) - 1, bool)
    for a, b in part.moves:
        inside[a:b] = True
    steps = np.abs(np.diff(states))
    if steps.sum() and steps[~inside].sum() > _OUTSIDE * steps.sum():
        share = 100 * steps[~inside].sum() / steps.sum()
        out.append(
            f"{share:.0f} % of its way lies outside the marked motions: begin them earlier, end them later"
        )
    if part.axis is not None:
        frame, places = part.axis
        ends = seen.world(frame, places)
        if np.isfinite(ends).all():
            apart = float(np.rad2deg(geo.angle_between(ends[1] - ends[0], joint.axis)))
            apart = min(apart, 180.0 - apart)
            if apart > _APART:
                out.append(f"the axis drawn is {apart:.0f}° off what the video shows")
    return out


def with_pivot_at(joint: Joint, point: Array) -> Joint:
    """The same joint, a hinge with the place on its axis that is nearest to a point (3,)."""
    if not isinstance(joint, Revolute):
        return joint
    return replace(joint, pivot=geo.nearest_point_on_line(point, joint.pivot, joint.axis))
