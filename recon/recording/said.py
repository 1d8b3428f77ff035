"""The user's word on a recording: where a part is, when it moves, its type of joint, which way is up.

It takes the place of what the stages would choose. It proves nothing: verdicts are given as without it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import zip_longest
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from recon.recording import Recording
from twin.errors import InputError
from twin.geometry import Array
from twin.runs.setting import Settings, setting

JointWord = Literal["hinge", "slide"]
Up = Literal["+x", "-x", "+y", "-y", "+z", "-z"] | tuple[float, float, float]


@dataclass(frozen=True)
class Word:
    """The user's word on one part. point: x, y px and frame. interval: first and last moving frame."""

    point: tuple[int, int, int] | None = None
    interval: tuple[int, int] | None = None

    def __str__(self) -> str:
        told = [] if self.point is None else ["--at {},{}@{}".format(*self.point)]
        return " ".join(
            [*told, *([] if self.interval is None else ["--interval {}:{}".format(*self.interval)])]
        )


@dataclass(frozen=True)
class Said(Settings):
    """The user's word, in place of what stages would choose; as --at, --interval, --type and --up give it.

    Points and intervals each name a part, beside those that are found without. If both are given, they pair
    in order.
    """

    at: tuple[tuple[int, int, int], ...] = setting(
        (), "x, y of a pixel of the colour picture that shows a moving part, and the frame", at_least=0
    )
    intervals: tuple[tuple[int, int], ...] = setting(
        (), "first and last frame in which a part moves; it rests in all others", at_least=0
    )
    types: tuple[JointWord, ...] = setting((), "type of joint of all parts, or of each in order")
    up: Literal["+x", "-x", "+y", "-y", "+z", "-z"] | tuple[float, float, float] | None = setting(
        None, "direction that points up in the first camera's axes, or the camera's axis nearest to it"
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        for first, last in self.intervals:
            if first >= last:
                raise self.refused("intervals", "have first < last")
        if self.at and len(self.intervals) not in (0, len(self.at)):
            raise self.refused("intervals", f"be one for each of {len(self.at)} points, or none")
        if len(self.types) > 1 and len(self.types) != len(self.words):
            raise self.refused("types", "be one for all parts, or one for each part that is said")
        if isinstance(self.up, tuple) and not np.linalg.norm(self.up) > 0:
            raise self.refused("up", "be a direction, not zero")

    @property
    def words(self) -> tuple[Word, ...]:
        """What is said of each part, in order; empty where nothing is said of one."""
        return tuple(Word(p, i) for p, i in zip_longest(self.at, self.intervals))

    def type_of(self, number: int) -> JointWord | None:
        """The type of the `number`-th part that is said."""
        return self.types[number if len(self.types) > 1 else 0] if self.types else None

    @property
    def texts(self) -> dict[str, str | list[str]]:
        """As the command line takes it, without what is not said: JSON types."""
        told: dict[str, str | list[str]] = {
            "at": [f"{x},{y}@{frame}" for x, y, frame in self.at],
            "interval": [f"{first}:{last}" for first, last in self.intervals],
            "type": list(self.types),
            "up": ",".join(f"{v:g}" for v in self.up) if isinstance(self.up, tuple) else self.up or "",
        }
        return {name: text for name, text in told.items() if text}


def up_direction(up: Up) -> Array:
    """Unit vector (3,) in the first camera's axes."""
    if isinstance(up, str):
        return np.asarray((1.0 if up[0] == "+" else -1.0) * np.eye(3)["xyz".index(up[1])])
    return np.asarray(up) / np.linalg.norm(up)


def frames_said(
    recording: Recording,
    at: Sequence[tuple[int, int, int | float]],
    intervals: Sequence[tuple[int | float, ...]],
) -> dict[str, list[list[int]]]:
    """`at` and `intervals` of `Said` in frames, where a float is a time in s from the first frame.

    Raises InputError for a time beyond the recording.
    """

    def frame(moment: int | float) -> int:
        if isinstance(moment, int):
            return moment
        times = np.asarray(recording.times) - recording.times[0]
        if moment > times[-1]:
            problem = f"{moment:g}s: the recording ends after {times[-1]:.1f} s"
            raise InputError(problem, "say a time of it, from its first frame on")
        return int(np.argmin(np.abs(times - moment)))

    return {
        "at": [[x, y, frame(moment)] for x, y, moment in at],
        "intervals": [[frame(moment) for moment in ends] for ends in intervals],
    }


def require_said(said: Said, recording: Recording) -> None:
    """Raises InputError for a frame or pixel beyond the recording, and for a pixel without depth."""
    last, camera = len(recording) - 1, recording.intrinsics
    for interval in said.intervals:
        if interval[1] > last:
            told = str(Word(interval=interval))
            raise InputError(f"{told}: the recording has frames 0..{last}", "say frames of these")
    for x, y, frame in said.at:
        told = str(Word((x, y, frame)))
        if frame > last:
            raise InputError(f"{told}: the recording has frames 0..{last}", "say a frame of these")
        if x >= camera.width or y >= camera.height:
            size = f"{camera.width}x{camera.height}"
            raise InputError(f"{told}: the picture has {size} pixels", "say x and y of a pixel in it, from 0")
        depth = recording.depth(frame)
        if not depth[y, x] > 0:
            raise InputError(f"{told}: there is no depth at this pixel", _nearest(depth, x, y))


def _nearest(depth: NDArray[np.float32], x: int, y: int) -> str:
    rows, columns = np.nonzero(depth > 0)
    k = int(np.argmin((columns - x) ** 2 + (rows - y) ** 2))
    return f"say another one; the nearest with depth is {columns[k]},{rows[k]}"
