"""Depth noise measured in a recording: against noise that was put there."""

from __future__ import annotations

import numpy as np
import pytest

from recon.dense.depth import depth_sigma, in_mid_air, pixel_sigma
from recon.dense.noise import GOOD_SENSOR, DepthNoise, measure_noise
from recon.recording import Intrinsics, Recording
from twin.geometry import Array
from twin.scene import Trajectory

CAMERA = Intrinsics(160, 120, 130.0, 130.0, 79.5, 59.5)
FRAMES = 16


def clip(fresh: Array, fixed: Array, mover: bool = False) -> tuple[Recording, Trajectory]:
    """A room's corner of a wall turned away, 0.8 to 3 m off, seen by a camera that moves sideways. fresh,
    fixed (2,): noise base + slope z^2 drawn in each pixel of each frame, and once for all frames. mover: a
    box takes a quarter of the picture from the middle on."""
    rng = np.random.default_rng(0)
    x = (np.arange(160) - CAMERA.cx) / CAMERA.fx
    pose = np.tile(np.eye(4), (FRAMES, 1, 1))
    pose[:, 0, 3] = np.linspace(0.0, 0.15, FRAMES)
    pattern = rng.standard_normal((120, 160))
    images = []
    for k in range(FRAMES):
        z = np.tile((1.6 + pose[k, 0, 3] * 0.9) / (1.0 - 0.9 * x), (120, 1))
        if mover and k >= FRAMES // 2:
            z[30:90, 40:120] -= 0.3
        for (base, slope), draw in ((fresh, rng.standard_normal(z.shape)), (fixed, pattern)):
            z = z + (base + slope * z**2) * draw
        images.append(z.astype(np.float32))
    colour = np.zeros((FRAMES, 120, 160, 3), np.uint8)
    recording = Recording.from_arrays(colour, np.stack(images), CAMERA, fps=15.0)
    return recording, Trajectory(np.arange(FRAMES), recording.times, pose)


@pytest.mark.parametrize("mover", [False, True])
@pytest.mark.parametrize(("base", "slope"), [(0.0005, 0.0), (0.006, 0.0), (0.001, 0.003)])
def test_noise_is_what_was_put_there(base: float, slope: float, mover: bool) -> None:
    found = measure_noise(*clip(np.array([base, slope]), np.zeros(2), mover))
    z = np.array([1.2, 2.0, 2.5])
    assert found.measured(z) == pytest.approx(base + slope * z**2, rel=0.2)
    assert found.slow < 0.25


def test_what_belongs_to_the_pixel_counts_and_is_slow() -> None:
    found = measure_noise(*clip(np.array([0.001, 0.0]), np.array([0.006, 0.0])))
    assert found.measured(1.5) == pytest.approx(np.hypot(0.006, 0.001), rel=0.25)


@pytest.mark.parametrize("size", [0.0, 0.004])
def test_what_a_frame_is_off_by_as_a_whole_is_its_drift(size: float) -> None:
    """Depth that is off by as much in all of a frame, drawn anew in each; the pixels' own noise is none."""
    recording, cameras = clip(np.array([0.003, 0.0]), np.zeros(2))
    colour, found = np.zeros((FRAMES, 120, 160, 3), np.uint8), []
    for off in size * np.random.default_rng(3).standard_normal((8, FRAMES)):
        shifted = np.stack([recording.depth(k) + np.float32(off[k]) for k in range(FRAMES)])
        found.append(measure_noise(Recording.from_arrays(colour, shifted, CAMERA, fps=15.0), cameras).drift)
    assert np.sqrt(np.mean(np.square(found))) == pytest.approx(size, rel=0.25, abs=2e-4)


def test_what_a_tile_is_off_by_is_drift_though_the_whole_frame_is_right() -> None:
    """Depth that swings twice across the picture, drawn anew in each frame: on the whole it is right, a
    quarter of its width is off by 2 / pi."""
    recording, cameras = clip(np.array([0.001, 0.0]), np.zeros(2))
    swing = np.sin(2 * np.pi * np.linspace(-1.0, 1.0, recording.intrinsics.width))
    colour, found = np.zeros((FRAMES, 120, 160, 3), np.uint8), []
    for size in 0.006 * np.random.default_rng(0).standard_normal((4, FRAMES)):
        shifted = np.stack([recording.depth(k) + np.float32(size[k] * swing) for k in range(FRAMES)])
        found.append(measure_noise(Recording.from_arrays(colour, shifted, CAMERA, fps=15.0), cameras).drift)
    assert 0.7 < np.mean(found) / (0.006 * 2 / np.pi) < 1.2


def test_the_mean_of_readings_that_share_their_error_is_as_unsure_as_one() -> None:
    """Kish: n readings of one error tell as much as one, of fresh errors as n; a sensor better than reckoned
    with tells no slow error."""
    assert DepthNoise(0.01, 0.0, 1.0, 0.0).of_mean(6) == pytest.approx(np.sqrt(6.0))
    assert DepthNoise(0.01, 0.0, 0.0, 0.0).of_mean(6) == 1.0
    assert DepthNoise(1e-6, 0.0, 1.0, 0.0).of_mean(6) == pytest.approx(1.0, abs=1e-3)


def test_without_shared_views_it_is_a_good_sensor() -> None:
    recording, cameras = clip(np.array([0.006, 0.0]), np.zeros(2))
    alone = Trajectory(cameras.frames[:1], cameras.times[:1], cameras.T_world_cam[:1])
    assert measure_noise(recording, alone) == GOOD_SENSOR


def test_gates_never_fall_below_a_good_sensor() -> None:
    z = np.linspace(0.3, 5.0, 20)
    assert np.array_equal(GOOD_SENSOR.sigma(z), depth_sigma(z))
    bad = DepthNoise(0.004, 0.002, 0.0, 0.0)
    assert (bad.sigma(z) >= depth_sigma(z)).all()
    assert (bad.sigma(z) >= bad.measured(z)).all()
    compiled = [pixel_sigma.py_func(np.float32(d), bad.curve) for d in z]
    assert np.array(compiled) == pytest.approx(bad.sigma(z), rel=1e-5)


def test_mid_air_lies_between_two_surfaces_only() -> None:
    depth = np.full((20, 20), 1.0, np.float32)
    depth[:, 10:] = 1.5
    sigma = np.full(depth.shape, 0.003)
    assert not in_mid_air(depth, sigma, 0.05).any()
    depth[:, 10] = 1.25
    assert np.array_equal(np.nonzero(in_mid_air(depth, sigma, 0.05).any(axis=0))[0], [10])
