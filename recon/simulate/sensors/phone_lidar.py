"""A phone's LiDAR as its maker's framework delivers it: a coarse, dense, smooth map filled by a network."""

from __future__ import annotations

import cv2
import numpy as np

from recon.simulate.render import Camera
from recon.simulate.sensors.fields import drifting_noise, fixed_rng, wide_noise
from recon.simulate.sensors.frame import Frame
from twin.geometry import Array

# ARKit's scene depth, made of some 576 measured points (Luetzenburg, Kroon, Bjork 2021)
WIDTH = 256
HEIGHT = 192
FARTHEST = 5.0  # metres; Apple's figure. What is farther is given as this: the map has no holes
# Accuracy +-1 cm on objects of more than 10 cm (Luetzenburg et al. 2021, "Evaluation of the Apple iPhone 12
# Pro LiDAR for an Application in Geosciences"); under 1 mm from a plane at rest, 1 cm when moved (Teo and
# Yang 2023, "Evaluating the accuracy and quality of an iPad Pro's built-in lidar for 3D indoor mapping"):
# nearly all of it is alike over centimetres. How it grows with the distance, and its parts, chosen by us so
# that the whole is 1 cm at 2 m.
ERROR = 0.004  # metres
ERROR_GROWTH = 0.003  # of the distance
FIXED_SHARE = 0.6  # of the error's deviation
FIXED_SIZE = 40.0  # samples over which it is alike
MOVING_SHARE = 0.8  # of the error's deviation
MOVING_SIZE = 8.0  # samples over which it is alike
MOVING_PERIOD = 10.0  # frames: the framework smooths over time
FRESH = 0.0005  # metres, white, in each sample
# samples: a step in depth becomes a ramp some three samples wide; chosen by us after published depth maps
SMEAR = 1.1


class PhoneLidar:
    """Its samples, at most 256 x 192, are enlarged to the picture."""

    def __init__(self, camera: Camera, scale: float, seed: int):
        self._scale, self._seed = scale, seed
        self._size = min(WIDTH, camera.width), min(HEIGHT, camera.height)
        width, height = self._size
        self._ratio = width / WIDTH  # of a smaller picture's samples to the full ones
        self._fixed = wide_noise(height, width, FIXED_SIZE * self._ratio, fixed_rng(seed, 0))

    def depth(self, frame: Frame) -> Array:
        """Depth (H, W) in metres, nowhere 0."""
        height, width = frame.view.depth.shape
        return np.asarray(cv2.resize(self.samples(frame), (width, height), interpolation=cv2.INTER_LINEAR))

    def samples(self, frame: Frame) -> Array:
        """Depth (192, 256) in metres as measured."""
        exact = frame.view.depth.astype(np.float64)
        width, height = self._size
        near = np.where((exact > 0.0) & (exact < FARTHEST), exact, FARTHEST)
        coarse = cv2.resize(near, self._size, interpolation=cv2.INTER_AREA)
        coarse = cv2.GaussianBlur(coarse, (0, 0), max(SMEAR * min(self._scale, 1.0), 0.3))
        size = MOVING_SIZE * self._ratio
        moving = drifting_noise(height, width, size, self._seed, frame.index, MOVING_PERIOD)
        error = (ERROR + ERROR_GROWTH * coarse) * (FIXED_SHARE * self._fixed + MOVING_SHARE * moving)
        error += FRESH * frame.rng.standard_normal((height, width))
        return np.clip(coarse + self._scale * error, 0.05, FARTHEST)
