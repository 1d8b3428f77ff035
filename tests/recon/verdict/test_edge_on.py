"""A door seen edge-on: a pixel of outline is a large share of the few that show it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from recon.interaction.parts.moving_part import MovingPart
from recon.recording import Intrinsics, Recording
from recon.verdict.lost_labels import least_labelled
from recon.verdict.of_video import LABELLED
from recon.verdict.posed import PosedTwin
from tests.makers.recon.tiny import box
from twin.scene import STATIC_LABEL, Motion, Prismatic, Trajectory

FRAMES, FAR = 10, 2.0
CAMERA = Intrinsics(160, 120, 160.0, 160.0, 79.5, 59.5)
PIXEL = 1.0 / CAMERA.fx  # m at 1 m


def strip(width: int, shift: int) -> tuple[PosedTwin, MovingPart, dict[int, np.ndarray]]:
    """An upright strip so many pixels wide that slides aside before a wall, and labels that are some pixels
    beside it."""
    mesh = box((0.0, 0.0, 1.0), (width * PIXEL, 60 * PIXEL, 1e-3))
    wall = box((0.0, 0.0, FAR), (8.0, 8.0, 1e-3))
    frames, times = np.arange(FRAMES), np.arange(FRAMES) / 15.0
    state = np.where(frames < FRAMES // 2, 0.0, 30 * PIXEL)
    part = MovingPart(2, Prismatic(np.array([1.0, 0.0, 0.0])), Motion(frames, times, state))
    cameras = Trajectory(frames, times, np.tile(np.eye(4), (FRAMES, 1, 1)))
    nothing = np.zeros((120, 160, 3), np.uint8)
    blank = Recording("strip", "memory", times, CAMERA, lambda _: nothing, lambda _: nothing[..., 0], "0")
    twin = PosedTwin(blank, cameras, wall, ((part, mesh),))
    shown = {f: twin.expected(f) for f in range(FRAMES)}
    twin = replace(twin, recording=replace(blank, read_depth=lambda f: shown[f].depth))
    labels = {f: np.where(e.owner == 2, 2, STATIC_LABEL).astype(np.uint8) for f, e in shown.items()}
    return twin, part, {f: np.roll(image, shift, axis=1) for f, image in labels.items()}


def least(width: int, shift: int) -> float:
    told = least_labelled(*strip(width, shift))
    assert told is not None
    return told[1]


def test_a_pixel_of_outline_is_no_other_place_for_a_door_that_is_seen_edge_on() -> None:
    """Six pixels wide, and labelled one pixel beside: five of seven agree."""
    assert least(6, 1) == 1.0


@pytest.mark.parametrize(("width", "shift"), [(6, 2), (6, 3), (14, 2), (14, 3)])
def test_labels_farther_away_are_elsewhere(width: int, shift: int) -> None:
    """Two pixels are more than an outline, and what is ten pixels wide shows where it is."""
    assert least(width, shift) < LABELLED


def test_a_narrow_piece_is_compared_as_it_is_where_the_labels_agree() -> None:
    assert least(6, 0) == 1.0
    assert least(14, 0) == 1.0
