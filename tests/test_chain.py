"""The whole chain on the shipped recording, as a user runs it: one reconstruction, then everything made from
it."""

from __future__ import annotations

import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from twin.cli import main as cli
from twin.files.assets import asset
from twin.files.text import read_json
from twin.runs.threads import threads
from twin.storage import load
from twin.verdict import Verdict

RECORDING = asset("recordings/cabinet_drawer")
STAGES = [
    "inspect", "tracks", "cameras", "gravity", "motion", "noise", "refine", "labels", "polish", "fusion", "up", "contact",
    "texture", "verdict", "handle",
]  # fmt: skip


def reconstruct(folder: Path, *more: str) -> int:
    return cli.run(["reconstruct", str(RECORDING), "-o", str(folder), *more])


def twin_bytes(folder: Path) -> dict[str, bytes]:
    """Everything that makes up the twin."""
    paths = [p for p in sorted((folder / "twin").rglob("*")) if p.is_file()]
    return {p.relative_to(folder).as_posix(): p.read_bytes() for p in paths}


def computed(folder: Path) -> dict[str, str]:
    """The stages that the last run computed, with the reason."""
    return {s["name"]: s["reason"] for s in read_json(folder / "manifest.json")["stages"] if not s["cached"]}


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("chain") / "run"
    assert reconstruct(folder) == 0
    return folder


@pytest.fixture
def run(finished: Path, tmp_path: Path) -> Path:
    """A copy of the finished run that a test may change."""
    shutil.copytree(finished, tmp_path / "run")
    return tmp_path / "run"


def test_the_run_folder_is_complete(finished: Path) -> None:
    assert [p.name[3:] for p in sorted((finished / "stages").glob("[0-9]*"))] == STAGES
    assert list(computed(finished)) == STAGES
    for name in ("config.toml", "manifest.json", "report.html", "twin/twin.json", "twin/cameras.txt"):
        assert (finished / name).stat().st_size > 0
    twin = load(finished)
    assert [p.joint.kind for p in twin.parts] == ["prismatic"]
    assert [twin.verdict, *(p.verdict for p in twin.parts)] == [Verdict(), Verdict()]  # trusted
    assert len(twin.labels) >= len(read_json(finished / "twin" / "twin.json")["cameras"]["frames"]) / 4


def test_the_shipped_recording_meets_every_goal(run: Path) -> None:
    assert cli.run(["evaluate", str(run), "--truth", str(RECORDING / "truth")]) == 0


def test_a_second_run_computes_nothing_and_changes_nothing(run: Path) -> None:
    before = twin_bytes(run)
    assert reconstruct(run) == 0
    assert computed(run) == {}
    assert twin_bytes(run) == before


def test_the_config_that_a_run_wrote_repeats_it(run: Path, tmp_path: Path) -> None:
    """Every stage has the key that it had, so that nothing is computed."""
    before, config = twin_bytes(run), tmp_path / "config.toml"
    shutil.move(run / "config.toml", config)
    assert reconstruct(run, "--config", str(config)) == 0
    assert computed(run) == {}
    assert twin_bytes(run) == before
    assert (run / "config.toml").read_bytes() == config.read_bytes()


def test_an_interrupted_run_ends_with_the_same_bytes(
    finished: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What a killed process leaves: the first stages, and half of another in a temporary folder. The number
    of threads is another."""
    monkeypatch.setenv("OMP_NUM_THREADS", "2" if threads() == 1 else "1")
    resumed = tmp_path / "run"
    for stage in sorted((finished / "stages").glob("[0-9]*"))[:7]:
        shutil.copytree(stage, resumed / "stages" / stage.name)
    half = resumed / "stages" / ".08_labels.tmp"
    half.mkdir()
    (half / "arrays.npz").write_bytes(b"PK")
    assert reconstruct(resumed) == 0
    assert list(computed(resumed)) == STAGES[7:]
    assert twin_bytes(resumed) == twin_bytes(finished)


def test_a_changed_setting_recomputes_what_depends_on_it(run: Path) -> None:
    from recon.config import ReconConfig

    gap = ReconConfig().closed_end.gap
    assert reconstruct(run, "--set", f"closed_end.gap={gap * 1.01}") == 0
    reasons = computed(run)
    assert list(reasons) == ["contact", "texture", "verdict", "handle"]
    assert f"gap changed from {gap}" in reasons["contact"]


def test_exports_agree_with_the_twin_in_every_program(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.run(["export", str(run)]) == 0
    assert cli.run(["check", str(run)]) == 0, capsys.readouterr().out


def test_the_robot_opens_the_drawer(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.run(["replay", str(run)]) == 0, capsys.readouterr().out
    (report,) = (run / "replay").glob("franka/*/report.json")
    assert read_json(report)["opening_final"] >= 0.9
    assert (report.parent / "replay.mp4").stat().st_size > 10_000
    page = (run / "report.html").read_text(encoding="utf-8")
    assert "phase by phase" in page
    assert "<td>approach</td>" in page


@pytest.mark.slow
def test_the_number_of_threads_changes_nothing(
    finished: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("OMP_NUM_THREADS", "2" if threads() == 1 else "1")
    assert reconstruct(tmp_path / "run") == 0
    assert twin_bytes(tmp_path / "run") == twin_bytes(finished)


@pytest.mark.slow
@pytest.mark.parametrize("stage", STAGES)
def test_killed_at_any_stage_it_resumes_to_the_same_bytes(stage: str, finished: Path, tmp_path: Path) -> None:
    """SIGKILL as soon as the stage before has been written, that is within this one."""
    folder, k = tmp_path / "run", STAGES.index(stage)
    for done in sorted((finished / "stages").glob("[0-9]*"))[: max(0, k - 1)]:
        shutil.copytree(done, folder / "stages" / done.name)
    command = [sys.executable, "-m", "twin", "reconstruct", str(RECORDING), "-o", str(folder)]
    before = folder / "stages" / (f"{k:02d}_{STAGES[k - 1]}" if k else ".lock")
    with subprocess.Popen(command, stderr=subprocess.DEVNULL) as process:
        while not before.exists() and process.poll() is None:
            time.sleep(0.02)
        time.sleep(0.2)
        process.send_signal(signal.SIGKILL)
    assert not (folder / "twin").exists()
    assert reconstruct(folder) == 0
    assert twin_bytes(folder) == twin_bytes(finished)
