"""What `open_recording` is told beside the path: a part of the recording, cameras, topics; and that a run
remembers it."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from benchmarks.layouts.ros import write_ros1
from recon.readers import open_recording
from recon.readers.fingerprint import BLOCKS, fingerprint, fingerprint_of
from recon.verdict.assemble import say_where
from tests.makers.recon.tiny import HEIGHT, WIDTH, write_recording
from twin.cli.main import run
from twin.errors import InputError
from twin.runs.manifest import opened_with, update_manifest


@pytest.fixture
def clip(tmp_path: Path) -> Path:
    return write_recording(tmp_path / "clip")


def calibration(folder: Path, fx: float = 88.0, **more: object) -> Path:
    file = folder / "calibration.json"
    color = {
        "width": WIDTH,
        "height": HEIGHT,
        "intrinsic_matrix": [fx, 0, 0, 0, fx, 0, 47.5, 35.5, 1],
        "distortion": [],
    }
    file.write_text(json.dumps({"format": "funtwin-calibration/1", "color": color, **more}))
    return file


def test_a_part_of_a_recording(clip: Path) -> None:
    whole = open_recording(clip)
    since = whole.times - whole.times[0]
    part = open_recording(clip, start=0.4, end=1.3)
    kept = np.flatnonzero((since >= 0.4 - 1e-6) & (since <= 1.3 + 1e-6))
    assert part.times.tolist() == whole.times[kept].tolist()
    np.testing.assert_array_equal(part.depth(0), whole.depth(int(kept[0])))
    np.testing.assert_array_equal(part.color(len(part) - 1), whole.color(int(kept[-1])))
    assert part.fingerprint != whole.fingerprint
    assert part.path == clip
    assert open_recording(clip, end=float(since[-1])).times.tolist() == whole.times.tolist()
    assert open_recording(clip, start=0.4, end=1.3).fingerprint == part.fingerprint


@pytest.mark.parametrize(("start", "end"), [(1.0, 0.5), (90.0, None), (None, 0.0), (float("nan"), 1.0)])
def test_times_outside_are_told(clip: Path, start: float | None, end: float | None) -> None:
    with pytest.raises(InputError, match=r"is no part of .*clip, which lasts 1\.933 s"):
        open_recording(clip, start=start, end=end)


def test_too_short_a_part_is_told(clip: Path) -> None:
    with pytest.raises(InputError, match="at least 10 frames"):
        open_recording(clip, start=0.4, end=0.6)


def test_a_calibration_goes_before_the_recordings_own_camera(clip: Path, tmp_path: Path) -> None:
    own = open_recording(clip)
    file = calibration(tmp_path, depth_scale=1.02)
    found = open_recording(clip, calibration=file)
    assert found.intrinsics.fx == 88.0
    np.testing.assert_allclose(found.depth(3), own.depth(3) * 1.02, rtol=1e-6)
    np.testing.assert_array_equal(found.color(3), own.color(3))
    assert found.fingerprint != own.fingerprint
    other = calibration(tmp_path, 90.0)
    assert open_recording(clip, calibration=other).fingerprint != found.fingerprint


def test_topics_are_of_bags(clip: Path, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="--depth-topic: topics are of ROS bags"):
        open_recording(clip, depth_topic="/depth")
    bag = write_ros1(open_recording(clip), tmp_path / "a.bag")
    opened = open_recording(bag)
    named = open_recording(bag, color_topic=opened.metadata["color_topic"])
    assert named.fingerprint == opened.fingerprint
    assert named.opened_with == {"color_topic": opened.metadata["color_topic"]}
    with pytest.raises(InputError, match="/nothing"):
        open_recording(bag, depth_topic="/nothing")


def test_a_run_remembers_what_its_recording_was_opened_with(clip: Path, tmp_path: Path) -> None:
    file = calibration(tmp_path)
    opened = open_recording(clip, "native", calibration=file, start=0.2)
    out = tmp_path / "deep" / "run"
    out.mkdir(parents=True)
    update_manifest(out, note="a run")
    say_where(opened, out)
    told = opened_with(out)
    assert told["start"] == 0.2
    assert told["layout"] == "native"
    assert open_recording(clip, **told).fingerprint == opened.fingerprint
    # both folders moved together
    moved = tmp_path / "elsewhere"
    moved.mkdir()
    for name in ("clip", "calibration.json", "deep"):
        (tmp_path / name).rename(moved / name)
    again = open_recording(moved / "clip", **opened_with(moved / "deep" / "run"))
    assert again.fingerprint == opened.fingerprint
    say_where(open_recording(moved / "clip"), moved / "deep" / "run")
    assert opened_with(moved / "deep" / "run") == {}


def test_options_of_the_command_line(clip: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "out"
    argv = ["convert", str(clip), "-o", str(out), "--calibration", str(calibration(tmp_path)), "--end", "1", "--json"]  # fmt: skip
    assert run(argv) == 0
    assert json.loads(capsys.readouterr().out)["frames"] == 16
    assert open_recording(out).intrinsics.fx == 88.0
    assert run(argv) == 1
    assert "is not an empty folder" in capsys.readouterr().err
    assert run(["inspect", str(clip), "--start", "-1"]) == 1
    assert "is no time" in capsys.readouterr().err


def test_large_recordings_are_told_apart_by_samples(
    clip: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Names, sizes and blocks from the first to the last byte count, wherever the folder lies."""
    files = sorted(p for p in clip.rglob("*") if p.is_file() and "truth" not in p.parts)
    monkeypatch.setattr("recon.readers.fingerprint.WHOLE_BYTES", 1000)
    monkeypatch.setattr("recon.readers.fingerprint.BLOCK_BYTES", 256)
    one = fingerprint(clip, files)
    moved = clip.rename(tmp_path / "moved")
    files = [moved / p.relative_to(clip) for p in files]
    assert fingerprint(moved, files) == one
    for victim in (files[0], files[-1]):
        data = victim.read_bytes()
        victim.write_bytes(
            bytes([data[0] ^ 1]) + data[1:] if victim == files[0] else data[:-1] + bytes([data[-1] ^ 1])
        )
        assert fingerprint(moved, files) != one
        victim.write_bytes(data + b" ")
        assert fingerprint(moved, files) != one
        victim.write_bytes(data)
    assert fingerprint(moved, files) == one
    big = tmp_path / "big.bin"
    big.write_bytes(np.random.default_rng(0).bytes(BLOCKS * 1000))
    first = fingerprint_of(big)
    assert fingerprint_of(big.rename(tmp_path / "renamed.bin")) == first
