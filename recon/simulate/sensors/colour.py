"""The colour camera: exposure, vignetting, shot and read noise, 8 bits."""

from __future__ import annotations

from functools import lru_cache

import numba
import numpy as np
from numpy.typing import NDArray

from twin.geometry import Array

GAMMA = 2.2
# Variance of the linear value where white is 1, chosen by us: 3 % at mid grey, as of a small sensor in a lit
# room.
READ = 2e-5
SHOT = 2.2e-4  # for each unit of signal
BINS = 4096  # of the look-up from linear values to levels; so many that few hold more than one step


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
        light: share of the full light. The camera makes up for it: the picture is as bright, but each value
            has so many fewer photons (variance / light), its read noise amplified (variance / light^2).
    """
    height, width = colour.shape[:2]
    rows = np.broadcast_to(np.asarray(gain, dtype=np.float64).reshape(-1), height).copy()
    noise = rng.standard_normal(colour.shape)
    return _developed(colour, rows, _vignette(height, width), noise, scale, light, *_LEVELS)


@lru_cache(maxsize=2)
def _vignette(height: int, width: int) -> Array:
    """Share (H, W) of the light that the lens lets through."""
    y, x = np.mgrid[0:height, 0:width]
    return 1.0 - 0.35 * np.hypot((x - width / 2) / width, (y - height / 2) / width) ** 2


def _levels() -> tuple[Array, NDArray[np.uint8]]:
    """Least linear value (255,) of levels 1 to 255, and the level (BINS + 1,) of equal steps of it."""
    least = np.asarray(((np.arange(1, 256) - 0.5) / 255.0) ** GAMMA, dtype=np.float64)
    return least, np.searchsorted(least, np.arange(BINS + 1) / BINS, side="right").astype(np.uint8)


_LEVELS = _levels()


@numba.njit(cache=True, nogil=True)
def _developed(
    colour: NDArray[np.float32],
    gain: Array,
    vignette: Array,
    noise: Array,
    scale: float,
    light: float,
    least: Array,
    start: NDArray[np.uint8],
) -> NDArray[np.uint8]:
    """8-bit RGB (H, W, 3); `noise` (H, W, 3) of unit deviation, `gain` (H,); gamma by `_levels`."""
    out = np.empty(colour.shape, np.uint8)
    for v in range(colour.shape[0]):
        for u in range(colour.shape[1]):
            for c in range(3):
                value = max(colour[v, u, c] * gain[v] * vignette[v, u], 0.0)
                if value > 0.6:
                    value = 0.6 + 0.4 * np.tanh((value - 0.6) / 0.4)
                value += scale * noise[v, u, c] * np.sqrt((READ / light + SHOT * value) / light)
                value = min(max(value, 0.0), 1.0)
                level = start[int(value * BINS)]
                while level < 255 and value >= least[level]:
                    level += 1
                out[v, u, c] = level
    return out
