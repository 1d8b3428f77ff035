"""Corners that are followed: over a step of exposure, and pictures made equally bright."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from recon.recording import Intrinsics, Recording
from recon.tracking.follow import equally_bright, follow, followed

CAMERA = Intrinsics(200, 150, 180.0, 180.0, 99.5, 74.5)


def panned(gains: list[float]) -> Recording:
    """A camera that pans over a plain pattern, 3 px a frame; each frame with its exposure."""
    rng = np.random.default_rng(0)
    wide = cv2.GaussianBlur(rng.normal(0.0, 1.0, (150, 200 + 3 * len(gains))), (0, 0), 2.5)
    wide = 130.0 + 14.0 * wide / wide.std()
    color = [
        np.repeat(np.clip(g * wide[:, 3 * k : 3 * k + 200], 0, 255)[..., None], 3, axis=2).astype(np.uint8)
        for k, g in enumerate(gains)
    ]
    depth = np.ones((len(gains), 150, 200), np.float32)
    return Recording.from_arrays(np.stack(color), depth, CAMERA, fps=15)


@pytest.mark.parametrize("gain", [1.0, 1.3, 0.75])
def test_corners_survive_a_step_of_exposure(gain: float) -> None:
    """Twelve frames, of which the sixth and those after are brighter or darker: as many go on as without."""
    seen = follow(panned([1.0] * 5 + [gain] * 7)).seen
    assert seen[5] > 0.8 * seen[4]


def test_without_equal_brightness_a_step_of_exposure_loses_most_corners() -> None:
    recording = panned([1.0, 1.3] + [1.0] * 10)
    before, after = (cv2.cvtColor(recording.color(k), cv2.COLOR_RGB2GRAY) for k in (0, 1))
    corners = cv2.goodFeaturesToTrack(before, 300, 0.01, 6)[:, 0]
    _, lost = followed(before, after, corners)
    _, kept = followed(*equally_bright(before, after), corners)
    assert lost.mean() < 0.5 < 0.8 < kept.mean()


@pytest.mark.parametrize(("first", "second"), [(100, 130), (130, 100), (90, 90)])
def test_the_brighter_picture_is_darkened(first: int, second: int) -> None:
    pictures = [np.full((4, 5), level, np.uint8) for level in (first, second)]
    before, after = equally_bright(*pictures)
    darker = min(first, second)
    assert set(np.unique(before)) == set(np.unique(after)) == {darker}
    black = np.zeros((4, 5), np.uint8)
    assert (equally_bright(black, pictures[1])[0] == 0).all()
