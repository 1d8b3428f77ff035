"""Hand keypoints: where they land in the picture and in space, and that the real detector is wired in."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np
import pytest

from recon.contact import hand_keypoints as hands
from recon.contact.hand_keypoints import FINGERTIPS, KEYPOINTS, detect_hands
from recon.recording import Intrinsics, Recording
from twin.errors import MissingDependencyError
from twin.scene import HAND_LABEL

CAMERA = Intrinsics(160, 120, 120.0, 120.0, 79.5, 59.5)
SPOT = np.array([100.0, 40.0])  # x, y of the hand in the picture


class SpotDetector:
    """Stands in for the detector: sees a hand whose keypoints all lie on the white spot, when the spot is
    large."""

    def __init__(self, least: int) -> None:
        self.least = least

    def __enter__(self) -> SpotDetector:
        return self

    def __exit__(self, *_: object) -> None:
        return None

    def process(self, color: Any) -> Any:
        y, x = np.nonzero(color[..., 0] > 128)
        if len(x) < self.least:
            return SimpleNamespace(multi_hand_landmarks=None, multi_handedness=None)
        spot = SimpleNamespace(x=(x.mean() + 0.5) / color.shape[1], y=(y.mean() + 0.5) / color.shape[0])
        side = SimpleNamespace(classification=[SimpleNamespace(score=0.9)])
        return SimpleNamespace(
            multi_hand_landmarks=[SimpleNamespace(landmark=[spot] * KEYPOINTS)], multi_handedness=[side]
        )


def spot_recording(depth: float = 0.8, frames: int = 10) -> Recording:
    color = np.zeros((120, 160, 3), np.uint8)
    x, y = SPOT.astype(int)
    color[y - 3 : y + 4, x - 3 : x + 4] = 255
    flat = np.full((120, 160), depth, np.float32)
    return Recording("spot", "memory", np.arange(frames) / 15.0, CAMERA, lambda _: color, lambda _: flat, "0")


def hand_label() -> np.ndarray:
    label = np.ones((120, 160), np.uint8)
    x, y = SPOT.astype(int)
    label[y - 5 : y + 30, x - 8 : x + 9] = HAND_LABEL
    return label


def test_keypoints_are_lifted_by_depth(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(hands, "_detector", lambda: SpotDetector(20))
    found = detect_hands(spot_recording(), [6, 2])
    assert found.frames.tolist() == [2, 6]
    np.testing.assert_allclose(found.pixels, np.broadcast_to(SPOT, (2, KEYPOINTS, 2)), atol=1e-9)
    expected = CAMERA.backproject(SPOT, np.array(0.8))
    np.testing.assert_allclose(found.points_cam, np.broadcast_to(expected, (2, KEYPOINTS, 3)), atol=1e-6)
    assert found.score.tolist() == [0.9, 0.9]


def test_small_hands_are_found_in_a_cut_out_around_their_label(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        hands, "_detector", lambda: SpotDetector(400)
    )  # 49 pixels are too few, magnified they do
    assert len(detect_hands(spot_recording(), [0])) == 0
    found = detect_hands(spot_recording(), [0], {0: hand_label()})
    assert len(found) == 1
    np.testing.assert_allclose(found.pixels[0], np.broadcast_to(SPOT, (KEYPOINTS, 2)), atol=0.3)


def test_a_surface_behind_the_hand_is_no_keypoint(monkeypatch: pytest.MonkeyPatch) -> None:
    pixels = np.tile(SPOT, (KEYPOINTS, 1))
    pixels[FINGERTIPS[1]] += [40, 0]  # this fingertip's pixel shows the wall
    pixels[FINGERTIPS[2]] += [0, 40]  # and this one no depth
    depth = np.full((120, 160), 0.8, np.float32)
    depth[:, 130:] = 2.0
    depth[75:, :] = 0.0
    monkeypatch.setattr(hands, "_detector", lambda: SpotDetector(20))
    monkeypatch.setattr(hands, "_detect", lambda *_: [(pixels, 1.0)])
    color = np.zeros((120, 160, 3), np.uint8)
    recording = Recording("w", "memory", np.arange(10.0), CAMERA, lambda _: color, lambda _: depth, "0")
    points = detect_hands(recording, [0]).points_cam[0]
    lost = [FINGERTIPS[1], FINGERTIPS[2]]
    assert np.isnan(points[lost]).all()
    assert np.isfinite(np.delete(points, lost, axis=0)).all()


@pytest.mark.parametrize(("beyond", "kept"), [(0.09, True), (-0.09, True), (0.16, False), (-0.16, False)])
def test_a_fingertip_may_be_a_hands_length_from_its_middle_in_depth(
    monkeypatch: pytest.MonkeyPatch, beyond: float, kept: bool
) -> None:
    pixels = np.tile(SPOT, (KEYPOINTS, 1))
    pixels[FINGERTIPS[1]] += [40, 0]
    depth = np.full((120, 160), 0.8, np.float32)
    depth[:, 130:] += beyond
    monkeypatch.setattr(hands, "_detector", lambda: SpotDetector(20))
    monkeypatch.setattr(hands, "_detect", lambda *_: [(pixels, 1.0)])
    recording = replace(spot_recording(), read_depth=lambda _: depth)
    points = detect_hands(recording, [0]).points_cam[0]
    assert np.isfinite(points[FINGERTIPS[1]]).all() == kept


def test_missing_package_names_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "mediapipe.python.solutions.hands", None)
    monkeypatch.setitem(sys.modules, "mediapipe", None)
    with pytest.raises(MissingDependencyError, match=r"install the package mediapipe==.*extra `hands`"):
        detect_hands(spot_recording(), [0])


def video(path: Path) -> Recording:
    """A colour video as a recording without depth."""
    reader = cv2.VideoCapture(str(path))
    frames = []
    while (got := reader.read())[0]:
        frames.append(cv2.cvtColor(got[1], cv2.COLOR_BGR2RGB).astype(np.uint8))
    height, width = frames[0].shape[:2]
    camera = Intrinsics(width, height, 525.0, 525.0, width / 2, height / 2)
    blank = np.zeros((height, width), np.float32)
    return Recording(
        path.stem, str(path), np.arange(len(frames)) / 30.0, camera, lambda i: frames[i], lambda _: blank, "0"
    )


@pytest.mark.filterwarnings("ignore::UserWarning", "ignore::DeprecationWarning")
@pytest.mark.parametrize("name", ["cabinet01", "microwave01"])
def test_real_hands_are_found(funtwin_data: Path, name: str) -> None:
    pytest.importorskip("mediapipe", reason="needs the extra hands")
    recording = video(funtwin_data / "hand_videos" / f"{name}.avi")
    n = len(recording)
    frames = np.linspace(0.3 * n, 0.7 * n, 6).astype(int).tolist()
    found = detect_hands(recording, frames)
    assert len(set(found.frames.tolist())) >= 4
    inside = (found.pixels > -40) & (
        found.pixels < [680, 520]
    )  # keypoints may lie a little outside the picture
    assert inside.mean() > 0.95
    # a hand has a length: wrist to middle fingertip spans some dozen pixels
    assert np.linalg.norm(found.pixels[:, 0] - found.pixels[:, 12], axis=1).min() > 20
    assert np.isnan(found.points_cam).all()  # no depth, no points
