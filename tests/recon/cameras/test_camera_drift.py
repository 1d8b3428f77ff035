"""A path that holds sees one room from every side, whatever stands before what; one that does not sees
two."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from recon.verdict.camera_drift import camera_drift
from recon.verdict.of_parts import CAMERAS, CAMERAS_LOST
from recon.verdict.posed import PosedTwin
from tests.makers.recon.cabinets import make_clip
from tests.makers.recon.tiny import box, merged
from twin.scene import HAND_LABEL, STATIC_LABEL, Trajectory


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


def room(twin: PosedTwin) -> dict[int, np.ndarray]:
    """Labels by which nothing moves."""
    shape = twin.recording.depth(0).shape
    return {f: np.full(shape, STATIC_LABEL, np.uint8) for f in range(12)}


def test_what_stands_before_the_wall_is_no_other_place_of_it() -> None:
    """From its left the panel hides all that is seen from its right."""
    twin = beside_a_panel(0.5, -0.5)
    assert camera_drift(twin, room(twin))[2] < 0.005


def test_an_arm_that_fills_the_common_view_is_no_other_place_of_it() -> None:
    """It is seen through in the other frames, and labelled hand."""
    twin = beside_a_panel(0.5, 0.2)
    read, labels = twin.recording.read_depth, room(twin)

    def depth(frame: int) -> np.ndarray:
        seen = np.asarray(read(frame)).copy()
        if frame == 2:
            seen[:, : int(0.8 * seen.shape[1])] = 0.5
        return seen

    seen = replace(twin, recording=replace(twin.recording, read_depth=depth))
    assert camera_drift(seen, labels)[2] > CAMERAS_LOST
    labels[2] = np.where(depth(2) == 0.5, HAND_LABEL, STATIC_LABEL).astype(np.uint8)
    assert camera_drift(seen, labels)[2] < 0.005


@pytest.mark.parametrize("off", [0.04, 0.1, 0.4])
def test_a_path_that_is_off_is_told_whatever_stands_before_the_wall(off: float) -> None:
    twin = beside_a_panel(0.5, 0.2)
    poses = twin.cameras.T_world_cam.copy()
    poses[6:, 1, 3] -= off
    off_path = replace(twin, cameras=replace(twin.cameras, T_world_cam=poses))
    first, second, apart = camera_drift(off_path, room(twin))
    assert first < 6 <= second
    assert (
        CAMERAS < apart < 1.2 * off
    )  # the panel slides along itself and agrees, up to a third of the picture
