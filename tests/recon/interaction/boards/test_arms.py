"""Arms among the surfaces that changed: long, narrow, free-standing and coming from the viewer; boards are
not, however they stand."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from recon.interaction.boards.arms import has_shape_of_arm, is_arm
from recon.recording import Intrinsics
from twin.geometry import Array

CAMERA = Intrinsics(160, 120, 130.0, 130.0, 79.5, 59.5)
WALL = 1.5


def picture(
    corners: list[tuple[float, float, float]], wall: float = WALL
) -> tuple[NDArray[np.bool_], NDArray[np.float32], Array]:
    """A parallelogram (m, camera axes) of three corners before a wall: its mask, the depth image and its
    points, as a camera sees them."""
    origin, along, across = (
        np.array(corners[0]),
        np.subtract(corners[1], corners[0]),
        np.subtract(corners[2], corners[0]),
    )
    v, u = np.mgrid[0 : CAMERA.height, 0 : CAMERA.width]
    rays = CAMERA.backproject(np.stack([u, v], axis=-1).astype(float), np.ones(u.shape))
    normal = np.cross(along, across)
    z = (origin @ normal) / (rays @ normal)
    hit = rays * z[..., None] - origin
    basis = np.linalg.pinv(np.stack([along, across], axis=1))
    inside = np.all((hit @ basis.T >= 0) & (hit @ basis.T <= 1), axis=-1) & (z > 0)
    depth = np.where(inside, z, wall).astype(np.float32)
    return inside, depth, (rays * depth[..., None])[inside]


def strip(width: float, near: float, far: float) -> list[tuple[float, float, float]]:
    """From beyond the lower border of the picture to its middle, from so near to so far."""
    x = 0.5 * width
    return [(-x, 0.55 * near, near), (-x, 0.0, far), (x, 0.55 * near, near)]


@pytest.mark.parametrize(
    ("width", "near", "far", "arm"),
    [
        (0.09, 0.35, 0.7, True),
        (0.13, 0.3, 0.6, True),
        (0.22, 0.35, 0.7, True),  # smeared
        (0.30, 0.12, 0.9, True),  # smeared more, but from the viewer
        (0.30, 0.35, 0.7, False),  # a board that stands open towards the viewer
        (0.09, 0.65, 0.7, False),  # a narrow front
    ],
)
def test_an_arm_is_narrow_and_comes_from_the_viewer(width: float, near: float, far: float, arm: bool) -> None:
    mask, depth, points = picture(strip(width, near, far))
    assert mask.sum() > 200
    assert is_arm(mask, depth, points) == arm
    sideways = mask.T[:, ::-1], np.ascontiguousarray(depth.T[:, ::-1])
    at = np.zeros((*mask.shape, 3))
    at[mask] = points
    assert is_arm(*sideways, np.swapaxes(at, 0, 1)[:, ::-1][sideways[0]]) == arm


def test_a_strip_of_a_wall_that_comes_nearer_is_no_arm() -> None:
    """What goes on beside it stands off from nothing."""
    mask, depth, points = picture(strip(0.09, 0.35, 0.7))
    beside = np.where(mask.any(axis=1)[:, None], depth.max(axis=1, where=mask, initial=0.0)[:, None], depth)
    assert not is_arm(mask, beside.astype(np.float32), points)


def test_a_board_that_hangs_on_one_side_is_no_arm() -> None:
    """As wide as a smeared arm and as near at its end, but what it hangs on goes on beside it."""
    mask, depth, points = picture(strip(0.22, 0.35, 0.7))
    row = depth.max(axis=1, where=mask, initial=0.0)[:, None]
    left = np.arange(CAMERA.width) < 60
    hung = np.where(mask.any(axis=1)[:, None] & left & ~mask, row, depth)
    assert is_arm(mask, depth, points)
    assert not is_arm(mask, hung.astype(np.float32), points)


def test_a_front_that_stands_off_is_no_arm() -> None:
    mask, depth, points = picture([(-0.3, -0.05, 0.8), (0.3, -0.05, 0.8), (-0.3, 0.06, 0.8)])
    assert not is_arm(mask, depth, points)


@pytest.mark.parametrize(
    ("size", "behind", "fist"), [(0.1, WALL, True), (0.1, 0.63, False), (0.25, WALL, False)]
)
def test_a_fist_is_short_and_stands_off(size: float, behind: float, fist: bool) -> None:
    mask, depth, points = picture(
        [(-0.05, -0.05, 0.6), (size - 0.05, -0.05, 0.6), (-0.05, 0.05, 0.6)], behind
    )
    assert is_arm(mask, depth, points) == fist
    assert not has_shape_of_arm(mask, depth, points)  # a verdict excuses no small thing at rest for it
