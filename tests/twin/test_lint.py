"""Every planted fault is found by its own rule alone, and what is right is left alone."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest

from tests.twin.lint_mutations import MUTATIONS, Mutation, lint_twin
from twin.cli import run
from twin.errors import InputError
from twin.export import Exported, export
from twin.lint import lint
from twin.lint.rules import RULES

SIMULATED = [name for name, rule in RULES.items() if rule.simulates]


@pytest.fixture(scope="module")
def clean(tmp_path_factory: pytest.TempPathFactory) -> Exported:
    return export(lint_twin(), tmp_path_factory.mktemp("lint"))


def planted(clean: Exported, mutation: Mutation, folder: Path) -> Path:
    shutil.copytree(clean[mutation.format].parent, folder / "model")
    path = folder / "model" / clean[mutation.format].name
    mutation.plant(path)
    return path


def test_our_exports_have_no_finding(clean: Exported) -> None:
    report = lint(list(clean.values()))
    assert report.findings == ()
    assert report.notes == (), "everything was looked at, in MuJoCo too"


def test_every_rule_has_a_planted_fault() -> None:
    assert {m.rule for m in MUTATIONS} == set(RULES)
    assert len({m.id for m in MUTATIONS}) == len(MUTATIONS)


@pytest.mark.parametrize("mutation", [m for m in MUTATIONS if m.rule not in SIMULATED], ids=lambda m: m.id)
def test_a_planted_fault_is_found_by_its_rule_alone(
    mutation: Mutation, clean: Exported, tmp_path: Path
) -> None:
    path = planted(clean, mutation, tmp_path)
    report = lint([path], ignore=SIMULATED)
    assert {f.rule for f in report.findings} == {mutation.rule}
    for f in report.findings:
        assert f.file == str(path)
        assert f.element
        assert f.value
        assert f.remedy


@pytest.mark.parametrize("mutation", [m for m in MUTATIONS if m.rule in SIMULATED], ids=lambda m: m.id)
def test_a_planted_fault_shows_in_motion(mutation: Mutation, clean: Exported, tmp_path: Path) -> None:
    assert {f.rule for f in lint([planted(clean, mutation, tmp_path)]).findings} == {mutation.rule}


@pytest.mark.slow
@pytest.mark.parametrize("mutation", [m for m in MUTATIONS if m.rule not in SIMULATED], ids=lambda m: m.id)
def test_a_planted_fault_gives_nothing_else_in_motion(
    mutation: Mutation, clean: Exported, tmp_path: Path
) -> None:
    assert {f.rule for f in lint([planted(clean, mutation, tmp_path)]).findings} == {mutation.rule}


def test_exit_codes_and_json(clean: Exported, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["lint", str(clean["urdf"])]) == 0
    wrong = planted(clean, next(m for m in MUTATIONS if m.id == "urdf-limits-order-swapped"), tmp_path)
    assert run(["lint", str(wrong)]) == 2
    assert "limits-order" in capsys.readouterr().out
    assert run(["lint", "--json", str(wrong)]) == 2
    report = json.loads(capsys.readouterr().out)
    assert not report["ok"]
    (finding,) = report["findings"]
    assert finding["element"].startswith("joint 'door_joint' (line ")
    assert finding["value"] == "1.4 > 0 rad"
    assert run(["lint", str(wrong), "--ignore", "limits-order", *SIMULATED]) == 0
    assert run(["lint", "--rules"]) == 0
    assert all(name in capsys.readouterr().out for name in ["pivot-off-part"])


def test_a_run_folder_is_taken_whole(clean: Exported, tmp_path: Path) -> None:
    for fmt, path in clean.items():
        shutil.copytree(path.parent, tmp_path / "run" / "export" / fmt)
    report = lint([tmp_path / "run"], ignore=SIMULATED)
    assert [Path(f).name for f in report.files] == ["cabinet.urdf", "cabinet.xml", "cabinet.usda"]
    with pytest.raises(InputError, match="run `twin export` first"):
        lint([tmp_path])


BAD = {
    "torn.urdf": ('<robot name="r"><link', "not well-formed"),
    "bomb.urdf": ('<!DOCTYPE r [<!ENTITY a "aa">]><robot name="r">&a;</robot>', "document type"),
    "bomb.xml": ('<!DOCTYPE r SYSTEM "http://example.org/r.dtd"><mujoco/>', "document type"),
    "other.urdf": ("<sdf/>", "no URDF"),
    "other.xml": ("<html/>", "no MJCF"),
    "torn.usda": ("#usda 1.0\ndef Xform {", "can't be opened as USD"),
    "model.xacro": ("<robot/>", "xacro"),
    "model.dae": ("<COLLADA/>", "suffix"),
}


@pytest.mark.parametrize("name", BAD)
def test_what_can_not_be_read_is_one_line(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text, said = BAD[name]
    (tmp_path / name).write_text(text)
    assert run(["lint", str(tmp_path / name)]) == 1
    error = capsys.readouterr().err
    assert said in error
    assert error.count("\n") == 1


def test_what_is_not_there_or_not_known_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="does not exist"):
        lint([tmp_path / "none.urdf"])
    with pytest.raises(InputError, match="did you mean 'limits-order'"):
        lint([], ignore=["limit-order"])
