"""Visits of the hand: a hand that comes to open something and goes has moved a part, or one was missed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from recon.interaction.parts.moving_part import MovingPart
from recon.recording import Recording
from twin.scene import HAND_LABEL

# Share of the picture that is a hand in view. Chosen by us.
_IN_VIEW = 0.004
# Labelled frames without a hand that end no visit. Chosen by us.
_MISSED = 1
# s by which a motion may miss a visit. Chosen by us.
_SLACK = 0.4
# Share of a part's range that is more than a shake. Chosen by us.
_MOVES = 0.2
# s that a hand is in view while nothing moves, by how many motions it is beside. Opening something takes .8 s
# at least, from the first finger in view. Reaching or leaving takes 1.6 s at most in 46 open recordings, 2.2
# in 90 labelled by earlier code; a missed part 3.1 to 6.7 in ten. All looked at
_IDLE_S = (0.8, 3.0, 6.0)


def idle_visit(
    recording: Recording, labels: Mapping[int, NDArray[np.uint8]], parts: Sequence[MovingPart]
) -> tuple[int, int] | None:
    """First and last frame of the longest time for which a hand is in view and no part moves by much, longer
    than it takes to reach for one and to leave it; None without one."""
    idle = [span for v in _visits(labels) for span in _idle(recording, parts, v)]
    return max(idle, key=lambda span: _seconds(recording, *span), default=None)


def _visits(labels: Mapping[int, NDArray[np.uint8]]) -> list[tuple[int, int]]:
    """Runs of labelled frames with a hand in view."""
    frames = sorted(labels)
    rows = [k for k, f in enumerate(frames) if np.mean(labels[f] == HAND_LABEL) > _IN_VIEW]
    out: list[tuple[int, int]] = []
    for k in rows:
        if out and k - out[-1][1] <= _MISSED + 1:
            out[-1] = (out[-1][0], k)
        else:
            out.append((k, k))
    return [(frames[a], frames[b]) for a, b in out]


def _seconds(recording: Recording, first: int, last: int) -> float:
    return float(recording.times[last] - recording.times[first])


def _idle(recording: Recording, parts: Sequence[MovingPart], visit: tuple[int, int]) -> list[tuple[int, int]]:
    """First and last frames of the times in a visit before, between and after motions, if too long."""
    spans, since, beside = [], visit[0], 0
    for first, last in sorted(m for part in parts for m in _motions(recording, part, visit)):
        spans.append((since, first, beside + 1))
        since, beside = max(since, last), 1
    spans.append((since, visit[1], beside))
    return [(a, b) for a, b, n in spans if _seconds(recording, a, b) >= _IDLE_S[n]]


def _motions(recording: Recording, part: MovingPart, visit: tuple[int, int]) -> list[tuple[int, int]]:
    """The intervals of a visit in which a part moves by more than a shake."""
    frames, state = part.motion.frames, part.motion.state
    out = []
    for first, last in part.motion.intervals:
        apart = max(_seconds(recording, last, visit[0]), _seconds(recording, visit[1], first))
        inside = (frames >= first) & (frames <= last)
        if apart <= _SLACK and np.ptp(state[inside]) > _MOVES * np.ptp(state):
            out.append((first, last))
    return out
