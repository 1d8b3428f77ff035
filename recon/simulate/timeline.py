"""When things happen: the phases of one interaction in frames, and the part's state over time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from recon.simulate.config import SimulateConfig
from twin.errors import ConfigError
from twin.geometry import Array


@dataclass(frozen=True)
class Timeline:
    """Frame indices: `enter` first frame with the hand, `grasp` first closed, `start` last at rest, `end` first at
    rest again, `release` last closed, `gone` first without the hand; `frames` in all.
    """

    enter: int
    grasp: int
    start: int
    end: int
    release: int
    gone: int
    frames: int

    @staticmethod
    def of(config: SimulateConfig) -> Timeline:
        """The phases of a configuration. Raises ConfigError when a phase has no frame."""
        lengths = np.array(
            [
                config.rest_before_s,
                config.reach_s,
                config.hold_s,
                config.move_s / config.speed,
                config.hold_s,
                config.leave_s,
                config.rest_after_s,
            ]
        )
        frames = config.frames if config.frames is not None else round(float(lengths.sum()) * config.fps)
        marks = np.round(np.cumsum(lengths) / lengths.sum() * frames).astype(int)
        if np.any(np.diff(np.concatenate([[0], marks])) < 1):
            raise ConfigError(
                f"{frames} frames are too few for the seven phases of a recording",
                "raise simulate.frames or fps",
            )
        enter, grasp, start, end, release, gone = (int(m) for m in marks[:6])
        return Timeline(enter, grasp, start, end, release, gone, frames)

    def states(self, opening: float) -> Array:
        """State (frames,) of the part: 0, a minimum-jerk rise between `start` and `end`, then `opening`."""
        t = (np.arange(self.frames) - self.start) / (self.end - self.start)
        return opening * minimum_jerk(t)

    def in_contact(self) -> list[bool]:
        """Whether the hand holds the part, per frame."""
        return [self.grasp <= i <= self.release for i in range(self.frames)]


def minimum_jerk(t: ArrayLike) -> Array:
    """10 t^3 - 15 t^4 + 6 t^5 for t clipped to 0..1 (Flash & Hogan 1985)."""
    x = np.clip(np.asarray(t, dtype=np.float64), 0.0, 1.0)
    return x**3 * (10.0 - 15.0 * x + 6.0 * x**2)
