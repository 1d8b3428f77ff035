"""Finding a board's corners in pictures."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from recon.readers import files
from recon.readers.calibration.board import CalibrationBoard
from twin.errors import InputError
from twin.geometry import Array
from twin.runs.loop import Loop, untold

MIN_CORNERS = 8  # of a picture, chosen by us: its pose has six unknowns, and a few corners may be wrong
MIN_LINES = 3  # rows and columns that they lie on, chosen by us: fewer hardly tell the board's tilt
MAX_BYTES = 2**28  # of a picture, chosen by us
MAX_PIXELS = 2**27  # chosen by us: 11585x11585
STRETCH = (1.0, 99.0)  # percentiles of a 16-bit infrared picture that become black and white, chosen by us
# Half the side, px, of the window that a checkerboard's corners are refined in, at most: OpenCV's charuco
# detector goes as far as 10. Chosen by us.
REFINE = 10
# The same as a share of the distance between corners: nothing of the next corner may lie in it. Chosen by us.
REFINE_PART = 0.25
TRIED = 5  # views by either pattern that decide which one the board has
_CRITERIA = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 100, 1e-4)
_SB = cv2.CALIB_CB_NORMALIZE_IMAGE | cv2.CALIB_CB_ACCURACY


@dataclass(frozen=True, eq=False)
class View:
    """A board in a picture: numbers (n,) of seen corners, their px (n, 2) with pixel centres at integers."""

    name: str
    ids: NDArray[np.int64]
    corners: Array


@dataclass(frozen=True, eq=False)
class Pictures:
    """One camera's pictures: size (width, height), a view or None for each, the fitting board."""

    size: tuple[int, int]
    names: tuple[str, ...]
    views: tuple[View | None, ...]
    board: CalibrationBoard

    @property
    def usable(self) -> list[View]:
        """The views."""
        return [v for v in self.views if v is not None]


def find_boards(
    paths: Sequence[Path], board: CalibrationBoard, what: str, progress: Loop = untold, certain: bool = False
) -> Pictures:
    """Find a board in one camera's pictures (JPEG or PNG, 8 or 16 bits).

    Of a ChArUco board's two patterns the one that fits is taken, unless it is `certain`. Raises InputError
    for a picture that can't be read and for one of another size; a picture without a board is none.
    """
    size: tuple[int, int] | None = None
    patterns = [board]
    if board.kind == "charuco" and board.rows % 2 == 0 and not certain:
        patterns.append(replace(board, legacy=not board.legacy))
    found: list[list[View | None]] = [[] for _ in patterns]
    alike = len({p.name for p in paths}) < len(paths)
    names = [f"{p.parent.name}/{p.name}" if alike else p.name for p in paths]
    for path, name in progress(list(zip(paths, names, strict=True)), what):
        grey = read_grey(path)
        shape = (grey.shape[1], grey.shape[0])
        if size is not None and shape != size:
            raise InputError(
                f"{files.shown(path)} is {shape[0]}x{shape[1]}, the pictures before it are {size[0]}x{size[1]}",
                "give pictures of one camera in one mode",
            )
        size = shape
        for pattern, views in zip(patterns, found, strict=True):
            views.append(_view(name, grey, pattern))
        if len(patterns) > 1 and sum(v is not None for v in found[0] + found[1]) >= TRIED:
            patterns, found = _better(patterns, found)
    if size is None:
        raise InputError(f"no {what}", "give pictures of a board")
    patterns, found = _better(patterns, found)
    return Pictures(size, tuple(names), tuple(found[0]), patterns[0])


def _better(
    patterns: list[CalibrationBoard], found: list[list[View | None]]
) -> tuple[list[CalibrationBoard], list[list[View | None]]]:
    """The pattern that most corners fit, and its views."""
    fitting = [sum(_fitting(v, p) for v in views) for p, views in zip(patterns, found, strict=True)]
    best = int(np.argmax(fitting))
    return [patterns[best]], [found[best]]


def read_grey(path: Path) -> NDArray[np.uint8]:
    """A picture (H, W) in grey; 16-bit values are stretched to their span. InputError if unreadable."""
    name = files.shown(path)
    if path.is_file() and path.stat().st_size > MAX_BYTES:
        raise InputError(f"{name} has {path.stat().st_size} bytes", "give JPEG or PNG pictures")
    data = files.read_bytes(path)
    files.check_complete(name, data)
    flags = cv2.IMREAD_ANYDEPTH | cv2.IMREAD_GRAYSCALE | cv2.IMREAD_IGNORE_ORIENTATION
    try:
        image: Any = cv2.imdecode(np.frombuffer(data, np.uint8), flags)
    except cv2.error:
        image = None
    if (
        image is None
        or image.ndim != 2
        or image.dtype not in (np.uint8, np.uint16)
        or image.size > MAX_PIXELS
    ):
        raise InputError(f"{name} is not a readable picture ({len(data)} bytes)", "give JPEG or PNG pictures")
    if image.dtype == np.uint8:
        return np.asarray(image)
    low, high = np.percentile(image, STRETCH)
    stretched = (image.astype(np.float32) - low) * (255.0 / max(float(high - low), 1.0))
    return np.clip(np.rint(stretched), 0, 255).astype(np.uint8)


def paired(first: Sequence[Path], second: Sequence[Path], names: tuple[str, str]) -> list[tuple[int, int]]:
    """Indices of pictures taken at the same moment: same name, else same number in the name, else same order.

    Raises InputError when none of these pairs them.
    """
    for key in (lambda p: p.stem, _number):
        one = {key(p): k for k, p in enumerate(first)}
        other = {key(p): k for k, p in enumerate(second)}
        both = one.keys() & other.keys() - {""}
        if len(one) == len(first) and len(other) == len(second) and both:
            return sorted((one[k], other[k]) for k in both)
    if len(first) != len(second):
        raise InputError(
            f"{len(first)} {names[0]} and {len(second)} {names[1]} pictures, without equal names or numbers",
            "name pictures of one moment alike",
        )
    return [(k, k) for k in range(len(first))]


def _number(path: Path) -> str:
    digits = re.findall(r"\d+", path.stem)
    return digits[-1].lstrip("0") or "0" if digits else ""


def _view(name: str, grey: NDArray[np.uint8], board: CalibrationBoard) -> View | None:
    try:
        found = _charuco(grey, board) if board.kind == "charuco" else _checkerboard(grey, board)
    except cv2.error:  # a picture in which marker-like things lie in one line makes its homography fail
        return None
    if found is None:
        return None
    ids, corners = found
    across = board.columns - 1
    lines = min(len(np.unique(ids // across)), len(np.unique(ids % across)))
    needed = min(MIN_LINES, board.rows - 1, board.columns - 1)
    if len(ids) < min(MIN_CORNERS, len(board.points)) or lines < needed:
        return None
    return View(name, ids, corners)


def _charuco(grey: NDArray[np.uint8], board: CalibrationBoard) -> tuple[NDArray[np.int64], Array] | None:
    corners, ids, _, _ = cv2.aruco.CharucoDetector(board.charuco).detectBoard(grey)
    if ids is None or len(ids) == 0:
        return None
    return np.asarray(ids).ravel().astype(np.int64), np.asarray(corners, dtype=np.float64).reshape(-1, 2)


def _checkerboard(grey: NDArray[np.uint8], board: CalibrationBoard) -> tuple[NDArray[np.int64], Array] | None:
    across, down = board.columns - 1, board.rows - 1
    good, corners = cv2.findChessboardCornersSB(grey, (across, down), flags=_SB)
    if not good:
        return None
    grid = np.asarray(corners, dtype=np.float64).reshape(down, across, 2)
    step = min(np.linalg.norm(np.diff(grid, axis=a), axis=-1).min() for a in (0, 1))
    half = int(min(REFINE, REFINE_PART * step))
    flat = grid.reshape(-1, 1, 2).astype(np.float32)
    if half >= 2:
        flat = np.asarray(cv2.cornerSubPix(grey, flat, (half, half), (-1, -1), _CRITERIA))
    return np.arange(across * down, dtype=np.int64), flat.reshape(-1, 2).astype(np.float64)


def _fitting(view: View | None, board: CalibrationBoard) -> int:
    """Corners that lie where a flat board has them, within a tenth of a square."""
    if view is None:
        return 0
    points = board.points[view.ids, :2] / board.square
    found, _ = cv2.findHomography(view.corners, points, cv2.RANSAC, 0.1)
    if found is None:
        return 0
    flat = cv2.perspectiveTransform(view.corners.reshape(-1, 1, 2), found).reshape(-1, 2)
    return int((np.linalg.norm(flat - points, axis=1) < 0.1).sum())
