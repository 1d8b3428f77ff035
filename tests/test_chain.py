"""The whole chain on the shipped recording, as a user runs it: one reconstruction, then everything made from
it."""

from __future__ import annotations

import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import mujoco
import pytest

from tests.makers.runs import STAGES, computed, reconstruct, twin_bytes
from twin.cli import main as cli
from twin.files.assets import asset
from twin.files.text import read_json
from twin.runs.threads import threads
from twin.storage import load
from twin.verdict import Verdict

RECORDING = asset("recordings/cabinet_drawer")


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("chain") / "run"
    assert reconstruct(RECORDING, folder) == 0
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
    assert twin.verdict == Verdict()
    (verdict,) = (p.verdict for p in twin.parts)
    assert verdict.trusted
    assert verdict.probability > 0.95
    assert len(twin.labels) >= len(read_json(finished / "twin" / "twin.json")["cameras"]["frames"]) / 4


def test_the_shipped_recording_meets_every_goal(run: Path) -> None:
    assert cli.run(["evaluate", str(run), "--truth", str(RECORDING / "truth")]) == 0


def test_exports_agree_with_the_twin_in_every_program(
    run: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delattr("twin.completion.infer.infer")  # an export only takes from the layer of the run
    assert cli.run(["export", str(run)]) == 0
    assert cli.run(["check", str(run)]) == 0, capsys.readouterr().out


def test_the_robot_opens_the_drawer(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.run(["replay", str(run)]) == 0, capsys.readouterr().out
    (report,) = (run / "replay").glob("franka/*/report.json")
    assert read_json(report)["opening_final"] >= 0.9
    assert (report.parent / "replay.mp4").stat().st_size > 10_000
    scene = mujoco.MjModel.from_xml_path(str(report.parent / "scene.xml"))
    assert scene.nkey == 3
    assert scene.ntext >= 2, "what of the twin is inferred, and why"
    page = (run / "report.html").read_text(encoding="utf-8")
    assert "phase by phase" in page
    assert "<td>approach</td>" in page


@pytest.mark.slow
def test_the_number_of_threads_changes_nothing(
    finished: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("OMP_NUM_THREADS", "2" if threads() == 1 else "1")
    assert reconstruct(RECORDING, tmp_path / "run") == 0
    assert twin_bytes(tmp_path / "run") == twin_bytes(finished)


@pytest.mark.slow
@pytest.mark.parametrize("stage", STAGES)
def test_killed_at_any_stage_it_resumes_to_the_same_bytes(stage: str, finished: Path, tmp_path: Path) -> None:
    """SIGKILL as soon as the stage before has been written, that is within this one."""
    folder, k = tmp_path / "run", STAGES.index(stage)
    for done in sorted((finished / "stages").glob("[0-9]*"))[: max(0, k - 1)]:
        shutil.copytree(done, folder / "stages" / done.name)
    command = [sys.executable, "-m", "twin", "reconstruct", str(RECORDING), "-o", str(folder)]
    before = folder / "stages" / f"{k:02d}_{STAGES[k - 1]}" if k else folder / ".lock"
    with subprocess.Popen(command, stderr=subprocess.DEVNULL) as process:
        while not before.exists() and process.poll() is None:
            time.sleep(0.02)
        time.sleep(0.2)
        process.send_signal(signal.SIGKILL)
    assert not (folder / "twin").exists()
    assert reconstruct(RECORDING, folder) == 0
    assert twin_bytes(folder) == twin_bytes(finished)
