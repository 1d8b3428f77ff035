"""The colour camera: exposure, vignetting, shot and read noise, 8 bits."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from twin.geometry import Array

GAMMA = 2.2
# Variance of the linear value where white is 1: read noise and, for each unit of signal, shot noise; chosen by us:
# 3 % at mid grey, as of a small sensor in a lit room.
READ, SHOT = 2e-5, 2.2e-4


def exposure(colour: NDArray[np.float32]) -> float:
    """Gain that brings the mean of the linear image to a mid grey of 0.3."""
    return 0.3 / max(float(np.mean(colour)), 1e-4)


def colour_image(
    colour: NDArray[np.float32],
    gain: float | Array,
    scale: float,
    rng: np.random.Generator,
    light: float = 1.0,
) -> NDArray[np.uint8]:
    """8-bit RGB (H, W, 3) of linear colour: vignetting, a soft shoulder, gamma, shot and read noise.

    Args:
        colour: linear (H, W, 3), as rendered in full light.
        gain: of the whole picture, or of its rows (H, 1, 1).
        scale: of the noise.
        light: share of the full light. The camera makes up for it: the picture is as bright, but each value stems from so many
            fewer photons (variance / light) and the read noise is amplified (variance / light^2).
    """
    height, width = colour.shape[:2]
    y, x = np.mgrid[0:height, 0:width]
    radius = np.hypot((x - width / 2) / width, (y - height / 2) / width)
    linear = np.maximum(colour * gain * (1.0 - 0.35 * radius**2)[..., None], 0.0)
    linear = np.where(linear > 0.6, 0.6 + 0.4 * np.tanh((linear - 0.6) / 0.4), linear)
    noise = np.sqrt((READ / light + SHOT * linear) / light)
    linear = linear + scale * rng.standard_normal(colour.shape) * noise
    return np.clip(np.round(255.0 * np.clip(linear, 0.0, 1.0) ** (1.0 / GAMMA)), 0, 255).astype(np.uint8)
