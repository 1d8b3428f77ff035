"""The frozen set: twelve rooms, in each of which a person opens and closes things ten or eleven times.

It has the shape of OmniFun4D (FunREC, supplement 2.2: 12 scenes, 127 interactions, 15 frames a second). Half
of the rooms have exact depth, as there; half have that of a time-of-flight camera, as RealFun4D.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from recon.simulate.random.strata import Sensor, WalkStratum
from recon.simulate.simulator import record
from recon.simulate.walk.scene import DrawnWalk, random_walk

ROOMS = 12
# of the first room; none of them is a seed that anything here was built with
_FIRST_SEED = 5000
_PARTS, _SECONDS = 6, 165.0
# Frames of rest on both sides of an interaction, where its neighbours leave so many: 1.5 s
REST = 22


@dataclass(frozen=True, order=True)
class Clip:
    """One interaction of a room, by its number in time."""

    room: int
    number: int

    @property
    def name(self) -> str:
        return f"{self.room:02d}-{self.number:02d}"


def interactions(room: int) -> int:
    """Interactions of a room: 127 in all."""
    return 11 if room < 7 else 10


def clips() -> list[Clip]:
    """All 127 of them; the first one of each room comes first: these are the subset."""
    every = [Clip(room, k) for room in range(ROOMS) for k in range(interactions(room))]
    return sorted(every, key=lambda c: (c.number > 0, c))


def subset() -> list[Clip]:
    """The first interaction of each room."""
    return clips()[:ROOMS]


def stratum(room: int) -> WalkStratum:
    """What is wanted of a room."""
    sensor: Sensor = "time_of_flight" if room % 2 else "ideal"
    order = "mixed" if room % 4 < 2 else "in_turn"
    return WalkStratum(sensor, _PARTS, interactions(room), _SECONDS, order, loops=True)  # type: ignore[arg-type]


@dataclass(frozen=True)
class Room:
    """One room as it was drawn, which takes a minute."""

    number: int

    @cached_property
    def walk(self) -> DrawnWalk:
        return random_walk(_FIRST_SEED + self.number, stratum(self.number))

    def spans(self) -> Iterator[tuple[int, int]]:
        """First and last frame of each clip: the interaction, from the hand's coming to its going, and rest
        on both sides up to its neighbours."""
        stage = self.walk.stage
        lines = sorted((line for _, line, _ in stage.journey.acts), key=lambda line: line.enter)
        for k, line in enumerate(lines):
            before = lines[k - 1].gone + 1 if k else 0
            after = lines[k + 1].enter - 1 if k + 1 < len(lines) else stage.frames - 1
            yield max(line.enter - REST, before), min(line.gone + REST, after)

    def render(self, number: int, folder: Path) -> Path:
        """One interaction as a recording with its truth, in a new folder, which is returned."""
        first, last = list(self.spans())[number]
        record(self.walk.stage.during(first, last), folder)
        told = {"room": self.number, "seed": _FIRST_SEED + self.number, "frames": [first, last]}
        (folder / "truth" / "clip.json").write_text(json.dumps(told) + "\n", encoding="utf-8")
        return folder
