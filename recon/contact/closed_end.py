"""Which end of a part's travel is the closed one: the furniture around decides.

FunREC, supplement 4: which of the limits is the closed end.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from recon.contact.closed_odds import ClosedCues
from recon.contact.faces import sample
from recon.contact.front import ALONG, Front, front_of
from recon.contact.surroundings import flush_shares, nearer_ahead
from recon.dense.depth import look_up
from recon.interaction.joints.sign_and_limits import smoothed
from recon.interaction.parts.moving_part import MovingPart
from recon.recording import Recording
from twin import geometry as geo
from twin.geometry import Array
from twin.scene import STATIC_LABEL, Joint, Mesh, Prismatic, Trajectory

# Step of turning a hinge past an end: the edge of a 0.5 m front moves less than twice `gap`. Chosen by us.
_TURN_STEP = np.radians(5.0)
# A rim closer than this (m) to the static surface is flush with it: a panel and a joint gap; chosen by us
_GAP = 0.03
# What lies so far (m) behind the part is a cavity, not the neighbour that a sliding door covers; chosen by us
_DEEP = 0.08
# Frames looked at for each end; chosen by us
_FRAMES = 8
# How far past an end a hinge is turned on, to see whether it would be flush there: a door may stand ajar at
# both ends; chosen by us
PAST_HINGE = float(np.radians(30.0))
# The same (m) of what slides along its front's normal; chosen by us
_PAST_SLIDE = 0.1
# Ends of the travel are this quantile of the smoothed state and its opposite; chosen by us
_QUANTILE = 0.02


@dataclass(frozen=True)
class ClosedEnd:
    """The closed end: its state in the part's own counting, the state's sign on opening, the reason.

    probability: of this end by the added log odds of all cues; .5 if no cue was looked at. adjoined: the
    greatest share of the front's rim beside which static surface stands, at an end of the travel or past it.
    """

    state: float
    opening_sign: Literal[1, -1]
    source: str
    probability: float = 0.5
    adjoined: float = 0.0


def find_closed_end(
    part: MovingPart,
    part_mesh: Mesh,
    static: Mesh,
    recording: Recording,
    cameras: Trajectory,
    labels: Mapping[int, NDArray[np.uint8]],
) -> ClosedEnd:
    """The likelier end by the surroundings of the part at both ends of its travel, and by where it starts
    (`recon.contact.closed_odds`). part_mesh: at the part's state 0.

    A slide in its own plane may be flush all along: its edge ahead, which stops at a wall of the furniture,
    and the cavity that it covers tell the ends apart.
    """
    ends = travel_ends(part.handled_states)
    starts = 1.0 - 2.0 * _starts_at(part, ends)
    surface = sample(part_mesh)
    if not len(surface.points):
        nothing = 0.0, 0.0
        return _end(ends, ClosedCues(nothing, nothing, nothing, None, 0.0, starts), 0.0)
    face = front_of(surface, part, cameras.T_world_cam[:, :3, 3])
    flush = flush_shares(surface, face, part.joint, ends, static, _GAP, _past(face, part.joint))
    along = float(face.normal @ part.joint.axis) if isinstance(part.joint, Prismatic) else 1.0
    in_plane = part.slides_within(face.normal)
    cavity = [0.0, 0.0]
    for k in (0, 1) if in_plane else ():
        depth = _depth_behind(
            part, face, ends[k], _far_frames(part, labels, ends, k), recording, cameras, labels
        )
        cavity[k] = float(np.mean(depth > _DEEP)) if len(depth) else 0.0
    slides_out = isinstance(part.joint, Prismatic) and abs(along) >= ALONG
    return _end(
        ends,
        ClosedCues(
            flush=[of_end[0] for of_end in flush],
            past=[max(of_end) for of_end in flush],
            cavity=cavity,
            ahead=nearer_ahead(face, part.joint, ends, static) if in_plane else None,
            pushed_away=float(np.sign(along)) if slides_out else 0.0,
            starts=starts,
        ),
        max(map(max, flush)),
    )


def _starts_at(part: MovingPart, ends: tuple[float, float]) -> int:
    """The end that is nearer to the first states."""
    first = float(np.median(part.handled_states[:5]))
    return int(abs(first - ends[1]) < abs(first - ends[0]))


def _past(face: Front, joint: Joint) -> Array:
    """How far past an end (rad or m) a part is carried, in steps from 0; only 0 for a slide in its own plane,
    which may have static surface beside it all along."""
    if not isinstance(joint, Prismatic):
        return np.arange(0.0, PAST_HINGE + 1e-9, _TURN_STEP)
    if abs(face.normal @ joint.axis) < ALONG:
        return np.zeros(1)
    return np.arange(0.0, _PAST_SLIDE + 1e-9, _GAP)


def _end(ends: tuple[float, float], cues: ClosedCues, adjoined: float) -> ClosedEnd:
    k, probability, source = cues.decided()
    return ClosedEnd(ends[k], -1 if k else 1, source, probability, adjoined)


def travel_ends(state: Array) -> tuple[float, float]:
    """Lowest and highest state (n,): the medians of the smoothed states within 2 % of the travel from robust
    quantiles. Extremes would grow with the number of frames."""
    s = smoothed(state)
    low, high = np.quantile(s, [_QUANTILE, 1 - _QUANTILE])
    near = 0.02 * (high - low)
    return float(np.median(s[s <= low + near])), float(np.median(s[s >= high - near]))


def _far_frames(
    part: MovingPart, labels: Mapping[int, NDArray[np.uint8]], ends: tuple[float, float], k: int
) -> list[int]:
    """Labelled frames in which the part is nearest to the other end, spread evenly."""
    away = [f for f in sorted(labels) if (s := part.state(f)) is not None and _share(s, ends, k) > 0.8]
    step = max(1, len(away) // _FRAMES)
    return away[::step][:_FRAMES]


def _share(state: float, ends: tuple[float, float], k: int) -> float:
    """How far a state is on the way from end k to the other one, 0..1."""
    return (state - ends[k]) / (ends[1 - k] - ends[k]) if ends[0] != ends[1] else 0.0


def _depth_behind(
    part: MovingPart,
    face: Front,
    end: float,
    frames: list[int],
    recording: Recording,
    cameras: Trajectory,
    labels: Mapping[int, NDArray[np.uint8]],
) -> Array:
    """Depth (n,) m, along the normal, of static surface seen behind points of the front posed at an end.

    frames: those in which the part is away. Points without a view are left out.
    """
    points = geo.transform(part.joint.pose(end), face.points[:: max(1, len(face.points) // 2000)])
    normal = geo.rotate(part.joint.pose(end), face.normal)
    seen = np.full((len(frames), len(points)), np.nan)
    for row, frame in zip(seen, frames, strict=True):
        T = cameras.pose(frame)
        if T is None:
            continue
        p = geo.transform(geo.invert_pose(T), points)
        inside, x, y, z = look_up(recording.depth(frame), recording.intrinsics, p)
        ok = inside & (z > 0) & (labels[frame][y, x] == STATIC_LABEL) & (z > p[:, 2] - 0.02)
        ray = (points[ok] - T[:3, 3]) * (z[ok] / p[ok, 2] - 1.0)[:, None]
        row[ok] = np.abs(ray @ normal)
    known = np.isfinite(seen).any(axis=0)
    return np.asarray(np.nanmedian(seen[:, known], axis=0))


def rebase(part: MovingPart, closed: ClosedEnd) -> MovingPart:
    """The part counted from its closed end: state 0 there, opening positive, `upper` at the other end.

    The axis is reversed if states fell on opening. The part's frame becomes its closed pose (`rebase_mesh`).
    """
    state = closed.opening_sign * (part.motion.state - closed.state)
    upper = max(0.0, travel_ends(closed.opening_sign * (part.handled_states - closed.state))[1])
    joint = part.joint if closed.opening_sign > 0 else part.joint.reversed()
    joint = replace(joint, lower=0.0, upper=upper)
    return replace(part, joint=joint, motion=replace(part.motion, state=state))


def rebase_mesh(mesh: Mesh, part: MovingPart, closed: ClosedEnd) -> Mesh:
    """The mesh of `part` (as it was before `rebase`) moved from state 0 to the closed end."""
    return mesh.transformed(part.joint.pose(closed.state))
