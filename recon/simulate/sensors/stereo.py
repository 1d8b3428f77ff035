"""Stereo, as of the RealSense D400: two pictures matched by windows, needing texture and two free views."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from recon.simulate.render import Camera
from recon.simulate.sensors.fields import displaced, facing, fixed_rng, near_edge, wide_noise
from recon.simulate.sensors.frame import Frame
from twin.geometry import Array

# Root mean square error = z^2 x subpixel / (focal length x baseline) (Grunnet-Jepsen, Sweetser, Woodfill,
# "Tuning depth cameras for best performance", Intel), for the D435 at 848 x 480: 424 px, 50 mm, and 0.07 px,
# within Intel's 0.05 to 0.1 px on good texture: 3.3 mm/m^2 z^2. A D435 that was measured gave 1.5, 15 and 31
# mm at 0.7, 2.1 and 3.2 m, and 10 % zeros; Ahn et al. 2019 ("Analysis and Noise Modeling of the Intel
# RealSense D435 for Mobile Robots") find the same growth with the square.
FOCAL = 424.0
BASELINE = 0.050
SUBPIXEL = 0.07
STEPS = 32.0  # disparities in a pixel ("Subpixel Linearity Improvement for RealSense D400", Intel)
NEAREST = 0.195  # metres; D400 data sheet, smallest distance at 848 x 480
FARTHEST = 10.0  # metres; the same
# The error's parts (shares of the deviation, their squares sum to 1) and over how many pixels each is alike;
# chosen by us: a map that belongs to the calibration, one that belongs to the texture in the window and so
# moves with the surface, one of each frame.
CALIBRATION = 0.35
CALIBRATION_SIZE = 60.0
TEXTURE = 0.55
WINDOW = 3.5
FRESH = 0.758
FRESH_SIZE = 3.5
# Contrast (8-bit steps of the grey picture, smoothed by a pixel, which takes most of its noise away) under
# which a window finds no match; chosen by us so that a furnished room loses about the tenth that was
# measured.
CONTRAST = 2.1
BLOTCHES = 0.5  # share by which blotches vary it
BLOTCH_SIZE = 6.0  # pixels
# pixels by which edges waver, as a window that holds two depths decides for either; chosen by us
WOBBLE = 1.3
EDGE = 0.03  # metres
GRAZING = 0.12  # cosine under which the two views of a surface differ too much to match; chosen by us


class Stereo:
    """The left of the two cameras is where colour is taken from."""

    def __init__(self, camera: Camera, scale: float, seed: int):
        self._scale, self._pixel = scale, camera.focal / FOCAL
        self._parallax = camera.focal * BASELINE  # px m: disparity in pixels of the picture is this / z
        self._shape = camera.height, camera.width
        rng = fixed_rng(seed, 0)
        self._calibration = wide_noise(*self._shape, CALIBRATION_SIZE * self._pixel, rng)
        self._weak = wide_noise(*self._shape, BLOTCH_SIZE * self._pixel, rng)
        self._waver = [wide_noise(*self._shape, WINDOW * self._pixel, rng) for _ in range(2)]

    def depth(self, frame: Frame) -> Array:
        """Depth (H, W) in metres, 0 = unknown."""
        scale, exact, rng = self._scale, frame.view.depth.astype(np.float64), frame.rng
        seen = exact > 0.0
        fresh = wide_noise(*self._shape, FRESH_SIZE * self._pixel, rng)
        z = self._edges(exact, rng)
        grey = cv2.GaussianBlur(frame.colour.astype(np.float64).mean(axis=-1), (0, 0), max(self._pixel, 0.3))
        pattern = texture_pattern(grey, WINDOW * self._pixel)
        error = CALIBRATION * self._calibration + TEXTURE * pattern + FRESH * fresh
        disparity = FOCAL * BASELINE / np.maximum(z, NEAREST) + scale * SUBPIXEL * error
        disparity = np.maximum(np.round(STEPS * disparity) / STEPS, 1.0 / STEPS)
        z = FOCAL * BASELINE / disparity
        blotches = 0.8 * self._weak + 0.6 * wide_noise(*self._shape, BLOTCH_SIZE * self._pixel, rng)
        harder = scale * np.maximum(1.0 + BLOTCHES * blotches, 0.3)
        plain = contrast(grey, WINDOW * self._pixel) < CONTRAST * harder
        grazing = facing(frame.view.normals, frame.rays) < GRAZING * harder
        lost = plain | grazing | shadow(exact, self._parallax)
        return np.where(seen & ~lost & (exact > NEAREST) & (z < FARTHEST), z, 0.0)

    def _edges(self, exact: Array, rng: np.random.Generator) -> Array:
        """Depth with edges that waver and foreground that is a little too large."""
        size = 2 * max(1, round(self._pixel)) + 1
        kernel = np.ones((size, size), np.uint8)
        reach = np.ones((2 * size + 1, 2 * size + 1), np.uint8)
        edge = cv2.dilate(near_edge(exact, EDGE).astype(np.uint8), reach) > 0
        far = np.where(exact > 0.0, exact, np.inf)
        wide = cv2.erode(far, kernel)
        wide = np.where(np.isfinite(wide), wide, 0.0)
        dx, dy = (
            self._scale
            * WOBBLE
            * self._pixel
            * (0.8 * w + 0.6 * wide_noise(*self._shape, WINDOW * self._pixel, rng))
            for w in self._waver
        )
        return np.where(edge, displaced(wide, dx, dy), exact)


def shadow(exact: Array, parallax: float) -> NDArray[np.bool_]:
    """Pixels (H, W) of the left camera that the right can't see: left of nearer surface, by disparity.

    parallax: focal length (px) x baseline (m).
    """
    height, width = exact.shape
    disparity = np.where(exact > 0.0, parallax / np.maximum(exact, 1e-3), 0.0)
    u = np.arange(width)[None, :]
    # the right picture, with room on its left
    right = np.clip(np.round(u - disparity).astype(int) + width, 0, 2 * width)
    cell = right + (2 * width + 1) * np.arange(height)[:, None]
    nearest = np.zeros(height * (2 * width + 1))
    np.maximum.at(nearest, cell.reshape(-1), disparity.reshape(-1))
    # surfaces that the right camera sees stretched leave gaps between their pixels: close those of one pixel
    grid = nearest.reshape(height, -1).astype(np.float32)
    closed = cv2.morphologyEx(grid, cv2.MORPH_CLOSE, np.ones((1, 3), np.uint8))
    return disparity < closed[np.arange(height)[:, None], right] - 1.5


def contrast(grey: Array, sigma: float) -> Array:
    """Deviation (H, W) of the grey values in a window of `sigma` pixels."""
    mean = cv2.GaussianBlur(grey, (0, 0), sigma)
    return np.sqrt(np.maximum(cv2.GaussianBlur(grey**2, (0, 0), sigma) - mean**2, 0.0))


def texture_pattern(grey: Array, sigma: float) -> Array:
    """A field (H, W) of about unit deviation that is a function of the texture alone: bands of its grey
    values about as wide as the matching window, relative to their own strength around.
    """
    band = cv2.GaussianBlur(grey, (0, 0), sigma) - cv2.GaussianBlur(grey, (0, 0), 2.0 * sigma)
    strength = np.sqrt(cv2.GaussianBlur(band**2, (0, 0), 4.0 * sigma))
    return np.clip(band / np.maximum(strength, 1e-3), -3.0, 3.0)
