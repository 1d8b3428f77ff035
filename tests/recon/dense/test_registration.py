"""Depth registered to colour: exact where it is already, on the surface everywhere, and nothing seen through
anything."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from recon.dense.registration import ColorGrid, DepthGrid, rays
from recon.readers.streams import Streams, recording_of
from recon.recording import Intrinsics
from recon.recording.rig import Lens, Rig
from twin.errors import InputError
from twin.geometry import Array, exp_so3, make_pose

COLOR = Intrinsics(160, 120, 150.0, 150.0, 80.3, 59.1)
DEPTH = Intrinsics(96, 72, 85.0, 86.0, 47.1, 36.4)
# wide and narrow lenses of today's cameras: k1 k2 p1 p2 k3 and, rational, k4 k5 k6
BENT = (0.12, -0.2, 0.001, -0.002, 0.05)
RATIONAL = (0.55, -0.02, 2e-5, -7e-5, -0.003, 0.89, 0.086, -0.014)
NORMAL = np.array([0.2, -0.1, -1.0])
BESIDE = make_pose(exp_so3([0.01, -0.02, 0.015]), [-0.05, 0.01, 0.004])


def plane_depth(lens: Lens, T_color_depth: Array, offset: float = -1.5) -> NDArray[np.float32]:
    """Depth of the plane NORMAL . p = offset of the colour camera, as the depth camera sees it, by its
    rays."""
    ray = np.concatenate([rays(lens), np.ones((lens.camera.height, lens.camera.width, 1))], axis=-1)
    n = T_color_depth[:3, :3].T @ NORMAL
    return np.nan_to_num((offset - NORMAL @ T_color_depth[:3, 3]) / (ray @ n)).astype(np.float32)


def off_plane(depth: NDArray[np.float32], camera: Intrinsics, offset: float = -1.5) -> Array:
    v, u = np.nonzero(depth)
    points = camera.backproject(np.stack([u, v], -1).astype(float), depth[v, u].astype(float))
    return np.abs(points @ NORMAL - offset) / np.linalg.norm(NORMAL)


@pytest.mark.parametrize("bent", [(), BENT, RATIONAL])
def test_rays_are_those_that_the_lens_model_projects_there(bent: tuple[float, ...]) -> None:
    lens = Lens(COLOR, bent)
    ray = rays(lens)
    v, u = np.mgrid[0:120:7, 0:160:9].reshape(2, -1)
    points = np.column_stack([ray[v, u], np.ones(len(u))])
    found, _ = cv2.projectPoints(
        points, np.zeros(3), np.zeros(3), COLOR.matrix, np.array(bent) if bent else None
    )
    np.testing.assert_allclose(found.reshape(-1, 2), np.stack([u, v], -1), atol=1e-3)


def test_rays_without_a_solution_are_unknown() -> None:
    folded = Lens(Intrinsics(160, 120, 60.0, 60.0, 80.0, 60.0), (-0.6, 0.0, 0.0, 0.0, 0.0))
    ray = rays(folded)  # r (1 - 0.6 r^2) turns around at r = 0.75, where it reaches 0.5
    assert np.isnan(ray[0, 0]).all()
    np.testing.assert_allclose(ray[60, 80], 0.0, atol=1e-12)
    assert np.nanmax(np.linalg.norm(ray, axis=-1)) < 0.8


@pytest.mark.parametrize("bent", [(), BENT, RATIONAL])
@pytest.mark.parametrize("T", [np.eye(4), BESIDE])
@pytest.mark.parametrize("seen", [DEPTH, COLOR, Intrinsics(40, 30, 35.0, 35.0, 19.5, 14.5)])
def test_a_plane_stays_a_plane(bent: tuple[float, ...], T: Array, seen: Intrinsics) -> None:
    rig = Rig(Lens(COLOR), Lens(seen, bent), T)
    out = DepthGrid(rig, COLOR)(plane_depth(rig.depth, T))
    assert np.count_nonzero(out) > 0.6 * out.size
    off = off_plane(out, COLOR)
    assert np.median(off) < 1e-6
    assert off.max() < 2e-3  # half a depth pixel beyond the last ones is continued as the surface goes
    inner = out[30:90, 40:120]
    assert np.all(inner > 0)  # a finer grid gets no holes


def test_depth_that_lies_on_colour_is_kept_to_the_bit() -> None:
    rng = np.random.default_rng(3)
    depth = (rng.integers(0, 4000, (120, 160)) / 1000).astype(np.float32)
    depth[rng.random(depth.shape) < 0.2] = 0.0
    np.testing.assert_allclose(DepthGrid(Rig.one(COLOR), COLOR)(depth), depth, rtol=3e-7)


def test_distance_along_the_ray_becomes_depth() -> None:
    rig = Rig(Lens(COLOR), Lens(COLOR), along_ray=True)
    ray = np.concatenate([rays(rig.depth), np.ones((120, 160, 1))], axis=-1)
    z = plane_depth(rig.depth, np.eye(4))
    out = DepthGrid(rig, COLOR)((z * np.linalg.norm(ray, axis=-1)).astype(np.float32))
    np.testing.assert_allclose(out, z, rtol=1e-6)


def test_two_surfaces_are_never_mixed_and_unknown_stays_unknown() -> None:
    depth = np.full((72, 96), 1.0, np.float32)
    depth[:, 48:] = 2.0
    depth[20:30, 20:30] = 0.0
    out = DepthGrid(Rig(Lens(COLOR), Lens(DEPTH)), COLOR)(depth)
    assert set(np.unique(out).round(5)) == {0.0, 1.0, 2.0}
    hole = Intrinsics(96, 72, 85.0, 86.0, 47.1, 36.4)
    x, y = np.rint(COLOR.project(hole.backproject(np.array([25.0, 25.0]), np.array(1.0)))).astype(int)
    assert out[y, x] == 0.0


def test_what_stands_before_hides_what_is_behind() -> None:
    """The colour camera stands 20 cm beside: it sees less of the wall behind a board than the depth camera
    does, and no hole in the board."""
    T = make_pose(translation=[0.2, 0.0, 0.0])
    depth = np.full((72, 96), 3.0, np.float32)
    depth[20:52, 30:60] = 1.0
    out = DepthGrid(Rig(Lens(COLOR), Lens(DEPTH), T), COLOR)(depth)
    corners = DEPTH.backproject(np.array([[30.0, 20.0], [59.0, 51.0]]), np.ones(2)) + [0.2, 0, 0]
    (x0, y0), (x1, y1) = np.rint(COLOR.project(corners)).astype(int)
    np.testing.assert_allclose(out[y0 : y1 + 1, x0 : x1 + 1], 1.0, rtol=1e-6)


def test_a_lone_pixel_is_as_large_as_a_pixel() -> None:
    depth = np.zeros((72, 96), np.float32)
    depth[36, 47] = 1.0
    fine = COLOR.scaled(640, 480)
    out = DepthGrid(Rig(Lens(fine), Lens(DEPTH)), fine)(depth)
    assert np.count_nonzero(out) == 0 or np.count_nonzero(out) < 9 * (fine.fx / DEPTH.fx) ** 2
    depth[36, 48] = depth[37, 47] = depth[37, 48] = 1.0
    area = np.count_nonzero(DepthGrid(Rig(Lens(fine), Lens(DEPTH)), fine)(depth))
    assert area == pytest.approx(4 * (fine.fx / DEPTH.fx) * (fine.fy / DEPTH.fy), rel=0.15)


def test_pictures_are_undistorted_and_scaled() -> None:
    lens = Lens(COLOR.scaled(640, 480), BENT)
    ray = rays(lens)
    # stripes that are straight in the world: their edge is where x/z = 0.2
    stored = np.where(ray[..., 0] < 0.2, 255, 0).astype(np.uint8)[..., None].repeat(3, axis=-1)
    out = ColorGrid(lens, COLOR)(stored)
    assert out.shape == (120, 160, 3)
    edge = 0.2 * COLOR.fx + COLOR.cx
    for row in (5, 60, 115):
        found = np.flatnonzero(out[row, :, 0] > 127)[-1] + 0.5
        assert abs(found - edge) < 1.0


def streams(n: int = 20, **changes: object) -> Streams:
    times = 5.0 + np.arange(n) / 15
    made = Streams(
        "clip", "clip", times, times,
        lambda k: np.full((120, 160, 3), k, np.uint8),
        lambda k: np.full((120, 160), 1 + k, np.float32),
        Rig.one(COLOR), "0" * 64,
    )  # fmt: skip
    return replace(made, **changes)  # type: ignore[arg-type]


def test_two_clocks_are_paired_by_the_nearest() -> None:
    times = streams().color_times
    recording = recording_of(streams(depth_times=np.delete(times, 7) + 0.011))
    assert len(recording) == 19
    assert recording.times.tolist() == np.delete(times, 7).tolist()
    assert [int(recording.depth(k)[0, 0]) for k in range(19)] == list(range(1, 20))
    assert [int(recording.color(k)[0, 0, 0]) for k in (6, 7)] == [6, 8]
    assert "1 of 20 colour images have no depth image in time" in recording.warnings[0]


def test_depth_that_is_slower_is_paired_within_half_of_its_own_frame() -> None:
    times = 5.0 + np.arange(60) / 30
    slow = 5.0 + np.arange(12) / 6 + 0.02
    recording = recording_of(streams(color_times=times, depth_times=slow))
    assert len(recording) == 12


def test_clocks_that_do_not_meet_are_refused() -> None:
    with pytest.raises(InputError, match=r"0 of 20 colour pictures.*one clock"):
        recording_of(streams(depth_times=streams().depth_times + 100))
    wrong = streams().depth_times.copy()
    wrong[4] = wrong[3]
    with pytest.raises(InputError, match="depth 4 has"):
        recording_of(streams(depth_times=wrong))
    with pytest.raises(InputError, match="holds no depth picture"):
        recording_of(streams(depth_times=wrong[:0]))


def test_pictures_of_another_size_are_named() -> None:
    recording = recording_of(streams(read_depth=lambda _: np.ones((60, 80), np.float32)))
    with pytest.raises(InputError, match="depth 3 is 80x60, its camera's numbers are of 160x120"):
        recording.depth(3)


def test_large_pictures_are_scaled_down_with_their_camera() -> None:
    big = COLOR.scaled(1280, 960)
    made = streams(rig=Rig(Lens(big), Lens(COLOR)), read_color=lambda k: np.full((960, 1280, 3), k, np.uint8))
    recording = recording_of(made)
    assert recording.intrinsics == big.scaled(640, 480)
    assert recording.frame(2).color.shape == (480, 640, 3)
    assert recording.frame(2).depth.shape == (480, 640)


def test_gravity_comes_from_poses_of_an_upright_world() -> None:
    n = 20
    poses = np.tile(make_pose(exp_so3([-np.pi / 2, 0, 0])), (n, 1, 1))  # looks along the world's y, level
    recording = recording_of(streams(poses=(streams().color_times, poses), upright=True))
    assert recording.gravity_camera0 is not None
    np.testing.assert_allclose(recording.gravity_camera0, [0, 1, 0], atol=1e-12)
    late = recording_of(streams(poses=(streams().color_times + 50, poses), upright=True))
    assert late.poses is None
    assert "are of another time" in late.warnings[0]


def test_a_lens_says_what_is_wrong_with_it() -> None:
    with pytest.raises(InputError, match="3 distortion coefficients"):
        Lens(COLOR, (0.1, 0.2, 0.3))
    with pytest.raises(InputError, match="leaves 1% of its pixels a ray"):
        DepthGrid(Rig(Lens(COLOR), Lens(COLOR, (-90.0, 90.0, 5.0, 5.0))), COLOR)


def test_absurd_cameras_give_nothing_and_end() -> None:
    wild = Intrinsics(160, 120, 8e20, 8e20, 80.0, 60.0)
    assert (
        np.count_nonzero(DepthGrid(Rig(Lens(wild), Lens(DEPTH)), wild)(np.ones((72, 96), np.float32))) < 2000
    )
    far = make_pose(translation=[1e12, 0, 0])
    assert not DepthGrid(Rig(Lens(COLOR), Lens(DEPTH), far), COLOR)(np.ones((72, 96), np.float32)).any()


def test_one_clock_that_falls_is_told_before_poses_are_matched() -> None:
    falling = streams().color_times[::-1].copy()
    poses = (falling, np.tile(np.eye(4), (20, 1, 1)))
    with pytest.raises(InputError, match="strictly increase, frame 1 has"):
        recording_of(streams(color_times=falling, depth_times=falling, poses=poses))
