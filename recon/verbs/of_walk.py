"""What `twin reconstruct` tells of a walk: when each part was handled, and what was not solved, by time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from recon.recording import Recording
from twin.geometry import Array
from twin.runs.manifest import warnings_of
from twin.scene import Part, Twin
from twin.verdict import LEVELS, reason

UNSOLVED = ["from", "to", "not solved, since", "what to try"]
NO_CAMERA = (
    "no camera pose: nothing joins these frames to the rest of the path",
    "keep the lens free, turn slower, keep textured things with depth in view, and look at places twice",
)
# s; shorter stretches without poses are told in a warning alone
_LOST_S = 0.5


def handled_text(part: Part) -> str:
    """When a part moves: "0:12-0:15 1:07-1:09", minutes and seconds from the recording's first frame."""
    motion = part.motion
    start = float(motion.times[0]) if len(motion.times) else 0.0
    seconds = motion.times - start
    return " ".join(
        f"{_clock(np.interp(a, motion.frames, seconds))}-{_clock(np.interp(b, motion.frames, seconds))}"
        for a, b in motion.intervals
    )


def notes(stages: Sequence[Mapping[str, Any]], recording: Recording) -> list[str]:
    """The warnings of a run's stages, those of a window with its time before them, each once."""
    told = warnings_of(stages)
    return [text if at is None else f"{_span(*at, recording.times)}: {text}" for _, at, text in told]


def moved_unseen(twin: Twin, recording: Recording) -> list[str]:
    """A sentence for each time, `_LOST_S` or longer, after which a part stood otherwise than it was left."""
    if twin.cameras is None:
        return []
    times, out = recording.times, []
    for part in twin.parts:
        known = np.isin(twin.cameras.frames, part.motion.frames)
        ends = np.flatnonzero(np.diff(np.r_[True, known, True].astype(int)))
        for first, after in ends.reshape(-1, 2).tolist():
            a, b = (int(twin.cameras.frames[k]) for k in (first, after - 1))
            inside = part.motion.frames[0] < a and b < part.motion.frames[-1]
            if inside and times[b] - times[a] >= _LOST_S:
                told = (
                    "stood otherwise than it was left: it was moved while out of view, its state is not known"
                )
                out.append(f"{_span(a, b, times)}: {part.name} {told}")
    return out


def unsolved_rows(run: Path, twin: Twin, recording: Recording) -> list[list[str]]:
    """Rows (`UNSOLVED`), by time: for each stretch of half a second without camera poses, and for each window
    of several in which something is handled and no part of the twin moves: the first reason against a part
    that was refused there, or that none was found."""
    times, rows = recording.times, _of_windows(run, twin)
    for first, last in twin.cameras.gaps(len(times)) if twin.cameras is not None else ():
        if times[last] - times[first] >= _LOST_S:
            rows.append(((first, last), NO_CAMERA))
    rows.sort(key=lambda row: row[0])
    return [[*_span(first, last, times).split("-"), *texts] for (first, last), texts in rows]


def _of_windows(run: Path, twin: Twin) -> list[tuple[tuple[int, int], tuple[str, str]]]:
    """First and last frame, why, and what to try, of each window of several without a part that moves."""
    from recon.pipeline import read_stage

    windows = read_stage(run, "windows")
    if len(windows) < 2:
        return []
    merged, judged = read_stage(run, "merge").parts, read_stage(run, "verdict").parts
    refused = [(p.windows, judged[p.id].reasons) for p in merged if judged[p.id].level == "refused"]
    moving = [span for p in twin.parts for span in p.motion.intervals]
    out: list[tuple[tuple[int, int], tuple[str, str]]] = []
    for w in windows:
        if w.handled is None or any(a <= w.last and w.first <= b for a, b in moving):
            continue
        against = [r for spans, reasons in refused if (w.first, w.last) in spans for r in reasons]
        against.sort(key=lambda r: -LEVELS.index(r.level))  # what refuses comes first
        why = against[0] if against else reason("HandMovesNothing", "doubtful", *w.handled)
        out.append((w.handled, (why.text, why.help)))
    return out


def _span(first: int, last: int, times: Array) -> str:
    return f"{_clock(times[first] - times[0])}-{_clock(times[last] - times[0])}"


def _clock(seconds: float) -> str:
    whole = round(float(seconds))
    return f"{whole // 60}:{whole % 60:02d}"
