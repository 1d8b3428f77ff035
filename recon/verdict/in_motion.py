"""Whether the twin, carried through a part's moving frames, is seen through there.

A hand is nearer than what it hides, never farther. Where the twin in its state is nearer than what was seen,
it is wrong there and no hand is the excuse.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from recon.interaction.parts.moving_part import MovingPart
from recon.verdict.posed import PosedTwin, gate, wide

FRAMES = 8  # of those in which the part moves, evenly over its travel; chosen by us


def seen_through(twin: PosedTwin, part: MovingPart) -> tuple[int, float] | None:
    """The frame with most pixels that are seen farther than the twin, and all of them over the part's own,
    where it is or was at rest; None without any. parts' surfaces must be those of `twin`."""
    counts = {frame: _count(twin, part, frame) for frame in frames_by_travel(part, FRAMES)}
    own, through = (sum(c[k] for c in counts.values()) for k in (0, 1))
    return (max(counts, key=lambda f: counts[f][1]), through / own) if own else None


def moving_rows(part: MovingPart) -> NDArray[np.int64]:
    """Rows of the part's motion that lie within its intervals."""
    frames = part.motion.frames
    inside = [(frames >= first) & (frames <= last) for first, last in part.motion.intervals]
    return np.flatnonzero(np.logical_or.reduce(inside)) if inside else np.zeros(0, np.int64)


def frames_by_travel(part: MovingPart, count: int) -> list[int]:
    """Frames in which the part moves, evenly over its travel, without the ends of it."""
    frames, state, rows = part.motion.frames, part.motion.state, moving_rows(part)
    if not len(rows):
        return []
    travel = np.cumsum(np.abs(np.diff(state, prepend=state[:1])))[rows]
    wanted = np.linspace(travel[0], travel[-1], count + 2)[1:-1]
    return sorted({int(frames[rows[np.argmin(np.abs(travel - t))]]) for t in wanted})


def _count(twin: PosedTwin, part: MovingPart, frame: int) -> tuple[int, int]:
    """Pixels of the part's own, and those seen through, in one frame."""
    states = twin.states(frame)
    rest = float(np.interp(part.motion.intervals[0][0], part.motion.frames, part.motion.state))
    now, before = twin.expected(frame), twin.expected(frame, states | {part.id: rest})
    seen: NDArray[np.float32] = twin.seen(frame)
    known, off = gate(seen, now.depth)
    own = known & ((now.owner == part.id) | (before.owner == part.id))
    through = wide(known & (seen > now.depth + off), now.depth, twin.camera)
    return int(own.sum()), int(through.sum())
