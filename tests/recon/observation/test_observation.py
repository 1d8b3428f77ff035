"""What pictures say of surfaces: noise, ranges of depth, where surfaces come from, and the likelihood of a
moved board, by closed form."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from recon.dense.looks import HIDDEN, SAME, THROUGH, UNKNOWN, look
from recon.interaction.boards.carrier import Carrier, Shared
from recon.interaction.boards.seeds import Seed
from recon.observation import origins as where
from recon.observation.likelihood import STILL, explained
from recon.observation.likelihood import THROUGH as SEEN_THROUGH
from recon.observation.origins import origins
from recon.observation.pictures import Pictures, depth_range
from recon.observation.room import room_directions
from recon.recording import Intrinsics
from tests.makers.recon.cabinets import make_clip
from twin import geometry as geo

CAMERA = Intrinsics(160, 120, 140.0, 140.0, 79.5, 59.5)
ROWS = 20
BACK, BOARD = 1.6, 1.0
FRONT = slice(40, 80), slice(60, 100)  # of the picture


def test_noise_is_measured() -> None:
    clip = make_clip("door")
    for sigma in (0.004, 0.012):

        def noisy(frame: int, sigma: float = sigma) -> np.ndarray:
            noise = np.random.default_rng(frame).normal(0, sigma, (150, 200))
            return (np.linspace(1.5, 2.5, 150)[:, None] + noise).astype(np.float32)

        cameras = replace(clip.cameras, T_world_cam=np.tile(np.eye(4), (26, 1, 1)))
        noise = Pictures.of(replace(clip.recording, read_depth=noisy), cameras).noise
        between = noise.base + 4.0 * noise.slope  # of the difference of two
        assert between == pytest.approx(np.sqrt(2.0) * sigma, rel=0.1)


def test_a_look_tells_nearer_from_farther() -> None:
    depth = np.full((9, 9), 2.0, np.float32)
    depth[:, :4] = 0.0
    points = np.array(
        [[0.0, 0.0, 2.01], [0.0, 0.0, 1.8], [0.0, 0.0, 2.2], [-0.9, 0.0, 2.0], [0.0, 0.0, -1.0]]
    )
    points[:3, 0] = 2 * 2.0 / 10.0
    told = look(points, np.eye(4), depth, 10.0, 10.0, 4.0, 4.0, 0.05, 0.0)
    assert told.tolist() == [SAME, THROUGH, HIDDEN, UNKNOWN, UNKNOWN]


def test_a_pixel_of_a_slanted_surface_has_a_range_of_depth_and_one_at_a_jump_has_not() -> None:
    slant = np.tile(1.0 + 0.005 * np.arange(40, dtype=np.float32), (40, 1))
    depth, near, far = depth_range(slant, 4)
    np.testing.assert_allclose(near[1:-1, 1:-1], depth[1:-1, 1:-1] - 0.01, atol=1e-6)
    np.testing.assert_allclose(far[1:-1, 1:-1], depth[1:-1, 1:-1] + 0.01, atol=1e-6)
    jump = np.where(np.arange(40) < 20, 1.0, 1.3)[None].repeat(40, axis=0).astype(np.float32)
    depth, near, far = depth_range(jump, 4)
    np.testing.assert_array_equal(near, depth)
    np.testing.assert_array_equal(far, depth)


def pictures(depth: list[NDArray[np.float32]], poses: np.ndarray | None = None) -> Pictures:
    seen = np.stack(depth)
    grey = np.full((*seen.shape, 3), 128, np.uint8)
    at = np.tile(np.eye(4), (len(seen), 1, 1)) if poses is None else poses
    return Pictures(CAMERA, np.arange(len(seen)), seen, seen, seen, grey, at)


def wall(z: float = BACK) -> NDArray[np.float32]:
    return np.full((120, 160), z, np.float32)


def with_board(z: float) -> NDArray[np.float32]:
    """A square board before the wall; nearer, it covers more of the picture."""
    half = 20 * BOARD / z
    v, u = np.mgrid[0:120, 0:160]
    on = (np.abs(u - 79.5) < half) & (np.abs(v - 59.5) < half)
    return np.where(on, z, BACK).astype(np.float32)


def test_what_comes_before_the_wall_moves_and_what_could_not_be_seen_is_unknown() -> None:
    """A wall, from a camera that goes aside at last: what comes into the picture is of unknown origin."""
    thing = wall(2.0)
    thing[40:80, 70:90] = 1.5
    poses = np.tile(np.eye(4), (ROWS, 1, 1))
    poses[-1, 0, 3] = 1.0
    seen = pictures([wall(2.0)] * 12 + [thing] * 8, poses)
    told = origins(seen)
    assert (told[15, 42:78, 72:88] == where.AMID).all()  # the last row doesn't see its place
    poses[-1, 0, 3] = 0.0
    told_in_view = origins(pictures([wall(2.0)] * 12 + [thing] * 8, poses))
    assert (told_in_view[15, 42:78, 72:88] == where.NEW).all()
    assert (told[5, 1:-1, 1:60] == where.STATIC).all()
    assert (told[-1, :, 150:] == where.UNKNOWN).all()


def test_what_is_behind_a_part_at_an_end_may_be_static_or_the_part() -> None:
    """A board comes out by 60 cm and stays: what lay behind it, its own place at first, is of unknown
    origin."""
    seen = pictures([with_board(1.4)] * 10 + [with_board(0.8)] * 10)
    told = origins(seen)
    assert (told[15, 50:70, 70:90] == where.NEW).all()
    assert (told[5, 50:70, 70:90] == where.UNKNOWN).all()
    assert (told[5, 1:-1, 1:30] == where.STATIC).all()


def carrier(seen: Pictures, rest: int) -> Carrier:
    shared = Shared(seen, origins(seen), np.arange(ROWS), np.arange(ROWS) / 15.0, np.zeros((3, 0)))
    return Carrier.of(shared, Seed.of(seen, rest, seen.depth[rest] < BACK))


def shift(z: float) -> NDArray[np.float64]:
    return geo.make_pose(np.eye(3), [0.0, 0.0, z])[None, None]


def test_evidence_is_counted_in_pixels_of_the_picture() -> None:
    """A board that comes nearer by half covers four times the pixels; seen through, each costs twice."""
    seen = pictures([with_board(1.2)] * 7 + [with_board(0.6)] * 6 + [with_board(1.2)] * 7)
    board = carrier(seen, 0)
    assert board.area == (seen.depth[0] < BACK).sum()
    near = board.scores(shift(-0.6), np.array([9]))[0, 0]
    assert near == pytest.approx((seen.depth[9] < BACK).sum(), rel=0.1)
    assert near == pytest.approx(4.0 * board.area, rel=0.1)
    through = board.scores(shift(-0.6), np.array([0]))[0, 0]
    still = STILL * board.area
    assert through == pytest.approx(-SEEN_THROUGH * near - still, rel=0.1)
    assert board.scores(shift(0.2), np.array([9]))[0, 0] == pytest.approx(0.0, abs=0.05 * board.area)


@pytest.mark.parametrize(
    ("origin", "share"), [(where.NEW, 1.0), (where.AMID, 1.0), (where.UNKNOWN, 0.25), (where.STATIC, 0.0)]
)
def test_what_a_pixel_explains_follows_from_its_origin(origin: int, share: float) -> None:
    """And from its colour: an unlike one is half as likely where something moves, and tells nothing else."""
    seen = pictures([with_board(1.2)] * 7 + [with_board(0.6)] * 6 + [with_board(1.2)] * 7)
    board, row = carrier(seen, 0), np.array([9])
    board.shared.origin[:] = origin
    told = board.scores(shift(-0.6), row)[0, 0]
    assert told == pytest.approx(share * (seen.depth[9] < BACK).sum(), rel=0.1)
    seen.colour[9, ..., 1] = 255
    unlike = board.scores(shift(-0.6), row)[0, 0]
    assert unlike == pytest.approx(0.5 * told if share == 1.0 else 0.0, abs=0.05 * board.area)


def test_a_surface_that_is_still_where_it_rested_did_not_leave() -> None:
    seen = pictures([with_board(1.2)] * ROWS)
    board = carrier(seen, 0)
    assert board.still.all()
    hidden = board.scores(shift(0.3), np.array([5]))[0, 0]  # behind the wall of pixels it explains nothing
    assert hidden == pytest.approx(-STILL * board.area, rel=0.1)


def test_what_a_part_explains_is_no_evidence_for_another() -> None:
    seen = pictures([with_board(1.2)] * 7 + [with_board(0.6)] * 6 + [with_board(1.2)] * 7)
    board = carrier(seen, 0)
    assert (board.shared.origin[9] == where.AMID).sum() > 0.8 * (seen.depth[9] < BACK).sum()
    poses = np.tile(np.eye(4), (ROWS, 1, 1))
    poses[7:13] = shift(-0.6)[0, 0]
    points = seen.points(0)[seen.depth[0] < BACK]
    explained(
        points, seen.T_cam_world, poses, seen.near, seen.far, board.shared.origin, seen.lens, (0.012, 0.0)
    )
    moves = board.shared.origin >= where.NEW
    assert moves[9].sum() < 0.2 * (seen.depth[9] < BACK).sum()  # its outline
    assert not moves[0].any()


def test_the_other_face_of_a_board_lies_nearer_and_is_of_it() -> None:
    """A board turns about its own middle line; from behind, its other face is seen 18 mm nearer."""
    seen = pictures([with_board(1.2)] * 7 + [with_board(1.182)] * 6 + [with_board(1.2)] * 7)
    board = carrier(seen, 0)
    turned = (
        geo.make_pose(np.eye(3), [0, 0, 1.2])
        @ geo.make_pose(geo.exp_so3([0.0, np.pi, 0.0]), [0, 0, 0])
        @ geo.make_pose(np.eye(3), [0, 0, -1.2])
    )
    row = np.array([9])
    board.shared.origin[:] = where.NEW
    assert board.scores(turned[None, None], row)[0, 0] == pytest.approx(board.area, rel=0.1)


def test_directions_of_the_room_are_those_of_its_walls() -> None:
    v, u = np.mgrid[0:120, 0:160]
    ray = np.stack([(u - 79.5) / 140.0, (v - 59.5) / 140.0, np.ones(u.shape)], axis=-1)
    R = geo.exp_so3([0.1, 0.5, 0.05])  # of the room's axes in the camera
    sides = [1.0 / np.maximum(sign * ray @ R[:, k], 1e-6) for k in range(3) for sign in (-1.0, 1.0)]
    room = np.minimum.reduce(sides).astype(np.float32)
    axes = room_directions(pictures([room] * ROWS))
    assert axes.shape == (3, 3)
    assert np.degrees(np.arccos(np.abs(axes.T @ R).max(axis=0))).max() < 1.0
