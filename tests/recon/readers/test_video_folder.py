"""Folders of a video with depth beside it."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

import recon
from benchmarks.layouts.phones import write_video_folder
from benchmarks.layouts.videos import write_video
from recon.readers import open_recording
from recon.readers.streams import recording_of
from recon.readers.video_folder import VideoFolderReader
from recon.recording import Recording
from tests.makers.recon.phone_recording import HOLE, phone_recording, refused, same_pictures
from tests.makers.recon.tiny import FRAMES, write_intrinsics, write_poses, write_recording
from twin.errors import InputError


@pytest.fixture(scope="module")
def original(tmp_path_factory: pytest.TempPathFactory) -> recon.Recording:
    return phone_recording(tmp_path_factory.mktemp("videos") / "tiny")


def opened(folder: Path) -> Recording:
    assert VideoFolderReader().recognises(folder)
    return recording_of(VideoFolderReader().streams(folder))


@pytest.fixture
def folder(original: recon.Recording, tmp_path: Path) -> Path:
    return write_video_folder(original, tmp_path / "clip")


@pytest.mark.parametrize("suffix", [".mp4", ".mov", ".mkv"])
def test_it_comes_back(original: recon.Recording, tmp_path: Path, suffix: str) -> None:
    found = opened(write_video_folder(original, tmp_path / "clip", suffix))
    assert len(found) == FRAMES
    assert found.warnings == ()
    assert found.poses is None
    assert found.intrinsics == original.intrinsics
    np.testing.assert_allclose(found.times - found.times[0], original.times - original.times[0], atol=6e-4)
    same_pictures(found, original)
    np.testing.assert_allclose(found.depth(7), original.depth(7), atol=6e-4)
    assert not found.depth(7)[HOLE].any()


def test_times_and_poses_beside_it(original: recon.Recording, folder: Path) -> None:
    (folder / "timestamps.txt").write_text("".join(f"{t:.6f}\n" for t in original.times))
    assert original.poses is not None
    write_poses(folder / "trajectory.txt", original.times, original.poses.T_world_cam)
    found = opened(folder)
    np.testing.assert_allclose(found.times, original.times, atol=1e-6)
    assert found.poses is not None
    np.testing.assert_allclose(found.poses.T_world_cam, original.poses.T_world_cam, atol=1e-9)
    assert found.gravity_camera0 is None  # whether that world is upright is not told


def test_depth_of_a_camera_of_its_own(original: recon.Recording, folder: Path) -> None:
    """Depth of the middle of the picture, seen by a camera with the same focal length."""
    for k in range(FRAMES):
        millimetres = np.rint(original.depth(k)[18:54, 24:72] * 1000).astype(np.uint16)
        cv2.imwrite(str(folder / "depth" / f"{k:06d}.png"), millimetres)
    with pytest.raises(InputError, match=r"depth/ is 48x36, intrinsic.json says 96x72; add depth_intrinsic"):
        opened(folder)
    write_intrinsics(folder / "depth_intrinsic.json", 48, 36, 80.0)
    depth, expected = opened(folder).depth(4), original.depth(4)
    middle = np.s_[20:52, 26:70]
    both = (depth[middle] > 0) & (expected[middle] > 0)
    assert both.mean() > 0.8
    assert np.median(np.abs(depth[middle] - expected[middle])[both]) < 1e-3
    assert not depth[:16].any()
    assert not depth[:, :22].any()


@pytest.mark.parametrize("frames", [29, 31])
def test_one_frame_more_or_less_is_left_out(original: recon.Recording, folder: Path, frames: int) -> None:
    write_video(original, folder / "clip.mp4", frames=frames)
    found = opened(folder)
    assert len(found) == min(frames, FRAMES)
    assert f"clip.mp4 holds {frames} frames, depth/ 30 images" in found.warnings[0]
    same_pictures(found, original, {0: 0, 28: 28})


def _removed(*names: str) -> Callable[[Path], None]:
    def change(folder: Path) -> None:
        for name in names:
            (folder / name).unlink()

    return change


def _camera(width: int, height: int) -> Callable[[Path], None]:
    return lambda folder: write_intrinsics(folder / "intrinsic.json", width, height, 80.0)


BAD: dict[str, tuple[Callable[[Path], object], str]] = {
    "two videos": (lambda f: shutil.copy(f / "clip.mp4", f / "other.mov"), r"holds 2 videos: clip\.mp4, other\.mov"),
    "no camera": (_removed("intrinsic.json"), "has no intrinsic.json; it holds"),
    "no depth": (lambda f: [p.unlink() for p in (f / "depth").iterdir()], "holds no PNG"),
    "two depth images short": (_removed("depth/000003.png", "depth/000004.png"), r"clip\.mp4 holds 30 frames, depth/ 28 images"),
    "camera of the turned video": (_camera(72, 96), "is 96x72, intrinsic.json says 72x96.*a flag that turns them"),
    "camera of another size": (_camera(192, 144), "clip.mp4 is 96x72, intrinsic.json says 192x144"),
    "few times": (lambda f: (f / "timestamps.txt").write_text("1\n2\n"), "has 2 times for 30 frames"),
    "times backwards": (lambda f: (f / "timestamps.txt").write_text("".join(f"{9 - k}\n" for k in range(30))), "must strictly increase"),
    "words": (lambda f: (f / "timestamps.txt").write_text("one\n" * 30), "line 1 is not numbers"),
    "no video": (lambda f: (f / "clip.mp4").write_text("hello hello hello"), "is no MP4"),
    "8-bit depth": (lambda f: cv2.imwrite(str(f / "depth" / "000000.png"), np.full((72, 96), 9, np.uint8)), "8-bit"),
}  # fmt: skip


@pytest.mark.parametrize("case", BAD)
def test_what_is_wrong_is_said_in_one_line(folder: Path, case: str) -> None:
    change, message = BAD[case]
    change(folder)
    refused(lambda: opened(folder).frame(0), folder, message)


def test_what_is_no_video_folder(folder: Path) -> None:
    reader = VideoFolderReader()
    assert not reader.recognises(folder / "clip.mp4")  # colour alone
    (folder / "color").mkdir()
    assert not reader.recognises(folder)
    (folder / "color").rmdir()
    (folder / "clip.mp4").unlink()
    assert not reader.recognises(folder)


def test_the_recording_depends_on_all_its_files(original: recon.Recording, folder: Path) -> None:
    first = opened(folder).fingerprint
    file = folder / "depth" / "000009.png"
    cv2.imwrite(str(file), np.full((72, 96), 1500, np.uint16))
    second = opened(folder).fingerprint
    write_video(replace(original, read_color=lambda k: original.color(k // 2)), folder / "clip.mp4")
    assert len({first, second, opened(folder).fingerprint}) == 3


def test_the_unit_of_depth_in_intrinsic_json_is_used(tmp_path: Path) -> None:
    original = open_recording(write_recording(tmp_path / "native"))
    folder = write_video_folder(original, tmp_path / "clip")
    usual = open_recording(folder).depth(3)
    described = json.loads((folder / "intrinsic.json").read_text())
    (folder / "intrinsic.json").write_text(json.dumps(described | {"depth_scale": 4000.0}))
    np.testing.assert_allclose(open_recording(folder).depth(3), usual / 4, rtol=1e-6)
