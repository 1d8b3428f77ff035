"""Phone layouts with something wrong: one line that names the file, the value and what to do."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from tests.makers.recon.phone_recording import altered_bytes, opened, phone_recording, written_layouts
from twin.errors import InputError


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    place = tmp_path_factory.mktemp("faults")
    return written_layouts(phone_recording(place / "tiny"), place)


@pytest.fixture
def copied(written: dict[str, Path], tmp_path: Path) -> Callable[[str], Path]:
    return lambda layout: Path(shutil.copytree(written[layout], tmp_path / layout))


def _json(pattern: str, **changes: Any) -> Callable[[Path], None]:
    """Sets keys of the first such file; None takes one out."""

    def change(folder: Path) -> None:
        file = sorted(folder.glob(pattern))[0]
        data = {**json.loads(file.read_text()), **changes}
        file.write_text(json.dumps({k: v for k, v in data.items() if v is not None}))

    return change


def _text(pattern: str, text: str) -> Callable[[Path], None]:
    return lambda folder: sorted(folder.glob(pattern))[0].write_text(text) and None


def _gone(pattern: str) -> Callable[[Path], None]:
    def change(folder: Path) -> None:
        for file in sorted(folder.glob(pattern)):
            file.unlink()

    return change


META = "EXR_RGBD/metadata.json"
CAMERA = "keyframes/corrected_cameras/*.json"
BY_COLUMNS = [1.0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0.5, 1.5, 0.2, 1]
BAD: dict[str, tuple[str, Callable[[Path], None], str]] = {
    "exr: no colour": ("record3d_exr", _gone("EXR_RGBD/rgb/*"), "holds no numbered .jpg"),
    "exr: not json": ("record3d_exr", _text(META, "{"), "is not JSON"),
    "exr: a list": ("record3d_exr", _text(META, "[1]"), "holds a list"),
    "exr: no size": ("record3d_exr", _json(META, w=None), "w is None, not a size"),
    "exr: infinite size": ("record3d_exr", _json(META, h=float("inf")), "h is inf, not a size"),
    "exr: no K": ("record3d_exr", _json(META, K=None), "lacks K"),
    "exr: short K": ("record3d_exr", _json(META, K=[1, 2]), "K is"),
    "exr: another size": ("record3d_exr", _json(META, w=72, h=96), "says 72x96, but the images are 96x72"),
    "exr: few stamps": ("record3d_exr", _json(META, frameTimestamps=[1, 2, 3]), "3 time stamps, but there is a frame 29"),
    "exr: stamps backwards": ("record3d_exr", _json(META, frameTimestamps=[*range(15), *range(15)]), "that of 15 is 0.0 s"),
    "exr: no clock": ("record3d_exr", _json(META, frameTimestamps=None, fps=0), "fps is 0"),
    "exr: ragged poses": ("record3d_exr", _json(META, poses=[[1, 2], [3]]), "poses is no table"),
    "exr: no quaternion": ("record3d_exr", _json(META, poses=[[1, 1, 0, 0, 0, 0, 0]] * 30), "of length 1.41"),
    "exr: depth is text": ("record3d_exr", _text("EXR_RGBD/depth/0.exr", "depth"), r"0\.exr is no readable EXR"),
    "exr: depth is empty": ("record3d_exr", _text("EXR_RGBD/depth/0.exr", ""), r"0\.exr is"),
    "polycam: no depth": ("polycam", _gone("keyframes/depth/*"), "30 corrected_images, 30 corrected_cameras and 0 depth images"),
    "polycam: key": ("polycam", _json(CAMERA, t_12=None), "lacks t_12"),
    "polycam: word": ("polycam", _json(CAMERA, fx="80"), "fx is 80, not a number"),
    "polycam: nan": ("polycam", _json(CAMERA, t_00=float("nan")), "t_00 is nan"),
    "polycam: size": ("polycam", _json(CAMERA, width=10**8), "100000000x72 pixels"),
    "polycam: pose": ("polycam", _json(CAMERA, t_00=3.0), "no rigid motion"),
    "polycam: not json": ("polycam", _text(CAMERA, "\x00"), "is not JSON"),
    "polycam: 8-bit": ("polycam", lambda f: _eight(f, "keyframes/depth/*.png"), "8-bit"),
    "scanner: no depth": ("scanner_app", _gone("depth_*.png"), r"holds no depth_\*\.png"),
    "scanner: no time": ("scanner_app", _json("frame_*.json", time=None), "time is missing, not 1 numbers"),
    "scanner: time": ("scanner_app", _json("frame_*.json", time=1e9), "time stamps must strictly increase"),
    "scanner: short pose": ("scanner_app", _json("frame_*.json", cameraPoseARFrame=[1, 2]), r"cameraPoseARFrame is \[1, 2\]"),
    "scanner: by columns": ("scanner_app", _json("frame_*.json", cameraPoseARFrame=BY_COLUMNS), "cameraPoseARFrame is column by column"),
    "scanner: K by columns": ("scanner_app", _json("frame_*.json", intrinsics=[80, 0, 0, 0, 80, 0, 47.5, 35.5, 1]), "intrinsics are column by column"),
    "scanner: K of words": ("scanner_app", _json("frame_*.json", intrinsics=list("abcdefghi")), "intrinsics is"),
    "scanner: picture": ("scanner_app", _text("frame_*.jpg", "picture"), "not a readable image"),
    "scenes: no colour": ("arkit_scenes", _gone("lowres_wide/*"), "holds no .png file: nothing"),
    "scenes: no cameras": ("arkit_scenes", _gone("lowres_wide_intrinsics/*"), "holds no .pincam file"),
    "scenes: camera": ("arkit_scenes", _text("lowres_wide_intrinsics/*", "96 72 80 80 47.5"), "has 5 numbers, not 6"),
    "scenes: sizes": ("arkit_scenes", _text("lowres_wide_intrinsics/*", "192 144 160 160 95 71"), "pixels"),
    "scenes: pose": ("arkit_scenes", _text("*.traj", "1 2 3"), "has 3 numbers, not 7"),
    "scenes: degrees": ("arkit_scenes", _text("*.traj", "8123.267 90 0 0 0 0 0"), "turns by 90 rad"),
    "scenes: name": ("arkit_scenes", lambda f: (f / "lowres_depth" / "a.png").write_text("") and None, "no time in its name"),
    "scenes: twice": ("arkit_scenes", lambda f: shutil.copy(next((f / "lowres_depth").iterdir()), f / "lowres_depth" / "x_8123.267.png") and None, "of one time"),
    "scenes: clocks": ("arkit_scenes", lambda f: _later(f / "lowres_depth"), "0 of 30 colour pictures"),
}  # fmt: skip


def _eight(folder: Path, pattern: str) -> None:
    cv2.imwrite(str(sorted(folder.glob(pattern))[0]), np.full((72, 96), 200, np.uint8))


def _later(folder: Path) -> None:
    for file in sorted(folder.iterdir()):
        file.rename(folder / f"x_{float(file.stem.split('_')[-1]) + 100:.3f}.png")


@pytest.mark.parametrize("case", BAD)
def test_what_is_wrong_is_said_in_one_line(copied: Callable[[str], Path], case: str) -> None:
    layout, change, message = BAD[case]
    folder = copied(layout)
    change(folder)
    with pytest.raises(InputError, match=message) as caught:
        opened(layout, folder).frame(0)
    assert "\n" not in str(caught.value)
    assert len(str(caught.value).replace(str(folder), "PATH")) < 400


@pytest.mark.parametrize(
    ("layout", "pattern"),
    [
        ("record3d_exr", META),
        ("record3d_exr", "EXR_RGBD/depth/0.exr"),
        ("record3d_exr", "EXR_RGBD/rgb/0.jpg"),
        ("polycam", CAMERA),
        ("polycam", "keyframes/depth/*.png"),
        ("scanner_app", "frame_*.json"),
        ("scanner_app", "conf_*.png"),
        ("arkit_scenes", "lowres_wide.traj"),
        ("arkit_scenes", "lowres_wide_intrinsics/*"),
        ("arkit_scenes", "lowres_wide/*"),
    ],
)
def test_altered_bytes_are_read_or_refused(
    copied: Callable[[str], Path], layout: str, pattern: str, capfd: pytest.CaptureFixture[str]
) -> None:
    folder = copied(layout)
    refused = 0
    for _ in altered_bytes(sorted(folder.glob(pattern))[0], 40):
        try:
            opened(layout, folder).frame(0)
        except InputError:
            refused += 1
    assert refused
    assert capfd.readouterr().out == ""  # what a library prints would mix with a command's own output
