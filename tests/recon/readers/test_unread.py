"""Recordings that are recognised but not read say in one line what they are and what to do."""

from __future__ import annotations

import json
import shlex
import sqlite3
import struct
import tarfile
import zipfile
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest

from recon.readers import READERS, UNREAD, open_recording
from recon.readers.unread import READ
from tests.makers.recon.tiny import FRAMES, read_image, write_recording
from tests.recon.readers.test_record3d import write_r3d
from twin.cli.main import run
from twin.errors import InputError

ROOT = Path(__file__).parents[3]


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


# name of the file or folder, how it is made, what it is, words of the remedy
CASES: dict[str, tuple[str, Callable[[Path], None], str, str]] = {
    "rtabmap": ("map.db", database(*(f"CREATE TABLE {t} (id INTEGER)" for t in ("Node", "Data", "Link"))), "an RTAB-Map database", "rtabmap-export --images --output_dir FOLDER {path}"),
    "mkv": ("a.mkv", written(b"\x1aE\xdf\xa3" + bytes(500)), "a video, colour without depth", "depth camera"),
    "mp4": ("a.mp4", written(b"\0\0\0\x18ftypmp42" + bytes(500)), "a video, colour without depth", "intrinsic.json into one folder"),
    "avi": ("a.avi", written(b"RIFF\0\0\0\0AVI LIST" + bytes(500)), "a video, colour without depth", "depth camera"),
    "zed": ("a.svo", written(bytes(100)), "a ZED recording", "svo_export.py --mode 4 --input_svo_file {path}"),
    "zed mcap": ("a.svo2", written(b"\x89MCAP0\r\n" + bytes(100)), "a ZED recording", "svo_export.py"),
    "openni": ("a.oni", written(b"NI10" + bytes(100)), "an OpenNI recording", "pyonitool.py --extractcolor"),
    "klg": ("a.klg", written(struct.pack("<i", 100) + bytes(100)), "a Kintinuous/ElasticFusion log", "klg2png {path} color depth"),
    "aria": ("a.vrs", written(bytes(100)), "no depth camera", "Record3D"),
    "hololens": ("a.bin", written(b"HL2SSV23" + bytes(100)), "a HoloLens 2 stream", "recon.Recording.from_arrays"),
    "zip": ("a.zip", zipped, "an archive", "unzip {path} -d FOLDER"),
    "tar.gz": ("a.tar.gz", tarred, "an archive", "tar -xf {path}"),
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


@pytest.mark.parametrize(
    "suffix", [*READ, *(s for k in UNREAD.values() if k.has is not None for s in k.suffixes)]
)
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
    for name in READERS:
        assert f"| `{name}` |" in page


def test_the_command_says_it_in_one_line_with_exit_1(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    name, write, what, _ = CASES["euroc"]
    write(tmp_path / name)
    assert run(["reconstruct", str(tmp_path / name), "-o", str(tmp_path / "run")]) == 1
    streams = capsys.readouterr()
    lines = [line for line in (streams.out + streams.err).splitlines() if line.startswith("twin: ")]
    assert len(lines) == 1
    assert what in lines[0]
    assert "put the colour images there" not in lines[0]
    assert "Traceback" not in streams.err


def test_a_folder_that_holds_one_says_which(tmp_path: Path) -> None:
    written(b"NI10" + bytes(9))(tmp_path / "log.bin")
    (tmp_path / "notes.txt").write_text("hello")
    assert "but holds log.bin, an OpenNI recording" in refusal(tmp_path).problem
    clip = write_recording(tmp_path / "more" / "clip")
    error = refusal(tmp_path / "more")
    assert "but holds clip (native)" in error.problem
    assert error.remedy == f"give {clip}"


def test_commands_hold_the_path_as_a_shell_takes_it(tmp_path: Path) -> None:
    place = tmp_path / "my o'clips"
    place.mkdir()
    CASES["rtabmap"][1](place / "a b.db")
    assert f"FOLDER {shlex.quote(str(place / 'a b.db'))}`" in refusal(place / "a b.db").remedy


def test_a_recording_that_may_not_be_read_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    clip = write_recording(tmp_path / "clip")
    monkeypatch.setattr("os.access", lambda path, _: Path(path) != clip)
    with pytest.raises(InputError, match="clip can't be read; change its permissions"):
        open_recording(clip)


def test_looking_at_a_database_changes_nothing(tmp_path: Path) -> None:
    CASES["rtabmap"][1](tmp_path / "a.db")
    before = (tmp_path / "a.db").read_bytes()
    refusal(tmp_path / "a.db")
    assert [p.name for p in tmp_path.iterdir()] == ["a.db"]
    assert (tmp_path / "a.db").read_bytes() == before


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
