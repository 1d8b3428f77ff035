"""Panels that slide in their own plane: the strips that leave and come are grown to the panel, and its way is
the true one."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from recon.interaction.boards.board import extents
from recon.interaction.boards.search import parts_by_depth
from recon.interaction.boards.seeds import seeds
from recon.observation.pictures import Pictures
from recon.recording import Intrinsics, Recording
from twin import geometry as geo
from twin.geometry import Array
from twin.scene import Trajectory

FRAMES = 24
CAMERA = Intrinsics(160, 120, 140.0, 140.0, 79.5, 59.5)
NEAR, BACK = 1.0, 1.3
V, U = np.mgrid[0:120, 0:160]
X, Y = (U - 79.5) / 140.0, (V - 59.5) / 140.0  # at a metre
FRONT = (-0.25, 0.05)  # of the panel at first, m
WAY = 0.12


def depth_of(low: float, high: float, plane: float = NEAR) -> NDArray[np.float32]:
    """A panel, 0.4 m high, from one place to another at a metre, before a back."""
    on = (plane * X >= low) & (plane * X <= high) & (np.abs(plane * Y) < 0.2)
    return np.where(on, plane, BACK).astype(np.float32)


def sliding(
    way: float, low: float = FRONT[0], high: float = FRONT[1], plane: float = NEAR
) -> list[NDArray[np.float32]]:
    """The panel rests, slides by `way` and rests."""
    shift = way * np.clip((np.arange(FRAMES) - 8) / 8, 0, 1)
    return [depth_of(low + s, high + s, plane) for s in shift]


def recorded(depth: list[NDArray[np.float32]], T: Array | None = None) -> tuple[Recording, Trajectory]:
    every = np.arange(FRAMES)
    color = np.full((120, 160, 3), 120, np.uint8)
    recording = Recording(
        "panel", "panel", every / 15.0, CAMERA, lambda _: color, lambda f: depth[f], "panel"
    )
    poses = np.tile(np.eye(4) if T is None else T, (FRAMES, 1, 1))
    return recording, Trajectory(every, every / 15.0, poses)


def test_a_strip_that_left_or_came_is_grown_to_the_whole_panel() -> None:
    recording, cameras = recorded(sliding(WAY))
    pictures = Pictures.of(recording, cameras)
    for rest, shift in ((0, 0.0), (FRAMES - 1, WAY)):
        (strip,) = seeds(pictures, rest)
        assert np.ptp(strip.points[:, 0]) < WAY + 0.02
        *_, board = extents(pictures, recording, strip)
        low, high = np.quantile(board.points[:, 0], (0.01, 0.99))
        assert (low, high) == pytest.approx((FRONT[0] + shift, FRONT[1] + shift), abs=0.02)
        assert np.ptp(board.points[:, 1]) == pytest.approx(0.4, abs=0.03)
        assert board.bounded > 0.9


@pytest.mark.parametrize("way", [0.06, 0.12, 0.2])
def test_a_panel_goes_as_far_as_it_does(way: float) -> None:
    """Not from the one strip to the other, by its own width."""
    T = geo.make_pose(geo.exp_so3([0.3, -0.5, 0.2]), [1.0, 0.5, -0.3])
    (part,) = parts_by_depth(*recorded(sliding(way), T))
    assert part.joint.kind == "prismatic"
    assert np.degrees(geo.line_angle(part.joint.axis, T[:3, 0])) < 2.0
    assert np.ptp(part.state) == pytest.approx(way, abs=0.012)


def there_and_back(way: float) -> list[NDArray[np.float32]]:
    """The panel rests, slides by `way`, rests, and is closed again."""
    shift = way * np.interp(np.arange(FRAMES), [5, 9, 14, 18], [0, 1, 1, 0])
    return [depth_of(FRONT[0] + s, FRONT[1] + s) for s in shift]


def test_a_panel_that_is_closed_again_goes_as_far_as_it_did() -> None:
    """At both ends of the recording only the strip at its trailing edge is seen to have been away."""
    (part,) = parts_by_depth(*recorded(there_and_back(WAY)))
    assert part.joint.kind == "prismatic"
    assert np.degrees(geo.line_angle(part.joint.axis, [1.0, 0.0, 0.0])) < 2.0
    assert np.ptp(part.state) == pytest.approx(WAY, abs=0.012)
    assert abs(part.state[-1]) < 0.012


def test_a_panel_whose_way_is_hidden_in_part_goes_as_far_as_it_does() -> None:
    """Something stands before two thirds of where it slides to."""
    box = (FRONT[1] + 0.01 < X) & (Y < 0.06)
    hidden = [np.where(box, 0.7, d).astype(np.float32) for d in sliding(0.17)]
    (part,) = parts_by_depth(*recorded(hidden))
    assert part.joint.kind == "prismatic"
    assert np.ptp(part.state) == pytest.approx(0.17, abs=0.012)


def test_a_part_that_is_in_view_for_a_fifth_of_the_time_is_found() -> None:
    """A drawer comes out by 12 cm; before and after it the camera looks at a wall beside it, for most of the
    recording."""
    count, there = 100, {*range(4), *range(43, 55), *range(96, 100)}
    away = geo.make_pose(geo.exp_so3([0.0, np.pi / 2, 0.0]), [0.0, 0.0, 0.0])
    poses = np.stack([np.eye(4) if f in there else away for f in range(count)])
    every = np.arange(count)
    plane = NEAR - 0.12 * np.clip((every - 45) / 6, 0, 1)
    wall = np.full((120, 160), 2.0, np.float32)
    depth = [depth_of(-0.2, 0.2, plane[f]) if f in there else wall for f in range(count)]
    color = np.full((120, 160, 3), 120, np.uint8)
    recording = Recording(
        "aside", "aside", every / 15.0, CAMERA, lambda _: color, lambda f: depth[f], "aside"
    )
    (part,) = parts_by_depth(recording, Trajectory(every, every / 15.0, poses))
    assert part.joint.kind == "prismatic"
    assert np.degrees(geo.line_angle(part.joint.axis, [0.0, 0.0, 1.0])) < 8.0
    assert np.ptp(part.state) == pytest.approx(0.12, abs=0.02)


def pulled_and_pushed(way: float, arm: bool) -> list[NDArray[np.float32]]:
    """A drawer's front comes out by `way`, rests and goes back; an arm that touches it is there meanwhile."""
    out = np.interp(np.arange(FRAMES), [5, 9, 14, 18], [0, 1, 1, 0])
    depth = []
    for k in range(FRAMES):
        d = depth_of(-0.2, 0.2, NEAR - way * out[k])
        on = (np.abs(U - 80) < 12) & (V > 60) & (4 <= k <= 19) & arm
        # from the front to the viewer
        depth.append(np.where(on, NEAR - way * out[k] - 0.009 * (V - 60), d).astype(np.float32))
    return depth


@pytest.mark.parametrize("arm", [False, True], ids=["alone", "with an arm"])
def test_a_drawer_that_is_pulled_and_pushed_back_is_found_between(arm: bool) -> None:
    """The first and the last row are alike, and nothing is seen through where it rests in them."""
    (part,) = parts_by_depth(*recorded(pulled_and_pushed(0.15, arm)))
    assert part.joint.kind == "prismatic"
    assert np.degrees(geo.line_angle(part.joint.axis, [0.0, 0.0, 1.0])) < 3.0
    assert np.ptp(part.state) == pytest.approx(0.15, abs=0.015)
    assert abs(part.state[-1]) < 0.01


def test_an_arm_that_comes_and_goes_is_no_part() -> None:
    assert not parts_by_depth(*recorded(pulled_and_pushed(0.0, arm=True)))


def test_a_thin_strip_of_a_scattered_panel_is_grown_to_all_of_it() -> None:
    """The strip's own pixels leave open how the plane leans: some degrees are far at the other edge."""
    rng = np.random.default_rng(5)
    low, high = -0.5, 0.15
    depth = [(d + rng.normal(0.0, 0.006, d.shape)).astype(np.float32) for d in sliding(0.05, low, high)]
    pictures = Pictures.of(*recorded(depth))
    (strip,) = seeds(pictures, FRAMES - 1)
    *_, board = extents(pictures, recorded(depth)[0], strip)
    assert np.ptp(strip.points[:, 0]) < 0.08
    told = np.quantile(board.points[:, 0], (0.01, 0.99))
    assert told == pytest.approx((low + 0.05, high + 0.05), abs=0.03)


def test_an_arm_that_holds_a_board_is_none_of_it() -> None:
    """A drawer's front that comes out by 20 cm, held at the end by an arm that leans towards the camera from
    its middle on: they are of one piece, and boards are what lies on the front."""
    held = (np.abs(U - 80) < 7) & (V >= 60)
    arm = np.where(held, NEAR - 0.2 - 0.012 * (V - 60), np.inf)
    closed = depth_of(-0.25, 0.25)
    depth = [closed] * 8 + [np.minimum(depth_of(-0.25, 0.25, NEAR - 0.2), arm).astype(np.float32)] * 16
    recording, cameras = recorded(depth)
    pictures = Pictures.of(recording, cameras)
    seed = max(seeds(pictures, FRAMES - 1), key=lambda s: len(s.points))
    assert seed.points[:, 2].min() < 0.5
    every, *boards = extents(pictures, recording, seed)
    assert every is seed or len(every.points) == len(seed.points)
    assert boards
    for board in boards:
        assert board.points[:, 2].min() > NEAR - 0.2 - 0.08
        assert np.ptp(board.points[:, 0]) == pytest.approx(0.5, abs=0.03)
