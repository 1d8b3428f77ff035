"""Bad recordings give one line that names the file, the value and the remedy."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from recon.readers import open_recording
from tests.makers.recon.tiny import (
    FRAMES,
    HEIGHT,
    WIDTH,
    cameras,
    read_image,
    write_intrinsics,
    write_poses,
    write_recording,
)
from twin.cli.main import run
from twin.errors import InputError
from twin.storage import load

Damage = Callable[[Path], object]


@pytest.fixture(scope="module")
def original(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_recording(tmp_path_factory.mktemp("bad") / "clip")


def depth_as(convert: Callable[[NDArray[Any]], NDArray[Any]], suffix: str = ".png") -> Damage:
    """Rewrite all depth images."""

    def damage(folder: Path) -> None:
        for file in sorted((folder / "depth").iterdir()):
            image = read_image(file)
            file.unlink()
            cv2.imwrite(str(file.with_suffix(suffix)), convert(image))

    return damage


def cut(file: str, share: float = 0.6) -> Damage:
    def damage(folder: Path) -> None:
        data = (folder / file).read_bytes()
        (folder / file).write_bytes(data[: int(len(data) * share)])

    return damage


def float_depth_named_png(folder: Path) -> None:
    depth_as(lambda d: (d / 1000).astype(np.float32), ".tiff")(folder)
    for file in (folder / "depth").iterdir():
        file.rename(file.with_suffix(".png"))


def remove(*names: str) -> Damage:
    def damage(folder: Path) -> None:
        for n in names:
            (folder / n).unlink()

    return damage


def only_three_frames(folder: Path) -> None:
    for name in ("color", "depth"):
        for file in sorted((folder / name).iterdir())[3:]:
            file.unlink()
    (folder / "timestamps.txt").write_text("5.0\n5.1\n5.2\n")


def nan_pose(folder: Path) -> None:
    T = cameras(FRAMES)
    T[7, 0, 3] = np.nan
    write_poses(folder / "trajectory.txt", 5.0 + np.arange(FRAMES) / 15, T)


def zero_quaternion(folder: Path) -> None:
    (folder / "trajectory.txt").write_text("5.0 0 0 0 0 0 0 0\n")


def other_clock(folder: Path) -> None:
    write_poses(folder / "trajectory.txt", 900.0 + np.arange(FRAMES) / 15, cameras(FRAMES))


def missing_pair_without_clock(folder: Path) -> None:
    remove("color/000009.jpg", "depth/000009.png", "timestamps.txt")(folder)


def stamps(*lines: str) -> Damage:
    return lambda folder: (folder / "timestamps.txt").write_text("\n".join(lines) + "\n")


def repeated_stamp(folder: Path) -> None:
    times = 5.0 + np.arange(FRAMES) / 15
    times[11] = times[10]
    stamps(*(f"{t:.6f}" for t in times))(folder)


def intrinsics(**values: object) -> Damage:
    def damage(folder: Path) -> None:
        data = json.loads((folder / "intrinsic.json").read_text())
        (folder / "intrinsic.json").write_text(json.dumps({**data, **values}))

    return damage


def color_is_text(folder: Path) -> None:
    (folder / "color" / "000004.jpg").write_text("not an image")
    (folder / "color" / "000000.jpg").write_text("not an image")


def empty_color(folder: Path) -> None:
    for file in (folder / "color").iterdir():
        file.unlink()


CASES: dict[str, tuple[Damage, tuple[str, ...]]] = {
    "depth frame missing": (remove("depth/000012.png"), ("30 colour and 29 depth", "depth/000012 is missing", "exactly one")),
    "colour frame missing": (remove("color/000012.jpg"), ("29 colour and 30 depth", "color/000012 is missing")),
    "different frames missing": (remove("color/000012.jpg", "depth/000013.png"), ("29 colour and 29", "color/000012")),
    "gap without a clock": (missing_pair_without_clock, ("000008.jpg is followed by 000010.jpg", "jumps by 2", "timestamps.txt")),
    "8-bit depth": (depth_as(lambda d: (d // 16).astype(np.uint8)), ("depth/000000.png", "8-bit", "16-bit PNG")),
    "3-channel depth": (depth_as(lambda d: cv2.cvtColor(d, cv2.COLOR_GRAY2BGR)), ("depth/000000.png", "3 channels")),
    "float depth": (depth_as(lambda d: (d / 1000).astype(np.float32), ".tiff"), ("depth/000000.tiff", "metres", "multiply by 1000")),
    "float depth named png": (float_depth_named_png, ("depth/000000.png is a float image (float32)", "16-bit PNG")),
    "depth in whole metres": (depth_as(lambda d: d // 1000), ("depth/000000.png", "no value above", "metres")),
    "intrinsics of another size": (intrinsics(width=640, height=480), ("000000.jpg is 96x72", "640x480", "intrinsics of the images")),
    "principal point outside": (intrinsics(width=40), ("intrinsic.json", "lies outside the 40x72")),
    "row-major intrinsics": (intrinsics(intrinsic_matrix=[80, 0, 47.5, 0, 80, 35.5, 0, 0, 1]), ("intrinsic.json", "row-major", "column by column")),
    "negative focal length": (intrinsics(intrinsic_matrix=[-80, 0, 0, 0, 80, 0, 47.5, 35.5, 1]), ("intrinsic.json", "-80")),
    "no intrinsics": (remove("intrinsic.json"), ("no intrinsic.json", "it holds color/", "intrinsic_matrix")),
    "garbled intrinsics": (lambda f: (f / "intrinsic.json").write_text("{fx: 80"), ("intrinsic.json is not JSON",)),
    "depth of another size": (depth_as(lambda d: d[::2, ::2]), ("depth/000000.png is 48x36", "depth_intrinsic.json")),
    "truncated JPEG": (cut("color/000017.jpg"), ("color/000017.jpg is truncated", "copy the recording again")),
    "truncated PNG": (cut("depth/000021.png"), ("depth/000021.png is truncated",)),
    "empty file": (cut("color/000003.jpg", 0.0), ("color/000003.jpg is empty (0 bytes)",)),
    "colour is no image": (color_is_text, ("color/000000.jpg is not a readable image (12 bytes)",)),
    "NaN pose": (nan_pose, ("trajectory.txt line 8", "nan", "leave out")),
    "no rotation in a pose": (zero_quaternion, ("trajectory.txt pose 1", "length 0", "qx qy qz qw")),
    "poses of another clock": (other_clock, ("trajectory.txt runs from 900.000", "the frames from 5.000", "clock")),
    "clip of 3 frames": (only_three_frames, ("at least 10 frames, got 3", "record the part at rest")),
    "too few time stamps": (stamps("5.0", "5.1"), ("timestamps.txt has 2 times for 30 frames",)),
    "time stands still": (repeated_stamp, ("strictly increase", "frame 11", "timestamps.txt")),
    "NaN time": (stamps("5.0", "nan"), ("timestamps.txt line 2", "nan")),
    "time is text": (stamps("5.0", "noon"), ("timestamps.txt line 2", "noon")),
    "gravity is no direction": (lambda f: (f / "metadata.json").write_text('{"gravity_camera0": [0, 9.81, 0]}'), ("metadata.json", "9.81", "unit vector")),
    "colour folder empty": (empty_color, ("color holds no JPEG or PNG",)),
    "no depth folder": (lambda f: shutil.rmtree(f / "depth"), ("no folder depth/", "16-bit PNG")),
    "no colour folder": (lambda f: shutil.rmtree(f / "color"), ("no folder color/", "it holds depth/")),
}  # fmt: skip


@pytest.mark.parametrize("case", CASES)
def test_one_line_names_file_value_and_remedy(case: str, original: Path, tmp_path: Path) -> None:
    damage, told = CASES[case]
    folder = Path(shutil.copytree(original, tmp_path / "clip"))
    damage(folder)
    with pytest.raises(InputError) as caught:
        open_recording(folder)
    message = str(caught.value)
    assert "\n" not in message
    assert len(message) < 400
    assert caught.value.remedy
    for words in told:
        assert words in message


def test_damage_after_opening_is_told_when_the_frame_is_read(original: Path, tmp_path: Path) -> None:
    folder = Path(shutil.copytree(original, tmp_path / "clip"))
    recording = open_recording(folder)
    cut("color/000017.jpg")(folder)
    cut("depth/000018.png")(folder)
    cv2.imwrite(str(folder / "depth" / "000019.png"), np.zeros((HEIGHT, WIDTH), np.uint16))
    for frame, told in (
        (17, "000017.jpg is truncated"),
        (18, "000018.png is truncated"),
    ):
        with pytest.raises(InputError, match=told.replace(".", r"\.")):
            recording.frame(frame)
    assert recording.frame(16).depth.max() > 0
    assert recording.frame(19).depth.max() == 0  # a covered lens


def test_a_lens_may_be_covered_for_a_while_but_not_throughout(original: Path, tmp_path: Path) -> None:
    folder = Path(shutil.copytree(original, tmp_path / "clip"))
    dark = np.zeros((HEIGHT, WIDTH), np.uint16)
    cv2.imwrite(str(folder / "depth" / "000000.png"), dark)
    assert not open_recording(folder).frame(0).depth.any()
    for file in (folder / "depth").iterdir():
        cv2.imwrite(str(file), dark)
    with pytest.raises(InputError, match="holds no depth: all pixels of its first, middle and last frame"):
        open_recording(folder)


def test_a_missing_pair_with_a_clock_is_fine(original: Path, tmp_path: Path) -> None:
    folder = Path(shutil.copytree(original, tmp_path / "clip"))
    remove("color/000009.jpg", "depth/000009.png")(folder)
    lines = (folder / "timestamps.txt").read_text().split()
    stamps(*lines[:9], *lines[10:])(folder)
    assert len(open_recording(folder)) == FRAMES - 1


def test_depth_intrinsics_of_another_size_are_named(original: Path, tmp_path: Path) -> None:
    folder = Path(shutil.copytree(original, tmp_path / "clip"))
    write_intrinsics(folder / "depth_intrinsic.json", 64, 48, 60.0)
    with pytest.raises(InputError, match=r"000000\.png is 96x72, depth_intrinsic\.json says 64x48"):
        open_recording(folder)


def told_by_the_command(capsys: pytest.CaptureFixture[str], *argv: object) -> str:
    """The error line of a command that has to fail with exit code 1."""
    capsys.readouterr()
    assert run([str(a) for a in argv]) == 1
    streams = capsys.readouterr()
    lines = [line for line in (streams.out + streams.err).splitlines() if line.startswith("twin: ")]
    assert len(lines) == 1
    assert "Traceback" not in streams.err
    return lines[0]


def test_where_nothing_moves_the_scene_is_written(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    still = write_recording(tmp_path / "still", still=True)
    assert run(["reconstruct", str(still), "-o", str(tmp_path / "run")]) == 2
    streams = capsys.readouterr()
    told = "verdict: refused: nothing articulated was found; nothing moved; record a part being opened"
    assert streams.out.startswith(told)
    assert [line for line in streams.err.splitlines() if line.startswith(f"twin: {told}")] != []
    twin = load(tmp_path / "run")
    assert twin.parts == ()
    assert twin.verdict is not None
    assert [r.type for r in twin.verdict.reasons] == ["NothingArticulated"]
    assert len(twin.static.mesh.faces) > 100
    assert set(np.unique(np.concatenate([twin.labels[f] for f in twin.labels]))) <= {0, 1, 255}


def test_the_command_tells_bad_files_in_one_line(
    original: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = Path(shutil.copytree(original, tmp_path / "clip"))
    cut("depth/000021.png")(folder)
    line = told_by_the_command(capsys, "reconstruct", folder, "-o", tmp_path / "run")
    assert "depth/000021.png is truncated" in line
    assert "no recording layout 'tun'" in told_by_the_command(
        capsys, "reconstruct", original, "-o", tmp_path / "run", "--layout", "tun"
    )


def test_an_output_that_cannot_be_written_is_named(
    original: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "file").write_text("a file, not a folder")
    line = told_by_the_command(capsys, "reconstruct", original, "-o", tmp_path / "file" / "run")
    assert "file/run can't be written" in line
    assert "another folder" in line
    assert (tmp_path / "file").read_text() == "a file, not a folder"
