"""Edits of a twin: each kind does what it says, and what can not be is told."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import twin as tw
from benchmarks.scenes.boards import cabinet_twin
from tests.makers.twin.judged import doubted
from twin import edits
from twin.cli.edit_options import EDITS
from twin.edits import Edit, Unfit, edit_of, made
from twin.edits.values import degrees_between
from twin.errors import InputError, SceneError
from twin.geometry import Array, transform
from twin.scene import Mesh, Part, Revolute, Twin
from twin.storage import digest, load, save
from twin.verdict import Verdict


@pytest.fixture
def cabinet() -> Twin:
    return cabinet_twin()


def after(twin: Twin, part: str, *texts: str, why: str = "") -> Twin:
    """The twin with edits that can be made."""
    result = made(twin, [edit_of(twin, part, text, why) for text in texts])
    assert result.unfit == ()
    return result.twin


def moved(part: Part, state: float) -> Array:
    return transform(part.joint.pose(state), part.mesh.vertices)


def made_one(twin: Twin, part: str, text: str, why: str = "") -> Twin:
    from twin.edits.kinds import applied

    return applied(twin, edit_of(twin, part, text, why))


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


@pytest.mark.parametrize("word", ["vertical", "edge"])
def test_a_tilted_hinge_snaps_and_keeps_its_place(word: str) -> None:
    """A door whose hinge leans by 2 degrees about its own middle: snapped, its pose at 60 degrees is that of
    the true one, within what the pivot's height leaves."""
    true = cabinet_twin(np.eye(4)).part("door")
    assert isinstance(true.joint, Revolute)
    lean = np.array([np.sin(np.deg2rad(2.0)), 0.0, -np.cos(np.deg2rad(2.0))])
    middle = true.joint.with_pivot(true.mesh.area_centroid)
    assert isinstance(middle, Revolute)
    leaning = replace(middle, axis=lean, pivot=middle.pivot + 0.5 * lean)  # said by a point far from the door
    tilted = replace(cabinet_twin(np.eye(4)), parts=(replace(true, joint=leaning),))
    door = after(tilted, "door", f"axis={word}").part("door")
    assert degrees_between(door.joint.axis, true.joint.axis) < {"vertical": 1e-4, "edge": 0.05}[word]
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
    stated = [len(o.collision) for o in (twin.static, twin.part("door"))]
    assert len(new.static.collision) == sum(stated) > max(stated)  # what a user stated still collides


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
    assert len(new.part("drawer").collision) == sum(len(p.collision) for p in cabinet.parts)
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


def test_a_verdict_of_words_alone_is_refused() -> None:
    with pytest.raises(SceneError, match="by a word"):
        Verdict((), None, "", doubted(cabinet_twin()).verdict.reasons)  # type: ignore[union-attr]
