"""The board that a camera is calibrated with: a checkerboard, or a ChArUco board of numbered squares."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, get_args

import cv2
import numpy as np

from recon.readers import files
from twin.errors import InputError, nearest_name
from twin.geometry import Array

Kind = Literal["charuco", "checkerboard"]
MAX_SQUARES = 100  # along a side, chosen by us
SQUARE = (1e-3, 1.0)  # m, chosen by us: others are millimetres written as metres
DICTIONARIES = sorted(
    {n.removeprefix("DICT_").upper() for n in dir(cv2.aruco) if n.startswith("DICT_")} - {"ARUCO_ORIGINAL"}
)
_KEYS = ("type", "columns", "rows", "square", "marker", "dictionary")


@dataclass(frozen=True)
class CalibrationBoard:
    """A flat board.

    columns, rows: squares along its sides (not inner corners). square, marker: sides in m. dictionary: of a
    ChArUco board's markers, as 5X5_250 or DICT_5X5_250. legacy: its first square is that of OpenCV before 4.6
    (differs with an even number of rows).
    """

    kind: Kind
    columns: int
    rows: int
    square: float
    marker: float = 0.0
    dictionary: str = ""
    legacy: bool = False

    def __post_init__(self) -> None:
        if self.kind not in get_args(Kind):
            raise InputError(f"a board of type {self.kind!r}", f"write {' or '.join(get_args(Kind))}")
        for name, count in (("columns", self.columns), ("rows", self.rows)):
            if not 3 <= count <= MAX_SQUARES:
                raise InputError(
                    f"a board with {count} {name}", f"count its squares: 3 to {MAX_SQUARES} along a side"
                )
        low, high = SQUARE
        if not low <= self.square <= high:
            raise InputError(
                f"a board with squares of {self.square:g} m", f"give metres, between {low:g} and {high:g}"
            )
        if self.kind == "checkerboard":
            if self.columns == self.rows:
                raise InputError(
                    f"a checkerboard with {self.columns} columns and as many rows has four equal sides",
                    "use one with another number of rows than columns, or a ChArUco board",
                )
            return
        object.__setattr__(self, "dictionary", dictionary_name(self.dictionary))
        if not 0 < self.marker < self.square:
            raise InputError(
                f"markers of {self.marker:g} m in squares of {self.square:g} m",
                "give the marker's side in metres",
            )
        if self.dictionary not in DICTIONARIES:
            near = nearest_name(self.dictionary, DICTIONARIES)
            raise InputError(
                f"unknown marker dictionary {self.dictionary!r}",
                f"did you mean {near}?" if near else f"known are {', '.join(DICTIONARIES)}",
            )

    @property
    def points(self) -> Array:
        """(n, 3) m: the inner corners, row by row, in the board's plane z = 0, numbered as OpenCV's."""
        x, y = np.meshgrid(np.arange(1, self.columns), np.arange(1, self.rows))
        return np.asarray(np.stack([x, y, 0 * x], axis=-1).reshape(-1, 3) * self.square, dtype=np.float64)

    @property
    def charuco(self) -> Any:
        """OpenCV's board."""
        code = getattr(cv2.aruco, f"DICT_{self.dictionary}")
        markers = cv2.aruco.getPredefinedDictionary(code)
        board = cv2.aruco.CharucoBoard((self.columns, self.rows), self.square, self.marker, markers)
        board.setLegacyPattern(self.legacy)
        if self.columns * self.rows // 2 > markers.bytesList.shape[0]:
            raise InputError(
                f"a board of {self.columns}x{self.rows} squares has more markers than {self.dictionary}",
                "name the dictionary that it was printed with",
            )
        return board

    def __str__(self) -> str:
        size = f"{self.columns}x{self.rows} squares of {1e3 * self.square:g} mm"
        return f"{self.kind}, {size}" + (f", markers {self.dictionary}" if self.kind == "charuco" else "")


def read_board(path: Path) -> CalibrationBoard:
    """A JSON board: {"type", "columns", "rows", "square", "marker", "dictionary"} (m), or Azure Kinect's."""
    data = files.read_json(path)
    where = files.shown(path)
    shapes = data.get("shapes")
    if isinstance(shapes, list) and shapes and isinstance(shapes[0], dict):
        shape = shapes[0]
        data = {
            "type": shape.get("shape"),
            "columns": shape.get("squares_x"),
            "rows": shape.get("squares_y"),
            "square": _metres(shape.get("square_length")),
            "marker": _metres(shape.get("marker_length")),
            "dictionary": shape.get("aruco_dict_name"),
        }
    return _of(where, data)


def dictionary_name(name: str | int) -> str:
    """The name of a dictionary, from OpenCV's name or number."""
    if isinstance(name, int):
        names = [n for n in DICTIONARIES if getattr(cv2.aruco, f"DICT_{n}", None) == name]
        return names[0] if names else str(name)
    return name.upper().removeprefix("DICT_")


def _metres(millimetres: Any) -> Any:
    return millimetres / 1e3 if isinstance(millimetres, int | float) else millimetres


def _of(where: str, data: Mapping[str, Any]) -> CalibrationBoard:
    for key in data:
        if key not in _KEYS:
            raise InputError(f"{where} has the unknown key {key[:40]!r}", f"known are {', '.join(_KEYS)}")
    values = {k: v for k, v in data.items() if v is not None}
    for key, kinds in (
        ("type", str), ("columns", int), ("rows", int), ("square", int | float), ("marker", int | float), ("dictionary", str | int),
    ):  # fmt: skip
        needed = key in _KEYS[:4] or values.get("type") == "charuco"
        value = values.get(key)
        if (value is None and needed) or (
            value is not None and (isinstance(value, bool) or not isinstance(value, kinds))
        ):
            told = "is missing" if value is None else f"is {json.dumps(value)[:40]}"
            raise InputError(f"{where}: {key} {told}", f"write {', '.join(_KEYS)}; lengths in m")
    try:
        return CalibrationBoard(
            values["type"],
            values["columns"],
            values["rows"],
            float(values["square"]),
            float(values.get("marker", 0.0)),
            dictionary_name(values.get("dictionary", "")),
        )
    except InputError as error:
        raise InputError(f"{where}: {error.problem}", error.remedy) from None
