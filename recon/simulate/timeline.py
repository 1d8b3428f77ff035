"""When things happen: the person's acts in order, the phases in frames, the part's state over time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from recon.simulate.config import SimulateConfig
from twin.errors import ConfigError
from twin.geometry import Array

# Durations (s) of a person who opens a part, all chosen by us: the rest before the hand enters
_REST_BEFORE = 1.4
# From the hand's entry to the closed grasp
_REACH = 0.95
# Between grasp and motion, and again between motion and release
_HOLD = 0.25
# The minimum-jerk motion at speed 1
_MOVE = 2.6
# From release until the hand is out of view
_LEAVE = 0.8
# The rest after the hand has left
REST_AFTER = 1.05


@dataclass(frozen=True)
class Leg:
    """The part goes to state `to`, rad or m, within `seconds` by minimum jerk; if there, it pauses."""

    to: float
    seconds: float


@dataclass(frozen=True)
class Episode:
    """One interaction: rest, the hand comes and takes hold of the part of `joint`, leads it from `start`
    through `legs`, lets go and leaves. reaches: whether a hand comes at all.
    """

    joint: str
    start: float
    legs: tuple[Leg, ...]
    wait_s: float
    reach_s: float
    hold_s: float
    leave_s: float
    reaches: bool = True

    @property
    def lengths(self) -> tuple[float, ...]:
        """Seconds of each phase in their order."""
        legs = (leg.seconds for leg in self.legs)
        return (self.wait_s, self.reach_s, self.hold_s, *legs, self.hold_s, self.leave_s)

    @property
    def levels(self) -> tuple[float, ...]:
        """State before the first and after each leg."""
        return (self.start, *(leg.to for leg in self.legs))


@dataclass(frozen=True)
class Timeline:
    """Frame indices of one interaction: `enter` first with the hand, `grasp` first closed, `turns` last at
    rest, then legs' ends, `release` last closed, `gone` first without the hand; `frames` of the whole
    recording."""

    enter: int
    grasp: int
    turns: tuple[int, ...]
    release: int
    gone: int
    frames: int

    @staticmethod
    def of(config: SimulateConfig) -> Timeline:
        """The phases of a configuration. Raises ConfigError when a phase has no frame."""
        return timelines((opening_episode("", 0.0, config),), REST_AFTER, config)[0]

    @property
    def start(self) -> int:
        """The last frame before the part is moved."""
        return self.turns[0]

    @property
    def end(self) -> int:
        """The first frame in which the part is at rest again."""
        return self.turns[-1]

    def begun_at(self, first: int) -> Timeline:
        """The same for who counts frames from `first` on, to the first one without the hand."""
        turns = tuple(t - first for t in self.turns)
        frames = self.gone - first + 1
        return Timeline(
            self.enter - first, self.grasp - first, turns, self.release - first, self.gone - first, frames
        )

    def states(self, levels: Sequence[float]) -> Array:
        """State (frames,) of the part through `levels`, one for each of `turns`, in minimum jerks."""
        out = np.full(self.frames, float(levels[0]))
        for k in range(len(levels) - 1):
            t = (np.arange(self.frames) - self.turns[k]) / (self.turns[k + 1] - self.turns[k])
            out = out + (levels[k + 1] - levels[k]) * minimum_jerk(t)
        return out

    def segments(self, levels: Sequence[float]) -> list[tuple[int, int]]:
        """Frames (last at rest, first at rest again) of each moving leg; legs without a pause are one."""
        out: list[tuple[int, int]] = []
        for k in range(len(levels) - 1):
            if levels[k + 1] != levels[k]:
                first, last = self.turns[k], self.turns[k + 1]
                turned = k > 0 and (levels[k + 1] - levels[k]) * (levels[k] - levels[k - 1]) < 0
                if out and out[-1][1] == first and not turned:
                    first, _ = out.pop()
                out.append((first, last))
        return out

    def in_contact(self) -> list[bool]:
        """Whether the hand holds the part, per frame."""
        return [self.grasp <= i <= self.release for i in range(self.frames)]


def opening_episode(joint: str, opening: float, config: SimulateConfig) -> Episode:
    """A part that stands closed is opened by `opening`, at the speed of a configuration."""
    legs = (Leg(opening, _MOVE / config.speed),)
    return Episode(joint, 0.0, legs, _REST_BEFORE, _REACH, _HOLD, _LEAVE)


def timelines(
    episodes: Sequence[Episode], rest_after_s: float, config: SimulateConfig
) -> tuple[Timeline, ...]:
    """The phases of interactions one after the other. Raises ConfigError when a phase has no frame."""
    lengths = np.array([*(s for e in episodes for s in e.lengths), rest_after_s])
    frames = config.frames if config.frames is not None else round(float(lengths.sum()) * config.fps)
    marks = np.round(np.cumsum(lengths) / lengths.sum() * frames).astype(int)
    if np.any(np.diff(np.concatenate([[0], marks])) < 1):
        raise ConfigError(
            f"{frames} frames are too few for the {len(lengths)} phases of a recording",
            "raise simulate.frames or fps",
        )
    out, first = [], 0
    for episode in episodes:
        m = [int(v) for v in marks[first : first + len(episode.lengths)]]
        first += len(m)
        out.append(Timeline(m[0], m[1], tuple(m[2:-2]), m[-2], m[-1], frames))
    return tuple(out)


def minimum_jerk(t: ArrayLike) -> Array:
    """10 t^3 - 15 t^4 + 6 t^5 for t clipped to 0..1 (Flash & Hogan 1985)."""
    x = np.clip(np.asarray(t, dtype=np.float64), 0.0, 1.0)
    return x**3 * (10.0 - 15.0 * x + 6.0 * x**2)
