"""Surfaces that left or came: they lie on the part, end where depth jumps, and hang together where it only
slants."""

from __future__ import annotations

import numpy as np
import pytest

from recon.interaction.boards.seeds import _torn, informative_rows, seeds
from recon.observation.origins import origins
from recon.observation.pictures import Pictures
from recon.recording import Intrinsics
from tests.makers.recon.cabinets import Clip, Kind, make_clip


@pytest.fixture(scope="module", params=["door", "drawer", "slide"])
def clip(request: pytest.FixtureRequest) -> Clip:
    kind: Kind = request.param
    return make_clip(kind)


def test_changed_surfaces_lie_on_the_part(clip: Clip) -> None:
    pictures = Pictures.of(clip.recording, clip.cameras)
    found = [s for rest in (0, len(pictures.frames) - 1) for s in seeds(pictures, rest)]
    assert found
    for surface in found:
        state = float(clip.part.motion.state[surface.rest])
        at_rest = clip.mesh.transformed(clip.part.joint.pose(state))
        low, high = at_rest.vertices.min(axis=0) - 0.02, at_rest.vertices.max(axis=0) + 0.02
        inside = ((surface.points > low) & (surface.points < high)).all(axis=1)
        assert inside.mean() > 0.97


@pytest.mark.parametrize("smear", [0, 1, 2])
def test_a_jump_of_depth_is_torn_however_a_sensor_smears_it_and_a_slant_is_not(smear: int) -> None:
    """An arm at 0.7 m before a front at 0.9 m, and a floor seen at a grazing angle."""
    arm = np.where(np.arange(80) < 40, 0.7, 0.9)
    box = np.ones(smear + 1) / (smear + 1)
    blurred = np.convolve(np.pad(arm, 8, mode="edge"), np.convolve(box, box), mode="same")[8:-8]
    torn = _torn(np.tile(blurred, (60, 1)).astype(np.float32))
    assert torn[2:-2, 36:44].any(axis=1).all()
    assert not torn[:, :36].any()
    assert not torn[:, 44:].any()
    floor = 60.0 / np.linspace(20.0, 60.0, 60)  # m; up to 14 cm a pixel
    assert not _torn(np.tile(floor[:, None], (1, 80)).astype(np.float32))[2:-2].any()


def _came(thing: np.ndarray) -> Pictures:
    """A wall at 2 m for ten frames, and then things (h, w) of this depth before it, 0 where there are
    none."""
    wall = np.full(thing.shape, 2.0, np.float32)
    depth = np.stack([wall] * 10 + [np.where(thing > 0, thing, wall).astype(np.float32)] * 10)
    camera = Intrinsics(thing.shape[1], thing.shape[0], 130.0, 130.0, 79.5, 59.5)
    grey = np.full((*depth.shape, 3), 128, np.uint8)
    return Pictures(camera, np.arange(20), depth, depth, depth, grey, np.tile(np.eye(4), (20, 1, 1)))


def test_an_arm_before_a_door_that_came_is_another_surface() -> None:
    door = np.zeros((120, 160))
    door[20:100, 40:120] = 1.2
    (alone,) = seeds(_came(door), 19)
    arm = door.copy()
    arm[70:, 60:80] = 1.0
    both = seeds(_came(arm), 19)
    assert len(both) == 2
    for surface in both:
        z = surface.points[:, 2]
        assert np.ptp(z) < 0.01
    assert len(both[0].points) > 0.7 * len(alone.points)


@pytest.mark.parametrize("slope", [20.0, 60.0, 80.0])
def test_a_slanted_board_is_one_surface(slope: float) -> None:
    board = np.zeros((120, 160))
    ray = (np.arange(40, 120) - 79.5) / 130.0
    board[20:100, 40:120] = 1.2 / np.maximum(1.0 + ray * np.tan(np.radians(slope)), 1e-3)
    board[board > 1.8] = 0.0
    (whole,) = seeds(_came(board), 19)
    assert len(whole.points) > 0.9 * np.count_nonzero(board) - 300


def test_rows_crowd_where_much_is_under_way(clip: Clip) -> None:
    pictures = Pictures.of(clip.recording, clip.cameras)
    rows = informative_rows(origins(pictures), 10)
    assert rows[0] == 0
    assert rows[-1] == len(pictures.frames) - 1
    under_way = ((rows >= 5) & (rows <= 20)).sum()
    assert under_way >= 6
