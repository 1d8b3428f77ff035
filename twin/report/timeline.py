"""When each part is handled and how far it is open, over the whole recording: one row of an SVG a part."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from twin.geometry import Array
from twin.report.frames import part_color
from twin.scene import Part, Twin

# px of the drawing
_WIDTH, _ROW, _LEFT, _FOOT = 1000, 34, 170, 24
# s between marks of the clock that are tried; at most `_MARKS` are drawn
_TICKS = (1, 2, 5, 10, 15, 30, 60, 120, 300)
_MARKS = 12
# s; in shorter recordings the parts' own plots tell the same
SHORTEST = 20.0


@dataclass(frozen=True)
class _Clock:
    """Seconds of the recording, and where they are drawn."""

    first: float
    last: float

    def x(self, time: float) -> float:
        return round(_LEFT + (_WIDTH - _LEFT) * (time - self.first) / (self.last - self.first), 1)


def timeline(twin: Twin) -> str:
    """The drawing; empty for a twin without cameras or parts, or of a recording shorter than `SHORTEST`."""
    if twin.cameras is None or not twin.parts or len(twin.cameras.times) < 2:
        return ""
    clock = _Clock(float(twin.cameras.times[0]), float(twin.cameras.times[-1]))
    if clock.last - clock.first < SHORTEST:
        return ""
    height = _ROW * len(twin.parts) + _FOOT
    rows = [_row(part, clock, k) for k, part in enumerate(twin.parts)]
    return (
        f'<svg viewBox="0 0 {_WIDTH} {height}" role="img" aria-label="when each part is handled">'
        f"{''.join(rows)}{_marks(clock, height)}</svg>"
    )


def _row(part: Part, clock: _Clock, number: int) -> str:
    """A part's name, its state as a filled curve from closed to open, and its interactions as bars."""
    motion = part.motion
    low, high = part.joint.lower, part.joint.upper
    top, base = _ROW * number + 6, _ROW * (number + 1) - 6
    share = np.clip((motion.state - low) / max(high - low, 1e-9), 0.0, 1.0)
    color = "#{:02x}{:02x}{:02x}".format(*part_color(part))
    curves = "".join(
        f'<polygon points="{_outline(motion.times[a:b], share[a:b], clock, top, base)}" fill="{color}" opacity="0.3"/>'
        for a, b in _runs(motion.frames.tolist())
    )
    bars = "".join(
        f'<rect x="{clock.x(start):g}" y="{base - 4}" width="{max(clock.x(end) - clock.x(start), 3.0):g}" '
        f'height="6" rx="2" fill="{color}"/>'
        for start, end in (np.interp(span, motion.frames, motion.times) for span in motion.intervals)
    )
    name = f'<text x="0" y="{base}" font-size="14">{part.name}</text>'
    line = f'<line x1="{_LEFT}" x2="{_WIDTH}" y1="{base}" y2="{base}" stroke="#e2e5e9"/>'
    return name + line + curves + bars


def _outline(times: Array, share: Array, clock: _Clock, top: int, base: int) -> str:
    """The curve of some states, closed along its base; where it goes straight on, points are left out."""
    points = [
        (clock.x(t), round(base - (base - top) * float(s), 1)) for t, s in zip(times, share, strict=True)
    ]
    kept = [
        p
        for k, p in enumerate(points)
        if k in (0, len(points) - 1) or not (points[k - 1][1] == p[1] == points[k + 1][1])
    ]
    whole = [(kept[0][0], float(base)), *kept, (kept[-1][0], float(base))]
    return " ".join(f"{x:g},{y:g}" for x, y in whole)


def _runs(frames: Sequence[int]) -> list[tuple[int, int]]:
    """Rows first:last of the stretches in which a state is known: frames without one end a stretch."""
    gap = 2 * max(1, int(np.median(np.diff(frames)))) if len(frames) > 1 else 1
    ends = [k + 1 for k in range(len(frames) - 1) if frames[k + 1] - frames[k] > gap]
    return list(zip([0, *ends], [*ends, len(frames)], strict=True))


def _marks(clock: _Clock, height: int) -> str:
    """Minutes and seconds below the rows."""
    long = clock.last - clock.first
    step = next((t for t in _TICKS if long / t <= _MARKS), _TICKS[-1])
    return "".join(
        f'<text x="{clock.x(clock.first + s):g}" y="{height - 6}" font-size="12" fill="#667078">{s // 60}:{s % 60:02d}</text>'
        for s in range(0, int(long) + 1, step)
    )
