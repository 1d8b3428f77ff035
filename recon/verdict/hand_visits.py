"""Visits of the hand: what comes into view to open something and goes again has moved a part, or one was missed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from recon.parts.moving_part import MovingPart
from recon.recording import Recording
from twin.scene import HAND_LABEL

# Chosen by us: share of the picture that is a hand in view; labelled frames without it that end no visit; s that opening something takes at
# least, from the first finger in view; s by which a motion may miss a visit; share of a part's range that is more than a shake.
_IN_VIEW, _MISSED, _LONG, _SLACK, _MOVES = 0.004, 1, 0.8, 0.4, 0.2


def idle_visit(
    recording: Recording, labels: Mapping[int, NDArray[np.uint8]], parts: Sequence[MovingPart]
) -> tuple[int, int] | None:
    """First and last labelled frame of the longest visit in which no part moves by much; None without one."""
    idle = [
        v for v in _visits(labels) if _seconds(recording, *v) >= _LONG and not _moves(recording, parts, v)
    ]
    return max(idle, key=lambda v: _seconds(recording, *v), default=None)


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


def _moves(recording: Recording, parts: Sequence[MovingPart], visit: tuple[int, int]) -> bool:
    """Whether a part moves by more than a shake in a visit."""
    for part in parts:
        frames, state = part.motion.frames, part.motion.state
        for first, last in part.motion.intervals:
            apart = max(_seconds(recording, last, visit[0]), _seconds(recording, visit[1], first))
            inside = (frames >= first) & (frames <= last)
            if apart <= _SLACK and np.ptp(state[inside]) > _MOVES * np.ptp(state):
                return True
    return False
