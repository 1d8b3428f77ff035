"""The depth cameras by name."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol, get_args

import numpy as np
from numpy.typing import NDArray

from recon.simulate.config import SimulateConfig
from recon.simulate.render import Camera
from recon.simulate.sensors.frame import Frame
from recon.simulate.sensors.phone_lidar import PhoneLidar
from recon.simulate.sensors.stereo import Stereo
from recon.simulate.sensors.structured_light import StructuredLight
from recon.simulate.sensors.time_of_flight import TimeOfFlight
from twin.errors import ConfigError
from twin.geometry import Array
from twin.runs.setting import types_of

SENSORS: tuple[str, ...] = get_args(types_of(SimulateConfig)["sensor"])


class Sensing(Protocol):
    """How a kind of camera measures."""

    def depth(self, frame: Frame) -> Array:
        """Depth (H, W) in metres, 0 = unknown."""


class DepthCamera:
    """A depth camera in one recording: the error common to all frames is drawn when it is made.

    Args:
        name: one of `SENSORS`.
        camera: the pinhole camera, which depth and colour share.
        scale: of all errors; 0 gives exact depth, 1 a typical sensor.
        seed: the recording's; equal seeds give equal errors.

    Raises ConfigError for another name.
    """

    def __init__(self, name: str, camera: Camera, scale: float, seed: int):
        if name not in SENSORS:
            raise ConfigError(f"there is no sensor {name!r}", f"use one of {', '.join(SENSORS)}")
        kinds: dict[str, Callable[[Camera, float, int], Sensing]] = {
            "structured_light": StructuredLight,
            "time_of_flight": TimeOfFlight,
            "phone_lidar": PhoneLidar,
            "stereo": Stereo,
        }
        exact = name == "ideal" or scale == 0.0
        self._sensing = None if exact else kinds[name](camera, scale, seed)

    def image(self, frame: Frame) -> NDArray[np.uint16]:
        """Depth (H, W) in millimetres, 0 = unknown."""
        if self._sensing is None:
            z = frame.view.depth.astype(np.float64)
        else:
            z = self._sensing.depth(frame)
        return np.clip(np.round(1000.0 * z), 0, 65535).astype(np.uint16)
