"""From exact renderings to what a camera delivers: depth noise and drop-out, colour noise, 8 and 16 bits."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from recon.simulate.render import View
from twin.geometry import Array

# Axial noise of structured-light and time-of-flight cameras: sigma = 1.2 mm + 1.9 mm/m^2 (z - 0.4 m)^2
# (Nguyen, Izadi, Lovell 2012), lateral jitter of about 0.5 pixels at edges.
AXIAL, AXIAL_GROWTH, AXIAL_FROM, LATERAL = 0.0012, 0.0019, 0.4, 0.45
EDGE, NEAREST, FARTHEST = 0.03, 0.2, 6.0  # metres
GAMMA = 2.2


def depth_image(view: View, rays: Array, scale: float, rng: np.random.Generator) -> NDArray[np.uint16]:
    """Depth (H, W) in millimetres, 0 = unknown.

    Args:
        view: exact rendering.
        rays: unit viewing directions (H, W, 3) in the world, for grazing angles.
        scale: 0 gives exact depth rounded to 1 mm, 1 a typical sensor.
    """
    exact = view.depth.astype(np.float64)
    if scale == 0.0:
        return np.round(1000.0 * exact).astype(np.uint16)
    height, width = exact.shape
    y, x = np.mgrid[0:height, 0:width]
    jitter = LATERAL * scale * rng.standard_normal((2, height, width))
    rows = np.clip(np.round(y + jitter[0]), 0, height - 1).astype(int)
    columns = np.clip(np.round(x + jitter[1]), 0, width - 1).astype(int)
    near_edge = _near_edge(exact)
    z = np.where(near_edge, exact[rows, columns], exact)
    sigma = scale * (AXIAL + AXIAL_GROWTH * (z - AXIAL_FROM) ** 2)
    facing = np.abs(np.einsum("ijk,ijk->ij", view.normals, rays))
    sigma = sigma * np.clip(0.7 / np.maximum(facing, 0.12), 1.0, 3.0)
    coarse = _smooth_noise(height, width, 2.0, rng)
    z = z + sigma * (0.85 * rng.standard_normal((height, width)) + 0.5 * coarse)
    lost = 0.6 * near_edge + 0.9 * np.clip((0.16 - facing) / 0.1, 0.0, 1.0)
    lost = lost + 0.35 * view.gloss * np.clip((0.16 - view.tone) / 0.1, 0.0, 1.0) + 0.002
    blotches = ndtr(_smooth_noise(height, width, 0.8, rng))  # uniform in 0..1, but not salt and pepper
    gone = blotches < np.clip(scale * lost, 0.0, 0.98)
    z = np.where(gone | (exact < NEAREST) | (exact > FARTHEST), 0.0, z)
    return np.clip(np.round(1000.0 * z), 0, 65535).astype(np.uint16)


def _smooth_noise(height: int, width: int, sigma: float, rng: np.random.Generator) -> Array:
    """Gaussian noise (height, width) of unit deviation, correlated over `sigma` pixels."""
    field = cv2.GaussianBlur(rng.standard_normal((height, width)), (0, 0), sigma)
    return field * (2.0 * np.sqrt(np.pi) * sigma)  # the blur's kernel has the norm 1 / (2 sqrt(pi) sigma)


def _near_edge(depth: Array) -> NDArray[np.bool_]:
    """Pixels within one pixel of a step in depth of more than EDGE and 2 %."""
    d = depth.astype(np.float32)
    kernel = np.ones((3, 3), np.uint8)
    step = cv2.dilate(d, kernel) - cv2.erode(d, kernel)
    slope = cv2.GaussianBlur(np.abs(cv2.Laplacian(d, cv2.CV_32F)), (0, 0), 0.8)
    return (step > np.maximum(EDGE, 0.02 * d)) & (slope > 0.25 * EDGE)


def exposure(colour: NDArray[np.float32]) -> float:
    """Gain that brings the mean of the linear image to a mid grey of 0.3."""
    return 0.3 / max(float(np.mean(colour)), 1e-4)


def colour_image(
    colour: NDArray[np.float32], gain: float, scale: float, rng: np.random.Generator
) -> NDArray[np.uint8]:
    """8-bit RGB (H, W, 3) of linear colour: vignetting, a soft shoulder, gamma, shot and read noise."""
    height, width = colour.shape[:2]
    y, x = np.mgrid[0:height, 0:width]
    radius = np.hypot((x - width / 2) / width, (y - height / 2) / width)
    linear = np.maximum(colour * gain * (1.0 - 0.35 * radius**2)[..., None], 0.0)
    linear = np.where(linear > 0.6, 0.6 + 0.4 * np.tanh((linear - 0.6) / 0.4), linear)
    linear = linear + scale * rng.standard_normal(colour.shape) * np.sqrt(2e-5 + 2.2e-4 * linear)
    return np.clip(np.round(255.0 * np.clip(linear, 0.0, 1.0) ** (1.0 / GAMMA)), 0, 255).astype(np.uint8)
