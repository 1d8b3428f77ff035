"""The benchmark of other people's files: what it takes, what it keeps, and that a judgement holds for one
result alone."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from benchmarks import imports
from benchmarks.imports_page import JUDGEMENTS, UNJUDGED, judgement_of, page, result_of

ROW: dict[str, Any] = {
    "name": "c/a.xml",
    "digest": "12",
    "seconds": 3,
    "steps": {"import": "0: a", "lint": "0: b"},
}
TOLD: dict[str, Any] = {
    "collection": {"c": {"packages": ["c-1"], "version": "1.0", "objects": "c/*.xml", "robots": []}},
    "file": {"c/a.xml": {"result": result_of(ROW), "judgement": "right", "because": "seen"}},
}


@pytest.mark.parametrize(
    ("text", "taken"),
    [
        ('<mujoco><worldbody><body><joint type="slide"/></body></worldbody></mujoco>', True),
        ("<mujoco><worldbody><body><frame><joint/></frame></body></worldbody></mujoco>", True),
        ('<mujoco><worldbody><body><include file="part.xml"/></body></worldbody></mujoco>', True),
        ('<mujoco><default><joint/></default><worldbody><body/></worldbody></mujoco>', False),
        ('<mujoco><worldbody><body><joint type="free"/></body></worldbody></mujoco>', False),
        ('<mujoco><worldbody/><equality><joint joint1="a"/></equality></mujoco>', False),
        ('<robot name="r"><joint type="prismatic"/></robot>', True),
        ('<robot name="r"><joint type="fixed"/></robot>', False),
        ("<mujocoinclude><body><joint/></body></mujocoinclude>", False),
    ],
)  # fmt: skip
def test_a_main_file_with_a_hinge_or_slide_of_a_body_is_taken(text: str, taken: bool, tmp_path: Path) -> None:
    (tmp_path / "part.xml").write_text('<mujocoinclude><body><joint axis="0 0 1"/></body></mujocoinclude>')
    (tmp_path / "a.xml").write_text(text)
    assert imports.moves(tmp_path / "a.xml") == taken


def test_a_changed_result_or_file_is_to_be_judged() -> None:
    assert judgement_of(ROW, TOLD) == ("right", "seen")
    assert judgement_of(ROW | {"seconds": 4}, TOLD) == ("right", "seen")
    for changed in ({"digest": "13"}, {"steps": ROW["steps"] | {"lint": "2: b"}}, {"name": "c/b.xml"}):
        assert judgement_of(ROW | changed, TOLD) == (UNJUDGED, "")


def test_the_page_is_whole_when_nothing_is_wrong_or_unjudged() -> None:
    text, whole = page([ROW], TOLD, "abc")
    assert whole
    assert "| c: `c-1` | 1.0 | 1 | 1 | 0 | 0 | 0 |" in text
    assert "**right**: seen" in text
    wrong = {"file": {"c/a.xml": TOLD["file"]["c/a.xml"] | {"judgement": "wrong"}}}
    for told in (TOLD | wrong, TOLD | {"file": {}}):
        assert not page([ROW], told, "abc")[1]


def test_rows_that_are_kept_are_not_measured_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("a.xml", "b.xml"):
        (tmp_path / name).write_text("<mujoco/>")
    asked: list[str] = []
    monkeypatch.setattr(imports, "measured", lambda file, _: asked.append(file.name) or {"import": "0: a"})
    state = tmp_path / "out" / "rows.jsonl"
    files = {"a.xml": tmp_path / "a.xml"}
    first = imports.rows(files, state, sheets=False)
    assert imports.rows(files | {"b.xml": tmp_path / "b.xml"}, state, sheets=False)[0] == first[0]
    assert asked == ["a.xml", "b.xml"]
    assert len(state.read_text().splitlines()) == 2


def test_what_a_verb_says_is_one_line(tmp_path: Path) -> None:
    failed = {"ok": False, "error": "no", "remedy": "try"}
    assert imports.said("import", 1, json.dumps(failed), "twin: no; try", tmp_path) == "1: no; try"
    assert imports.said("import", 1, "", "Traceback\nKeyError: 3\n", tmp_path) == "1: KeyError: 3"
    found = {"findings": [{"severity": "error", "rule": "axis"}] * 2, "warnings": []}
    assert imports.said("lint", 2, json.dumps(found), "", tmp_path) == "2: error axis x 2"
    parts = {"parts": {"a": {"ok": True, "reason": ""}, "b": {"ok": False, "reason": "slipped by 15.27 mm"}}}
    assert imports.said("replay", 2, json.dumps(parts), "", tmp_path) == "2: a: opened; b: slipped by 15 mm"


def test_every_judgement_has_a_reason() -> None:
    for name, judged in imports.listed().get("file", {}).items():
        assert judged["judgement"] in JUDGEMENTS, name
        assert judged["because"], name
