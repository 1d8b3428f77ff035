"""A folder of pictures without depth is told that colour alone is not enough, and what would help."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest

from recon.readers import open_recording
from tests.makers.recon.tiny import write_intrinsics
from twin.cli.main import run
from twin.errors import InputError

PICTURE = np.full((72, 96, 3), 90, np.uint8)


def pictures(*folders: str, suffix: str = ".jpg") -> Callable[[Path], None]:
    def write(place: Path) -> None:
        for folder in folders:
            (place / folder).mkdir(parents=True, exist_ok=True)
            for k in range(12):
                cv2.imwrite(str(place / folder / f"{k:04d}{suffix}"), PICTURE)

    return write


def with_camera(place: Path) -> None:
    pictures("color")(place)
    write_intrinsics(place / "intrinsic.json", 96, 72, 80.0)


FOLDERS: dict[str, Callable[[Path], None]] = {
    "pictures": pictures("."),
    "png": pictures(".", suffix=".png"),
    "a folder of them": pictures("images"),
    "the native layout without depth": pictures("color"),
    "with its camera": with_camera,
    "two folders": pictures("left", "right"),
}


@pytest.mark.parametrize("case", FOLDERS)
def test_colour_alone_is_not_enough(case: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = tmp_path / "clip"
    folder.mkdir()
    FOLDERS[case](folder)
    with pytest.raises(InputError) as caught:
        open_recording(folder)
    assert "colour alone is not enough" in caught.value.remedy
    assert "depth camera, or on a phone" in caught.value.remedy
    assert "depth/ (16-bit PNG in mm" in caught.value.remedy
    assert run(["reconstruct", str(folder), "-o", str(tmp_path / "run")]) == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(f"twin: {folder} ")
    assert len(line.replace(str(folder), "PATH")) < 400


@pytest.mark.parametrize("depth", ["depth.npy", "0001.exr", "depth/0001.png", "sixteen.png"])
def test_a_folder_that_may_hold_depth_is_not_called_colour_alone(depth: str, tmp_path: Path) -> None:
    pictures("frames")(tmp_path)
    file = tmp_path / depth
    file.parent.mkdir(exist_ok=True)
    if file.suffix == ".png":
        cv2.imwrite(str(file), np.full((72, 96), 900, np.uint16))
    else:
        file.write_bytes(b"depth")
    with pytest.raises(InputError) as caught:
        open_recording(tmp_path)
    assert "pictures without depth" not in str(caught.value)


def test_a_folder_with_a_picture_among_other_files_is_none(tmp_path: Path) -> None:
    cv2.imwrite(str(tmp_path / "overview.png"), PICTURE)
    for name in ("a.md", "b.md", "c.py"):
        (tmp_path / name).write_text("text")
    with pytest.raises(InputError, match="is no recording known here"):
        open_recording(tmp_path)
