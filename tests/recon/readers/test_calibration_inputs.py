"""Input that can't calibrate: pictures, depth maps and boards that are wrong, and pictures that don't belong
together."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from benchmarks.layouts.boards import SMALL_COLOR, SMALL_DEPTH, pose, texture, write_boards
from recon.readers.calibration.board import CalibrationBoard, read_board
from recon.readers.calibration.calibrate import CalibrationResult, calibrate
from recon.readers.calibration.file import Calibration
from recon.readers.calibration.pictures import paired
from recon.recording import Intrinsics
from recon.recording.rig import Lens
from tests.makers.recon.tiny import read_image
from twin.errors import InputError

SCALE, SQUARE = 1.012, 0.03
CHARUCO = CalibrationBoard("charuco", 9, 6, SQUARE, 0.021, "5X5_250")
CHECKER = CalibrationBoard("checkerboard", 9, 6, SQUARE)


def files_in(folder: Path) -> list[Path]:
    return sorted(folder.iterdir())


@pytest.fixture(scope="module")
def boards(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Four pictures by both cameras, and depth maps."""
    out = tmp_path_factory.mktemp("boards") / "charuco"
    beside = pose((0.0, 0.02, 0.0), (-0.03, 0.0, 0.0))
    return write_boards(
        out, texture(9, 6, "5X5_250"), SQUARE, beside, 4, SCALE, cameras=(SMALL_COLOR, SMALL_DEPTH)
    )


def flat(path: Path, size: tuple[int, int] = (640, 480)) -> Path:
    cv2.imwrite(str(path), np.full((size[1], size[0]), 128, np.uint8))
    return path


def test_pictures_that_cannot_be_used(boards: Path, tmp_path: Path) -> None:
    empty = [flat(tmp_path / f"{k}.png") for k in range(3)]
    with pytest.raises(
        InputError, match="no charuco, 9x6 squares of 30 mm, markers 5X5_250 in any of 3 colour"
    ):
        calibrate(empty, CHARUCO)
    with pytest.raises(InputError, match="no checkerboard"):
        calibrate(empty, CHECKER)
    with pytest.raises(InputError, match="640x480, the pictures before it are 480x360"):
        calibrate([*files_in(boards / "color")[:1], *empty], CHARUCO)
    with pytest.raises(InputError, match="4 of 4 colour pictures show the board, 5 are needed"):
        calibrate(files_in(boards / "color")[:4], CHARUCO)
    with pytest.raises(InputError, match="no pictures"):
        calibrate([], CHARUCO)
    cut = tmp_path / "cut.png"
    cut.write_bytes((boards / "color" / "00.png").read_bytes()[:-20])
    text = tmp_path / "text.jpg"
    text.write_text("no picture")
    for path, told in (
        (cut, "is truncated"),
        (text, "not a readable picture"),
        (tmp_path / "none.png", "can't be read"),
    ):
        with pytest.raises(InputError, match=told):
            calibrate([path], CHARUCO)


def test_depth_maps_that_cannot_be_used(boards: Path, tmp_path: Path) -> None:
    c = SMALL_DEPTH
    k = Intrinsics(c.width, c.height, c.fx, c.fy, c.cx, c.cy)
    known = Calibration(Lens(k, c.distortion), None, None, None)

    def scale(change: Callable[[NDArray[Any]], NDArray[Any]]) -> CalibrationResult:
        for k in range(2):
            image = read_image(boards / "depth" / f"{k:02d}.png")
            cv2.imwrite(str(tmp_path / f"{k:02d}.png"), change(image))
        maps = [tmp_path / f"{k:02d}.png" for k in range(2)]
        return calibrate(files_in(boards / "infrared")[:2], CHARUCO, depth_maps=maps, known=known)

    good = scale(lambda d: d)  # without infrared the maps lie on the pictures that are given
    assert good.scale is not None
    assert abs(good.scale.scale - SCALE) < 1.5e-3
    half = scale(lambda d: d[::2, ::2])
    assert half.scale is not None
    assert abs(half.scale.scale - SCALE) < 4e-3
    with pytest.raises(InputError, match="times what the depth maps hold"):
        scale(lambda d: d * 5)
    with pytest.raises(InputError, match="no depth map has depth where the board is"):
        scale(lambda d: np.where(np.arange(d.shape[1]) < 1, 500, 0 * d).astype(np.uint16))
    with pytest.raises(InputError, match="another shape"):
        scale(lambda d: d[:-60])
    with pytest.raises(InputError, match="16-bit"):
        scale(lambda d: (d // 8).astype(np.uint8))


def test_pairs() -> None:
    def named(*names: str) -> list[Path]:
        return [Path(n) for n in names]

    kinds = ("colour", "depth")
    assert paired(named("a.png", "b.png"), named("b.png", "a.png", "c.png"), kinds) == [(0, 1), (1, 0)]
    assert paired(named("color-0.jpg", "color-10.jpg"), named("ir-010.png"), kinds) == [(1, 0)]
    assert paired(named("x.png", "y.png"), named("u.png", "v.png"), kinds) == [(0, 0), (1, 1)]
    with pytest.raises(InputError, match="1 colour and 2 depth pictures, without equal names"):
        paired(named("x.png"), named("u.png", "v.png"), kinds)


def test_boards_are_read(tmp_path: Path) -> None:
    def board(data: object) -> CalibrationBoard:
        path = tmp_path / "board.json"
        path.write_text(json.dumps(data))
        return read_board(path)

    ours = {
        "type": "charuco",
        "columns": 9,
        "rows": 6,
        "square": 0.03,
        "marker": 0.021,
        "dictionary": "DICT_5X5_250",
    }
    assert board(ours) == CHARUCO
    assert board({**ours, "dictionary": 6}) == CHARUCO
    assert board({"type": "checkerboard", "columns": 9, "rows": 6, "square": 0.03}) == CHECKER
    assert CalibrationBoard("charuco", 9, 6, SQUARE, 0.021, "dict_5x5_250") == CHARUCO
    shape = {
        "shape": "charuco",
        "squares_x": 9,
        "squares_y": 6,
        "square_length": 30,
        "marker_length": 21,
        "aruco_dict_name": 6,
    }
    assert board({"target": "a", "shapes": [shape]}) == CHARUCO
    assert np.allclose(CHARUCO.charuco.getChessboardCorners(), CHARUCO.points, atol=1e-6)
    for change, told in (
        ({"columns": 2}, "2 columns"), ({"rows": "6"}, "rows is"), ({"square": 30}, "squares of 30 m"),
        ({"marker": 0.04}, "markers of 0.04 m"), ({"marker": None}, "marker is missing"), ({"dictionary": "5X5_25"}, "did you mean 5X5_250"),
        ({"type": "dots"}, "type 'dots'"), ({"colums": 9}, "unknown key 'colums'"), ({"square": float("nan")}, "squares of nan m"),
    ):  # fmt: skip
        with pytest.raises(InputError, match=told):
            board({**ours, **change})
    with pytest.raises(InputError, match="four equal sides"):
        CalibrationBoard("checkerboard", 8, 8, 0.03)
    with pytest.raises(InputError, match="more markers than"):
        _ = CalibrationBoard("charuco", 20, 20, 0.03, 0.02, "4X4_50").charuco
