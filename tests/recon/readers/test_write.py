"""Writing recordings: what comes back is what was there, and an interrupted one leaves nothing."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from recon.readers import open_recording
from recon.recording import Intrinsics, Recording
from recon.recording.write import FINER, write_recording
from tests.makers.recon.tiny import cameras, read_image
from tests.makers.recon.tiny import write_recording as write_tiny
from twin import geometry as geo
from twin.errors import InputError
from twin.geometry import Array
from twin.scene import Trajectory

FRAMES = 12


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Recording:
    """A tiny native recording with times of many digits, gravity, and the poses of some of its frames."""
    folder = write_tiny(tmp_path_factory.mktemp("tiny") / "source", frames=FRAMES)
    opened = open_recording(folder)
    times = 1.7e9 + np.arange(FRAMES) / 30.0 + np.random.default_rng(1).uniform(0, 0.01, FRAMES)
    frames = np.arange(FRAMES)
    poses = Trajectory(frames, times, cameras(FRAMES))
    gravity = geo.unit(np.array([0.1, 0.9, 0.3]))
    camera = Intrinsics(96, 72, 80.123456789012345, 79.9, 47.5 + 1e-13, 35.4999)
    return replace(
        opened,
        times=times,
        poses=poses,
        gravity_camera0=gravity,
        intrinsics=camera,
        metadata={"description": "a door"},
    )


def from_depth(recording: Recording, change: object) -> Recording:
    """The recording with other depth: change(index, depth) -> depth."""
    return replace(recording, read_depth=lambda k: change(k, recording.read_depth(k)).astype(np.float32))  # type: ignore[operator]


def test_native_comes_back_bit_by_bit(recording: Recording, tmp_path: Path) -> None:
    written = write_recording(recording, tmp_path / "out")
    assert (written.frames, written.warnings) == (FRAMES, recording.warnings)
    again = open_recording(written.path)
    assert np.array_equal(again.times, recording.times)
    assert again.intrinsics == recording.intrinsics
    assert again.metadata["description"] == "a door"
    assert "depth_scale" not in json.loads((tmp_path / "out" / "intrinsic.json").read_text())
    for k in range(FRAMES):
        assert np.array_equal(again.color(k), recording.color(k))
        assert np.array_equal(again.depth(k), recording.depth(k))
    assert again.poses is not None
    assert recording.poses is not None
    assert np.array_equal(again.poses.frames, recording.poses.frames)
    assert np.allclose(again.poses.T_world_cam, recording.poses.T_world_cam, rtol=0, atol=1e-14)
    assert again.gravity_camera0 is not None
    assert recording.gravity_camera0 is not None
    assert np.allclose(again.gravity_camera0, recording.gravity_camera0, rtol=0, atol=1e-15)


def test_tum_comes_back(recording: Recording, tmp_path: Path) -> None:
    written = write_recording(recording, tmp_path / "out", "tum")
    again = open_recording(written.path)
    assert np.array_equal(again.times, recording.times)
    assert again.intrinsics == recording.intrinsics
    assert any("gravity" in w for w in written.warnings)
    for k in range(FRAMES):
        assert np.array_equal(again.color(k), recording.color(k))
        assert np.abs(again.depth(k) - recording.depth(k)).max() < 1e-4
    assert again.poses is not None
    assert np.allclose(again.poses.T_world_cam, cameras(FRAMES), rtol=0, atol=1e-14)


@pytest.mark.parametrize(("far", "bound"), [(3.0, 0.05e-3), (9.0, 0.1e-3), (20.0, 0.25e-3), (60.0, 0.5e-3)])
def test_depth_between_millimetres_is_rounded_least(
    recording: Recording, tmp_path: Path, far: float, bound: float
) -> None:
    def change(k: int, depth: Array) -> Array:
        """Whole mm at first, so that images are written again; far depth in the last image."""
        between = depth + 0.00023 * (k >= 2) * (depth > 0)
        return np.where((np.arange(depth.shape[1]) < 3) & (k == FRAMES - 1), far, between)

    source = from_depth(recording, change)
    again = open_recording(write_recording(source, tmp_path / "out").path)
    worst = max(float(np.abs(again.depth(k) - source.depth(k)).max()) for k in range(FRAMES))
    assert worst <= bound + 4e-6  # float32 at 60 m
    told = json.loads((tmp_path / "out" / "intrinsic.json").read_text()).get("depth_scale", 1000.0)
    assert told == FINER[[0.05e-3, 0.1e-3, 0.25e-3, 0.5e-3].index(bound)]


def test_depth_beyond_the_layout_is_counted(recording: Recording, tmp_path: Path) -> None:
    def change(k: int, depth: Array) -> Array:
        return np.where((np.arange(depth.shape[1]) < 2) & (k == 3), 14.0, depth)

    written = write_recording(from_depth(recording, change), tmp_path / "out", "tum")
    assert any("144 depth values are beyond 13.1 m" in w for w in written.warnings)
    assert not open_recording(written.path).depth(3)[:, :2].any()


def test_frames_without_depth_are_left_out(recording: Recording, tmp_path: Path) -> None:
    written = write_recording(from_depth(recording, lambda k, d: d * (k not in (0, 5))), tmp_path / "out")
    assert written.frames == FRAMES - 2
    assert any("2 of 12 frames hold no depth" in w for w in written.warnings)
    again = open_recording(written.path)
    kept = [k for k in range(FRAMES) if k not in (0, 5)]
    assert np.array_equal(again.times, recording.times[kept])
    assert np.array_equal(again.depth(5), recording.depth(7))
    assert np.array_equal(again.color(0), recording.color(1))
    assert again.poses is not None
    assert recording.poses is not None
    assert again.gravity_camera0 is not None
    assert np.allclose(again.poses.T_world_cam, recording.poses.T_world_cam[kept], rtol=0, atol=1e-14)
    assert recording.gravity_camera0 is not None
    down = recording.poses.T_world_cam[0, :3, :3] @ recording.gravity_camera0
    assert np.allclose(again.poses.T_world_cam[0, :3, :3] @ again.gravity_camera0, down, atol=1e-12)
    lost = write_recording(
        replace(from_depth(recording, lambda k, d: d * (k != 0)), poses=None), tmp_path / "lost"
    )
    assert any("gravity is told in the axes of a frame that is left out" in w for w in lost.warnings)
    with pytest.raises(InputError, match="9 of 12 frames have depth, 10 are needed"):
        write_recording(from_depth(recording, lambda k, d: d * (k > 2)), tmp_path / "few")
    assert not (tmp_path / "few").exists()


def test_an_interrupted_one_leaves_nothing(recording: Recording, tmp_path: Path) -> None:
    def broken(k: int) -> NDArray[np.uint8]:
        if k == 7:
            raise KeyboardInterrupt
        return recording.read_color(k)

    with pytest.raises(KeyboardInterrupt):
        write_recording(replace(recording, read_color=broken), tmp_path / "out")
    assert list(tmp_path.iterdir()) == []


def test_nothing_is_overwritten(recording: Recording, tmp_path: Path) -> None:
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "mine.txt").write_text("mine")
    (tmp_path / "file").write_text("mine")
    for name in ("full", "file"):
        with pytest.raises(InputError, match="exists and is not an empty folder"):
            write_recording(recording, tmp_path / name)
    assert [p.name for p in (tmp_path / "full").iterdir()] == ["mine.txt"]
    (tmp_path / "empty").mkdir()
    assert write_recording(recording, tmp_path / "empty").frames == FRAMES
    with pytest.raises(InputError, match="unknown layout 'ply'"):
        write_recording(recording, tmp_path / "new", "ply")  # type: ignore[arg-type]
    with pytest.raises(InputError, match="can't write the folder"):
        write_recording(recording, tmp_path / "file" / "below")


def test_the_files_are_those_of_the_layouts(recording: Recording, tmp_path: Path) -> None:
    native = write_recording(recording, tmp_path / "native").path
    assert sorted(p.name for p in native.iterdir()) == [
        "color", "depth", "intrinsic.json", "metadata.json", "timestamps.txt", "trajectory.txt",
    ]  # fmt: skip
    assert read_image(native / "depth" / "000003.png").dtype == np.uint16
    tum = write_recording(recording, tmp_path / "tum", "tum").path
    assert sorted(p.name for p in tum.iterdir()) == [
        "depth", "depth.txt", "groundtruth.txt", "intrinsic.json", "rgb", "rgb.txt",
    ]  # fmt: skip
    counts, metres = read_image(tum / "depth" / "000003.png"), recording.depth(3)
    assert np.array_equal(counts, np.rint(metres.astype(np.float64) * 5000))
