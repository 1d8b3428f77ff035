"""Multipath: light that reaches a surface over neighbours makes concave corners look farther and rounder."""

from __future__ import annotations

import math

import cv2
import numba
import numpy as np
from numpy.typing import NDArray

from recon.simulate.sensors.fields import enlarged
from twin.geometry import Array

# One diffuse bounce between what the camera sees, as the simulators of Fuchs 2010 ("Multipath Interference
# Compensation in Time-of-Flight Camera Images") and Jimenez et al. 2014 do: patches of the picture light each
# other by form factors. Occlusion between patches is ignored; what is out of view lights nothing.
EMITTERS = 24  # patches over the picture's width
RECEIVERS = 120  # patches over the picture's width
# Radians of phase per metre at 200 MHz, about the Azure Kinect's highest: long detours cancel each other.
PHASE = 4.0 * np.pi * 200e6 / 299792458.0


def multipath(
    exact: Array, rays: Array, normals: NDArray[np.float32], tone: NDArray[np.float32], along: Array
) -> Array:
    """Excess distance (H, W) in metres along each ray.

    Args:
        exact: depth (H, W), 0 = nothing.
        rays: unit viewing directions (H, W, 3) in the world; normals (H, W, 3) are in the same frame.
        tone: reflectivity (H, W).
        along: depth of a metre of each ray (H, W).
    """
    height, width = exact.shape
    points = rays * (exact / along)[..., None]
    steps = [max(1, width // n) for n in (EMITTERS, RECEIVERS)]
    grids = [np.s_[s // 2 :: s, s // 2 :: s] for s in steps]
    patch = points[grids[0]]
    # solid angle of a patch of step x step pixels, before division by its cosine: step^2 pixels'
    spread = np.abs(np.cross(rays[0, 1] - rays[0, 0], rays[1, 0] - rays[0, 0]) @ rays[0, 0])
    solid = steps[0] ** 2 * spread * (along[grids[0]] / along[0, 0]) ** 3
    out = _excess(
        np.ascontiguousarray(points[grids[1]].reshape(-1, 3)),
        np.ascontiguousarray(normals[grids[1]].reshape(-1, 3), dtype=np.float64),
        np.ascontiguousarray(patch.reshape(-1, 3)),
        np.ascontiguousarray(normals[grids[0]].reshape(-1, 3), dtype=np.float64),
        np.ascontiguousarray(np.clip(tone[grids[0]], 0.0, 1.0).reshape(-1), dtype=np.float64),
        np.ascontiguousarray(solid.reshape(-1)),
    )
    coarse = out.reshape(points[grids[1]].shape[:2]).astype(np.float32)
    # a receiver in a gap between two fronts must not speak for the fronts
    calm = np.asarray(cv2.medianBlur(coarse, 3), dtype=np.float64)
    middle = float(steps[1] // 2)
    return enlarged(calm, steps[1], (middle, middle), (height, width))


@numba.njit(cache=True, nogil=True)
def _excess(
    points: Array, normals: Array, patches: Array, patch_normals: Array, tone: Array, solid: Array
) -> Array:
    """Excess distance (n,) of points (n, 3) lit by patches (m, 3); relative to the camera and lamp."""
    out = np.zeros(len(points))
    for i in range(len(points)):
        p, n = points[i], normals[i]
        far = np.sqrt(p[0] * p[0] + p[1] * p[1] + p[2] * p[2])
        if far == 0.0:
            continue
        direct = max(abs(n[0] * p[0] + n[1] * p[1] + n[2] * p[2]) / far, 0.05) / (far * far)
        real, imaginary = 1.0, 0.0  # of the light's phasor, relative to the direct light's
        for j in range(len(patches)):
            q, m = patches[j], patch_normals[j]
            dx, dy, dz = q[0] - p[0], q[1] - p[1], q[2] - p[2]
            square = dx * dx + dy * dy + dz * dz
            height = n[0] * dx + n[1] * dy + n[2] * dz
            lean = -(m[0] * dx + m[1] * dy + m[2] * dz)
            if height <= 0.0 or lean <= 0.0:
                continue
            reach = np.sqrt(square)
            away = np.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2])
            # a patch's area is solid angle x distance^2 / cosine, its light cosine / distance^2: both cancel
            light = tone[j] * solid[j]
            area = solid[j] * away * away
            ratio = light * height * lean / (square * (np.pi * square + area)) / direct
            phase = PHASE * 0.5 * (away + reach - far)
            real += ratio * math.cos(phase)
            imaginary += ratio * math.sin(phase)
        out[i] = math.atan2(imaginary, real) / PHASE
    return out
