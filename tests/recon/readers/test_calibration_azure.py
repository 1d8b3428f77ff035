"""Calibration from real pictures: 8 of the 30 of an Azure Kinect that its makers publish with their own
result."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest

from recon.readers.calibration.board import read_board
from recon.readers.calibration.calibrate import calibrate
from recon.readers.calibration.camera import calibrate_camera
from recon.readers.calibration.file import read_calibration
from recon.readers.calibration.lens_fit import Model, fit_lens, pose_of, rms
from recon.readers.calibration.pictures import Pictures, find_boards
from twin.geometry import rotation_angle

pytestmark = pytest.mark.slow
_FOUND: list[Pictures] = []  # the boards of the eight pictures, which take seconds to find


@pytest.fixture
def folder(funtwin_data: Path) -> Path:
    return funtwin_data / "samples" / "azure_kinect_charuco"


@pytest.fixture
def azure(folder: Path) -> Pictures:
    if not _FOUND:
        paths = sorted((folder / "calibration").glob("*.jpg"), key=lambda p: int(p.stem.split("-")[1]))
        _FOUND.append(find_boards(paths, read_board(folder / "plane.json"), "colour pictures"))
    return _FOUND[0]


def test_azure_kinect_lens(azure: Pictures, folder: Path) -> None:
    """Of 8 of the 30 pictures that its makers' calibration is from."""
    theirs = read_calibration(folder / "calib.yml").color
    assert theirs is not None
    result = calibrate_camera("colour", azure)
    found = result.lens.camera
    assert result.model == "k1 to k6"
    assert abs(found.fx / theirs.camera.fx - 1) < 1e-3
    assert abs(found.fy / theirs.camera.fy - 1) < 1e-3
    assert abs(found.cx - theirs.camera.cx) < 2.0
    assert abs(found.cy - theirs.camera.cy) < 2.0


def test_azure_kinect_left_out(azure: Pictures, folder: Path) -> None:
    """Two pictures that the lens was not fitted to fit it nearly as well as their makers' lens, in most of
    the 28 pairs.

    With eight coefficients, which all eight pictures bear; of six pictures alone some bear but five.
    """
    theirs = read_calibration(folder / "calib.yml").color
    assert theirs is not None
    bent, points, views = np.array(theirs.distortion), azure.board.points, azure.usable
    ratios = []
    for pair in combinations(range(len(views)), 2):
        fit = fit_lens([v for k, v in enumerate(views) if k not in pair], points, azure.size, Model(8, False))
        own = rms([pose_of(views[k], points, fit.matrix, fit.distortion)[2] for k in pair])
        ratios.append(own / rms([pose_of(views[k], points, theirs.camera.matrix, bent)[2] for k in pair]))
    assert np.median(ratios) < 1.1
    assert np.mean(np.array(ratios) <= 1.1) > 0.75


def test_azure_kinect_pose(folder: Path) -> None:
    """One pair of a colour and an infrared picture; the device's drawing has the cameras 32 mm and 6 degrees
    apart."""
    known = replace(
        read_calibration(folder / "registration" / "calib_color.yml"),
        depth=read_calibration(folder / "registration" / "calib_ir.yml").color,
    )
    pair = folder / "registration"
    board = read_board(folder / "plane.json")
    found = calibrate([pair / "color-0.jpg"], board, depth=[pair / "ir-0.png"], known=known).pose
    assert found is not None
    assert found.rms < 0.4
    assert np.abs(found.T_color_depth[:3, 3] - [-0.032, -0.002, 0.004]).max() < 2e-3
    assert np.rad2deg(rotation_angle(found.T_color_depth[:3, :3])) < 7.0
