"""Poses from depth beside tracks: planes in depth, what moves is not the camera, and what no frame can tell
is said."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from recon.cameras.depth_kernels import block_means, planes
from recon.cameras.depth_poses import poses_by_depth
from recon.cameras.poses import camera_poses, estimate_cameras
from recon.recording import Intrinsics, Recording
from recon.tracking.tracks import Tracks
from tests.makers.recon import tiny
from tests.makers.recon.sparse import sparse
from twin import geometry as geo
from twin.errors import ReconstructionError
from twin.geometry import Array

CAMERA = Intrinsics(160, 120, 130.0, 130.0, 79.5, 59.5)
FRAMES = 36
LATERAL = 0.6 / 130.0
# A room (n, d) with n x = d: back wall, side walls, floor, ceiling; and a near board that may move along z.
ROOM = (
    ((0.0, 0.0, -1.0), -1.8),
    ((1.0, 0.0, 0.0), -1.0),
    ((-1.0, 0.0, 0.0), -0.9),
    ((0.0, -1.0, 0.0), -0.75),
    ((0.0, 1.0, 0.0), -0.8),
)
BOARD = (-0.26, 0.3, -0.33, 0.33)  # left, right, top, bottom, m: two thirds of the picture at 0.7 m


def _path() -> Array:
    t = np.linspace(0.0, 1.0, FRAMES)
    turn = np.stack([0.05 * np.sin(4 * t), 0.08 * np.sin(3 * t), 0.03 * t], axis=-1)
    return np.asarray(
        geo.exp_se3(np.concatenate([0.12 * np.sin(np.outer(t, [2.0, 3.0, 2.5])), turn], axis=-1))
    )


def _depth(T_world_cam: Array, board_z: float | None) -> NDArray[np.float32]:
    """Depth image (H, W) m of the room and of the board at that place."""
    v, u = np.mgrid[0 : CAMERA.height, 0 : CAMERA.width]
    rays = CAMERA.backproject(np.stack([u, v], axis=-1).astype(float), np.ones(u.shape))
    ahead, at = geo.rotate(T_world_cam, rays), T_world_cam[:3, 3]
    z = np.full(u.shape, np.inf)
    with np.errstate(divide="ignore"):
        for normal, d in ROOM:
            hit = (d - at @ normal) / (ahead @ normal)
            z = np.where((hit > 0) & (hit < z), hit, z)
        if board_z is not None:
            hit = (board_z - at[2]) / ahead[..., 2]
            x, y = at[0] + hit * ahead[..., 0], at[1] + hit * ahead[..., 1]
            on = (x > BOARD[0]) & (x < BOARD[1]) & (y > BOARD[2]) & (y < BOARD[3])
            z = np.where(on & (hit < z), hit, z)
    return z.astype(np.float32)


def _board(moves: bool) -> Array:
    """Place of the board, m: it goes away by 30 mm a frame for 8 frames."""
    return 0.7 + (0.25 * tiny.smooth(FRAMES, 12, 20) if moves else np.zeros(FRAMES))


def _recording(poses: Array, board: Array | None, noise: float = 0.0) -> Recording:
    rng = np.random.default_rng(0)
    images = []
    for k, pose in enumerate(poses):
        z = _depth(pose, None if board is None else float(board[k]))
        images.append(z + (noise * z**2 * rng.normal(size=z.shape)).astype(np.float32))
    times = np.arange(FRAMES) / 15.0
    grey = np.full((CAMERA.height, CAMERA.width, 3), 128, np.uint8)
    return Recording("room", "room", times, CAMERA, lambda _: grey, images.__getitem__, "0")


def _tracks(poses: Array, board: Array | None, per_side: int, break_at: int | None = None) -> Tracks:
    """Tracks of points that the first frame sees on a grid of pixels; all of them end where the path of
    tracks breaks."""
    u, v = np.meshgrid(
        np.linspace(4, CAMERA.width - 5, per_side), np.linspace(4, CAMERA.height - 5, per_side)
    )
    pixels = np.stack([u.ravel().round(), v.ravel().round()], axis=-1)
    first = _depth(poses[0], None if board is None else float(board[0]))
    z = first[pixels[:, 1].astype(int), pixels[:, 0].astype(int)].astype(float)
    world = geo.transform(poses[0], CAMERA.backproject(pixels, z))
    moving = np.zeros(len(world), bool) if board is None else np.abs(world[:, 2] - board[0]) < 1e-3
    points = np.repeat(world[None], FRAMES, axis=0)
    if board is not None:
        points[:, moving, 2] += (board - board[0])[:, None]
    cam = geo.transform(geo.invert_pose(poses), points)
    visible = np.ones(cam.shape[:2], bool)
    if break_at is not None:
        visible[break_at:] = False
    cam[~visible] = np.nan
    return Tracks(cam, CAMERA.project(cam), visible)


def _worst(found: Array, truth: Array) -> float:
    relative = geo.invert_pose(found) @ geo.invert_pose(truth[0]) @ truth
    return float(np.linalg.norm(relative[:, :3, 3], axis=1).max())


def test_planes_of_an_image_are_the_walls() -> None:
    pose = geo.exp_se3([0.1, 0.05, 0.0, 0.1, -0.2, 0.05])
    image = _depth(pose, None)
    plane = planes(block_means(image, 1, 1), CAMERA.vector, 2, 0.01)
    known = np.isfinite(plane[..., 0])
    assert known.mean() > 0.7
    normals, offsets = np.array([n for n, _ in ROOM]), np.array([d for _, d in ROOM])
    in_camera = normals @ pose[:3, :3]
    d = offsets - normals @ pose[:3, 3]
    found = plane[known].astype(float)
    wall = np.argmax(found[:, :3] @ in_camera.T, axis=1)
    # beside corners the window holds a little of another wall
    assert np.quantile(np.linalg.norm(found[:, :3] - in_camera[wall], axis=1), 0.8) < 1e-3
    assert np.quantile(np.abs(found[:, 3] - d[wall]), 0.8) < 1e-3


def test_depth_alone_finds_the_path_in_a_room() -> None:
    truth = _path()
    recording, none = _recording(truth, None, noise=0.001), _tracks(truth, None, 4, break_at=1)
    found = poses_by_depth(recording, none, np.tile(np.eye(4), (FRAMES, 1, 1)), LATERAL)
    assert found.posed.all()
    assert _worst(found.T_world_cam, truth) < 3e-3


def test_a_board_that_fills_most_of_the_view_and_moves_is_not_the_camera() -> None:
    truth, board = _path(), _board(moves=True)
    tracks = _tracks(truth, board, 14)
    share = (np.abs(_depth(truth[0], float(board[0])) - _depth(truth[0], None)) > 0.1).mean()
    assert share > 0.63
    recording = _recording(truth, board, noise=0.001)
    by_tracks = estimate_cameras(tracks, recording.times, CAMERA.fx)
    assert _worst(by_tracks.T_world_cam, truth) > 0.1  # the tracks' own majority follows the board
    found = camera_poses(recording, sparse(tracks, CAMERA))
    assert len(found.frames) == FRAMES
    assert _worst(found.T_world_cam, truth) < 8e-3


def test_where_both_agree_the_poses_are_those_of_the_tracks() -> None:
    truth, board = _path(), _board(moves=False)
    tracks = sparse(_tracks(truth, board, 14), CAMERA)
    recording = _recording(truth, board, noise=0.001)
    alone = estimate_cameras(tracks.dense(), recording.times, CAMERA.fx)
    found = camera_poses(recording, tracks)
    np.testing.assert_array_equal(found.T_world_cam, alone.T_world_cam)


def test_depth_carries_the_path_on_where_all_tracks_end() -> None:
    truth = _path()
    recording, tracks = _recording(truth, None, noise=0.001), _tracks(truth, None, 14, break_at=20)
    found = camera_poses(recording, sparse(tracks, CAMERA))
    assert len(found.frames) == FRAMES
    assert _worst(found.T_world_cam, truth) < 5e-3


def test_a_bare_wall_without_tracks_tells_no_path() -> None:
    poses = _path()
    recording = _recording(poses, None)
    flat = np.full((CAMERA.height, CAMERA.width), 1.5, np.float32)
    wall = Recording("wall", "wall", recording.times, CAMERA, recording.color, lambda _: flat, "0")
    with pytest.raises(ReconstructionError, match="texture"):
        camera_poses(wall, sparse(_tracks(poses, None, 14, break_at=1), CAMERA))
