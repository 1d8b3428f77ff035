"""The camera of a walk: the person's eyes, smoothed, with steps, sway and tremor."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import gaussian_filter1d

from recon.simulate.camera_path import look_at, sway
from recon.simulate.config import Staging
from twin.geometry import Array, exp_so3, make_pose

Rng = np.random.Generator
# s over which eyes and looks are smoothed
_EYES, _LOOKS = 0.13, 0.08
# m that a head goes up and down with each step, and to the side with every other; steps/s at walking speed
_BOB, _SIDE, _STEPS = 0.010, 0.008, 1.8
# m/s at which steps are as high as that
_FULL = 0.6
# m and degrees of sway at 1; the head of who walks hangs on the body less firmly than a tripod's
_SWAY_M, _SWAY_DEG, _TREMOR = 0.010, 0.7, 0.05


def cameras_of(eyes: Array, looks: Array, config: Staging, rng: Rng) -> Array:
    """T_world_camera (n, 4, 4) of eyes (n, 3) m and looks (n, 2): yaw and pitch, rad."""
    n, fps = len(eyes), config.fps
    path = gaussian_filter1d(eyes, _EYES * fps, axis=0, mode="nearest")
    turned = gaussian_filter1d(looks, _LOOKS * fps, axis=0, mode="nearest")
    steps = np.gradient(path[:, :2], axis=0) * fps
    speed = np.linalg.norm(steps, axis=1)
    share = gaussian_filter1d(np.clip(speed / _FULL, 0.0, 1.2), 0.3 * fps, mode="nearest")
    phase = 2.0 * np.pi * _STEPS * np.arange(n) / fps + float(rng.uniform(0.0, 2.0 * np.pi))
    across = np.stack([-np.sin(turned[:, 0]), np.cos(turned[:, 0]), np.zeros(n)], axis=1)
    path = path + share[:, None] * (_SIDE * np.sin(0.5 * phase)[:, None] * across)
    path[:, 2] += share * _BOB * np.sin(phase)
    path = path + _SWAY_M * config.sway * sway(n, fps, 1.0, _TREMOR, rng)
    wobble = np.radians(config.sway) * sway(n, fps, _SWAY_DEG, _TREMOR, rng)
    out = np.empty((n, 4, 4))
    for i, (yaw, pitch) in enumerate(turned):
        ahead = np.array([np.cos(pitch) * np.cos(yaw), np.cos(pitch) * np.sin(yaw), np.sin(pitch)])
        out[i] = make_pose(look_at(np.zeros(3), ahead) @ exp_so3(wobble[i]), path[i])
    return out


def turning(cameras: Array, fps: float) -> Array:
    """Degrees/s (n - 1,) by which the camera turns from frame to frame."""
    relative = np.einsum("nij,nik->njk", cameras[:-1, :3, :3], cameras[1:, :3, :3])
    cosine = 0.5 * (np.trace(relative, axis1=1, axis2=2) - 1.0)
    return np.asarray(np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))) * fps)
