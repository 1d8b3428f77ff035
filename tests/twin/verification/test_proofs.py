"""The verb `check` asks engines, behaviour and validators, each once, and is as good as the worst of them."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from benchmarks.scenes.boards import cabinet_twin
from twin.cli.main import run
from twin.exporters import export
from twin.scene import Twin
from twin.storage import save
from twin.validators import Finding, UsdVerdict
from twin.verification import ENGINES, OURS, CheckReport, CheckRow, proofs
from twin.verification.behaviour import BehaviourReport, BehaviourRow


@pytest.fixture(scope="module")
def run_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("proofs") / "run"
    twin = cabinet_twin()
    save(twin, folder / "twin")
    export(twin, folder / "export")
    return folder


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """All three questions are answered at once and well; who was asked is noted."""
    names: list[str] = []

    def check(twin: Twin, files: dict[str, Path], engines: tuple[str, ...], processes: int) -> CheckReport:
        names.extend(engines)
        return CheckReport((CheckRow("urdf", engines[0], "mass", "door", "1", "1", 0.0, 1e-5),), ())

    def behave(twin: Twin, files: dict[str, Path]) -> BehaviourReport:
        names.append("behaviour")
        return BehaviourReport((BehaviourRow("urdf", "door", "sweep_m", 0.0, 1e-3, "deepest contact"),))

    def validate_usd(path: Path) -> UsdVerdict:
        names.append(path.name)
        return UsdVerdict((), {"Core": True, "Optional": False})

    monkeypatch.setattr(proofs, "interpreter", Path)
    for stand_in in (check, behave, validate_usd):
        monkeypatch.setattr(proofs, stand_in.__name__, stand_in)
    return names


@pytest.mark.parametrize(
    ("arguments", "who"),
    [
        ((), [*OURS, "behaviour"]),
        (("--engines", "yourdfpy"), ["yourdfpy", "behaviour"]),
        (("--engines", "validators"), ["behaviour", "cabinet.usda"]),
        (("--engines", "validators", "--format", "urdf"), ["behaviour"]),
        (("--engines", "all"), [*ENGINES, "behaviour", "cabinet.usda"]),
    ],
)
def test_who_is_named_is_asked(
    arguments: tuple[str, ...],
    who: list[str],
    asked: list[str],
    run_folder: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert run(["check", str(run_folder), "--json", *arguments]) == 0
    assert asked == who
    told = json.loads(capsys.readouterr().out)
    assert told["behaviour"]["ok"]
    assert ("agreement" in told) == any(n in ENGINES for n in who)
    assert ("validators" in told) == ("cabinet.usda" in who)


def test_an_error_of_a_validator_fails_the_check(
    asked: list[str], run_folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    bad = UsdVerdict((Finding("nvidia", "error", "a rule", "what is wrong", "cabinet.usda"),))
    monkeypatch.setattr(proofs, "validate_usd", lambda _: bad)
    assert run(["check", str(run_folder), "--engines", "validators"]) == 2
    out = capsys.readouterr().out
    assert "what is wrong" in out
    assert "1 of 1 demands on behaviour met" in out, "the others are still told"


@pytest.mark.parametrize("name", ["drake", "validators", "all"])
def test_a_missing_environment_is_one_line(
    name: str,
    run_folder: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setenv("FUNTWIN_ENGINES", str(tmp_path / "none"))
    monkeypatch.setattr(proofs, "behave", lambda *_: BehaviourReport(()))
    assert run(["check", str(run_folder), "--engines", name]) == 1
    last = capsys.readouterr().err.strip().splitlines()[-1]
    assert last.startswith("twin: the environment of engine")
    assert "twin engines --install" in last
