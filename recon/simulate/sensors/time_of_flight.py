"""Amplitude-modulated time of flight, as of the Azure Kinect: the phase of returning light over all paths."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri

from recon.simulate.render import Camera
from recon.simulate.sensors.fields import cosines, facing, fixed_rng, smooth_noise, wide_noise
from recon.simulate.sensors.frame import Frame
from recon.simulate.sensors.multipath import multipath
from twin.geometry import Array

FOCAL = 504.0  # pixels, of the Azure Kinect's narrow mode (640 x 576): lengths in pixels are told for it
NEAREST = 0.25  # metres; Azure Kinect DK hardware specification, over its modes
FARTHEST = 5.46  # metres; the same
# The specification: at 15 to 95 % reflectivity a random error of at most 17 mm, a systematic one below 11 mm
# + 0.1 % of the distance without multipath; confirmed by Tolgyessy et al. 2021 ("Evaluation of the Azure
# Kinect and Its Comparison to Kinect V1 and V2").
SYSTEMATIC = 0.011  # metres
SYSTEMATIC_SHARE = 0.001  # of the distance
# Reflectivity at the end of the narrow mode's range (metres), which the specification still promises.
DARKEST = 0.15
DARKEST_AT = 3.86
# Shot noise: sigma ~ 1 / sqrt(returning light) ~ distance / sqrt(reflectivity) (Foix, Alenya, Torras 2011,
# "Lock-in Time-of-Flight Cameras: A Survey"). Chosen by us: 1 mm at 1 m on white, so that the darkest
# promised surface has 10 of the 17 mm.
SHOT = 0.001
# Wiggling: the modulation is no pure sine; its harmonics give an error that is periodic in the distance, four
# times in the range of the highest modulation frequency of about 200 MHz (Foix et al. 2011; Lefloch et al.
# 2013, "Technical Foundation and Calibration Methods for Time-of-Flight Cameras"). What calibration leaves of
# it, and of the pixels' and the amplitude's offsets: chosen by us to fill the specification's systematic
# error.
WIGGLE = 0.003  # metres
WIGGLE_PERIOD = 0.19  # metres
OFFSET = 0.0035  # metres
OFFSET_SIZE = 90.0  # pixels over which it is alike
# metres between a black and a white surface (intensity-related error, Lefloch et al. 2013)
AMPLITUDE_OFFSET = 0.006
# Flying pixels: a pixel on an edge sees both surfaces and gives a distance between them (Lefloch et al.
# 2013). The footprint, and which share of them the camera notices and leaves out, chosen by us after pictures
# in Tolgyessy et al. 2021.
FOOTPRINT = 1.0
MIXED = 0.02
NOTICED = 0.45
GLOSS = 0.6  # share of the light that a glossy surface sends elsewhere; chosen by us


class TimeOfFlight:
    """Its systematic error belongs to camera and distance, the same in every frame of a recording."""

    def __init__(self, camera: Camera, scale: float, seed: int):
        rng = fixed_rng(seed, 0)
        self._scale, self._pixel = scale, camera.focal / FOCAL
        self._phase = float(rng.uniform(0.0, 2.0 * np.pi))
        self._darker = float(rng.choice([-1.0, 1.0]))
        height, width = camera.height, camera.width
        self._along = cosines(camera)
        self._offset = OFFSET * wide_noise(height, width, OFFSET_SIZE * self._pixel, rng)
        self._dead = smooth_noise(height, width, 0.8, rng)

    def depth(self, frame: Frame) -> Array:
        """Depth (H, W) in metres, 0 = unknown."""
        view, rng = frame.view, frame.rng
        exact = view.depth.astype(np.float64)
        height, width = exact.shape
        seen = exact > 0.0
        straight = facing(view.normals, frame.rays)
        reflected = np.clip(view.tone, 0.02, 1.0) * (1.0 - GLOSS * view.gloss) * np.maximum(straight, 0.05)
        light = np.where(seen, reflected / np.maximum(exact, NEAREST) ** 2, 0.0)
        mixed, spread = self._footprint(exact, light)
        along = self._along
        bounced = multipath(exact, frame.rays, view.normals, view.tone, along)
        error = bounced + self.systematic(mixed / along, view.tone)
        z = mixed + self._scale * along * error
        sigma = SHOT / np.sqrt(np.maximum(light, 1e-6))
        z = z + self._scale * sigma * rng.standard_normal((height, width))
        limit = DARKEST / DARKEST_AT**2
        noise = 0.7 * self._dead + 0.7 * smooth_noise(height, width, 0.8, rng)
        lost = light < limit * np.clip(1.0 + 0.3 * noise, 0.2, 2.0)
        lost |= (spread > MIXED) & (noise < ndtri(NOTICED))
        return np.where(lost | (mixed < NEAREST) | (mixed > FARTHEST), 0.0, z)

    def systematic(self, distance: Array, tone: NDArray[np.float32]) -> Array:
        """Error (H, W) in metres that is the same whenever this pixel sees this distance and reflectivity."""
        wiggle = WIGGLE * np.sin(2.0 * np.pi * distance / WIGGLE_PERIOD + self._phase)
        amplitude = self._darker * AMPLITUDE_OFFSET * (0.5 - np.clip(tone, 0.0, 1.0))
        limit = SYSTEMATIC + SYSTEMATIC_SHARE * distance
        return np.clip(wiggle + self._offset + amplitude, -limit, limit)

    def _footprint(self, exact: Array, light: Array) -> tuple[Array, Array]:
        """Depth as mixed by the light in each pixel's footprint, and how far from pure it is (metres)."""
        sigma = max(FOOTPRINT * self._pixel * min(self._scale, 1.0), 0.3)
        total = np.maximum(cv2.GaussianBlur(light, (0, 0), sigma), 1e-12)
        mixed: Array = cv2.GaussianBlur(light * exact, (0, 0), sigma) / total
        square = cv2.GaussianBlur(light * exact**2, (0, 0), sigma) / total
        return mixed, np.sqrt(np.maximum(square - mixed**2, 0.0))
