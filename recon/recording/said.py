"""The user's word on a recording: where a part is, when it moves, its type of joint, which way is up.

It takes the place of what the stages would choose. It proves nothing: verdicts are given as without it.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import zip_longest
from typing import Literal, cast

import numpy as np
from numpy.typing import NDArray

from recon.recording import Recording
from twin.errors import InputError
from twin.geometry import Array
from twin.runs.setting import Settings, setting

JointWord = Literal["hinge", "slide"]
Up = Literal["+x", "-x", "+y", "-y", "+z", "-z"] | tuple[float, float, float]

_WORD = re.compile(
    r"(?:--at (\d+),(\d+)@(\d+) ?)?(?:--interval (\d+):(\d+) ?)?(?:--type (hinge|slide))?", re.ASCII
)
# px: a pixel without depth stands for one with depth so near, as fingers and mice point.
_NEAR_PX = 4.0


@dataclass(frozen=True)
class Word:
    """The user's word on one part. point: x, y px and frame. interval: first and last moving frame. type: of
    its joint."""

    point: tuple[int, int, int] | None = None
    interval: tuple[int, int] | None = None
    type: JointWord | None = None

    def __str__(self) -> str:
        """As the command line takes it."""
        told = [] if self.point is None else ["--at {},{}@{}".format(*self.point)]
        told += [] if self.interval is None else ["--interval {}:{}".format(*self.interval)]
        return " ".join([*told, *([] if self.type is None else [f"--type {self.type}"])])

    @classmethod
    def of(cls, text: str) -> Word:
        """Raises ValueError for a text that says neither where nor when."""
        found = _WORD.fullmatch(text)
        if found is None or (found[1] or found[4]) is None:
            raise ValueError(text)
        x, y, frame, first, last = (None if v is None else int(v) for v in found.groups()[:5])
        point = None if x is None or y is None or frame is None else (x, y, frame)
        interval = None if first is None or last is None else (first, last)
        return cls(point, interval, cast("JointWord | None", found[6]))

    def counted_from(self, first: int) -> Word:
        """The same, its frames counted from another one."""
        point = None if self.point is None else (*self.point[:2], self.point[2] - first)
        interval = None if self.interval is None else (self.interval[0] - first, self.interval[1] - first)
        return replace(self, point=point, interval=interval)


@dataclass(frozen=True)
class Said(Settings):
    """The user's word, in place of what stages would choose; as --at, --interval, --type and --up give it.

    Each of `parts` names a part, beside those that are found without.
    """

    parts: tuple[str, ...] = setting(
        (), "one text a part, such as '--at 320,240@45 --interval 30:75 --type hinge', with any of the three"
    )
    type: Literal["hinge", "slide"] | None = setting(None, "type of the joints of all other parts")
    up: Literal["+x", "-x", "+y", "-y", "+z", "-z"] | tuple[float, float, float] | None = setting(
        None, "direction that points up in the first camera's axes, or the camera's axis nearest to it"
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        for text in self.parts:
            try:
                word = Word.of(text)
            except ValueError:
                example = "'--at 320,240@45' or '--interval 30:75', then perhaps '--type hinge'"
                raise self.refused("parts", f"be texts such as {example}") from None
            if word.interval is not None and word.interval[0] >= word.interval[1]:
                raise self.refused("parts", "have intervals whose first frame is before the last")
        if isinstance(self.up, tuple) and not np.linalg.norm(self.up) > 0:
            raise self.refused("up", "be a direction, not zero")

    @property
    def words(self) -> tuple[Word, ...]:
        """What is said of each part, in order; empty where nothing is said of one."""
        return tuple(map(Word.of, self.parts))

    @property
    def texts(self) -> list[str]:
        """As the command line takes it, without what is not said."""
        told = list(self.parts)
        if self.type is not None:
            told.append(f"--type {self.type}")
        if self.up is not None:
            told.append(
                f"--up {self.up if isinstance(self.up, str) else ','.join(f'{v:g}' for v in self.up)}"
            )
        return told

    def after(self, before: Iterable[str]) -> Said:
        """This beside `texts` that were said before, which it overrules where it says another type or up."""
        parts, kind, up = [], self.type, self.up
        for text in before:
            option, _, value = text.partition(" ")
            if option == "--type":
                kind = kind or cast("JointWord", value)
            elif option == "--up":
                up = up or _up_of(value)
            else:
                parts.append(text)
        return Said((*parts, *(p for p in self.parts if p not in parts)), kind, up)


def _up_of(text: str) -> Up:
    return cast("Up", tuple(map(float, text.split(","))) if "," in text else text)


def up_direction(up: Up) -> Array:
    """Unit vector (3,) in the first camera's axes."""
    if isinstance(up, str):
        return np.asarray((1.0 if up[0] == "+" else -1.0) * np.eye(3)["xyz".index(up[1])])
    return np.asarray(up) / np.linalg.norm(up)


def words_said(
    recording: Recording,
    at: Sequence[tuple[int, int, int | float]],
    intervals: Sequence[tuple[int | float, ...]],
    types: Sequence[JointWord],
) -> tuple[Word, ...]:
    """The words of the command line's options, in frames: there, a float is a time in s from the first frame.
    A pixel without depth stands for the nearest one with some.

    Raises InputError for a time or frame beyond the recording, and options that don't belong together.
    """

    def frame(moment: int | float) -> int:
        last = len(recording) - 1
        if isinstance(moment, int):
            return moment
        times = np.asarray(recording.times) - recording.times[0]
        if moment > times[-1]:
            problem = f"{moment:g}s: the recording ends after {times[-1]:.1f} s"
            raise InputError(problem, f"say a time of it, from its first frame on; its frames are 0..{last}")
        return int(np.argmin(np.abs(times - moment)))

    if at and len(intervals) not in (0, len(at)):
        problem = f"{len(intervals)} --interval for {len(at)} --at: they pair in order"
        raise InputError(problem, "give one for each --at, or none")
    count = max(len(at), len(intervals))
    if len(types) > 1 and len(types) != count:
        raise InputError(f"{len(types)} --type for {count} parts that are said", "give one, or one for each")
    points = [(x, y, frame(moment)) for x, y, moment in at]
    spans = [(frame(first), frame(last)) for first, last in intervals]
    kinds = types if len(types) > 1 else [*types] * count
    return tuple(
        Word(None if point is None else _with_depth(recording, point), span, kind)
        for point, span, kind in zip_longest(points, spans, kinds)
    )


def _with_depth(recording: Recording, point: tuple[int, int, int]) -> tuple[int, int, int]:
    """A pixel with depth that is next to one without; the pixel itself where there is none so near."""
    x, y, frame = point
    if frame >= len(recording):
        return point
    depth = recording.depth(frame)
    if y >= depth.shape[0] or x >= depth.shape[1] or depth[y, x] > 0 or not (depth > 0).any():
        return point
    near_x, near_y = _nearest(depth, x, y)
    return (near_x, near_y, frame) if np.hypot(near_x - x, near_y - y) <= _NEAR_PX else point


def require_said(said: Said, recording: Recording) -> None:
    """Raises InputError for a frame or pixel beyond the recording, and for a pixel without depth."""
    last, camera = len(recording) - 1, recording.intrinsics
    for word in said.words:
        if word.interval is not None and word.interval[1] > last:
            told = str(Word(interval=word.interval))
            raise InputError(f"{told}: the recording has frames 0..{last}", "say frames of these")
        if word.point is None:
            continue
        (x, y, frame), told = word.point, str(Word(word.point))
        if frame > last:
            raise InputError(f"{told}: the recording has frames 0..{last}", "say a frame of these")
        if x >= camera.width or y >= camera.height:
            size = f"{camera.width}x{camera.height}"
            raise InputError(f"{told}: the picture has {size} pixels", "say x and y of a pixel in it, from 0")
        depth = recording.depth(frame)
        if not depth[y, x] > 0:
            problem = f"{told}: there is no depth at this pixel"
            if not (depth > 0).any():
                raise InputError(f"{problem}, nor elsewhere in the frame", "point at it in another frame")
            near_x, near_y = _nearest(depth, x, y)
            raise InputError(problem, f"say another one; the nearest with depth is {near_x},{near_y}")


def _nearest(depth: NDArray[np.float32], x: int, y: int) -> tuple[int, int]:
    """The pixel with depth that is nearest."""
    rows, columns = np.nonzero(depth > 0)
    k = int(np.argmin((columns - x) ** 2 + (rows - y) ** 2))
    return int(columns[k]), int(rows[k])
