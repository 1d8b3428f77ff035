"""What the stages of a run found, by names that are public: tracks and labels among them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import recon
from recon.recording import Intrinsics
from recon.tracking.tracks import Tracks
from tests.makers.recon import tiny
from tests.makers.recon.sparse import sparse
from twin.errors import InputError
from twin.runs.stages import Run

CAMERA = Intrinsics(6, 4, 5.0, 5.0, 2.5, 1.5)
TRACKS = sparse(Tracks(np.ones((5, 3, 3)), np.ones((5, 3, 2)), np.ones((5, 3), bool)), CAMERA)
LABELS = {0: np.ones((4, 6), np.uint8), 4: np.full((4, 6), 2, np.uint8)}


@pytest.fixture
def run(tmp_path: Path) -> Path:
    with Run(tmp_path, "f" * 64) as made:
        tracks = made.stage("tracks", 1, None, [], lambda: TRACKS)
        made.stage("labels", 1, None, [tracks], lambda: LABELS)
    return tmp_path


def test_tracks_and_labels_of_a_run_are_read(run: Path) -> None:
    tracks: recon.SparseTracks = recon.read_stage(run, "tracks")
    np.testing.assert_array_equal(tracks.dense().pixels, TRACKS.dense().pixels)
    labels = recon.read_stage(str(run), "labels")
    assert sorted(labels) == [0, 4]
    np.testing.assert_array_equal(labels[4], LABELS[4])


def test_tracks_of_a_recording_are_made_without_a_run(tmp_path: Path) -> None:
    folder = tiny.write_recording(tmp_path / "r", ("door",), frames=12, scale=1, still=True)
    tracks = recon.track_points(recon.open_recording(folder))
    assert tracks.frames == 12
    assert repr(tracks) == f"<SparseTracks: {len(tracks)} in 12 frames, {len(tracks.track)} observations>"
    dense = tracks.dense()
    assert repr(dense).startswith(f"<Tracks: {len(tracks)} in 12 frames, visible in ")


@pytest.mark.parametrize(
    ("name", "told"),
    [
        ("track", "there is no stage 'track'; did you mean 'tracks'? stages: inspect, tracks, cameras"),
        ("verdict", "holds no stage 'verdict'; give the folder of a run"),
    ],
)
def test_what_is_not_there_is_told(name: str, told: str, run: Path) -> None:
    with pytest.raises(InputError, match=told.replace("?", r"\?")):
        recon.read_stage(run, name)
