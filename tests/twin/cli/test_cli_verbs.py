"""What the verbs hand on: the reconstruction, the robots and the judges are stood in for."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest

from benchmarks.scenes.boards import cabinet_twin
from tests.makers.twin.stand_ins import Settings, stand_in
from twin.cli import main as cli
from twin.errors import InputError
from twin.runs.stages import Run
from twin.storage import load, save


@pytest.fixture(autouse=True)
def plain_page(monkeypatch: pytest.MonkeyPatch) -> None:
    """The page without its pictures, which have tests of their own."""
    from twin.page import page

    monkeypatch.setattr(page, "_pictures", lambda _: {"opening": [], "dollhouse": "", "plan": ""})


@pytest.fixture
def run(tmp_path: Path) -> Path:
    save(cabinet_twin(), tmp_path / "run" / "twin")
    return tmp_path / "run"


def test_a_failed_reconstruction_still_renders_the_page(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def reconstruct(recording: Any, config: Any, *, out: Path, progress: Any, hint: Any) -> None:
        with Run(out, "x", progress) as run:
            run.stage("tracks", 1, None, [], lambda: 1)
            raise InputError("nothing moves in it", "record an opening")

    stand_in(monkeypatch, open_recording=lambda *_, **__: None, reconstruct=reconstruct, ReconConfig=Settings)
    assert cli.run(["reconstruct", "rec", "-o", str(tmp_path / "run")]) == 1
    assert "tracks" in (tmp_path / "run" / "report.html").read_text(encoding="utf-8")


def test_reconstruct_hands_on_its_arguments(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    asked: list[Any] = []

    def reconstruct(recording: Any, config: Any, *, out: Path, progress: Any, hint: Any) -> Any:
        asked.extend([recording, config])
        with Run(out, "x", progress) as run:
            run.warn("no time stamps")
        save(cabinet_twin(), out / "twin")
        return load(out)

    stand_in(
        monkeypatch,
        open_recording=lambda *a, **told: (a, told),
        reconstruct=reconstruct,
        ReconConfig=Settings,
    )
    argv = [
        "reconstruct",
        "rec",
        "-o",
        str(tmp_path / "run"),
        "--layout",
        "tum",
        "--set",
        "seed=7",
        "--start",
        "1.5",
    ]
    assert cli.run(argv) == 0
    (opened, told), settings = asked
    assert opened == (Path("rec"),)
    assert {k: v for k, v in told.items() if v is not None} == {"layout": "tum", "start": 1.5}
    assert settings == Settings(7)
    out = capsys.readouterr().out
    for words in (
        "door",
        "revolute",
        "0.0 to 80.2 °",
        "drawer",
        "0.0 to 300.0 mm",
        "warning: no time stamps",
    ):
        assert words in out


def test_export_keeps_the_collision_shapes_with_the_twin(
    run: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    class Files(dict[str, Path]):
        warnings = ("usd: friction loss is left out",)
        overlaps = ()

    full = load(run)
    bare = cabinet_twin(name="bare")

    def export(
        twin: Any,
        folder: Path,
        formats: Sequence[str],
        package: str,
        cache: Path,
        *,
        asset: Any,
        overwrite: bool,
        view: Any,
        collision: Any,
        footage: Any,
    ) -> Files:
        assert (list(formats), package, asset.author) == (["urdf"], "bare_kitchen", "Me")
        return Files(urdf=folder / "x.urdf")

    stand_in(monkeypatch, complete=lambda *_: bare, export=export)
    options = ["--format", "urdf", "--package", "bare_kitchen", "--asset", "author=Me"]
    assert cli.run(["export", str(run), *options]) == 0
    assert load(run).name == "bare" != full.name
    out = capsys.readouterr().out
    assert "x.urdf" in out
    assert "warning: usd: friction loss is left out" in out


def test_check_shows_the_worst_of_each_quantity_and_what_fails(
    run: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    from twin.verification import CheckReport, CheckRow

    def row(program: str, field: str, difference: float) -> CheckRow:
        return CheckRow("urdf", program, field, "door", "1", "2", difference, 1e-3)

    def check(twin: Any, files: dict[str, Path], engines: Sequence[str], processes: int) -> CheckReport:
        assert processes == 2
        assert engines == ("mujoco", "pinocchio", "yourdfpy")
        assert files == {"urdf": run / "export" / "urdf" / "cabinet.urdf"}
        rows = (
            row("mujoco", "axis_deg", 1e-6),
            row("mujoco", "axis_deg", 2e-5),
            row("pinocchio", "axis_deg", 0.0625),
        )
        return CheckReport(rows, ("urdf/mujoco: odd",))

    assert cli.run(["check", str(run), "--format", "urdf"]) == 1
    assert "run `twin export" in capsys.readouterr().err
    (run / "export" / "urdf").mkdir(parents=True)
    (run / "export" / "urdf" / "cabinet.urdf").write_text("<robot/>")
    monkeypatch.setattr("twin.verification.proofs.check", check)
    assert cli.run(["check", str(run), "--format", "urdf"]) == 2
    out = capsys.readouterr().out
    for words in (
        "2e-05",
        "0.06",
        "0.0625",
        "FAILED",
        "2 of 3 comparisons agree",
        "warning: urdf/mujoco: odd",
    ):
        assert words in out
    assert "urdf/mujoco: odd" in (run / "report.html").read_text(encoding="utf-8")


def test_a_folder_without_twin_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.run(["export", str(tmp_path)]) == 1
    assert "holds no twin.json" in capsys.readouterr().err


def test_doctor_reports_and_exits_with_one_when_something_is_missing(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    from twin.cli import doctor

    def diagnose(findings: Sequence[doctor.Finding]) -> None:
        monkeypatch.setattr(doctor, "diagnose", lambda: list(findings))

    diagnose([doctor.Finding("python", True, "3.11")])
    assert cli.run(["doctor"]) == 0
    assert "everything that is needed is here" in capsys.readouterr().out
    diagnose([doctor.Finding("libgl1", False, "not found", "apt-get install -y libgl1")])
    assert cli.run(["doctor"]) == 1
    captured = capsys.readouterr()
    assert "missing" in captured.out
    assert captured.err.splitlines()[-1].endswith("missing or altered; apt-get install -y libgl1")
