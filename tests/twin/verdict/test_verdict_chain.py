"""Verdicts through the chain: exports, verbs with their exit codes, and pages say them."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import pytest

import twin as funtwin
from benchmarks.scenes.boards import cabinet_twin
from tests.makers.twin.judged import bare, doubted
from tests.makers.twin.stand_ins import stand_in
from twin import verdict as v
from twin.cli import main, verbs
from twin.cli.console import Outcome
from twin.cli.step import Step, judged
from twin.page import page
from twin.scene import Twin
from twin.storage import load, save
from twin.verdict import Verdict


@pytest.fixture(autouse=True)
def plain_page(monkeypatch: pytest.MonkeyPatch) -> None:
    """Pages without the pictures of the twin, which take seconds."""
    monkeypatch.setattr(page, "_pictures", lambda _: {"opening": [], "dollhouse": "", "plan": ""})


def exported(twin: Twin, folder: Path) -> dict[str, Path]:
    return dict(funtwin.export(twin, folder))


def comment(path: Path) -> str:
    """The first node in a file's root, a comment."""
    parser = ET.XMLParser(target=ET.TreeBuilder(insert_comments=True))  # noqa: S314
    first = ET.parse(path, parser).getroot()[0]  # noqa: S314  (our own file)
    assert first.tag is ET.Comment  # type: ignore[comparison-overlap]
    return str(first.text)


def prim_data(path: Path, name: str) -> Any:
    from pxr import Usd

    stage = Usd.Stage.Open(str(path))
    return stage.GetPrimAtPath(f"/{name}").GetCustomDataByKey("verdict")


def test_exports_carry_the_verdict(tmp_path: Path) -> None:
    files = exported(doubted(), tmp_path)
    for path in (files["urdf"], files["mjcf"], files["mjcf"].with_name("scene.xml")):
        assert "verdict: doubtful: door: its axis is known to ± 1.25° only" in comment(path)
    for path in (files["usd"], files["usd"].with_name("cabinet_physx.usda")):
        data = prim_data(path, "cabinet")
        assert data["level"] == "doubtful"
        assert "its axis is known to ± 1.25° only" in data["reasons"][0]
    for path in files.values():
        readme = path.with_name("README.md").read_text()
        assert "Verdict: **doubtful**\n\n- doubtful: door: its axis" in readme
        assert readme.index("Verdict") < 20


def test_exports_of_a_stated_twin_are_as_they_were(tmp_path: Path) -> None:
    stated = replace(cabinet_twin(), recorded=None)
    files = exported(stated, tmp_path)
    for path in (files["urdf"], files["mjcf"]):
        assert "verdict" not in path.read_text()
    assert prim_data(files["usd"], "cabinet") is None
    assert "Verdict: none, stated, not reconstructed." in files["urdf"].with_name("README.md").read_text()


def told(capsys: pytest.CaptureFixture[str], *argv: object) -> tuple[int, list[str], str]:
    """Exit code, lines of stdout and stderr of a command."""
    capsys.readouterr()
    code = main.run([str(a) for a in argv])
    said = capsys.readouterr()
    return code, said.out.splitlines(), said.err


def test_a_twin_without_parts_goes_through_the_chain(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run = tmp_path / "run"
    save(bare(), run / "twin")
    line = "verdict: refused: nothing articulated was found; 1 thing moved freely; record a part being opened"
    code, out, _ = told(capsys, "export", run)
    assert code == 0
    assert out[0].startswith(line)
    import mujoco
    import yourdfpy
    from pxr import Usd

    folder = run / "export"
    model = mujoco.MjModel.from_xml_path(str(folder / "mjcf" / "cabinet.xml"))
    assert (model.njnt, model.ngeom > 1) == (0, True)
    robot = yourdfpy.URDF.load(str(folder / "urdf" / "cabinet.urdf"))
    assert robot.actuated_joint_names == []
    stage = Usd.Stage.Open(str(folder / "usd" / "cabinet.usda"))
    assert stage.GetPrimAtPath("/cabinet/carcass").IsValid()
    code, out, _ = told(capsys, "check", run, "--engines", "mujoco", "yourdfpy", "--json")
    assert code == 0
    assert json.loads("\n".join(out))["verdict"] == v.verdict_document(bare().verdict)
    code, _, _ = told(capsys, "lint", run)
    assert code == 0
    for verb in (("replay",), ("trajectory", "--format", "csv", "-o", tmp_path / "t")):
        code, out, err = told(capsys, verb[0], run, *verb[1:])
        assert code == 1
        assert len(err.splitlines()) == 1
        assert "has no moving part" in err
        assert "nothing articulated was found; 1 thing moved freely" in err
    shown = (run / "report.html").read_text()
    assert 'class="verdict refused"' in shown
    assert "nothing articulated was found; 1 thing moved freely" in shown


def test_json_carries_the_verdict_and_whatever_the_verb_tells() -> None:
    outcome = judged(Outcome({"files": {}}, ok=True), doubted())
    assert outcome.data["verdict"] == v.verdict_document(doubted().verdict)
    assert (outcome.data["files"], outcome.ok) == ({}, True)
    assert outcome.first.startswith("verdict: doubtful: door: its axis is known to ± 1.25° only")
    assert judged(Outcome({}), cabinet_twin()).data == {"verdict": None}


CODES = [("trusted", 0), ("doubtful", 2), ("refused", 2)]


@pytest.fixture
def made(monkeypatch: pytest.MonkeyPatch) -> dict[str, Twin]:
    """Twins by their verdicts, one of which is found whatever is reconstructed: that under the recording's
    name."""
    trusted = replace(cabinet_twin(), verdict=Verdict())
    twins = {"trusted": trusted, "doubtful": doubted(), "refused": bare()}

    def reconstruct(recording: str, *_: Any, out: Path, **__: Any) -> Twin:
        save(twins[recording], out / "twin")
        return twins[recording]

    stand_in(monkeypatch, open_recording=lambda path, **_: path.name, reconstruct=reconstruct)
    return twins


@pytest.mark.usefixtures("made")
@pytest.mark.parametrize(("level", "code"), CODES)
def test_reconstruct_ends_with_two_where_it_is_not_trusted(
    level: str, code: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    ended, out, err = told(capsys, "reconstruct", tmp_path / level, "-o", tmp_path / "run")
    assert ended == code
    assert out[0].startswith(f"verdict: {level}")
    said = [line for line in err.splitlines() if line.startswith("twin: ")]
    assert said == ([] if code == 0 else [f"twin: {out[0]}"])
    assert load(tmp_path / "run").name == "cabinet"
    ended, out, _ = told(capsys, "reconstruct", tmp_path / level, "-o", tmp_path / "run", "--json")
    report = json.loads("\n".join(out))
    assert (ended, report["ok"], report["verdict"]["level"]) == (code, code == 0, level)


@pytest.mark.usefixtures("made")
@pytest.mark.parametrize(("level", "code"), CODES)
def test_demo_ends_with_two_where_it_is_not_trusted(
    level: str, code: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    import robots.replay_verb

    moved = []

    def step(verb: str) -> Any:
        def done(*_: Any) -> Step:
            moved.append(verb)
            return Step(verb, Outcome({}), verb, 0.0)

        return done

    monkeypatch.setattr(verbs, "export_step", step("export"))
    monkeypatch.setattr(verbs, "check_step", step("check"))
    monkeypatch.setattr(robots.replay_verb, "replay_step", step("replay"))
    ended, out, _ = told(capsys, "demo", "--recording", tmp_path / level, "-o", tmp_path / "run")
    assert (ended, out[0].split(";")[0].startswith(f"verdict: {level}")) == (code, True)
    assert moved == ["export", "check", *([] if level == "refused" else ["replay"])]  # nothing to replay


@pytest.mark.parametrize(
    ("twin", "shown"),
    [
        (doubted(), 'class="verdict doubtful"><b>Doubtful</b>'),
        (doubted(replace(cabinet_twin(), parts=cabinet_twin().parts[1:])), 'class="verdict doubtful"'),
        (replace(cabinet_twin(), verdict=Verdict()), 'class="verdict trusted"><b>Trusted</b>'),
        (cabinet_twin(), "No verdict: made before verdicts"),
    ],
    ids=["doubtful", "other part", "trusted", "none"],
)
def test_the_page_begins_with_the_verdict(twin: Twin, shown: str, tmp_path: Path) -> None:
    save(twin, tmp_path / "twin")
    text = page.render(tmp_path).read_text()
    assert shown in text
    assert text.index('class="verdict') < text.index('class="cards"')
