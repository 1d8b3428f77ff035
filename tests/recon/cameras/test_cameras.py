"""Cameras from tracks of a static world with noise, things that move, and frames that see nothing."""

from __future__ import annotations

import numpy as np
import pytest

from recon.cameras.poses import estimate_cameras
from recon.tracking.tracks import Tracks
from tests.makers.recon import tiny
from twin import geometry as geo
from twin.errors import ReconstructionError, SceneError
from twin.geometry import Array

FOCAL = 420.0
FRAMES, POINTS = 40, 300


def _tracks(poses: Array, noise: float, moving: int = 0, seed: int = 0) -> Tracks:
    rng = np.random.default_rng(seed)
    points = rng.uniform([-1.0, 0.2, 0.2], [1.0, 1.2, 2.2], (POINTS, 3))
    shift = np.zeros((len(poses), POINTS, 3))
    shift[:, :moving, 1] = -0.4 * tiny.smooth(len(poses), 10, 30)[:, None]
    cam = geo.transform(geo.invert_pose(poses), points + shift)
    z = cam[..., 2:]
    cam = cam + rng.normal(size=cam.shape) * noise * np.concatenate(
        [z / FOCAL, z / FOCAL, 0.003 * z], axis=-1
    )
    pixels = cam[..., :2] / cam[..., 2:] * FOCAL
    visible = np.ones(cam.shape[:2], dtype=bool)
    return Tracks(cam, pixels, visible)


def _worst(found: Array, truth: Array) -> tuple[float, float]:
    relative = geo.invert_pose(found) @ (geo.invert_pose(truth[0]) @ truth)
    return float(np.linalg.norm(relative[:, :3, 3], axis=1).max()), float(
        geo.rotation_angle(relative[:, :3, :3]).max()
    )


def test_perfect_tracks_give_exact_poses() -> None:
    truth = tiny.cameras(FRAMES)
    found = estimate_cameras(_tracks(truth, 0.0), np.arange(FRAMES) / 15, FOCAL)
    shift, turn = _worst(found.T_world_cam, truth)
    assert shift < 1e-9
    assert turn < 1e-9


@pytest.mark.parametrize("moving", [0, 90])
def test_noise_and_moving_things_leave_the_poses_within_two_millimetres(moving: int) -> None:
    truth = tiny.cameras(FRAMES)
    found = estimate_cameras(_tracks(truth, 1.0, moving), np.arange(FRAMES) / 15, FOCAL)
    assert len(found.frames) == FRAMES
    T_truth_found = geo.fit_rigid(found.T_world_cam[:, :3, 3], truth[:, :3, 3])
    error = geo.transform(T_truth_found, found.T_world_cam[:, :3, 3]) - truth[:, :3, 3]
    # 3.6 mm of lateral noise a point (1 px at 1.5 m) over 300 points, turned into position by a 1.5 m lever:
    # about 1 mm
    assert np.sqrt((error**2).sum(axis=1).mean()) < 2e-3


def test_a_frame_without_tracks_is_left_out_and_the_rest_stays() -> None:
    truth = tiny.cameras(FRAMES)
    full = _tracks(truth, 1.0)
    points, pixels, visible = full.points_cam.copy(), full.pixels.copy(), full.visible.copy()
    points[17], pixels[17], visible[17] = np.nan, np.nan, False
    found = estimate_cameras(Tracks(points, pixels, visible), np.arange(FRAMES) / 15, FOCAL)
    assert found.pose(17) is None
    assert len(found.frames) == FRAMES - 1


def test_too_few_tracks_are_an_error_that_says_what_to_try() -> None:
    full = _tracks(tiny.cameras(FRAMES), 1.0)
    few = Tracks(full.points_cam[:, :5], full.pixels[:, :5], full.visible[:, :5])
    with pytest.raises(ReconstructionError, match="texture"):
        estimate_cameras(few, np.arange(FRAMES) / 15, FOCAL)


def test_tracks_refuse_points_where_nothing_is_visible() -> None:
    full = _tracks(tiny.cameras(FRAMES), 1.0)
    visible = full.visible.copy()
    visible[3, 4] = False
    with pytest.raises(SceneError, match="NaN exactly"):
        Tracks(full.points_cam, full.pixels, visible)
