"""Landscape pictures of Record3D 1.10.1 and newer whose poses are those of the portrait picture: turned back,
by what moves."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.layouts.phones import write_r3d, write_record3d_exr
from recon.evaluation.read_truth import load_truth
from recon.readers import open_recording
from recon.readers.turned import quarter_turn
from recon.recording import Recording
from twin.files.assets import asset
from twin.geometry import exp_so3, make_pose


@pytest.fixture(scope="module")
def known() -> Recording:
    """Every third frame of the shipped recording with its true poses."""
    folder = asset("recordings/cabinet_drawer")
    cameras = load_truth(folder / "truth").cameras
    assert cameras is not None
    return replace(open_recording(folder), poses=cameras)[::3]


def turned(recording: Recording, quarters: int) -> Recording:
    assert recording.poses is not None
    turn = make_pose(exp_so3([0.0, 0.0, -quarters * np.pi / 2]))
    return replace(recording, poses=replace(recording.poses, T_world_cam=recording.poses.T_world_cam @ turn))


@pytest.mark.parametrize("write", [write_r3d, write_record3d_exr])
@pytest.mark.parametrize("quarters", [1, 3])
def test_turned_poses_are_turned_back_and_told(
    known: Recording, tmp_path: Path, write: Callable[[Recording, Path], Path], quarters: int
) -> None:
    right = open_recording(write(known, tmp_path / "right.r3d"))
    found = open_recording(write(turned(known, quarters), tmp_path / "turned.r3d"))
    assert right.warnings == ()
    (said,) = found.warnings
    assert f"poses turned by {90 if quarters == 1 else -90}°" in said
    assert "Record3D 1.10.1" in said
    assert found.poses is not None
    assert right.poses is not None
    np.testing.assert_allclose(found.poses.T_world_cam, right.poses.T_world_cam, atol=1e-5)
    np.testing.assert_allclose(found.gravity_camera0, right.gravity_camera0, atol=1e-5)


def test_a_camera_that_hardly_moves_does_not_tell_and_that_is_said(known: Recording, tmp_path: Path) -> None:
    color, depth = known.frame(0)
    assert known.poses is not None
    poses = replace(known.poses, T_world_cam=np.tile(known.poses.T_world_cam[0], (len(known), 1, 1)))
    still = replace(known, poses=poses, read_color=lambda _: color, read_depth=lambda _: depth)
    (said,) = open_recording(write_r3d(still, tmp_path / "still.r3d")).warnings
    assert "can't be told, the camera moves too little" in said


def test_poses_that_are_of_no_turn_are_left_alone(known: Recording) -> None:
    """Those of another recording fit by no quarter turn."""
    assert known.poses is not None
    T = known.poses.T_world_cam[::-1]
    assert quarter_turn(known.times, T, known.intrinsics, known.frame) is None
