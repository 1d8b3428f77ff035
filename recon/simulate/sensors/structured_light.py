"""Structured light, as of the first Kinect: a projected pattern, triangulated."""

from __future__ import annotations

import numpy as np
from scipy.special import ndtr

from recon.simulate.render import Camera
from recon.simulate.sensors.fields import displaced, facing, near_edge, smooth_noise
from recon.simulate.sensors.frame import Frame
from twin.geometry import Array

# Axial noise: sigma = 1.2 mm + 1.9 mm/m^2 (z - 0.4 m)^2, lateral jitter of about 0.5 pixels at edges
# (Nguyen, Izadi, Lovell 2012, "Modeling Kinect Sensor Noise for Improved 3D Reconstruction and Tracking").
AXIAL = 0.0012  # metres
AXIAL_GROWTH = 0.0019  # 1/metre
AXIAL_FROM = 0.4  # metres
LATERAL = 0.45  # pixels
EDGE = 0.03  # metres
NEAREST = 0.2  # metres
FARTHEST = 6.0  # metres


class StructuredLight:
    """All of its error is drawn anew in each frame: it needs neither camera nor seed of the recording."""

    def __init__(self, _camera: Camera, scale: float, _seed: int):
        self._scale = scale

    def depth(self, frame: Frame) -> Array:
        """Depth (H, W) in metres, 0 = unknown."""
        scale, rng, view = self._scale, frame.rng, frame.view
        exact = view.depth.astype(np.float64)
        height, width = exact.shape
        jitter = LATERAL * scale * rng.standard_normal((2, height, width))
        edge = near_edge(exact, EDGE)
        z = np.where(edge, displaced(exact, jitter[1], jitter[0]), exact)
        sigma = scale * (AXIAL + AXIAL_GROWTH * (z - AXIAL_FROM) ** 2)
        straight = facing(view.normals, frame.rays)
        sigma = sigma * np.clip(0.7 / np.maximum(straight, 0.12), 1.0, 3.0)
        coarse = smooth_noise(height, width, 2.0, rng)
        z = z + sigma * (0.85 * rng.standard_normal((height, width)) + 0.5 * coarse)
        lost = 0.6 * edge + 0.9 * np.clip((0.16 - straight) / 0.1, 0.0, 1.0)
        lost = lost + 0.35 * view.gloss * np.clip((0.16 - view.tone) / 0.1, 0.0, 1.0) + 0.002
        blotches = ndtr(smooth_noise(height, width, 0.8, rng))  # uniform in 0..1, but not salt and pepper
        gone = blotches < np.clip(scale * lost, 0.0, 0.98)
        return np.where(gone | (exact < NEAREST) | (exact > FARTHEST), 0.0, z)
