"""The hand's tracks by colour, in a rendered recording with known labels."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from recon.interaction.parts.hand_tracks import HandTracks, _smooth_log_odds
from recon.readers import open_recording
from recon.tracking.tracks import Tracks
from tests.makers.recon import tiny
from twin.scene import HAND_LABEL, Trajectory

FRAMES = 30


@pytest.fixture(scope="module")
def door(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tiny.write_recording(tmp_path_factory.mktemp("hand") / "door", ("door",), frames=FRAMES)
    for picture in (folder / "color").iterdir():  # everything is grey there: give the hand the colour of skin
        color = tiny.read_image(picture)
        hand = tiny.read_image(folder / "truth" / "labels" / f"{picture.stem}.png") == HAND_LABEL
        color[hand] = color[hand] // 4 + np.array([80, 110, 160], dtype=np.uint8)
        cv2.imwrite(str(picture), color)
    return folder


LABELS = (HAND_LABEL, 2, 1)


def _tracks(folder: Path) -> Tracks:
    """One track that stays on the hand, one on the door, one on the wall, wherever a label image shows
    them."""
    visible = np.zeros((FRAMES, len(LABELS)), dtype=bool)
    pixels = np.full((FRAMES, len(LABELS), 2), np.nan)
    rng = np.random.default_rng(0)
    for i in range(FRAMES):
        label = tiny.read_image(folder / "truth" / "labels" / f"{i:06d}.png")
        for k, wanted in enumerate(LABELS):
            y, x = np.nonzero(label == wanted)
            if len(x) > 10:
                pick = rng.integers(len(x))
                visible[i, k], pixels[i, k] = True, (x[pick], y[pick])
    points = np.where(visible[..., None], 1.0, np.nan) * np.ones(3)
    return Tracks(points, pixels, visible)


def test_hand_tracks_are_found_and_others_are_not(door: Path) -> None:
    recording = open_recording(door)
    cameras = Trajectory(np.arange(FRAMES), recording.times, tiny.cameras(FRAMES))
    tracks = _tracks(door)
    assert tracks.visible[::3].sum(axis=0).min() >= 3
    # the hand is in view while the door rests only just before and after the motion
    on_hand = HandTracks(recording, cameras, tracks).of([(0, 9), (20, FRAMES - 1)])
    assert on_hand.tolist() == [True, False, False]


def test_no_hand_in_view_means_no_hand_tracks(door: Path) -> None:
    recording = open_recording(door)
    cameras = Trajectory(np.arange(FRAMES), recording.times, tiny.cameras(FRAMES))
    tracks = _tracks(door)
    assert not HandTracks(recording, cameras, tracks).of([(0, 4)]).any()


def test_colours_are_blurred_by_one_bin() -> None:
    """A single colour of the hand speaks half as much for the next colour on one axis, and a quarter for that
    on two."""
    hand, rest = np.zeros((8, 8, 8)), np.ones((8, 8, 8))
    hand[3, 4, 2] = 1.0
    odds = np.exp(_smooth_log_odds(hand.ravel(), rest.ravel(), 8)).reshape(8, 8, 8)
    nothing = odds[7, 7, 7]
    speaks = (odds - nothing) / (odds[3, 4, 2] - nothing)
    for at, share in (
        ((3, 4, 3), 0.5),
        ((2, 4, 2), 0.5),
        ((2, 5, 2), 0.25),
        ((2, 5, 1), 0.125),
        ((3, 4, 4), 0.0),
    ):
        assert speaks[at] == pytest.approx(share, abs=1e-9)
