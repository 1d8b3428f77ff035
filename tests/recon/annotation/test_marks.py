"""Marks: what their texts say, what they can't, and the file that keeps them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from recon.annotation.marks import Mark, marks_of, read_marks, write_marks
from tests.makers.recon.cabinets import make_clip
from twin.errors import FuntwinError, InputError

RECORDING = make_clip("door").recording  # 26 frames of 200 x 150
PART = Mark("door", "part", "hinge")


def test_the_last_word_counts_of_what_there_is_once() -> None:
    rows = [
        PART,
        Mark("door", "outline", "3: 1,1 9,1 9,9"),
        Mark("door", "outline", "3: 2,2 8,2 8,8 2,8"),
        Mark("door", "moves", "12:20"),
        Mark("door", "moves", "2:9"),
        Mark("door", "point", "4: 7.5,3"),
        Mark("", "only", "yes"),
        Mark("", "description", "a door"),
    ]
    told = marks_of(rows, RECORDING)
    (door,) = told.parts
    assert (door.kind, door.moves, list(door.outlines)) == ("revolute", ((2, 9), (12, 20)), [3])
    assert door.outlines[3].shape == (4, 2)
    assert door.points[4].tolist() == [7.5, 3.0]
    assert (told.only, told.description) == (True, "a door")


@pytest.mark.parametrize(
    ("mark", "told"),
    [
        (Mark("door", "outline", "3: 1,1 9,1"), "FRAME: X,Y X,Y X,Y"),
        (Mark("door", "outline", "3: 1,1 9,1 999,9"), "200 x 150"),
        (Mark("door", "moves", "9:3"), "first frame first"),
        (Mark("door", "moves", "3:99"), "0 to 25"),
        (Mark("lid", "closed", "3"), "add it first"),
        (Mark("door", "colour", "red"), "one of part, outline"),
        (Mark("<b>", "part", "hinge"), "legal"),
        (Mark("door", "point", "٣: 1,1"), "FRAME: X,Y"),
    ],
)
def test_what_says_nothing_is_refused(mark: Mark, told: str) -> None:
    with pytest.raises(FuntwinError, match=told):
        marks_of([PART, mark], RECORDING)


def test_two_motions_do_not_overlap() -> None:
    with pytest.raises(InputError, match="2 to 9 is marked already"):
        marks_of([PART, Mark("door", "moves", "2:9"), Mark("door", "moves", "9:12")], RECORDING)


def test_the_file_gives_back_what_was_marked_and_is_of_one_recording(tmp_path: Path) -> None:
    path = tmp_path / "annotation.json"
    marks = marks_of([PART, Mark("door", "closed", "3")], RECORDING)
    write_marks(path, marks, RECORDING)
    assert read_marks(path, RECORDING).rows == marks.rows
    with pytest.raises(InputError, match="another recording"):
        read_marks(path, replace(RECORDING, fingerprint="other"))
    path.write_text("{}")
    with pytest.raises(InputError, match="holds no marks"):
        read_marks(path, RECORDING)
    assert read_marks(tmp_path / "none.json", RECORDING).rows == ()
