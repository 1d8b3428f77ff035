"""Painters of procedural surfaces: tileable albedo images drawn from a seed. None is a photograph."""

from __future__ import annotations

from functools import cache
from itertools import pairwise

import cv2
import numpy as np
from numpy.typing import NDArray

from twin.geometry import Array

SIZE = 512  # texels per side; all images tile
Image = NDArray[np.float32]


def noise(rng: np.random.Generator, power: float, stretch: float = 1.0, low: float = 1.0) -> Image:
    """Tileable Gaussian noise (SIZE, SIZE) of unit deviation, amplitude falling as 1 / frequency^power.

    `stretch` > 1 draws it out along the rows; frequencies below `low` cycles a tile are left out.
    """
    gain = _spectrum(power, stretch, low)
    field = np.fft.irfft2(np.fft.rfft2(rng.standard_normal((SIZE, SIZE))) * gain, s=(SIZE, SIZE))
    return ((field - field.mean()) / max(float(field.std()), 1e-12)).astype(np.float32)


@cache
def _spectrum(power: float, stretch: float, low: float) -> Array:
    """Amplitude by frequency, for the transform of a real image."""
    fy = np.fft.fftfreq(SIZE)[:, None] * SIZE
    fx = np.fft.rfftfreq(SIZE)[None, :] * SIZE * stretch
    radius = np.hypot(fx, fy)
    return np.asarray(np.where(radius >= low, np.maximum(radius, 1.0) ** -power, 0.0))


def _mix(base: Array, value: Image, other: Array) -> Image:
    t = np.clip(value, 0.0, 1.0)[..., None]
    return ((1.0 - t) * base + t * other).astype(np.float32)


def wood(rng: np.random.Generator, colour: Array) -> Image:
    """Grain along the rows with growth rings, pores and, for some, planks."""
    flow = noise(rng, 1.6, stretch=9.0)
    rings = 0.5 + 0.5 * np.sin(2.0 * np.pi * (flow * rng.uniform(0.7, 1.5)))
    pores = np.clip(noise(rng, 0.35, stretch=12.0) - 0.8, 0.0, 2.0)
    value = 0.55 * rings + 0.35 * pores + 0.12 * noise(rng, 0.8, stretch=4.0)
    if rng.random() < 0.5:
        value = value + _planks(rng)
    value = value + 0.9 * _knots(rng)
    return _mix(colour * 1.12, value, colour * 0.42)


def _planks(rng: np.random.Generator) -> Image:
    rows = int(rng.integers(5, 9))
    out = np.zeros((SIZE, SIZE), np.float32)
    edges = np.linspace(0, SIZE, rows + 1).astype(int)
    for top, bottom in pairwise(edges):
        cuts = np.sort(rng.choice(SIZE, size=3, replace=False))
        shade = rng.uniform(-0.25, 0.3, size=3)
        columns = np.searchsorted(cuts, np.arange(SIZE)) % 3
        out[top:bottom] += shade[columns][None, :].astype(np.float32)
        out[top : top + 1] += 0.5
        out[top:bottom, cuts] += 0.5
    return out


def _knots(rng: np.random.Generator) -> Image:
    out = np.zeros((SIZE, SIZE), np.float32)
    for _ in range(int(rng.integers(3, 9))):
        centre = tuple(int(v) for v in rng.integers(20, SIZE - 20, 2))
        axes = (int(rng.integers(5, 14)), int(rng.integers(3, 8)))
        for k in range(3, 0, -1):
            cv2.ellipse(
                out, centre, (axes[0] * k // 3 + 1, axes[1] * k // 3 + 1), 0, 0, 360, 0.9 - 0.2 * k, -1
            )
    return cv2.GaussianBlur(out, (0, 0), 1.0).astype(np.float32)


def speckle(rng: np.random.Generator, colour: Array) -> Image:
    """Stone or terrazzo: grains of several sizes and tones on a cloudy ground."""
    image = _mix(colour, 0.5 + 0.25 * noise(rng, 1.4), colour * 0.75)
    for size, share in ((6.0, 0.9), (3.0, 1.1), (1.2, 1.3)):
        grains = _blurred_noise(rng, size)
        tone = np.clip(colour * rng.uniform(0.25, 0.6) + rng.uniform(-0.06, 0.06, 3), 0.02, 0.95)
        image = np.where(grains[..., None] > share + 0.3, tone.astype(np.float32), image)
        light = np.clip(colour * 1.5 + 0.08, 0.0, 0.95).astype(np.float32)
        image = np.where(grains[..., None] < -share - 0.5, light, image)
    return image.astype(np.float32)


def _blurred_noise(rng: np.random.Generator, sigma: float) -> Image:
    """Tileable white noise blurred by `sigma` texels, unit deviation."""
    fy, fx = np.fft.fftfreq(SIZE)[:, None], np.fft.rfftfreq(SIZE)[None, :]
    gain = np.exp(-2.0 * (np.pi * sigma) ** 2 * (fx**2 + fy**2))
    field = np.fft.irfft2(np.fft.rfft2(rng.standard_normal((SIZE, SIZE))) * gain, s=(SIZE, SIZE))
    return (field / field.std()).astype(np.float32)


def tiles(rng: np.random.Generator, colour: Array) -> Image:
    """Bricks or tiles with joints; each has its own tone and its own wear."""
    rows = int(rng.choice([4, 6, 8]))
    per_row = rows // 2 if rng.random() < 0.6 else rows
    shift = 0.5 if per_row != rows else 0.0
    y, x = np.mgrid[0:SIZE, 0:SIZE] / SIZE
    row = np.floor(y * rows).astype(int)
    across = x * per_row + shift * (row % 2)
    column = np.floor(across).astype(int) % per_row
    tone = rng.uniform(-0.28, 0.28, (rows, per_row))[row, column]
    fy, fx = np.abs(y * rows % 1.0 - 0.5) * 2.0, np.abs(across % 1.0 - 0.5) * 2.0
    joint = (fy > 0.93) | (fx > 1.0 - 0.07 * per_row / rows)
    value = 0.35 + tone + 0.14 * noise(rng, 1.0) + 0.1 * noise(rng, 0.5, low=20.0)
    image = _mix(colour * 1.1, value, colour * 0.5)
    mortar = np.clip(colour * 0.5 + 0.12, 0.0, 1.0) * (1.0 + 0.12 * noise(rng, 0.4)[..., None])
    return np.where(joint[..., None], mortar, image).astype(np.float32)


def plaster(rng: np.random.Generator, colour: Array) -> Image:
    """Trowelled wall: clouds, ridges and specks."""
    ridges = 1.0 - np.abs(noise(rng, 1.2, low=4.0))
    specks = np.clip(np.abs(noise(rng, 0.3, low=30.0)) - 1.6, 0.0, 1.0)
    grit = noise(rng, 0.9, low=10.0)
    value = 0.3 + 0.14 * ridges + 0.1 * noise(rng, 1.5) + 0.13 * grit + 0.7 * specks
    return _mix(colour * 1.1, value, colour * 0.55)


def laminate(rng: np.random.Generator, colour: Array) -> Image:
    """Painted or laminated board: fine fibres, scratches and smudges."""
    value = (
        0.3 + 0.15 * noise(rng, 0.7, stretch=5.0) + 0.1 * noise(rng, 1.3) + 0.13 * noise(rng, 0.9, low=8.0)
    )
    scratches = np.zeros((SIZE, SIZE), np.float32)
    for _ in range(200):
        a = rng.integers(0, SIZE, 2)
        b = a + rng.integers(-50, 50, 2)
        cv2.line(
            scratches, tuple(map(int, a)), tuple(map(int, b)), float(rng.uniform(0.2, 0.6)), 1, cv2.LINE_AA
        )
    for _ in range(200):
        centre = tuple(map(int, rng.integers(0, SIZE, 2)))
        cv2.circle(scratches, centre, int(rng.integers(1, 5)), float(rng.uniform(0.2, 0.7)), -1, cv2.LINE_AA)
    return _mix(colour, value + scratches, colour * 0.4 + 0.04)


def metal(rng: np.random.Generator, colour: Array) -> Image:
    """Brushed metal with stains."""
    value = 0.4 + 0.14 * noise(rng, 0.25, stretch=14.0) + 0.2 * noise(rng, 1.3)
    return _mix(colour * 1.1, value, colour * 0.5)


def fabric(rng: np.random.Generator, colour: Array) -> Image:
    """Woven cloth."""
    y, x = np.mgrid[0:SIZE, 0:SIZE]
    weave = np.sin(x * 2.0 * np.pi * 64 / SIZE) * np.sin(y * 2.0 * np.pi * 64 / SIZE)
    value = 0.45 + 0.2 * weave + 0.16 * noise(rng, 0.3) + 0.1 * noise(rng, 1.4)
    return _mix(colour * 1.25, value, colour * 0.55)


def skin(rng: np.random.Generator, colour: Array) -> Image:
    """Faintly mottled skin."""
    return _mix(colour * 1.04, 0.4 + 0.13 * noise(rng, 1.2) + 0.05 * noise(rng, 0.3), colour * 0.8)


def plain(rng: np.random.Generator, colour: Array) -> Image:
    """Evenly painted: nothing to follow but a faint cloud."""
    return _mix(colour, 0.5 + 0.06 * noise(rng, 1.6), colour * 0.92)


def stripes(rng: np.random.Generator, colour: Array) -> Image:
    """Stripes along the rows: nothing to follow along them."""
    y = np.mgrid[0:SIZE, 0:SIZE][0] / SIZE
    bands = np.sin(2.0 * np.pi * int(rng.integers(4, 14)) * y) > rng.uniform(-0.6, 0.6)
    value = 0.8 * bands + 0.05 * noise(rng, 1.2)
    return _mix(colour, value, np.clip(colour * rng.uniform(0.2, 0.6), 0.02, 0.9))


def poster(rng: np.random.Generator, colour: Array) -> Image:
    """Posters, cartons and book covers: coloured shapes and lines of print."""
    image = np.tile(colour.astype(np.float32), (SIZE, SIZE, 1))
    for _ in range(int(rng.integers(14, 26))):
        tone = tuple(float(v) for v in rng.uniform(0.03, 0.85, 3))
        a, size = rng.integers(0, SIZE, 2), rng.integers(12, 120, 2)
        corner, far = tuple(map(int, a)), tuple(map(int, a + size))
        if rng.random() < 0.5:
            cv2.rectangle(image, corner, far, tone, -1)
        else:
            axes, angle = (int(size[0] // 2), int(size[1] // 2)), float(rng.uniform(0, 180))
            cv2.ellipse(image, corner, axes, angle, 0, 360, tone, -1, cv2.LINE_AA)
    for _ in range(9):
        x, y = (int(v) for v in rng.integers(0, SIZE - 100, 2))
        ink = (float(rng.choice([0.03, 0.8])),) * 3
        for line in range(int(rng.integers(2, 6))):
            for word in range(5):
                start = x + word * 22
                end = start + int(rng.integers(8, 18))
                cv2.line(image, (start, y + 9 * line), (end, y + 9 * line), ink, 3)
    return np.clip(image * (1.0 + 0.08 * noise(rng, 0.8)[..., None]), 0.0, 1.0).astype(np.float32)
