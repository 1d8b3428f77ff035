"""A path that holds sees one room from every side, whatever stands before what; one that does not sees
two."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from recon.verdict.camera_drift import camera_drift
from recon.verdict.of_parts import CAMERAS
from recon.verdict.posed import PosedTwin
from tests.makers.recon.cabinets import make_clip
from tests.makers.recon.tiny import box, merged
from twin.scene import Trajectory


def beside_a_panel(first: float, second: float) -> PosedTwin:
    """Six frames from `first` m to the right of a panel that stands square to a wall, then six from `second`,
    both looking at the wall."""
    clip = make_clip("door")
    wall, panel = box((0.0, 3.05, 1.0), (8.0, 0.1, 4.0)), box((0.0, 1.9, 1.0), (0.04, 2.2, 4.0))
    poses = np.tile(np.eye(4), (12, 1, 1))
    poses[:, :3, :3] = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])  # looks along y
    poses[:, 2, 3] = 1.0
    poses[:6, 0, 3], poses[6:, 0, 3] = first, second
    cameras = Trajectory(np.arange(12), np.arange(12) / 15.0, poses)
    true = PosedTwin(clip.recording, cameras, merged(wall, panel), ())
    step = true.step

    def depth(frame: int) -> np.ndarray:
        return np.kron(true.expected(frame).depth, np.ones((step, step), np.float32))

    shape = clip.recording.depth(0).shape
    recording = replace(clip.recording, read_depth=lambda f: depth(f)[: shape[0], : shape[1]])
    return PosedTwin(recording, cameras, true.static, ())


def test_what_stands_before_the_wall_is_no_other_place_of_it() -> None:
    """From its left the panel hides all that is seen from its right."""
    assert camera_drift(beside_a_panel(0.5, -0.5))[2] < 0.005


@pytest.mark.parametrize("off", [0.04, 0.1, 0.4])
def test_a_path_that_is_off_is_told_whatever_stands_before_the_wall(off: float) -> None:
    twin = beside_a_panel(0.5, 0.2)
    poses = twin.cameras.T_world_cam.copy()
    poses[6:, 1, 3] -= off
    first, second, apart = camera_drift(replace(twin, cameras=replace(twin.cameras, T_world_cam=poses)))
    assert first < 6 <= second
    assert (
        CAMERAS < apart < 1.2 * off
    )  # the panel slides along itself and agrees, up to a third of the picture
