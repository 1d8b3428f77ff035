"""Marks that a person makes on a recording's pictures, and the file that keeps them.

A mark is three texts: the part that it is of, what it tells, and a value. Pixels are those of the recording.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from recon.interaction.joints.observations import Kind
from recon.recording import Recording
from twin.errors import InputError
from twin.files.text import read_json, write_text
from twin.geometry import Array
from twin.names import require_legal

_FORMAT = "funtwin-annotation/1"
KINDS: Mapping[str, Kind] = {"slide": "prismatic", "hinge": "revolute"}
_XY = r"-?\d+(?:\.\d+)?,-?\d+(?:\.\d+)?"
# What a mark may tell, its value's form, and what it says to those who got it wrong.
_FORMS = {
    "part": (r"slide|hinge", "slide or hinge"),
    "outline": (rf"(\d+):((?: {_XY}){{3,}})", "FRAME: X,Y X,Y X,Y and more"),
    "moves": (r"(\d+):(\d+)", "FIRST:LAST frame of a motion"),
    "axis": (rf"(\d+):((?: {_XY}){{2}})", "FRAME: X,Y X,Y"),
    "point": (rf"(\d+):( {_XY})", "FRAME: X,Y"),
    "closed": (r"(\d+)", "a frame"),
    "description": (r"[^\n]{0,400}", "a sentence"),
    "only": (r"yes|no", "yes, where nothing else is opened, or no"),
}
OF_ALL = ("description", "only")  # marks of the recording, whose part is ""


@dataclass(frozen=True)
class Mark:
    """One thing that a person marked."""

    part: str
    what: str
    value: str

    @property
    def row(self) -> dict[str, str]:
        return {"part": self.part, "what": self.what, "value": self.value}


@dataclass(frozen=True, eq=False)
class PartMarks:
    """All marks of one part.

    outlines: corners (n, 2) px by frame. moves: first and last frame of each motion. axis: frame and two
    places (2, 2) px: on the hinge's axis, or along the slide. points: the places (2,) px of one point of the
    part by frame; the first is where it was chosen. closed: a frame in which the part is.
    """

    name: str
    kind: Kind
    outlines: Mapping[int, Array] = field(default_factory=dict)
    moves: tuple[tuple[int, int], ...] = ()
    axis: tuple[int, Array] | None = None
    points: Mapping[int, Array] = field(default_factory=dict)
    closed: int | None = None


@dataclass(frozen=True, eq=False)
class Marks:
    """All marks on a recording: in the order in which they were made, and by part."""

    rows: tuple[Mark, ...]
    parts: tuple[PartMarks, ...]
    description: str = ""
    only: bool = False


def marks_of(rows: Sequence[Mark], recording: Recording) -> Marks:
    """What the rows say together: of a frame's outline or point, and of what there is once, the last counts.

    Raises InputError for a row that says nothing, or of no frame and no pixel of the recording.
    """
    parts: dict[str, PartMarks] = {}
    told: dict[str, str] = {}
    for row in rows:
        form = _FORMS.get(row.what)
        match = None if form is None else re.fullmatch(form[0], row.value, re.ASCII)
        if form is None or match is None:
            allowed = form[1] if form else f"one of {', '.join(_FORMS)}"
            raise InputError(f"{row.what!r:.40} can't be {row.value!r:.60}", f"give {allowed}")
        if row.what in OF_ALL:
            told[row.what] = row.value
        elif row.what == "part":
            require_legal(row.part)
            before = parts.get(row.part, PartMarks(row.part, "prismatic"))
            parts[row.part] = replace(before, kind=KINDS[row.value])
        elif row.part not in parts:
            raise InputError(f"there is no part {row.part!r:.60}", "add it first")
        else:
            parts[row.part] = _READ[row.what](parts[row.part], match, recording)
    return Marks(tuple(rows), tuple(parts.values()), told.get("description", ""), told.get("only") == "yes")


def _outline(part: PartMarks, match: re.Match[str], recording: Recording) -> PartMarks:
    frame = _frame(match[1], recording)
    return replace(part, outlines={**part.outlines, frame: _pixels(match[2], recording)})


def _moves(part: PartMarks, match: re.Match[str], recording: Recording) -> PartMarks:
    first, last = _frame(match[1], recording), _frame(match[2], recording)
    if first >= last:
        raise InputError(f"a motion can't go from frame {first} to {last}", "give its first frame first")
    for a, b in part.moves:
        if first <= b and a <= last:
            raise InputError(
                f"a motion from frame {a} to {b} is marked already", "undo it, or give other frames"
            )
    return replace(part, moves=tuple(sorted((*part.moves, (first, last)))))


def _axis(part: PartMarks, match: re.Match[str], recording: Recording) -> PartMarks:
    return replace(part, axis=(_frame(match[1], recording), _pixels(match[2], recording)))


def _point(part: PartMarks, match: re.Match[str], recording: Recording) -> PartMarks:
    frame = _frame(match[1], recording)
    return replace(part, points={**part.points, frame: _pixels(match[2], recording)[0]})


def _closed(part: PartMarks, match: re.Match[str], recording: Recording) -> PartMarks:
    return replace(part, closed=_frame(match[1], recording))


_READ: Mapping[str, Callable[[PartMarks, re.Match[str], Recording], PartMarks]] = {
    "outline": _outline, "moves": _moves, "axis": _axis, "point": _point, "closed": _closed,
}  # fmt: skip


def _frame(text: str, recording: Recording) -> int:
    if int(text) >= len(recording):
        raise InputError(f"there is no frame {text}", f"frames go from 0 to {len(recording) - 1}")
    return int(text)


def _pixels(text: str, recording: Recording) -> Array:
    places = np.array([[float(v) for v in pair.split(",")] for pair in text.split()])
    size = recording.intrinsics.width, recording.intrinsics.height
    outside = (places < -0.5) | (places > np.array(size) - 0.5)
    if outside.any():
        x, y = places[outside.any(axis=1)][0]
        raise InputError(f"{x:g},{y:g} is no pixel", f"a picture has {size[0]} x {size[1]}")
    return places


def read_marks(path: Path, recording: Recording) -> Marks:
    """The marks of a file; none where there is no file.

    Raises InputError for a file that is none of ours, or of another recording.
    """
    if not path.is_file():
        return Marks((), ())
    told: dict[str, Any] = read_json(path)
    rows = told.get("marks")
    if told.get("format") != _FORMAT or not isinstance(rows, list):
        raise InputError(f"{path} holds no marks", f'it begins with "format": "{_FORMAT}"')
    if told.get("recording") != recording.fingerprint:
        raise InputError(f"{path} is of another recording", "give that one, or another folder with -o")
    try:
        marks = [Mark(str(r["part"]), str(r["what"]), str(r["value"])) for r in rows]
    except (KeyError, TypeError) as e:
        raise InputError(f"{path} has a mark that lacks {e}", "mend it, or move it away") from e
    return marks_of(marks, recording)


def write_marks(path: Path, marks: Marks, recording: Recording) -> None:
    """Write them, one a line."""
    rows = ",\n".join(f"  {json.dumps(m.row, ensure_ascii=False)}" for m in marks.rows)
    head = json.dumps({"format": _FORMAT, "recording": recording.fingerprint})[:-1]
    write_text(path, f'{head}, "marks": [\n{rows}\n]}}\n')
