"""Two rigid motions: a near panel that slides in its own plane before a flat cabinet, where depth tells
nothing of the way."""

from __future__ import annotations

import numpy as np
import pytest

from recon.cameras.poses import camera_poses, estimate_cameras
from recon.cameras.rigid import point_sigmas
from recon.cameras.rival import followed_part
from recon.recording import Intrinsics, Recording
from recon.tracking.tracks import Tracks
from tests.makers.recon import tiny
from tests.makers.recon.sparse import sparse
from twin import geometry as geo
from twin.geometry import Array

CAMERA = Intrinsics(160, 120, 130.0, 130.0, 79.5, 59.5)
FRAMES, SLIDE_M, WALL_M, PANEL_M = 36, 0.2, 0.75, 0.72
LATERAL = 0.6 / CAMERA.fx
PANEL = np.array([[-0.2, -0.22], [0.2, 0.22]])  # left, top; right, bottom, m


def _poses() -> Array:
    t = np.linspace(0.0, 1.0, FRAMES)
    turn = np.stack([0.05 * np.sin(4 * t), 0.06 * np.sin(3 * t), 0.03 * t], axis=-1)
    return np.asarray(
        geo.exp_se3(np.concatenate([0.04 * np.sin(np.outer(t, [2.0, 3.0, 2.5])), turn], axis=-1))
    )


def _recording(poses: Array, slide: Array) -> Recording:
    """Depth, with noise, of the wall and the panel before it."""
    v, u = np.mgrid[0 : CAMERA.height, 0 : CAMERA.width]
    rays = CAMERA.backproject(np.stack([u, v], axis=-1).astype(float), np.ones(u.shape))
    rng, images = np.random.default_rng(0), []
    for pose, x in zip(poses, slide, strict=True):
        ahead, at = geo.rotate(pose, rays), pose[:3, 3]
        near, far = ((z - at[2]) / ahead[..., 2] for z in (PANEL_M, WALL_M))
        on = (at + near[..., None] * ahead)[..., :2] - [x, 0.0]
        z = np.where(((on > PANEL[0]) & (on < PANEL[1])).all(axis=-1), near, far)
        images.append((z + 0.001 * rng.normal(size=z.shape)).astype(np.float32))
    grey = np.full((CAMERA.height, CAMERA.width, 3), 128, np.uint8)
    return Recording(
        "panel", "panel", np.arange(FRAMES) / 15.0, CAMERA, lambda _: grey, images.__getitem__, "0"
    )


def _tracks(poses: Array, slide: Array, on_panel: int, around: int) -> Tracks:
    """Tracks of points on the panel, which come first, and of points of the wall around all its places."""
    rng = np.random.default_rng(1)
    inner = rng.uniform(PANEL[0], PANEL[1], (on_panel, 2))
    outer = rng.uniform([-0.45, -0.34], [0.45, 0.34], (20 * around, 2))
    free = ((outer < PANEL[0] - 0.02) | (outer > PANEL[1] + 0.02 + [SLIDE_M, 0.0])).any(axis=1)
    flat = np.concatenate([inner, outer[free][:around]])
    z = np.where(np.arange(len(flat)) < on_panel, PANEL_M, WALL_M)
    world = np.repeat(np.column_stack([flat, z])[None], FRAMES, axis=0)
    world[:, :on_panel, 0] += slide[:, None]
    cam = geo.transform(geo.invert_pose(poses), world)
    cam += 0.0005 * rng.normal(size=cam.shape)
    visible = np.ones(cam.shape[:2], bool)
    return Tracks(cam, CAMERA.project(cam), visible)


def _worst(found: Array, truth: Array) -> float:
    relative = geo.invert_pose(found) @ geo.invert_pose(truth[0]) @ truth
    return float(np.linalg.norm(relative[:, :3, 3], axis=1).max())


def _sigma(tracks: Tracks) -> Array:
    return np.asarray(np.hypot(*point_sigmas(tracks.points_cam, LATERAL)))


@pytest.fixture(scope="module")
def slide() -> Array:
    return SLIDE_M * tiny.smooth(FRAMES, 12, 22)


def test_cameras_leave_a_panel_that_has_most_of_the_tracks(slide: Array) -> None:
    truth = _poses()
    tracks, recording = _tracks(truth, slide, 300, 90), _recording(truth, slide)
    by_tracks = estimate_cameras(tracks, recording.times, CAMERA.fx)
    assert _worst(by_tracks.T_world_cam, truth) > 0.15  # the majority follows the panel
    found = camera_poses(recording, sparse(tracks, CAMERA))
    assert len(found.frames) == FRAMES
    assert _worst(found.T_world_cam, truth) < 3e-3


def test_what_the_cameras_follow_is_named_track_by_track(slide: Array) -> None:
    truth = _poses()
    tracks, every = _tracks(truth, slide, 300, 90), np.ones(FRAMES, bool)
    panel = np.arange(len(tracks)) < 300
    with_panel = truth.copy()
    with_panel[:, 0, 3] -= slide
    told = followed_part(tracks, with_panel, every, _sigma(tracks), np.random.default_rng(0))
    np.testing.assert_array_equal(told, panel)


@pytest.mark.parametrize(("on_panel", "around"), [(300, 90), (90, 300)])
def test_cameras_that_follow_the_room_stay(slide: Array, on_panel: int, around: int) -> None:
    truth = _poses()
    tracks, every = _tracks(truth, slide, on_panel, around), np.ones(FRAMES, bool)
    assert not followed_part(tracks, truth, every, _sigma(tracks), np.random.default_rng(0)).any()


def test_motions_that_reach_equally_far_are_not_told_apart(slide: Array) -> None:
    """Leaves before a wall: every other track moves, all over the picture."""
    truth, every = _poses(), np.ones(FRAMES, bool)
    flat = np.random.default_rng(2).uniform([-0.3, -0.25], [0.3, 0.25], (300, 2))
    world = np.repeat(np.column_stack([flat, np.full(300, WALL_M)])[None], FRAMES, axis=0)
    world[:, ::2, 0] += slide[:, None]
    cam = geo.transform(geo.invert_pose(truth), world)
    visible = np.ones(cam.shape[:2], bool)
    tracks = Tracks(cam, CAMERA.project(cam), visible)
    assert not followed_part(tracks, truth, every, _sigma(tracks), np.random.default_rng(0)).any()


def test_a_still_scene_has_no_rival(slide: Array) -> None:
    truth = _poses()
    tracks, every = _tracks(truth, 0.0 * slide, 300, 90), np.ones(FRAMES, bool)
    assert not followed_part(tracks, truth, every, _sigma(tracks), np.random.default_rng(0)).any()


def test_tracks_without_some_show_the_others_only(slide: Array) -> None:
    tracks = _tracks(_poses(), slide, 30, 9)
    some = np.arange(len(tracks)) < 30
    left = tracks.without(some)
    assert not left.visible[:, some].any()
    np.testing.assert_array_equal(left.points_cam[:, ~some], tracks.points_cam[:, ~some])
