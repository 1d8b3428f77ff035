"""One cause of doubt, and how bad each is."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields
from math import isfinite
from typing import Any, Literal, get_args

from twin.cause import Cause
from twin.errors import SceneError

Level = Literal["trusted", "doubtful", "refused"]
# Of the user's words, those that help most reasons.
POINT_AT_IT = "point at the part with --at X,Y@FRAME"
CUT = "cut the recording to the opening with --interval A:B"
LEVELS: tuple[Level, ...] = get_args(Level)  # from the best to the worst


def worst(levels: Iterable[Level]) -> Level:
    """The worst of some levels; `trusted` of none."""
    return LEVELS[max((LEVELS.index(level) for level in levels), default=0)]


@dataclass(frozen=True)
class Reason(Cause):
    """One cause of doubt. level: what it makes of its part or twin: `doubtful` or `refused`.

    A subclass holds the numbers behind it, as numbers, texts or truth values, and alone writes what it says.
    Raises SceneError for another level, and for a number that is not finite, which no file could hold.
    """

    level: Level

    def __post_init__(self) -> None:
        if self.level not in LEVELS[1:]:
            raise SceneError(f"a reason makes a part doubtful or refused, not {self.level!r:.40}")
        for f in fields(self):
            value = getattr(self, f.name)
            if isinstance(value, float) and not isfinite(value):
                raise SceneError(f"{type(self).__name__}.{f.name} must be finite, got {value}")

    @property
    @abstractmethod
    def help(self) -> str:
        """What would help: how to record better, or which of the user's words."""


@dataclass(frozen=True)
class StatedReason(Reason):
    """A reason of a type this version doesn't know, as written. raw: its object in twin.json, JSON types."""

    raw: Mapping[str, Any]

    @property
    def text(self) -> str:
        return str(self.raw["text"])

    @property
    def kind(self) -> str:
        return str(self.raw.get("kind", self.raw.get("type", "")))

    @property
    def help(self) -> str:
        return str(self.raw.get("help", ""))
