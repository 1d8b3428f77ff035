"""RUN/edits.json: edits are kept, made again or told, in every file, and taken back to the byte."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np
import pytest

from benchmarks.scenes.boards import cabinet_twin
from recon.verdict.assemble import keep_twin
from twin import edits
from twin.cli.main import run as cli
from twin.edits import edit_of
from twin.files.text import read_json
from twin.page import render
from twin.runs.stages import Run
from twin.scene import Twin
from twin.storage import digest, load, save


@pytest.fixture
def cabinet() -> Twin:
    return cabinet_twin()


@pytest.fixture
def run(cabinet: Twin, tmp_path: Path) -> Path:
    save(cabinet, tmp_path / "run" / "twin")
    return tmp_path / "run"


def test_numbers_are_set_as_twin_physics_sets_them(run: Path) -> None:
    assert (
        cli(["physics", "set", str(run), "--part", "door", "--mass", "3.2", "--measured", "--note", "scale"])
        == 0
    )
    (edit,) = edits.read(run, load(run))
    assert (edit.what, edit.part, edit.to, edit.unit, edit.measured) == ("mass", "door", 3.2, "kg", True)
    mass = load(run).part("door").inertial.mass  # type: ignore[union-attr]
    assert (mass.value, mass.source) == (3.2, "measured: scale")
    assert cli(["edit", str(run), "--part", "drawer", "friction=0.4"]) == 0
    assert load(run).part("drawer").physics.friction.value == 0.4  # type: ignore[union-attr]
    assert load(run).part("door").inertial.mass.value == 3.2  # type: ignore[union-attr]


KINDS: list[tuple[str, str, str]] = [
    ("door", "upper=95deg", "1.65806"), ("drawer", "upper=31cm", "0.31"), ("door", "axis=vertical", ""),
    ("door", "closed=1.4", ""), ("door", "name=fridge_door", "fridge_door"), ("door", "removed", ""),
    ("door", "merged=drawer", ""), ("door", "mass=7.25", "7.25"), ("door", "friction=0.45", "0.45"),
    ("drawer", "frictionloss=3.5", "3.5"),
]  # fmt: skip


@pytest.mark.parametrize(("part", "text", "number"), KINDS)
def test_an_edit_of_each_kind_is_exported_checked_and_taken_back(
    run: Path, capsys: pytest.CaptureFixture[str], part: str, text: str, number: str
) -> None:
    before = digest(load(run))
    bytes_before = (run / "twin" / "twin.json").read_bytes()
    assert cli(["edit", str(run), "--part", part, text, "--why", "by hand"]) == 0
    assert cli(["export", str(run)]) == 0
    assert cli(["check", str(run)]) == 0, capsys.readouterr().out
    files = [run / "export" / "urdf" / "cabinet.urdf", run / "export" / "mjcf" / "cabinet.xml"]
    if number:
        for file in files:
            root = ET.parse(file).getroot()  # noqa: S314  (our own file)
            values = " ".join(v for e in root.iter() for v in e.attrib.values())
            assert number in values, file
        usd = b"".join(p.read_bytes() for p in (run / "export" / "usd").rglob("*.usda")).decode()
        if "deg" not in text:  # degrees there
            assert number in usd
    assert read_json(run / "twin" / "twin.json")["provenance"]["edits"] == [
        e.row for e in edits.read(run, edits.found_twin(run))
    ]
    assert cli(["edit", str(run), "--undo"]) == 0
    assert digest(load(run)) == before
    assert (run / "twin" / "twin.json").read_bytes() == bytes_before
    assert not (run / "edits.json").exists()
    assert not (run / "twin_found").exists()


def test_a_file_that_was_put_there_is_made_by_the_next_verb(
    run: Path, cabinet: Twin, capsys: pytest.CaptureFixture[str]
) -> None:
    edits.add(run, [edit_of(cabinet, "door", "upper=95deg")])
    file = (run / "edits.json").read_text(encoding="utf-8")
    edits.undo(run)
    (run / "edits.json").write_text(file, encoding="utf-8")
    assert cli(["export", str(run), "--format", "urdf"]) == 0
    assert "edits are made now" in capsys.readouterr().out
    assert load(run).part("door").joint.upper == pytest.approx(np.deg2rad(95))
    (run / "edits.json").unlink()
    assert cli(["export", str(run), "--format", "urdf"]) == 0
    assert load(run).part("door").joint.upper == pytest.approx(1.4)


def test_edits_of_another_twin_are_refused_by_name(
    run: Path, cabinet: Twin, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    other = tmp_path / "other"
    fridge = replace(cabinet, name="fridge", recorded=replace(cabinet.recorded, fingerprint="f" * 64))  # type: ignore[type-var]
    save(fridge, other / "twin")
    edits.add(run, [edit_of(cabinet, "door", "upper=95deg")])
    shutil.copy(run / "edits.json", other)
    assert cli(["export", str(other)]) == 1
    told = capsys.readouterr().err
    assert "another twin, 'cabinet'" in told
    assert "'fridge'" in told
    assert not (other / "export").exists()


def test_a_twin_that_was_changed_by_hand_is_not_lost(run: Path, cabinet: Twin) -> None:
    edits.add(run, [edit_of(cabinet, "door", "upper=95deg")])
    path = run / "twin" / "twin.json"
    document = json.loads(path.read_text(encoding="utf-8"))
    document["parts"][1]["joint"]["upper"] = 0.33
    path.write_text(json.dumps(document), encoding="utf-8")
    told = edits.add(run, [edit_of(cabinet, "door", "name=fridge")]).warnings
    assert any("kept in" in line for line in told)
    assert load(run / "twin_before_1").part("drawer").joint.upper == 0.33
    path.write_text(json.dumps(document), encoding="utf-8")
    assert any("kept in" in line for line in edits.undo(run)[1].warnings)
    assert load(run / "twin_before_2").part("drawer").joint.upper == 0.33


@pytest.mark.parametrize(
    ("row", "words"),
    [
        (7, "is no edit"),
        ({"what": "colour", "part": "door"}, "'colour' can't be edited"),
        ({"what": "upper", "part": "door", "to": 1.5, "when": "now"}, "no 'when'"),
        ({"what": "upper", "part": 3, "to": 1.5}, "part is a text"),
        ({"what": "mass", "part": "door", "to": 3, "interval": [1]}, "two numbers"),
        ({"what": "mass", "part": "door", "to": 3, "measured": "no"}, "true or false"),
    ],
)
def test_a_file_that_is_none_is_told_by_its_place(
    run: Path, row: Any, words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    head = {"format": "funtwin-edits/1", "twin": "cabinet", "recording": "0" * 16}
    (run / "edits.json").write_text(json.dumps({**head, "edits": [row]}), encoding="utf-8")
    assert cli(["edit", str(run)]) == 1
    told = capsys.readouterr().err
    assert words in told
    assert "edit 1" in told


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["--part", "door", "colour=red"], "'colour' can't be edited"),
        (["--part", "door", "upper"], "write upper=VALUE"),
        (["--part", "door", "removed=yes"], "write removed"),
        (["--part", "door", "upper=3kg"], "no state"),
        (["--part", "door", "axis=up"], "vertical, horizontal"),
        (["--part", "door", "axis=0,0,0"], "no direction"),
        (["--part", "dor", "upper=1.5"], "did you mean 'door'"),
        (["upper=1.5"], "which part is not clear"),
        (["--undo"], "has no edits"),
        (["--undo", "1", "upper=1.5"], "not both"),
        (["--part", "door", "verdict=refused", "--why", "x"], "verdict=trusted"),
    ],
)  # fmt: skip
def test_wrong_words_are_one_line_and_change_nothing(
    run: Path, words: list[str], told: str, capsys: pytest.CaptureFixture[str]
) -> None:
    before = (run / "twin" / "twin.json").read_bytes()
    assert cli(["edit", str(run), *words]) == 1
    lines = capsys.readouterr().err.strip().splitlines()
    assert len(lines) == 1
    assert told in lines[0]
    assert (run / "twin" / "twin.json").read_bytes() == before
    assert sorted(p.name for p in run.iterdir() if not p.name.startswith(".")) == ["twin"]


def test_another_reconstruction_keeps_what_fits_and_tells_what_does_not(run: Path, cabinet: Twin) -> None:
    """Equal, then another result: the door's edit is made again, the drawer is gone; then taken back."""
    edits.add(run, [edit_of(cabinet, "door", "upper=95deg"), edit_of(cabinet, "drawer", "upper=31cm")])
    with Run(run, "0" * 16) as stages:
        assert digest(keep_twin(stages, cabinet, run)) == digest(load(run))
        assert load(run).part("drawer").joint.upper == pytest.approx(0.31)
        door = cabinet.part("door")
        other = replace(cabinet, parts=(replace(door, joint=replace(door.joint, upper=1.43)),))
        kept = keep_twin(stages, other, run)
        assert digest(kept) == digest(load(run))
    assert kept.part("door").joint.upper == pytest.approx(np.deg2rad(95))
    told = " ".join(read_json(run / "manifest.json")["warnings"])
    assert "there is no part 'drawer'" in told
    assert not list(run.glob("twin_before*"))
    edits.undo(run, 2)
    assert load(run).part("door").joint.upper == 1.43


def test_what_is_said_of_the_recording_is_kept_and_heard_again(run: Path, cabinet: Twin) -> None:
    """It changes no twin that has heard it: RUN/twin stays as it was found, and nothing is copied."""
    assert cabinet.recorded is not None
    of = cabinet.recorded.fingerprint
    assert edits.said_before(run, of) == []
    point, up = "--at 31,40@5 --type hinge", "--up -y"
    heard = replace(cabinet, provenance={**cabinet.provenance, "said": [point, up]})
    with Run(run, of) as stages:
        assert digest(keep_twin(stages, heard, run, [point, up])) == digest(load(run)) == digest(heard)
    assert edits.said_before(run, of) == [point, up]
    assert edits.said_before(run, "f" * 16) == []
    assert not (run / "twin_found").exists()
    edits.add(run, [edit_of(cabinet, "door", "upper=95deg")])
    twice = replace(heard, provenance={**heard.provenance, "said": [point, "--up +z"]})
    with Run(run, of) as stages:
        kept = keep_twin(stages, twice, run, [point, "--up +z"])
    assert kept.part("door").joint.upper == pytest.approx(np.deg2rad(95))
    rows = [e.to for e in edits.read(run, kept) if e.what == "said"]
    assert rows == [point, "--up +z"], "another direction takes the place of the first one"
    assert "has not heard" not in " ".join(edits.made(twice, edits.read(run, twice)).warnings)
    undone, result = edits.undo(run)
    assert [e.to for e in undone] == ["--up +z"]
    assert result.warnings == ["it was made with --up +z: `twin reconstruct` makes it without"]
    assert edits.said_before(run, of) == [point]
    assert (
        edits.made(cabinet, edits.read(run, cabinet)).unfit[0][1] == "`twin reconstruct` has not heard it yet"
    )


def test_another_recording_in_the_run_sets_the_edits_aside(run: Path, cabinet: Twin) -> None:
    edits.add(run, [edit_of(cabinet, "door", "upper=95deg")])
    assert cabinet.recorded is not None
    other = replace(cabinet, recorded=replace(cabinet.recorded, fingerprint="f" * 16))
    with Run(run, "f" * 16) as stages:
        kept = keep_twin(stages, other, run)
    assert kept.part("door").joint.upper == 1.4
    assert (run / "edits.json_before_1").is_file()
    assert not (run / "edits.json").exists()
    assert "another twin" in " ".join(read_json(run / "manifest.json")["warnings"])


def test_the_page_tells_the_edits(run: Path, cabinet: Twin) -> None:
    edits.add(run, [edit_of(cabinet, "door", "upper=95deg")])
    text = render(run).read_text(encoding="utf-8")
    assert "Edited by the user: <code>upper of door = 1.65806 rad</code>" in text


def test_a_catch_outlives_edits_that_are_made_after_it(run: Path) -> None:
    assert cli(["edit", str(run), "--part", "door", "upper=95deg"]) == 0
    assert cli(["physics", "catch", str(run), "--part", "door", "--hold", "7.2Nm"]) == 0
    assert cli(["edit", str(run), "--part", "door", "name=fridge"]) == 0
    for name in ("fridge", "door"):
        physics = load(run).part(name).physics
        assert physics is not None
        assert physics.catch is not None
        assert physics.catch.force.value == pytest.approx(7.2)
        if name == "fridge":
            assert cli(["edit", str(run), "--undo", "2"]) == 0
