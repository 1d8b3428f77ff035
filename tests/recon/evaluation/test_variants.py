"""Recordings cut or played backwards carry their truth along."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from benchmarks.variants import HAND_SHARE, main, write_variant
from recon.evaluation.read_truth import load_truth
from recon.evaluation.truth import Truth
from recon.readers import open_recording
from tests.makers.recon.tiny import cameras, write_poses, write_recording
from twin.errors import InputError
from twin.scene import HAND_LABEL


@pytest.fixture(scope="module")
def source(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = write_recording(tmp_path_factory.mktemp("variants") / "clip")
    write_poses(folder / "trajectory.txt", 5.0 + np.arange(30) / 15, cameras(30))
    T = cameras(30)[0]
    down = (T[:3, :3].T @ [0, 0, -1.0]).tolist()
    (folder / "metadata.json").write_text(json.dumps({"gravity_camera0": down, "description": "open it"}))
    return folder


def hand_share(truth: Truth, frame: int) -> float:
    return float(np.mean(truth.labels[frame] == HAND_LABEL))


def test_backwards_closes_from_open_and_twice_is_the_original(source: Path, tmp_path: Path) -> None:
    once = write_variant(source, tmp_path / "once", "reversed")
    old, new = load_truth(source), load_truth(once)
    np.testing.assert_array_equal(new.parts[0].states, old.parts[0].states[::-1])
    assert new.parts[0].states[0] > new.parts[0].states[-1] == 0.0
    a, b = old.parts[0].span or (0, 0)
    assert new.parts[0].span == (29 - b, 29 - a)
    np.testing.assert_allclose(new.cameras.T_world_cam, old.cameras.T_world_cam[::-1], atol=1e-8)
    recording, original = open_recording(once), open_recording(source)
    np.testing.assert_array_equal(recording.frame(3).color, original.frame(26).color)
    np.testing.assert_allclose(np.diff(recording.times), 1 / 15, atol=2e-6)
    assert recording.gravity_camera0 is not None
    down = new.cameras.T_world_cam[0, :3, :3] @ recording.gravity_camera0
    np.testing.assert_allclose(down, [0, 0, -1], atol=1e-7)
    assert recording.poses is not None
    np.testing.assert_allclose(recording.poses.T_world_cam, new.cameras.T_world_cam, atol=1e-7)
    twice = load_truth(write_variant(once, tmp_path / "twice", "reversed"))
    assert twice.parts[0].segments == old.parts[0].segments
    assert open_recording(twice.folder.parent).frame(7).depth.tolist() == original.frame(7).depth.tolist()


def test_every_second_frame_halves_the_interval(source: Path, tmp_path: Path) -> None:
    old, new = load_truth(source), load_truth(write_variant(source, tmp_path / "half", "half"))
    assert new.frames == 15
    assert json.loads((new.folder / "truth.json").read_text())["fps"] == pytest.approx(7.5, rel=1e-4)
    (a, b), (c, d) = old.parts[0].segments[0], new.parts[0].segments[0]
    assert old.parts[0].states[2 * c] == 0.0
    assert abs(2 * c - a) <= 1
    assert abs(2 * d - b) <= 1
    np.testing.assert_array_equal(new.labels[5], old.labels[10])
    assert new.parts[0].grip is not None


def test_trimmed_clips_show_the_hand_at_their_ends_and_the_whole_motion(source: Path, tmp_path: Path) -> None:
    old = load_truth(source)
    travel = old.parts[0].travel
    first = load_truth(write_variant(source, tmp_path / "first", "hand-first"))
    last = load_truth(write_variant(source, tmp_path / "last", "hand-last"))
    both = load_truth(write_variant(source, tmp_path / "both", "hand-both"))
    for truth, at_start, at_end in ((first, True, False), (last, False, True), (both, True, True)):
        assert (hand_share(truth, 0) >= HAND_SHARE) == at_start
        assert (hand_share(truth, truth.frames - 1) >= HAND_SHARE) == at_end
        assert truth.parts[0].travel == travel
        assert truth.frames < old.frames


def test_command_line(source: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([str(source), str(tmp_path), "--kind", "half", "hand-first"]) == 0
    assert (tmp_path / "clip_half" / "truth" / "truth.json").is_file()
    assert (tmp_path / "clip_hand_first" / "color" / "000000.jpg").is_file()
    capsys.readouterr()
    assert main([str(source), str(tmp_path), "--kind", "half"]) == 1
    assert "clip_half exists" in capsys.readouterr().err
    with pytest.raises(InputError, match="no kind 'sideways'"):
        write_variant(source, tmp_path / "x", "sideways")
