"""Edits: each kind does what it says, in every file; taking it back leaves nothing; a new result keeps what
fits and tells what doesn't."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np
import pytest

import twin as tw
from benchmarks.scenes.boards import cabinet_twin
from recon.verdict.assemble import keep_twin
from tests.makers.twin.judged import doubted
from twin import edits
from twin.cli.edit_options import EDITS
from twin.cli.main import run as cli
from twin.edits import Edit, Unfit, edit_of, made
from twin.edits.values import degrees_between
from twin.errors import InputError, SceneError
from twin.files.text import read_json
from twin.geometry import Array, transform
from twin.page import render
from twin.runs.stages import Run
from twin.scene import Mesh, Part, Revolute, Twin
from twin.storage import digest, load, save
from twin.verdict import Verdict


@pytest.fixture
def cabinet() -> Twin:
    return cabinet_twin()


@pytest.fixture
def run(cabinet: Twin, tmp_path: Path) -> Path:
    save(cabinet, tmp_path / "run" / "twin")
    return tmp_path / "run"


def after(twin: Twin, part: str, *texts: str, why: str = "") -> Twin:
    """The twin with edits that can be made."""
    result = made(twin, [edit_of(twin, part, text, why) for text in texts])
    assert result.unfit == ()
    return result.twin


def moved(part: Part, state: float) -> Array:
    return transform(part.joint.pose(state), part.mesh.vertices)


def test_the_command_line_names_every_kind() -> None:
    assert set(EDITS) == set(edits.KINDS)


def test_limits_are_the_users(cabinet: Twin) -> None:
    door = after(cabinet, "door", "upper=95deg", "lower=-3deg").part("door")
    assert np.allclose(np.rad2deg([door.joint.lower, door.joint.upper]), [-3, 95])
    assert door.limits_source == "user"
    assert after(cabinet, "drawer", "upper=31cm").part("drawer").joint.upper == pytest.approx(0.31)


def test_limits_that_cut_off_what_was_seen_are_refused(cabinet: Twin) -> None:
    with pytest.raises(SceneError, match="cut off its recorded motion"):
        made_one(cabinet, "drawer", "upper=5mm")


def made_one(twin: Twin, part: str, text: str, why: str = "") -> Twin:
    from twin.edits.kinds import applied

    return applied(twin, edit_of(twin, part, text, why))


@pytest.mark.parametrize("word", ["vertical", "edge"])
def test_a_tilted_hinge_snaps_and_keeps_its_place(word: str) -> None:
    """A door whose hinge leans by 2 degrees about its own middle: snapped, its pose at 60 degrees is that of
    the true one, within what the pivot's height leaves."""
    true = cabinet_twin(np.eye(4)).part("door")
    assert isinstance(true.joint, Revolute)
    lean = np.array([np.sin(np.deg2rad(2.0)), 0.0, -np.cos(np.deg2rad(2.0))])
    tilted = replace(
        cabinet_twin(np.eye(4)),
        parts=(replace(true, joint=replace(true.joint.with_pivot(true.mesh.area_centroid), axis=lean)),),
    )
    door = after(tilted, "door", f"axis={word}").part("door")
    assert (
        np.rad2deg(np.arccos(min(1.0, door.joint.axis @ true.joint.axis)))
        < {"vertical": 1e-4, "edge": 0.05}[word]
    )
    assert np.abs(moved(door, 1.0) - moved(true, 1.0)).max() < 1e-3  # 12 mm before
    assert door.joint.sigma is None


def test_a_drawer_snaps_to_its_fronts_normal_and_to_level(cabinet: Twin) -> None:
    drawer = cabinet.part("drawer")
    off = drawer.joint.plus([np.deg2rad(1.5), np.deg2rad(-1.0)])
    twin = replace(cabinet, parts=(replace(drawer, joint=off),))
    for word in ("front", "edge"):
        snapped = after(twin, "drawer", f"axis={word}").part("drawer").joint.axis
        assert degrees_between(snapped, drawer.joint.axis) < 0.1
    assert after(twin, "drawer", "axis=horizontal").part("drawer").joint.axis[2] == 0.0
    x, y, z = drawer.joint.axis
    assert np.allclose(
        after(twin, "drawer", f"axis={-x},{-y},{-z}").part("drawer").joint.axis, drawer.joint.axis
    )


def test_a_pivot_moves_the_line(cabinet: Twin) -> None:
    door = cabinet.part("door")
    assert isinstance(door.joint, Revolute)
    to = door.joint.pivot + [0.01, 0.0, 0.0]
    new = after(cabinet, "door", "pivot=" + ",".join(map(str, to))).part("door").joint
    assert isinstance(new, Revolute)
    assert np.allclose(new.pivot, to)
    with pytest.raises(Unfit, match="slides"):
        made_one(cabinet, "drawer", "pivot=0,0,0")


def test_the_other_end_is_closed(cabinet: Twin) -> None:
    """The same places, counted the other way: what was open at 1.4 is 0, and 0 is 1.4."""
    door = cabinet.part("door")
    new = after(cabinet, "door", f"closed={door.joint.upper}").part("door")
    assert (new.joint.lower, new.joint.upper) == pytest.approx((0.0, door.joint.upper))
    for state in (0.0, 0.5, 1.4):
        assert np.allclose(moved(new, 1.4 - state), moved(door, state), atol=1e-9)
    assert np.allclose(new.motion.state, 1.4 - door.motion.state)
    assert new.closed_source == "user"
    middle = after(cabinet, "drawer", "closed=10cm").part("drawer")
    assert (middle.joint.lower, middle.joint.upper) == pytest.approx((-0.1, 0.2))
    assert np.allclose(moved(middle, 0.2), moved(cabinet.part("drawer"), 0.3), atol=1e-9)


def test_what_a_part_carries_goes_along_when_another_end_is_closed() -> None:
    twin = cabinet_twin(nested=True)
    new = after(twin, "door", "closed=1.4")
    door, flap = (twin.part(n) for n in ("door", "flap"))
    for a, b in ((0.3, 0.0), (1.0, 0.7)):
        before = transform(twin.part_pose(flap.id, {door.id: a, flap.id: b}), flap.mesh.vertices)
        now = transform(
            new.part_pose(flap.id, {door.id: 1.4 - a, flap.id: b}), new.part("flap").mesh.vertices
        )
        assert np.allclose(before, now, atol=1e-9)


def test_a_name_changes_everywhere() -> None:
    twin = replace(cabinet_twin(), filtered_pairs=(("door", "drawer"),))
    new = after(twin, "door", "name=fridge")
    assert [p.name for p in new.parts] == ["fridge", "drawer"]
    assert new.filtered_pairs == (("fridge", "drawer"),)
    for text, words in (("name=two words", "not legal"), ("name=drawer", "unique")):
        with pytest.raises(SceneError, match=words):
            made_one(twin, "door", text)


def test_what_is_no_part_stands_still(cabinet: Twin) -> None:
    labels = {0: np.array([[1, 2], [3, 255]], np.uint8)}
    twin = replace(cabinet, labels=labels)
    new = after(twin, "door", "removed")
    assert [p.name for p in new.parts] == ["drawer"]
    assert new.static.mesh.area == pytest.approx(twin.static.mesh.area + twin.part("door").mesh.area)
    assert new.labels[0].tolist() == [[1, 1], [3, 255]]


def test_what_stood_on_it_stands_where_it_stood() -> None:
    twin = cabinet_twin(nested=True)
    new = after(twin, "door", "removed")
    assert new.part("flap").parent is None
    assert np.allclose(moved(new.part("flap"), 0.5), moved(twin.part("flap"), 0.5))
    lonely = after(twin, "flap", "removed")
    assert lonely.part("door").mesh.area == pytest.approx(
        twin.part("door").mesh.area + twin.part("flap").mesh.area
    )


def test_a_piece_of_another_part_moves_with_it(cabinet: Twin) -> None:
    new = after(cabinet, "door", "merged=drawer")
    whole = sum(p.mesh.area for p in cabinet.parts)
    assert [p.name for p in new.parts] == ["drawer"]
    assert new.part("drawer").mesh.area == pytest.approx(whole)
    with pytest.raises(Unfit, match="that part"):
        made_one(cabinet, "door", "merged=door")


def test_a_part_of_two_pieces_is_split(cabinet: Twin) -> None:
    """Merged and split again at a vertex of what was merged: two parts with the surfaces they had."""
    joined = after(cabinet, "door", "merged=drawer")
    point = cabinet.part("door").mesh.vertices[0]
    new = after(joined, "drawer", "split=" + ",".join(f"{v:.9f}" for v in point))
    assert len(new.parts) == 2
    assert sum(p.mesh.area for p in new.parts) == pytest.approx(sum(p.mesh.area for p in cabinet.parts))
    apart = next(p for p in new.parts if p.name != "drawer")
    assert np.linalg.norm(apart.mesh.vertices - point, axis=1).min() < 1e-6
    single = Mesh(np.array([[0, 0, 0], [1, 0, 0], [0, 0, 1.0]]), np.array([[0, 1, 2]], np.int32))
    whole = replace(cabinet, parts=(replace(cabinet.parts[1], mesh=single, contact=None),))
    with pytest.raises(Unfit, match="100"):
        made_one(whole, "drawer", "split=0,0,0")


def test_a_doubt_is_overruled_for_a_reason(tmp_path: Path) -> None:
    twin = doubted(cabinet_twin())
    assert twin.verdict is not None
    assert twin.verdict.level == "doubtful"
    (part,) = [p for p in twin.parts if p.verdict is not None and p.verdict.reasons]
    with pytest.raises(InputError, match="reason"):
        made_one(twin, part.name, "verdict=trusted")
    new = after(twin, part.name, "verdict=trusted", why="opened it, it is so")
    assert new.part(part.name).verdict == part.verdict.by_word("opened it, it is so")  # type: ignore[union-attr]
    assert new.verdict is not None
    assert new.verdict.trusted
    assert new.verdict.text == f"trusted, by the user's word: {part.name}: opened it, it is so"
    save(new, tmp_path)
    again = load(tmp_path)
    assert again.verdict == new.verdict
    assert again.part(part.name).verdict == new.part(part.name).verdict


def test_every_file_says_whose_word_it_is(tmp_path: Path) -> None:
    twin = doubted(cabinet_twin())
    (part,) = [p for p in twin.parts if p.verdict is not None and p.verdict.reasons]
    new = after(twin, part.name, "verdict=trusted", why="opened it")
    files = tw.export(new, tmp_path, ["urdf", "mjcf", "usd", "glb"])
    for fmt in files:
        text = b"".join(p.read_bytes() for p in (tmp_path / fmt).rglob("*") if p.is_file())
        assert b"by the user's word" in text or b"by the user&#39;s word" in text, fmt


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


def test_edits_are_made_again_of_a_new_result_or_told(cabinet: Twin) -> None:
    told = [
        edit_of(cabinet, "door", "upper=95deg"),
        edit_of(cabinet, "drawer", "axis=horizontal"),
        edit_of(cabinet, "drawer", "upper=31cm"),
        edit_of(cabinet, "door", "name=fridge"),
    ]
    door, drawer = cabinet.parts
    wider = replace(cabinet, parts=(replace(door, joint=replace(door.joint, upper=1.45)), drawer))
    result = made(wider, told)
    assert result.unfit == ()
    assert result.twin.part("fridge").joint.upper == pytest.approx(np.deg2rad(95))
    hinge = Revolute(np.array([0.0, 0, 1.0]), 0.0, 0.3, pivot=drawer.mesh.area_centroid)
    other = replace(cabinet, parts=(door, replace(drawer, joint=hinge)))
    result = made(other, told)
    assert [(e.what, e.part) for e, _ in result.unfit] == [("axis", "drawer"), ("upper", "drawer")]
    assert "no unit of it" in result.warnings[1]
    assert result.twin.provenance["edits"] == [told[0].row, told[3].row]
    named = replace(cabinet, parts=(replace(door, name="fridge"), drawer))
    assert [e.what for e, _ in made(named, told[3:]).unfit] == []


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


@pytest.mark.parametrize(
    ("row", "words"),
    [
        (7, "is no edit"),
        ({"what": "colour", "part": "door"}, "'colour' can't be edited"),
        ({"what": "upper", "part": "door", "to": 1.5, "when": "now"}, "no 'when'"),
        ({"what": "upper", "part": 3, "to": 1.5}, "part is a text"),
        ({"what": "mass", "part": "door", "to": 3, "interval": [1]}, "two numbers"),
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
    ("row", "words"),
    [
        (Edit("upper", "door", "wide"), "is a number"),
        (Edit("upper", "door", float("nan")), "is a number"),
        (Edit("axis", "door", [0, 0], [0, 0, 1]), "three numbers"),
        (Edit("upper", "lid", 1.0), "no part 'lid'"),
        (Edit("upper", ""), "is of a part"),
    ],
)
def test_an_edit_with_a_wrong_value_is_told_and_not_made(cabinet: Twin, row: Edit, words: str) -> None:
    result = made(cabinet, [row])
    assert [words in why for _, why in result.unfit] == [True]
    assert digest(result.twin) == digest(cabinet)


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


def test_a_verdict_of_words_alone_is_refused() -> None:
    with pytest.raises(SceneError, match="by a word"):
        Verdict((), None, "", doubted(cabinet_twin()).verdict.reasons)  # type: ignore[union-attr]


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
