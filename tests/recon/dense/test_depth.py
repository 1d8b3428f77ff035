"""Laws of the pinhole camera and of the one depth look-up."""

from __future__ import annotations

import numpy as np
import pytest

from recon.dense.depth import depth_normals, look_up, mean_depth
from recon.recording import Intrinsics
from twin.geometry import Array

CAMERA = Intrinsics(160, 120, 210.0, 190.0, 81.3, 57.2)


def plane_depth(camera: Intrinsics, normal: Array, offset: float) -> Array:
    """Depth (H, W) m of the plane normal @ x == offset."""
    y, x = np.mgrid[0 : camera.height, 0 : camera.width]
    rays = camera.backproject(np.stack([x, y], axis=-1), np.ones(x.shape))
    return np.asarray(offset / (rays @ normal))


def test_project_is_the_inverse_of_backproject() -> None:
    rng = np.random.default_rng(3)
    pixels, depth = rng.uniform([-50, -50], [210, 170], (500, 2)), rng.uniform(0.2, 9.0, 500)
    points = CAMERA.backproject(pixels, depth)
    np.testing.assert_allclose(CAMERA.project(points), pixels, atol=1e-10)
    np.testing.assert_allclose(CAMERA.backproject(CAMERA.project(points), points[:, 2]), points, atol=1e-12)
    by_matrix = points @ CAMERA.matrix.T
    np.testing.assert_allclose(CAMERA.project(points), by_matrix[:, :2] / by_matrix[:, 2:], atol=1e-10)
    np.testing.assert_array_equal(np.diag(CAMERA.matrix)[:2], CAMERA.vector[:2])


@pytest.mark.parametrize("factor", [2, 3, 7])
def test_a_block_of_pixels_is_seen_along_the_ray_through_its_middle(factor: int) -> None:
    small = CAMERA.binned(factor)
    assert (small.width, small.height) == (160 // factor, 120 // factor)
    block = np.array([[0, 0], [5, 11], [small.width - 1, small.height - 1]])
    middle = block * factor + (factor - 1) / 2
    ones = np.ones(len(block))
    np.testing.assert_allclose(small.backproject(block, ones), CAMERA.backproject(middle, ones), atol=1e-12)


@pytest.mark.parametrize("step", [2, 3, 7])
def test_a_picture_of_every_so_many_pixels_is_seen_along_their_own_rays(step: int) -> None:
    x = np.tile(np.arange(CAMERA.width), (CAMERA.height, 1))[::step, ::step]
    small = CAMERA.strided(step)
    assert (small.height, small.width) == x.shape
    at = np.array([[0, 0], [3, 2], [small.width - 1, small.height - 1]])
    ones = np.ones(len(at))
    np.testing.assert_allclose(small.backproject(at, ones), CAMERA.backproject(at * step, ones), atol=1e-12)


def test_points_of_a_plane_read_their_own_depth() -> None:
    normal = np.array([0.2, -0.1, 0.97])
    depth = plane_depth(CAMERA, normal, 1.3)
    y, x = np.mgrid[0 : CAMERA.height, 0 : CAMERA.width]
    pixels = np.stack([x.ravel(), y.ravel()], axis=1)
    points = CAMERA.backproject(pixels, depth.ravel())
    found = look_up(depth, CAMERA, points)
    assert found.inside.all()
    np.testing.assert_array_equal(np.stack([found.x, found.y], axis=1), pixels)
    np.testing.assert_array_equal(found.z, points[:, 2])
    nearer = look_up(depth, CAMERA, 0.9 * points)  # along its ray a point falls on the same pixel
    np.testing.assert_array_equal(nearer.z, points[:, 2])


def test_the_pixel_that_is_read_is_the_nearest_one() -> None:
    rng = np.random.default_rng(0)
    pixels = rng.uniform([-0.49, -0.49], [159.49, 119.49], (2000, 2))
    depth = rng.uniform(0.5, 2.0, (CAMERA.height, CAMERA.width)).astype(np.float32)
    found = look_up(depth, CAMERA, CAMERA.backproject(pixels, rng.uniform(0.3, 3.0, len(pixels))))
    assert found.inside.all()
    assert np.abs(np.stack([found.x, found.y], axis=1) - pixels).max() <= 0.5
    np.testing.assert_array_equal(found.z, depth[found.y, found.x].astype(np.float64))


def test_what_is_beside_behind_or_too_near_is_not_in_view() -> None:
    depth = np.full((CAMERA.height, CAMERA.width), 2.0)
    outside = CAMERA.backproject(np.array([[-1.0, 5], [160, 5], [5, -1.0], [5, 120]]), np.ones(4))
    behind = -CAMERA.backproject(np.array([[80.0, 60.0]]), np.ones(1))
    near = CAMERA.backproject(np.full((2, 2), 60.0), np.array([0.09, 0.11]))
    found = look_up(depth, CAMERA, np.concatenate([outside, behind, near]))
    assert found.inside.tolist() == [False] * 6 + [True]
    assert found.z.tolist() == [0.0] * 6 + [2.0]
    assert look_up(depth, CAMERA, near, near=0.05).inside.all()
    depth[60, 60] = 0.0
    assert look_up(depth, CAMERA, near[1:]).z.tolist() == [0.0]  # in view, and unknown


def test_normals_are_those_of_the_planes_and_none_stands_at_holes_creases_and_far_away() -> None:
    wall, floor = np.array([0.3, 0.1, -0.9]), np.array([0.0, -1.0, -0.05])
    wall, floor = wall / np.linalg.norm(wall), floor / np.linalg.norm(floor)
    far, low = plane_depth(CAMERA, wall, -2.0), plane_depth(CAMERA, floor, -0.35)
    on_floor = (low > 0) & (low < far)
    depth = np.where(on_floor, low, far).astype(np.float32)
    depth[30:33, 60:63] = 0.0
    found = depth_normals(depth, CAMERA, np.inf)
    known = np.isfinite(found).all(axis=-1)
    for plane, mine in ((wall, ~on_floor), (floor, on_floor)):
        some = found[known & mine]
        assert len(some) > 0.3 * mine.sum()
        assert np.mean(np.abs(some - plane).max(axis=1) < 1e-3) > 0.95, "but beside the crease"
    beside = np.zeros(depth.shape, bool)  # those two pixels off, across or along, that a hole is in
    for down, right in ((0, 0), (2, 0), (-2, 0), (0, 2), (0, -2)):
        beside |= np.roll(depth == 0, (down, right), (0, 1))
    assert not known[beside].any()
    crease = np.argmax(on_floor, axis=0)
    assert not known[crease, np.arange(CAMERA.width)].any()
    assert not known[:2].any()
    assert not known[:, -2:].any()
    nearer = np.isfinite(depth_normals(depth, CAMERA, 1.9)).all(axis=-1)
    assert nearer.any()
    assert not nearer[depth >= 1.9].any()


def test_a_surface_seen_in_spots_has_a_mean_depth_and_the_rim_of_a_hole_has_none() -> None:
    """A plane that returns depth in 55 % of its pixels, and one that ends before another at a jump."""
    plane = plane_depth(CAMERA, np.array([0.3, -0.2, 0.93]), 1.2).astype(np.float32)
    spots = np.where(np.random.default_rng(0).random(plane.shape) < 0.55, plane, 0.0).astype(np.float32)
    size = CAMERA.width // 2, CAMERA.height // 2
    whole, told = mean_depth(plane, size), mean_depth(spots, size)
    assert (told > 0).mean() > 0.85
    assert np.abs(told - whole)[told > 0].max() < 0.01
    jump = np.full(plane.shape, 1.0, np.float32)
    jump[:, 40:] = 1.5
    jump[1::2, 39:42] = 0.0  # cells of the jump are known by half
    assert (mean_depth(jump, size)[:, 19:21] == 0).all()
