"""Stray Scanner folders: axes, clock, lens, confidence, numbers with gaps, and what is refused."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path

import cv2
import numpy as np
import pytest

import recon
from benchmarks.layouts.phones import write_stray
from benchmarks.layouts.videos import FrameClock, write_video
from recon.readers.stray_scanner import StrayScannerReader
from recon.readers.streams import recording_of
from recon.recording import Recording
from tests.makers.recon.phone_recording import (
    HOLE,
    SIZE,
    altered_bytes,
    phone_recording,
    refused,
    same_pictures,
)
from tests.makers.recon.tiny import FRAMES
from twin.errors import InputError

TICK = Fraction(1, 60)  # s, of the app's video


def opened(folder: Path) -> Recording:
    assert StrayScannerReader().recognises(folder)
    return recording_of(StrayScannerReader().streams(folder))


@pytest.fixture(scope="module")
def original(tmp_path_factory: pytest.TempPathFactory) -> recon.Recording:
    return phone_recording(tmp_path_factory.mktemp("stray") / "tiny")


@pytest.fixture(scope="module")
def written(original: recon.Recording, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_stray(original, tmp_path_factory.mktemp("stray") / "b7a01f", SIZE)


@pytest.fixture
def folder(written: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(written, tmp_path / "b7a01f"))


def lines(folder: Path) -> list[str]:
    return (folder / "odometry.csv").read_text().splitlines()


def rewrite(folder: Path, change: Callable[[list[str]], list[str]]) -> None:
    (folder / "odometry.csv").write_text("\n".join(change(lines(folder))) + "\n")


def test_it_comes_back(original: recon.Recording, written: Path) -> None:
    found = opened(written)
    assert len(found) == FRAMES
    assert found.warnings == ()
    assert found.name == "b7a01f"
    np.testing.assert_allclose(found.times, original.times, atol=1e-6)  # uneven, not the video's 60 a second
    assert found.intrinsics == original.intrinsics
    same_pictures(found, original)
    for k in (0, 7, 29):
        np.testing.assert_allclose(found.depth(k), original.depth(k), atol=6e-4)
        assert not found.depth(k)[HOLE].any()  # a guess of low confidence
        assert found.depth(k)[-1].all()  # medium confidence is kept


def test_the_world_is_z_up_and_poses_have_the_cameras_axes(original: recon.Recording, written: Path) -> None:
    found = opened(written)
    assert found.poses is not None
    assert original.poses is not None
    np.testing.assert_allclose(found.poses.T_world_cam, original.poses.T_world_cam, atol=1e-7)
    down = original.poses.T_world_cam[0, :3, :3].T @ [0, 0, -1]
    assert found.gravity_camera0 is not None
    np.testing.assert_allclose(found.gravity_camera0, down, atol=1e-7)


def test_the_imu_is_not_read(folder: Path) -> None:
    expected = opened(folder)
    (folder / "imu.csv").write_text("timestamp, a_x\nnonsense")
    found = opened(folder)
    np.testing.assert_array_equal(found.gravity_camera0, expected.gravity_camera0)
    assert found.fingerprint == expected.fingerprint


def test_depth_of_its_own_size_is_of_the_same_lens(original: recon.Recording, tmp_path: Path) -> None:
    folder = write_stray(original, tmp_path / "small", (48, 36))
    rig = StrayScannerReader().streams(folder).rig
    k = rig.depth.camera
    assert (k.width, k.height, k.fx, k.fy) == (48, 36, 40.0, 40.0)
    assert (k.cx, k.cy) == (23.5, 17.5)  # of 47.5 and 35.5: pixel centres are at integers
    np.testing.assert_array_equal(rig.T_color_depth, np.eye(4))
    depth, expected = opened(folder).depth(3), original.depth(3)
    both = (depth > 0) & (expected > 0)
    assert both.mean() > 0.9
    assert np.median(np.abs(depth - expected)[both]) < 0.004  # m, half a depth pixel of slanted surfaces


def test_columns_of_the_newer_app(original: recon.Recording, tmp_path: Path) -> None:
    folder = write_stray(original, tmp_path / "newer", SIZE, per_frame=True)
    (folder / "camera_matrix.csv").unlink()
    assert opened(folder).intrinsics == original.intrinsics
    rewrite(folder, lambda rows: [rows[0], *(r.replace(", 80.0, 80.0,", ", 80.5, 80.5,") for r in rows[1:])])
    assert opened(folder).intrinsics.fx == 80.5
    rewrite(folder, lambda rows: [*rows[:-3], *(r.replace(", 80.5, 80.5,", ", 83, 83,") for r in rows[-3:])])
    found = opened(folder)
    assert found.intrinsics.fx == 80.5
    assert "change by 3.1% of the focal length" in found.warnings[0]


def test_depth_is_found_by_its_number(original: recon.Recording, tmp_path: Path) -> None:
    folder = write_stray(original, tmp_path / "gaps", SIZE, first=120, without_depth=(3, 4, 20))
    found = opened(folder)
    kept = [k for k in range(FRAMES) if k not in (3, 4, 20)]
    np.testing.assert_allclose(found.times, original.times[kept], atol=1e-6)
    for k, of in ((3, 5), (17, 19), (18, 21)):
        np.testing.assert_allclose(found.depth(k), original.depth(of), atol=6e-4)
    same_pictures(found, original, {3: 5, 17: 19, 18: 21})
    assert "3 of 30 colour images have no depth image in time" in found.warnings[0]


@pytest.mark.parametrize("frames", [29, 31])
def test_the_video_may_hold_a_frame_more_or_less(
    original: recon.Recording, folder: Path, frames: int
) -> None:
    write_video(original, folder / "rgb.mp4", FrameClock(TICK, -1), frames=frames)
    found = opened(folder)
    assert len(found) == min(frames, FRAMES)
    assert f"rgb.mp4 holds {frames} frames, odometry.csv 30" in found.warnings[0]
    same_pictures(found, original)


@pytest.mark.parametrize("frames", [28, 32])
def test_the_video_of_another_recording_is_refused(
    original: recon.Recording, folder: Path, frames: int
) -> None:
    write_video(original, folder / "rgb.mp4", FrameClock(TICK, -1), frames=frames)
    with pytest.raises(InputError, match=f"rgb.mp4 holds {frames} frames, odometry.csv 30"):
        opened(folder)


@pytest.mark.parametrize("start", [-1, 0, 5])
def test_where_the_video_starts_does_not_matter(original: recon.Recording, folder: Path, start: int) -> None:
    write_video(original, folder / "rgb.mp4", FrameClock(TICK, start))
    found = opened(folder)
    assert len(found) == FRAMES
    same_pictures(found, original)


def test_a_flag_that_turns_the_video_is_not_followed(original: recon.Recording, folder: Path) -> None:
    write_video(original, folder / "rgb.mp4", FrameClock(TICK, -1), rotation=-90)
    found = opened(folder)
    assert found.intrinsics == original.intrinsics
    same_pictures(found, original)


def test_a_video_that_was_turned_or_cropped_is_refused(original: recon.Recording, folder: Path) -> None:
    turned = original.color(0).transpose(1, 0, 2)
    pictures = [turned] * FRAMES
    k = recon.Intrinsics(72, 96, 80, 80, 35.5, 47.5)
    upright = Recording.from_arrays(pictures, [np.ones((96, 72), np.float32)] * FRAMES, k, fps=60)
    write_video(upright, folder / "rgb.mp4")
    (folder / "camera_matrix.csv").write_text("80, 0, 35.5\n0, 80, 47.5\n0, 0, 1")
    with pytest.raises(InputError, match="colour is 72x96, depth 96x72: one of them was turned"):
        opened(folder)
    k = recon.Intrinsics(96, 54, 80, 80, 47.5, 26.5)
    low = Recording.from_arrays(
        [original.color(0)[9:-9]] * FRAMES, [np.ones((54, 96), np.float32)] * FRAMES, k, fps=60
    )
    write_video(low, folder / "rgb.mp4")
    (folder / "camera_matrix.csv").write_text("80, 0, 47.5\n0, 80, 26.5\n0, 0, 1")
    with pytest.raises(InputError, match="colour is 96x54, depth 96x72: one of them was cropped"):
        opened(folder)


def test_numbers_of_another_resolution_are_refused(folder: Path) -> None:
    (folder / "camera_matrix.csv").write_text("40, 0, 23.5\n0, 40, 17.5\n0, 0, 1")
    with pytest.raises(InputError, match=r"principal point \(23.5, 17.5\) is far from the middle of 96x72"):
        opened(folder)


def test_without_confidence_all_depth_is_kept(folder: Path) -> None:
    shutil.rmtree(folder / "confidence")
    assert np.all(opened(folder).depth(2)[HOLE] == 3.0)


def _row(k: int, old: str, new: str) -> Callable[[Path], None]:
    def change(folder: Path) -> None:
        rows = lines(folder)
        assert old in rows[k]
        rows[k] = rows[k].replace(old, new, 1)
        (folder / "odometry.csv").write_text("\n".join(rows))

    return change


def _text(name: str, text: str) -> Callable[[Path], None]:
    return lambda folder: (folder / name).write_text(text) and None


def _image(name: str, image: np.ndarray) -> Callable[[Path], None]:
    return lambda folder: cv2.imwrite(str(folder / name), image) and None


BAD: dict[str, tuple[Callable[[Path], object], str]] = {
    "no video": (lambda f: (f / "rgb.mp4").unlink(), r"has no rgb\.mp4; it holds"),
    "no depth": (lambda f: shutil.rmtree(f / "depth"), "has no depth"),
    "no camera": (lambda f: (f / "camera_matrix.csv").unlink(), "neither camera_matrix.csv nor fx"),
    "camera words": (_text("camera_matrix.csv", "a,b,c\n1,2,3\n4,5,6"), "no 3x3 matrix"),
    "camera column by column": (_text("camera_matrix.csv", "80,0,0\n0,80,0\n47.5,35.5,1"), "last row is"),
    "camera infinite": (_text("camera_matrix.csv", "inf,0,47\n0,80,35\n0,0,1"), "no 3x3 matrix"),
    "empty odometry": (_text("odometry.csv", ""), r"odometry\.csv is empty"),
    "header alone": (_text("odometry.csv", "timestamp, frame, x, y, z, qx, qy, qz, qw\n"), "holds no frame"),
    "odometry without times": (_row(0, "timestamp, frame, ", ""), "no column timestamp, frame"),
    "odometry is binary": (lambda f: (f / "odometry.csv").write_bytes(b"\xff\xfe\x00\x01"), "not a text file"),
    "cut line": (lambda f: rewrite(f, lambda r: [*r[:-1], r[-1][:20]]), "line 31 is"),
    "frame is a word": (_row(4, "000003", "three"), "line 5 is"),
    "twice": (_row(4, "000003", "000002"), "frame 2 twice"),
    "quaternion": (lambda f: rewrite(f, lambda r: [*r[:4], r[4].rsplit(",", 1)[0] + ", 7", *r[5:]]), "of length 7"),
    "nan": (lambda f: rewrite(f, lambda r: [*r[:4], r[4].rsplit(",", 1)[0] + ", nan", *r[5:]]), "not finite"),
    "backwards": (lambda f: rewrite(f, lambda r: [r[0], *r[:0:-1]]), "must strictly increase"),
    "numbers of others": (lambda f: rewrite(f, lambda r: [r[0], *(x.replace(", 0000", ", 0900") for x in r[1:])]), "none of odometry"),
    "video is text": (_text("rgb.mp4", "hello, this is text"), r"no MP4, MOV, MKV or AVI video"),
    "video is empty": (lambda f: (f / "rgb.mp4").write_bytes(b""), "begins with b''"),
    "8-bit depth": (_image("depth/000000.png", np.full((72, 96), 200, np.uint8)), "8-bit"),
    "depth of another size": (_image("depth/000000.png", np.full((36, 60), 900, np.uint16)), "colour is 96x72, depth 60x36"),
    "confidence of another size": (_image("confidence/000000.png", np.full((9, 9), 2, np.uint8)), "is 9x9, the first depth image"),
    "confidence in colour": (_image("confidence/000000.png", np.full((72, 96, 3), 2, np.uint8)), "not a one-channel 8-bit"),
    "depth is text": (_text("depth/000000.png", "depth"), "is no PNG"),
}  # fmt: skip


@pytest.mark.parametrize("case", BAD)
def test_what_is_wrong_is_said_in_one_line(folder: Path, case: str) -> None:
    change, message = BAD[case]
    change(folder)
    refused(lambda: opened(folder).frame(0), folder, message)


def test_a_cut_depth_image_is_told_where_it_is_met(folder: Path) -> None:
    file = folder / "depth" / "000009.png"
    recording = opened(folder)
    file.write_bytes(file.read_bytes()[:300])
    recording.depth(8)
    with pytest.raises(InputError, match=r"000009\.png is truncated: 300 bytes"):
        recording.depth(9)


def test_a_converted_folder_is_not_taken(folder: Path) -> None:
    (folder / "color").mkdir()
    assert not StrayScannerReader().recognises(folder)
    assert not StrayScannerReader().recognises(folder / "rgb.mp4")


@pytest.mark.parametrize(
    "name", ["odometry.csv", "camera_matrix.csv", "depth/000000.png", "confidence/000000.png"]
)
def test_altered_bytes_are_read_or_refused(folder: Path, name: str) -> None:
    refused = 0
    for _ in altered_bytes(folder / name, 50):
        try:
            opened(folder).depth(0)
        except InputError:
            refused += 1
    assert refused
