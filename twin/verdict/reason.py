"""One cause of doubt, and how bad each is."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Literal, get_args

from twin.cause import Cause
from twin.errors import SceneError

Level = Literal["trusted", "doubtful", "refused"]
LEVELS: tuple[Level, ...] = get_args(Level)  # from the best to the worst


def worst(levels: Iterable[Level]) -> Level:
    """The worst of some levels; `trusted` of none."""
    return LEVELS[max((LEVELS.index(level) for level in levels), default=0)]


@dataclass(frozen=True)
class Reason(Cause):
    """One cause of doubt. level: what it makes of the part, or of the twin, that it is about: `doubtful` or
    `refused`. Raises SceneError for another level."""

    level: Level

    def __post_init__(self) -> None:
        if self.level not in LEVELS[1:]:
            raise SceneError(f"a reason makes a part doubtful or refused, not {self.level!r:.40}")

    def at_level(self, level: Level) -> Reason:
        """The same, making a part this."""
        return replace(self, level=level)
