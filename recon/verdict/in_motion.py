"""Whether the twin explains the motion: carried through a part's moving frames, against recorded depth.

A hand is nearer than what it hides, never farther. Where the twin in its state is nearer than what was seen,
it is wrong there and no hand is the excuse. And what has another depth than it had at rest must have the one
that the twin has in that state.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recon.interaction.parts.moving_part import MovingPart
from recon.verdict.posed import PosedTwin, gate, opened, wide

FRAMES = 8  # of those in which the part moves, evenly over its travel; chosen by us


@dataclass(frozen=True)
class InMotion:
    """What a part's moving frames show, in pixels summed over them.

    own: of the part, where it is or was at rest. through: seen farther than the twin. right: with another
    depth than the twin has with the part at rest, and that of the twin in its state. wrong: with another
    depth than at rest and farther than the twin in its state, or with that at rest where the twin's state
    makes it another. What is nearer than the twin may be a hand and counts as neither. worst: the frame with
    most of `through`.
    """

    own: int
    through: int
    right: int
    wrong: int
    worst: int


def in_motion(twin: PosedTwin, part: MovingPart) -> InMotion | None:
    """What the frames of a part's motion show, None without any. parts' surfaces must be those of `twin`."""
    counts = {frame: _count(twin, part, frame) for frame in frames_by_travel(part, FRAMES)}
    if not counts:
        return None
    own, through, right, wrong = np.sum(list(counts.values()), axis=0)
    return InMotion(int(own), int(through), int(right), int(wrong), max(counts, key=lambda f: counts[f][1]))


def moving_rows(part: MovingPart) -> NDArray[np.int64]:
    """Rows of the part's motion that lie within its intervals."""
    frames = part.motion.frames
    inside = [(frames >= first) & (frames <= last) for first, last in part.motion.intervals]
    return np.flatnonzero(np.logical_or.reduce(inside)) if inside else np.zeros(0, np.int64)


def travel_at(part: MovingPart, rows: NDArray[np.int64]) -> NDArray[np.float64]:
    """Travel (n,) of the part until each of these rows, m or rad, whichever way it goes."""
    state = part.motion.state
    return np.asarray(np.cumsum(np.abs(np.diff(state, prepend=state[:1])))[rows])


def frames_by_travel(part: MovingPart, count: int) -> list[int]:
    """Frames in which the part moves, evenly over its travel, without the ends of it."""
    rows = moving_rows(part)
    if not len(rows):
        return []
    travel = travel_at(part, rows)
    wanted = np.linspace(travel[0], travel[-1], count + 2)[1:-1]
    return sorted({int(part.motion.frames[rows[np.argmin(np.abs(travel - t))]]) for t in wanted})


def _count(twin: PosedTwin, part: MovingPart, frame: int) -> tuple[int, int, int, int]:
    """own, through, right and wrong in one frame."""
    states, first = twin.states(frame), part.motion.intervals[0][0]
    now, rest = (
        twin.expected(frame),
        twin.expected(frame, states | {part.id: part_state(part, first)}),
    )
    seen = twin.seen(frame)
    known, off = gate(seen, now.depth)
    both = known & gate(seen, rest.depth)[0]
    unseen = seen <= 0
    changed = opened(both & (np.abs(seen - rest.depth) > off), unseen)
    right = opened(changed & (np.abs(seen - now.depth) <= off), unseen)
    stayed = (np.abs(now.depth - rest.depth) > 2 * off) & (np.abs(seen - rest.depth) <= off)
    wrong = opened((changed & (seen > now.depth + off)) | (both & stayed), unseen)
    own = known & ((now.owner == part.id) | (rest.owner == part.id))
    through = wide(known & (seen > now.depth + off), now.depth, twin.camera)
    return int(own.sum()), int(through.sum()), int(right.sum()), int(wrong.sum())


def part_state(part: MovingPart, frame: int) -> float:
    """The part's state at a frame, between those that are known."""
    return float(np.interp(frame, part.motion.frames, part.motion.state))
