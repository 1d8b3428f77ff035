"""What is drawn on purpose in a random recording; all else is left to chance."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

Sensor = Literal["structured_light", "ideal", "time_of_flight", "phone_lidar", "stereo"]

SENSORS: tuple[Sensor, ...] = ("ideal", "structured_light", "time_of_flight", "phone_lidar", "stereo")
ORDINARY_SENSORS = SENSORS[:3]
View = Literal["ordinary", "near", "steep", "moving"]
VIEWS: tuple[View, ...] = ("ordinary", "near", "steep", "moving")
Negative = Literal["nothing", "carried", "curtain", "person", "screen", "camera", "gestures", "rattle"]
NEGATIVES: tuple[Negative, ...] = (
    "nothing", "carried", "curtain", "person", "screen", "camera", "gestures", "rattle",
)  # fmt: skip
# s that a walk takes where nobody says
WALK_SECONDS = (45.0, 180.0)
# s below which a walk may have less than three interactions
_BRIEF = 45.0
# s of a sealed walk for each interaction, and how many of these are with a part that was not handled before
_EVERY, _NEW = 12.6, 0.63
# Share of a drawn walk's interactions that are with new parts at most, so that a third comes again
_MOST_NEW = 0.66


@dataclass(frozen=True)
class Stratum:
    """hard_picture: three or more faults of the colour pictures at once. view: near: the part covers over
    half of the picture; steep: pitched by -35 degrees or less, or 20 or more; moving: a path of 0.6 m or
    more. short: 12 to 20 degrees or 6 to 10 cm. negative: what moves in place of a part. group: of the set
    that rates are told for. Picture size in pixels, frames a second.
    """

    sensor: Sensor
    hard_picture: bool = False
    view: View = "ordinary"
    short: bool = False
    negative: Negative | None = None
    size: tuple[int, int] = (640, 480)
    fps: float = 15.0
    group: Literal["ordinary", "hard", "negative"] = "ordinary"

    @staticmethod
    def drawn(rng: np.random.Generator) -> Stratum:
        """Any of them, each as likely as it is in `sealed_set`."""
        every = sealed_set()
        return every[int(rng.integers(len(every)))]


def sealed_set() -> tuple[Stratum, ...]:
    """The 160 strata that rates are measured on: 60 ordinary ones, 60 hard ones, 40 negatives.

    Ordinary: 20 of each of three sensors. Hard: 12 of each of five sensors, 30 of each picture, 15 of each
    view. Every fifth of both is short. Negatives: five of each kind, in all sensors and pictures. 6 of the
    120 are of 1280 to 1920 pixels, 6 of 30 frames a second.
    """
    ordinary = [Stratum(ORDINARY_SENSORS[k % 3], short=k % 5 == 0) for k in range(60)]
    hard = [_hard(k) for k in range(60)]
    special = ordinary + hard
    sizes = [(1280, 720), (1280, 960), (1920, 1080)] * 2
    for n, size in enumerate(sizes):
        special[20 * n + 7] = replace(special[20 * n + 7], size=size)
        special[20 * n + 16] = replace(special[20 * n + 16], fps=30.0)
    negative = [
        Stratum(SENSORS[k // 8], (k // 8 + k) % 2 == 0, negative=NEGATIVES[k % 8], group="negative")
        for k in range(40)
    ]
    return (*special, *negative)


def _hard(k: int) -> Stratum:
    """Every twenty go through all sensors and views, every other picture hard, the next twenty reversed."""
    sensor, view = k % 5, (k // 5) % 4
    hard_picture = (sensor + view + k // 20) % 2 == 0
    return Stratum(SENSORS[sensor], hard_picture, VIEWS[view], short=(k + k // 5) % 5 == 0, group="hard")


@dataclass(frozen=True)
class WalkStratum:
    """What is wanted of a random walk: how many `parts` are handled in `interactions`, within `seconds`.

    Attributes:
        sensor: as in `Stratum`, as are hard_picture, size and fps.
        parts: fronts that are opened or closed, 1 to 6.
        interactions: how often one is, as often as there are parts or more.
        seconds: length of the walk.
        order: each thing in turn round the room, or mixed.
        loops: whether the path returns to earlier places.
    """

    sensor: Sensor
    parts: int = 4
    interactions: int = 6
    seconds: float = 75.0
    order: Literal["in_turn", "mixed"] = "mixed"
    loops: bool = True
    hard_picture: bool = False
    size: tuple[int, int] = (640, 480)
    fps: float = 15.0

    @staticmethod
    def drawn(rng: np.random.Generator, seconds: float | None = None) -> WalkStratum:
        """Any; seconds: how long it takes, None: drawn from 45 to 180."""
        long = float(np.round(rng.uniform(*WALK_SECONDS))) if seconds is None else seconds
        parts = int(rng.integers(3, 7))
        interactions = max(1 if long < _BRIEF else 3, round(long / float(rng.uniform(10.0, 15.0))))
        return WalkStratum(
            SENSORS[int(rng.integers(len(SENSORS)))],
            min(parts, max(1, round(_MOST_NEW * interactions))),
            interactions,
            long,
            "mixed" if rng.random() < 0.5 else "in_turn",
            bool(rng.random() < 0.7),
            bool(rng.random() < 0.5),
        )


def sealed_walks() -> tuple[WalkStratum, ...]:
    """The 16 walks that rates are measured on, from 45 to 120 s: 68 parts, 106 interactions.

    A third of the parts or more is handled again. Of all orders, loops and pictures there are eight, of each
    combination two; each sensor has three walks, the phone's four.
    """
    out = []
    for k in range(16):
        seconds = 45.0 + 5.0 * k
        interactions = round(seconds / _EVERY)
        parts = min(6, max(3, round(_NEW * interactions)))
        order: Literal["in_turn", "mixed"] = "mixed" if k % 2 else "in_turn"
        loops, hard = (k // 2) % 2 == 1, (k // 4) % 2 == 1
        out.append(WalkStratum(SENSORS[(k + k // 5) % 5], parts, interactions, seconds, order, loops, hard))
    return tuple(out)
