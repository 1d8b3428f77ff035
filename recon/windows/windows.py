"""Windows of a recording: each holds an interaction with the rests around it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from recon.dense.noise import DepthNoise
from recon.recording import Recording
from recon.windows.activity import activity, moved_points, share_in_view
from twin.geometry import Array
from twin.runs.keys import Stage
from twin.runs.loop import Loop, untold
from twin.scene import Trajectory

WINDOWS = Stage("windows", 3, ())
# s; shorter recordings are one window: nothing is saved by cutting them.
_CLIP_S = 20.0
# Share of the picture that moves while a hand is in view: as for hand visits.
_HANDLED = 0.004
# s; shorter bursts are noise.
_LEAST_S = 0.4
# s without motion that end no interaction: a hand that holds still.
_PAUSE_S = 1.0
# s of rest on both sides: they tell what was there before and after.
REST_S = 3.0
# s of rest that stay wherever the person looks.
_LEAST_REST_S = 0.7
# Share of what is shown of the handled place at most, below which the person looks elsewhere. Chosen by us.
_IN_VIEW = 0.5


@dataclass(frozen=True)
class Window:
    """First and last frame, and the first and last frame in which something is handled."""

    first: int
    last: int
    handled: tuple[int, int] | None = None

    @property
    def frames(self) -> slice:
        """The frames as a slice of the recording."""
        return slice(self.first, self.last + 1)

    def is_whole(self, recording: Recording) -> bool:
        """Whether it has all frames of a recording."""
        return self.first == 0 and self.last == len(recording) - 1

    @property
    def name(self) -> str:
        """Of folders."""
        return f"{self.first:06d}-{self.last:06d}"


def is_long(recording: Recording) -> bool:
    """Whether a recording is no clip: it may have several windows, or none."""
    return bool(recording.times[-1] - recording.times[0] >= _CLIP_S)


def find_windows(
    recording: Recording, cameras: Trajectory, noise: DepthNoise, progress: Loop = untold
) -> tuple[Window, ...]:
    """Where something is handled, each time with up to `REST_S` of rest around in which its place is in view.

    A clip is one window with all frames.
    """
    times = np.asarray(recording.times)
    if not is_long(recording):
        return (Window(0, len(recording) - 1),)
    share = activity(recording, cameras, noise, progress)
    out = []
    for window in padded(handled(share, times), times):
        assert window.handled is not None
        points = moved_points(recording, cameras, noise, window.handled)
        out.append(looked_at(window, share_in_view(points, recording, cameras), times))
    return tuple(out)


def looked_at(window: Window, shown: Array, times: Array) -> Window:
    """A window without the rest in which the person looks elsewhere, but `_LEAST_REST_S` of it.

    shown (T,): share of the handled place that is in view.
    """
    assert window.handled is not None
    a, b = window.handled
    enough = shown >= _IN_VIEW * float(shown[a : b + 1].max())
    first, last = a, b
    while first > window.first and (enough[first - 1] or times[a] - times[first - 1] <= _LEAST_REST_S):
        first -= 1
    while last < window.last and (enough[last + 1] or times[last + 1] - times[b] <= _LEAST_REST_S):
        last += 1
    return Window(first, last, window.handled)


def handled(share: Array, times: Array) -> list[tuple[int, int]]:
    """First and last frames of the times in which enough of the picture moves. share (T,): see `activity`."""
    busy = np.flatnonzero(np.nan_to_num(share) >= _HANDLED)
    out: list[tuple[int, int]] = []
    for k in busy.tolist():
        if out and times[k] - times[out[-1][1]] <= _PAUSE_S:
            out[-1] = (out[-1][0], k)
        else:
            out.append((k, k))
    return [(a, b) for a, b in out if times[b] - times[a] >= _LEAST_S]


def padded(spans: Sequence[tuple[int, int]], times: Array) -> tuple[Window, ...]:
    """A window about each span of frames, with rest on both sides as long as nothing else is handled.

    Neighbouring windows share the rest between them.
    """
    out = []
    ends = [-1, *(b for _, b in spans)]
    starts = [*(a for a, _ in spans[1:]), len(times)]
    for (a, b), before, after in zip(spans, ends, starts, strict=False):
        first = int(np.searchsorted(times, times[a] - REST_S))
        last = int(np.searchsorted(times, times[b] + REST_S, side="right")) - 1
        out.append(Window(max(first, before + 1), min(last, after - 1), (a, b)))
    return tuple(out)


def apart(windows: Sequence[Window]) -> list[tuple[int, int]]:
    """First and last frames of what windows cover, those that share frames together."""
    out: list[tuple[int, int]] = []
    for w in windows:
        if out and w.first <= out[-1][1]:
            out[-1] = (out[-1][0], max(w.last, out[-1][1]))
        else:
            out.append((w.first, w.last))
    return out
