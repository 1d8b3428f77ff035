"""Which way is up: Manhattan axes of noisy normals, and the device's own word for it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from recon.cameras.gravity import find_gravity, manhattan_axes
from recon.readers import open_recording
from tests.laws import random_pose
from tests.makers.recon import tiny
from twin import geometry as geo
from twin.scene import Trajectory


@pytest.mark.parametrize("seed", range(5))
def test_axes_of_noisy_normals_with_clutter(seed: int) -> None:
    rng = np.random.default_rng(seed)
    truth = random_pose(rng)[:3, :3]
    picks = rng.choice(3, 4000, p=[0.5, 0.35, 0.15])
    normals = truth.T[picks] * rng.choice([-1, 1], 4000)[:, None] + rng.normal(scale=0.05, size=(4000, 3))
    clutter = rng.normal(size=(2000, 3))
    found = manhattan_axes(geo.unit(np.concatenate([normals, clutter])))
    agreement = np.abs(found.T @ truth).max(axis=1)
    assert np.degrees(np.arccos(np.clip(agreement, 0, 1))).max() < 0.5


def test_one_plane_alone_still_gives_its_normal() -> None:
    normals = np.tile([0.0, 0.6, 0.8], (500, 1))
    assert np.abs(manhattan_axes(normals).T @ [0.0, 0.6, 0.8]).max() == pytest.approx(1.0)


def test_up_from_planes_and_from_metadata(tmp_path: Path) -> None:
    recording = open_recording(tiny.write_recording(tmp_path / "r"))
    truth = tiny.cameras(len(recording))
    start = geo.invert_pose(truth[0]) @ truth
    cameras = Trajectory(np.arange(len(truth)), recording.times, start)
    up_start = truth[0, :3, :3].T @ [0.0, 0.0, 1.0]
    planes = find_gravity(recording, cameras)
    assert planes.source == "planes"
    assert np.degrees(geo.angle_between(planes.R_world_start @ up_start, [0, 0, 1])) < 1.0
    told = find_gravity(replace(recording, gravity_camera0=-up_start), cameras)
    assert told.source == "metadata"
    assert geo.angle_between(told.R_world_start @ up_start, [0, 0, 1]) < 1e-9
