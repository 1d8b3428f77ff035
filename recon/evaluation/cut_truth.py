"""The truth of some frames of a recording: of one that was cut, or whose depth lagged."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from recon.evaluation.metrics import Span
from recon.evaluation.truth import Truth, TruthPart
from recon.recording import Recording
from twin.scene import Trajectory

# s: times are written with six digits
_SAME_TIME = 1e-5


def truth_of(true: Truth, recording: Recording) -> Truth:
    """The truth of a recording's frames if they are some of those the truth knows, by times; else as is."""
    count = len(recording)
    if true.cameras is None or count >= true.frames:
        return true
    first = int(np.argmin(np.abs(true.cameras.times - recording.times[0])))
    times = true.cameras.times[first : first + count]
    alike = len(times) == count and np.allclose(times, recording.times, rtol=0.0, atol=_SAME_TIME)
    return of_frames(true, first, count) if alike else true


def of_frames(true: Truth, first: int, count: int) -> Truth:
    """The truth of a recording of `count` frames from `first` on."""
    cameras = true.cameras
    if cameras is not None:
        rows = (cameras.frames >= first) & (cameras.frames < first + count)
        cameras = Trajectory(cameras.frames[rows] - first, cameras.times[rows], cameras.T_world_cam[rows])
    return replace(
        true,
        frames=count,
        cameras=cameras,
        parts=tuple(_part(p, first, count) for p in true.parts),
        labels={k - first: true.labels[k] for k in true.labels if first <= k < first + count},
    )


def _part(part: TruthPart, first: int, count: int) -> TruthPart:
    """A part with the motions that these frames show."""

    def shown(spans: tuple[Span, ...]) -> tuple[Span, ...]:
        held = ((max(a - first, 0), min(b - first, count - 1)) for a, b in spans)
        return tuple((a, b) for a, b in held if a < b)

    rows = slice(first, first + count)
    return replace(
        part,
        states=part.states[rows],
        T_world_part=part.T_world_part[rows],
        segments=shown(part.segments),
        told_spans=None if part.told_spans is None else shown(part.told_spans),
    )
