"""Random fields over a picture: the correlated part of a sensor's error."""

from __future__ import annotations

import math
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from recon.simulate.render import Camera
from twin.geometry import Array

COARSE = 3.0  # from this many pixels of correlation on, a field is drawn on a coarser grid and enlarged
# A recording's streams of random numbers beside those of its frames.
FIXED = 8
DRIFTING = 9


def smooth_noise(height: int, width: int, sigma: float, rng: np.random.Generator) -> Array:
    """Gaussian noise (height, width) of unit deviation, correlated over `sigma` pixels."""
    field = cv2.GaussianBlur(rng.standard_normal((height, width)), (0, 0), sigma)
    return field * (2.0 * np.sqrt(np.pi) * sigma)  # the blur's kernel has the norm 1 / (2 sqrt(pi) sigma)


def wide_noise(height: int, width: int, sigma: float, rng: np.random.Generator) -> Array:
    """The same for wide correlations, at a constant cost; below 3 pixels it is `smooth_noise`."""
    step = max(1.0, sigma / COARSE)
    margin = math.ceil(3.0 * COARSE)  # the blur mirrors at the border, which would raise the deviation there
    rows, columns = math.ceil(height / step) + 1, math.ceil(width / step) + 1
    coarse = smooth_noise(rows + 2 * margin, columns + 2 * margin, sigma / step, rng)
    return enlarged(coarse, step, (-margin * step, -margin * step), (height, width))


def enlarged(coarse: Array, step: float, first: tuple[float, float], size: tuple[int, int]) -> Array:
    """Image of `size` (height, width) between samples `step` pixels apart, the first at `first` (y, x)."""
    y, x = ((np.arange(n) - start) / step for n, start in zip(size, first, strict=True))
    columns, rows = np.meshgrid(x.astype(np.float32), y.astype(np.float32))
    values = np.asarray(coarse, dtype=np.float32)
    out = cv2.remap(values, columns, rows, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(out, dtype=np.float64)


def fixed_rng(seed: int, which: int) -> np.random.Generator:
    """Generator of what stays the same over a recording."""
    return np.random.default_rng([seed, FIXED, which + 1])  # a trailing 0 would not tell streams apart


def drifting_noise(height: int, width: int, sigma: float, seed: int, index: int, period: float) -> Array:
    """Field of frame `index` in a sequence of unit deviation that forgets itself over `period` frames.

    It turns from one independent field into the next along a quarter of a circle, which keeps its deviation,
    and depends on the frame's index alone, so that frames can be made in any order.
    """
    first = math.floor(index / period)
    angle = 0.5 * math.pi * (index / period - first)
    parts = [np.random.default_rng([seed, DRIFTING, first + k + 1]) for k in (0, 1)]
    now, then = (wide_noise(height, width, sigma, rng) for rng in parts)
    return math.cos(angle) * now + math.sin(angle) * then


def near_edge(depth: Array, step: float) -> NDArray[np.bool_]:
    """Pixels within one pixel of a jump in depth of more than `step` metres and 2 %; slopes are no jumps."""
    d = depth.astype(np.float32)
    kernel = np.ones((3, 3), np.uint8)
    rise = cv2.dilate(d, kernel) - cv2.erode(d, kernel)
    slope = cv2.GaussianBlur(np.abs(cv2.Laplacian(d, cv2.CV_32F)), (0, 0), 0.8)
    return (rise > np.maximum(step, 0.02 * d)) & (slope > 0.25 * step)


def displaced(image: NDArray[Any], dx: Array, dy: Array) -> Array:
    """Nearest values of an image (H, W) at pixels moved by (dx, dy)."""
    height, width = image.shape
    y, x = np.mgrid[0:height, 0:width]
    rows = np.clip(np.round(y + dy), 0, height - 1).astype(int)
    columns = np.clip(np.round(x + dx), 0, width - 1).astype(int)
    return np.asarray(image[rows, columns], dtype=np.float64)


def facing(normals: NDArray[np.float32], rays: Array) -> Array:
    """Cosine (H, W) of the angle between a surface's normal and the ray that sees it, 0..1."""
    return np.abs(np.einsum("ijk,ijk->ij", normals, rays))


def cosines(camera: Camera) -> Array:
    """Cosine (H, W) of each ray from the optical axis: the depth of a metre of it."""
    v, u = np.mgrid[0 : camera.height, 0 : camera.width]
    cx, cy = camera.centre
    return camera.focal / np.sqrt((u - cx) ** 2 + (v - cy) ** 2 + camera.focal**2)
