"""Parts by two witnesses, tracks and depth: tracks alone drift along edges, depth alone is coarse."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from recon.interaction.boards.meanwhile import MEANWHILE, carried_along, together
from recon.interaction.boards.search import part_at
from recon.interaction.joints.config import LIMIT_QUANTILE
from recon.interaction.joints.observations import Kind
from recon.interaction.joints.sign_and_limits import smoothed
from recon.interaction.motion.intervals import state_intervals
from recon.interaction.motion.movers import Movers
from recon.interaction.parts.compete import Witnessed, followers, proposed, told, witnessed
from recon.interaction.parts.found import PartTracks
from recon.interaction.parts.moving_part import MovingPart
from recon.interaction.parts.static_spans import REST_MARGIN
from recon.recording import Recording
from recon.recording.said import Word
from twin.describe import range_text
from twin.scene import FIRST_PART_ID, Motion, Trajectory

# Tracks of a part that need no second witness, with the axis as sure as below. Of the joints that depth did
# not confirm in 110 recordings we looked at, all seven with such tracks were right, and depth's own joint was
# wrong or the same; of 27 others three were right or nearly so. Chosen by us.
_MANY = 120
# Sigma (rad) of their axis.
_FIRM = np.radians(0.5)
# Share of a board's pixels that its joint explains, from which depth contradicts such tracks: a flap whose
# tracks had an axis 6 deg off and sure to .3 had .5, a lid seen edge-on has .04. Chosen by us.
_STRONG = 0.1
# Least share of the moved part's way that a hand goes meanwhile. Chosen by us.
_CARRIED = 0.5


def reconciled_parts(
    found: Sequence[PartTracks],
    recording: Recording,
    cameras: Trajectory,
    movers: Movers,
    most: int,
) -> tuple[PartTracks, ...]:
    """The parts by both witnesses, at most `most`.

    A joint of the tracks, which are finer, is taken where it explains what depth shows as well as depth's
    own, with the states that explain more: tracks that slip along a part or lie on the hand know its joint
    but not its way. If depth finds a part,
    track-only parts that depth does not confirm are dropped with a warning: corners that drift along edges
    follow some joint as well. Many tracks with a sure axis need no confirmation: a part that depth hardly
    sees moving meanwhile is the same part.
    """
    seen = witnessed(recording, cameras, movers, [f.part for f in found])
    if not seen:
        return tuple(found)
    left = [f for k, f in enumerate(found) if all(w.by_tracks != k for w in seen)]
    firm = [f for f in left if _firm(f) and not any(_strong(w) and _meanwhile(w, f, cameras) for w in seen)]
    parts: list[PartTracks] = []
    taken: set[int | None] = set()
    for w in seen[:most]:
        if w.by_tracks is None or _in_turn(w, seen):
            if not _goes_along(w, seen) and not any(_meanwhile(w, f, cameras) for f in firm):
                parts.append(_of_depth(w, recording, cameras, movers))
        elif w.by_tracks not in taken:
            parts.append(_mended(w, found[w.by_tracks], movers))
        taken.add(w.by_tracks)
    for f in left:
        if not any(f is kept for kept in firm):
            _warn(f)
    parts = [*parts, *firm][:most]
    return tuple(replace(p, part=replace(p.part, id=FIRST_PART_ID + k)) for k, p in enumerate(parts))


def reconciled_word(
    found: PartTracks | None,
    word: Word,
    kind: Kind | None,
    recording: Recording,
    cameras: Trajectory,
    movers: Movers,
) -> PartTracks | None:
    """The part that the user points at, by both witnesses. found: by tracks. kind: as the user says it.

    Of an interval, depth looks at its frames and a few about it, and at the one that is pointed at.
    """
    if word.point is None:
        return found
    frames = cameras.frames
    if word.interval is not None:
        first, last = (f(e, word.point[2]) for f, e in zip((min, max), word.interval, strict=True))
        frames = frames[(frames >= first - REST_MARGIN) & (frames <= last + REST_MARGIN)]
    some = np.isin(cameras.frames, frames)
    shown = Trajectory(cameras.frames[some], cameras.times[some], cameras.T_world_cam[some])
    known = [] if found is None else [proposed(found.part.joint)]
    part = part_at(recording, shown, word.point, known, kind)
    if part is None:
        return found
    w = told(part, cameras, movers, [] if found is None else [found.part], known)
    if found is not None and w.by_tracks is not None:
        return _mended(w, found, movers)
    if found is not None and _firm(found):
        return found
    out = _of_depth(w, recording, cameras, movers)
    return out if kind is None else replace(out, type_source="said by the user")


def _firm(f: PartTracks) -> bool:
    """Whether the tracks' joint needs no second witness."""
    sigma = f.part.joint.sigma
    return sigma is not None and sigma.axis <= _FIRM and int(f.members.sum()) >= _MANY


def _strong(w: Witnessed) -> bool:
    """Whether depth sees enough of a part to contradict tracks, however many."""
    return w.strength >= _STRONG


def _meanwhile(w: Witnessed, f: PartTracks, cameras: Trajectory) -> bool:
    """Whether depth's part moves while the tracks' part does: one hand opens one part at a time."""
    other = np.interp(cameras.frames, f.part.motion.frames, f.part.motion.state)
    return together(w.state, other) >= MEANWHILE


def _goes_along(w: Witnessed, seen: Sequence[Witnessed]) -> bool:
    """Whether a part goes along with another one of the same tracks that agrees better: a hand follows."""
    rivals = [o for o in seen if o is not w and o.by_tracks is not None and o.by_tracks == w.by_tracks]
    return any(_along(w, o) > _CARRIED for o in rivals if o.as_well > w.as_well)


def _in_turn(w: Witnessed, seen: Sequence[Witnessed]) -> bool:
    """Whether the same tracks follow another part, too, that moves at another time: of two drawers whose ways
    are parallel tracks know one slide, as far as both go."""
    return any(
        o is not w and o.by_tracks == w.by_tracks and together(w.state, o.state) < MEANWHILE for o in seen
    )


def _along(w: Witnessed, other: Witnessed) -> float:
    return carried_along(np.sign(w.joint.axis @ other.joint.axis) * w.state, other.state)


def _warn(left: PartTracks) -> None:
    tracks = int(left.members.sum())
    warnings.warn(
        f"{tracks} tracks follow a joint ({range_text(left.part.joint)}) by which no changed surface moves: left out",
        stacklevel=4,
    )


def _mended(w: Witnessed, tracked: PartTracks, movers: Movers) -> PartTracks:
    """The tracks' part, with states by depth where its tracks slip: those are not of it."""
    if w.mended is None:
        return replace(tracked, part=tracked.part.with_board(w.board))
    joint, m = tracked.part.joint, tracked.part.motion
    low, high = np.quantile(smoothed(w.mended), (LIMIT_QUANTILE, 1.0 - LIMIT_QUANTILE))
    joint = replace(joint, lower=min(float(low), 0.0), upper=max(float(high), 0.0))
    spans = state_intervals(m.frames, w.mended, joint.sigma.state if joint.sigma is not None else 0.0)
    motion = replace(m, state=w.mended, intervals=tuple((i.first, i.last) for i in spans))
    members = followers(joint, m.frames, w.mended, movers)
    part = replace(tracked.part, joint=joint, motion=motion).with_board(w.board)
    return PartTracks(part, members, tracked.type_source)


def _of_depth(w: Witnessed, recording: Recording, cameras: Trajectory, movers: Movers) -> PartTracks:
    """A part that depth alone found. Its inliers are the share of movers that follow; refinement fits it."""
    spread = w.joint.sigma.state if w.joint.sigma is not None else 0.0
    spans = tuple((i.first, i.last) for i in state_intervals(cameras.frames, w.state, spread))
    inliers = float(w.followers.sum()) / max(int(movers.moving.sum()), 1)
    motion = Motion(cameras.frames, recording.times[cameras.frames], w.state, spans, 0.0, inliers)
    return PartTracks(MovingPart(FIRST_PART_ID, w.joint, motion).with_board(w.board), w.followers, "depth")
