"""The colour camera through one recording: when its rows are exposed, in what light, with what gain."""

from __future__ import annotations

import numpy as np

from recon.simulate.config import Staging
from recon.simulate.render import Camera
from recon.simulate.sensors.fields import fixed_rng
from recon.simulate.shutter import F32, Flow, exposed
from twin.geometry import Array

MAINS = 50.0  # Hz; lamps swing twice in a period
MAINS_ERROR = 0.05  # Hz; grids hold their frequency to this most of the time
JUMP_EVERY = 2.0  # seconds between steps of the automatic exposure, on average; chosen by us


class Picture:
    """The faults of `Staging.picture`, with what is random in them drawn once for the recording."""

    def __init__(self, config: Staging, camera: Camera, frames: int):
        self._faults, self._fps = config.picture, config.fps
        rng = fixed_rng(config.seed, 1)
        self._lamp = 2.0 * (MAINS + float(rng.uniform(-MAINS_ERROR, MAINS_ERROR)))
        self._phase = float(rng.uniform(0.0, 2.0 * np.pi))
        self._jumps = exposure_jumps(frames, config.fps, config.picture.exposure_jumps, rng)
        down = np.linspace(-0.5, 0.5, camera.height)
        self._rows = self._faults.rolling_shutter_s * down + self._faults.colour_delay_s

    @property
    def moves(self) -> bool:
        """Whether pictures differ from the rendering at the frame's time."""
        return bool(self._faults.shutter > 0.0 or np.any(self._rows))

    def exposed(self, colour: F32, flow: Flow) -> F32:
        """Linear colour (H, W, 3) as it falls on the sensor while the shutter is open."""
        return exposed(colour, flow, self._rows * self._fps, self._faults.shutter)

    def brightness(self, index: int) -> Array:
        """Factor (H, 1, 1) on the rows of frame `index`: lamps' swing and the automatic exposure's steps."""
        times = index / self._fps + self._rows
        opened = self._faults.shutter / self._fps
        swing = np.sin(2.0 * np.pi * self._lamp * times + self._phase) * np.sinc(self._lamp * opened)
        return (self._jumps[index] * (1.0 + self._faults.flicker * swing))[:, None, None]


def exposure_jumps(frames: int, fps: float, step: float, rng: np.random.Generator) -> Array:
    """Gain (frames,): 1, then up and down by 1 + step, never beyond one step from 1, at least once."""
    count = max(1, round(frames / fps / JUMP_EVERY))
    at = rng.choice(np.arange(1, frames), size=min(count, frames - 1), replace=False)
    level, levels = 0, np.zeros(frames)
    for frame in sorted(at):
        level = level + int(rng.choice([-1, 1])) if level == 0 else 0
        levels[frame:] = level
    return (1.0 + step) ** levels
