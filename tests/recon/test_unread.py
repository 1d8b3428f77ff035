"""Recordings that are recognised but not read say in one line what they are and what to do."""

from __future__ import annotations

import json
import shlex
import shutil
import sqlite3
import struct
import tarfile
import zipfile
from collections.abc import Callable
from pathlib import Path

import av
import cv2
import numpy as np
import pytest

from benchmarks import stray_scanner
from recon.readers import READERS, UNREAD, open_recording
from tests.recon.test_record3d import write_r3d
from tests.recon.tiny import FRAMES, read_image, write_recording
from twin.cli.main import run
from twin.errors import InputError

ROOT = Path(__file__).parents[2]


def written(data: bytes) -> Callable[[Path], None]:
    return lambda path: path.write_bytes(data) and None


def database(*statements: str) -> Callable[[Path], None]:
    def write(path: Path) -> None:
        base = sqlite3.connect(path)
        for statement in statements:
            base.execute(statement)
        base.commit()
        base.close()

    return write


def folder(*names: str, text: str = "") -> Callable[[Path], None]:
    def write(path: Path) -> None:
        for name in names:
            (path / name).parent.mkdir(parents=True, exist_ok=True)
            (path / name).write_text(text)

    return write


def zipped(path: Path) -> None:
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("clip/color/000000.jpg", "x")


def tarred(path: Path) -> None:
    with tarfile.open(path, "w:gz") as archive:
        archive.add(Path(__file__), "clip/readme.py")


ROS2 = ("CREATE TABLE topics (id INTEGER, name TEXT)", "CREATE TABLE messages (id INTEGER)")
SENS = struct.pack("<IQ", 4, 15) + b"StructureSensor" + bytes(200)
# name of the file or folder, how it is made, what it is, words of the remedy
CASES: dict[str, tuple[str, Callable[[Path], None], str, str]] = {
    "realsense_bag": ("a.bag", written(b"#ROSBAG V2.0\n" + bytes(5000) + b"/device_0/sensor_0/Depth_0/image/data"), "a RealSense recording (ROS 1 bag)", "RGBDVideoReader.create('{path}').save_frames"),
    "rosbag": ("a.bag", written(b"#ROSBAG V2.0\n" + bytes(5000) + b"/camera/color/image_raw"), "a ROS 1 bag", "rosbags.highlevel.AnyReader"),
    "realsense_db3": ("a.db3", database(*ROS2, "INSERT INTO topics VALUES (1, '/device_0/sensor_0/Depth_0/image/data')"), "a RealSense recording (ROS 2 bag)", "pyrealsense2"),
    "rosbag2": ("a.db3", database(*ROS2, "INSERT INTO topics VALUES (1, '/camera/depth')"), "a ROS 2 bag", "recon.Recording.from_arrays"),
    "rosbag2 folder": ("bag", folder("metadata.yaml", "bag_0.mcap", text="rosbag2_bagfile_information:\n  version: 5\n"), "a ROS 2 bag", "rosbags"),
    "mcap": ("a.mcap", written(b"\x89MCAP0\r\n" + bytes(100)), "an MCAP log", "rosbags"),
    "rtabmap": ("map.db", database(*(f"CREATE TABLE {t} (id INTEGER)" for t in ("Node", "Data", "Link"))), "an RTAB-Map database", "rtabmap-export --images"),
    "azure_kinect": ("a.mkv", written(b"\x1aE\xdf\xa3" + bytes(500) + b"K4A_DEPTH_MODE"), "an Azure Kinect recording", "azure_kinect_mkv_reader --input {path} --output FOLDER"),
    "mkv": ("a.mkv", written(b"\x1aE\xdf\xa3" + bytes(500)), "a video, colour without depth", "depth camera"),
    "mp4": ("a.mp4", written(b"\0\0\0\x18ftypmp42" + bytes(500)), "a video, colour without depth", "ffmpeg -i {path}"),
    "avi": ("a.avi", written(b"RIFF\0\0\0\0AVI LIST" + bytes(500)), "a video, colour without depth", "depth camera"),
    "zed": ("a.svo", written(bytes(100)), "a ZED recording", "svo_export.py --mode 4 --input_svo_file {path}"),
    "zed mcap": ("a.svo2", written(b"\x89MCAP0\r\n" + bytes(100)), "a ZED recording", "svo_export.py"),
    "openni": ("a.oni", written(b"NI10" + bytes(100)), "an OpenNI recording", "pyonitool.py --extractcolor"),
    "klg": ("a.klg", written(struct.pack("<i", 100) + bytes(100)), "a Kintinuous/ElasticFusion log", "klg2png {path} color depth"),
    "scannet": ("a.sens", written(SENS), "a ScanNet recording", "reader.py --filename {path} --output_path FOLDER"),
    "aria": ("a.vrs", written(bytes(100)), "no depth camera", "Record3D"),
    "zip": ("a.zip", zipped, "an archive", "unzip {path} -d FOLDER"),
    "tar.gz": ("a.tar.gz", tarred, "an archive", "tar -xf {path}"),
    "stray_scanner": ("b7a01f", folder("rgb.mp4", "odometry.csv", "camera_matrix.csv", "depth/000000.png", "confidence/000000.png", "imu.csv"), "a Stray Scanner recording", "benchmarks/stray_scanner.py"),
    "record3d_exr": ("clip", folder("metadata.json", "rgb/0.jpg", "depth/0.exr"), "Record3D's export as EXR and RGB", "as .r3d"),
    "polycam": ("clip", folder("mesh_info.json", "keyframes/images/1.jpg", "keyframes/depth/1.png"), "Polycam's raw data", "Record3D"),
    "scanner_app": ("clip", folder("frame_00000.jpg", "frame_00000.json", "depth_00000.png"), "an export of 3D Scanner App", "intrinsics in frame_*.json"),
    "arkit_scenes": ("47333462", folder("lowres_wide/47333462_1.0.png", "lowres_depth/47333462_1.0.png", "lowres_wide.traj"), "an ARKitScenes sequence", ".pincam"),
    "euroc": ("MH_01", folder("mav0/cam0/data.csv", "mav0/imu0/data.csv"), "an EuRoC sequence", "depth camera"),
}  # fmt: skip


def refusal(path: Path) -> InputError:
    with pytest.raises(InputError) as caught:
        open_recording(path)
    message = str(caught.value)
    assert "\n" not in message
    assert len(message.replace(str(path), "PATH")) < 400
    return caught.value


@pytest.mark.parametrize("case", CASES)
def test_a_format_that_is_not_read_says_what_it_is_and_what_to_do(case: str, tmp_path: Path) -> None:
    name, write, what, remedy = CASES[case]
    path = tmp_path / name
    write(path)
    error = refusal(path)
    assert what in error.problem
    assert error.problem.startswith(f"{path} is ")
    assert error.problem.endswith("which is not read")
    assert remedy.format(path=path) in error.remedy


@pytest.mark.parametrize("case", [c for c, v in CASES.items() if c not in ("zed", "zed mcap", "klg", "aria")])
def test_a_renamed_recording_is_known_by_its_content(case: str, tmp_path: Path) -> None:
    _, write, what, _ = CASES[case]
    path = tmp_path / "IMG_0001.dat"
    write(path)
    assert what in refusal(path).problem


@pytest.mark.parametrize("suffix", [s for k in UNREAD.values() if k.has is not None for s in k.suffixes])
def test_a_name_without_its_content_is_told_apart(suffix: str, tmp_path: Path) -> None:
    path = tmp_path / f"clip{suffix}"
    path.write_bytes(b"hello")
    error = refusal(path)
    assert "is named like" in error.problem
    assert "its 5 bytes do not begin like one" in error.problem


def test_every_format_that_is_not_read_has_a_case_and_a_row_in_the_docs() -> None:
    assert set(UNREAD) - {"video", "archive"} <= set(CASES)
    page = (ROOT / "docs" / "recordings.md").read_text(encoding="utf-8")
    for kind in UNREAD.values():
        for suffix in kind.suffixes[:1]:
            assert f"`{suffix}`" in page


def test_the_command_says_it_in_one_line_with_exit_1(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    name, write, what, _ = CASES["stray_scanner"]
    write(tmp_path / name)
    assert run(["reconstruct", str(tmp_path / name), "-o", str(tmp_path / "run")]) == 1
    streams = capsys.readouterr()
    lines = [line for line in (streams.out + streams.err).splitlines() if line.startswith("twin: ")]
    assert len(lines) == 1
    assert what in lines[0]
    assert "put the colour images there" not in lines[0]
    assert "Traceback" not in streams.err


def test_a_folder_that_holds_one_says_which(tmp_path: Path) -> None:
    written(b"\x89MCAP0\r\n")(tmp_path / "log.bin")
    (tmp_path / "notes.txt").write_text("hello")
    assert "but holds log.bin, an MCAP log" in refusal(tmp_path).problem
    name, write, what, _ = CASES["stray_scanner"]
    write(tmp_path / "more" / name)
    assert f"but holds {name}, {what}" in refusal(tmp_path / "more").problem


def test_commands_hold_the_path_as_a_shell_and_as_python_takes_it(tmp_path: Path) -> None:
    place = tmp_path / "my o'clips"
    place.mkdir()
    CASES["scannet"][1](place / "a b.sens")
    assert (
        f"--filename {shlex.quote(str(place / 'a b.sens'))} --output_path"
        in refusal(place / "a b.sens").remedy
    )
    CASES["realsense_bag"][1](place / "a.bag")
    assert f"create({str(place / 'a.bag')!r})" in refusal(place / "a.bag").remedy


def test_a_recording_that_may_not_be_read_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    clip = write_recording(tmp_path / "clip")
    monkeypatch.setattr("os.access", lambda path, _: Path(path) != clip)
    with pytest.raises(InputError, match="clip can't be read; change its permissions"):
        open_recording(clip)


def test_looking_at_a_bag_changes_nothing(tmp_path: Path) -> None:
    CASES["rosbag2"][1](tmp_path / "a.db3")
    before = (tmp_path / "a.db3").read_bytes()
    refusal(tmp_path / "a.db3")
    assert [p.name for p in tmp_path.iterdir()] == ["a.db3"]
    assert (tmp_path / "a.db3").read_bytes() == before


def test_a_folder_that_was_converted_is_read(tmp_path: Path) -> None:
    clip = write_recording(tmp_path / "clip")
    for name in ("odometry.csv", "rgb.mp4", "camera_matrix.csv"):
        (clip / name).write_text("")
    assert len(open_recording(clip)) == FRAMES


def test_a_renamed_record3d_archive_is_read(tmp_path: Path) -> None:
    path = write_r3d(tmp_path / "clip.r3d")
    expected = open_recording(path)
    found = open_recording(path.rename(tmp_path / "clip.zip"))
    assert found.fingerprint == expected.fingerprint
    assert list(READERS) == ["record3d", "tum", "native"]


def test_what_open3d_unpacks_keeps_its_depth_unit_and_its_clock(tmp_path: Path) -> None:
    """Open3D writes depth as the camera counts it, with depth_scale and fps beside the intrinsics."""
    clip = write_recording(tmp_path / "clip")
    millimetres = open_recording(clip).frame(3).depth
    for file in (clip / "depth").iterdir():
        cv2.imwrite(str(file), read_image(file) * 4)
    data = json.loads((clip / "intrinsic.json").read_text())
    (clip / "intrinsic.json").write_text(json.dumps({**data, "depth_scale": 4000.0, "fps": 30.0}))
    (clip / "timestamps.txt").unlink()
    found = open_recording(clip)
    np.testing.assert_allclose(found.frame(3).depth, millimetres, rtol=1e-6)
    np.testing.assert_allclose(found.times, np.arange(FRAMES) / 30)
    assert "intrinsic.json says 30 frames per second" in found.warnings[0]
    for wrong in (0, -1, "1000", True, None):
        (clip / "intrinsic.json").write_text(json.dumps({**data, "depth_scale": wrong}))
        if wrong is None:
            open_recording(clip)
        else:
            with pytest.raises(InputError, match="depth_scale is"):
                open_recording(clip)


def write_stray(path: Path, frames: int = 12) -> Path:
    """A Stray Scanner folder: 320x240 video that brightens, 64x48 depth, one more picture than depth images."""
    for name in ("depth", "confidence"):
        (path / name).mkdir(parents=True)
    with av.open(str(path / "rgb.mp4"), "w") as video:
        stream = video.add_stream("mpeg4", rate=30)
        stream.width, stream.height, stream.pix_fmt, stream.bit_rate = 320, 240, "yuv420p", 4_000_000
        for k in range(frames + 1):
            picture = av.VideoFrame.from_ndarray(np.full((240, 320, 3), 10 * k, np.uint8), format="rgb24")
            video.mux(stream.encode(picture))
        video.mux(stream.encode())
    rows = ["timestamp, frame, x, y, z, qx, qy, qz, qw"]
    for k in range(frames):
        depth, sure = np.full((48, 64), 1000 + k, np.uint16), np.full((48, 64), 2, np.uint8)
        sure[:, 0] = 0
        cv2.imwrite(str(path / "depth" / f"{k:06d}.png"), depth)
        cv2.imwrite(str(path / "confidence" / f"{k:06d}.png"), sure)
        rows.append(f"{100 + k / 60:.6f}, {k:06d}, 0, 0, 0, 0, 0, 0, 1")
    (path / "odometry.csv").write_text("\n".join(rows) + "\n")
    (path / "camera_matrix.csv").write_text("240.0, 0.0, 159.5\n0.0, 240.0, 119.5\n0.0, 0.0, 1.0\n")
    return path


def test_a_stray_folder_becomes_a_recording_by_the_script(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    stray = write_stray(tmp_path / "b7a01f")
    assert "a Stray Scanner recording" in refusal(stray).problem
    assert stray_scanner.main([str(stray), str(tmp_path / "clip")]) == 0
    recording = open_recording(tmp_path / "clip")
    k = recording.intrinsics
    assert (k.width, k.height, k.fx, k.cx) == (320, 240, 240.0, 159.5)
    np.testing.assert_allclose(recording.times, 100 + np.arange(12) / 60, atol=1e-6)
    frame = recording.frame(7)
    assert abs(int(frame.color[100, 100, 0]) - 70) < 6
    assert frame.depth[100, 100] == pytest.approx(1.007)
    assert np.all(frame.depth[:, :2] == 0)  # confidence 0
    assert stray_scanner.main([str(stray), str(tmp_path / "clip")]) == 1
    assert "exists already" in capsys.readouterr().err
    (stray / "odometry.csv").unlink()
    assert stray_scanner.main([str(stray), str(tmp_path / "other")]) == 1
    assert "has no odometry.csv" in capsys.readouterr().err


def test_real_files_are_recognised(funtwin_data: Path, tmp_path: Path) -> None:
    kinect = funtwin_data / "samples" / "azure_kinect" / "recording.mkv"
    assert "an Azure Kinect recording" in refusal(kinect).problem
    assert (
        "an Azure Kinect recording" in refusal(Path(shutil.copyfile(kinect, tmp_path / "clip.dat"))).problem
    )
    for video in sorted((funtwin_data / "hand_videos").glob("*.avi")):
        assert "a video, colour without depth" in refusal(video).problem
