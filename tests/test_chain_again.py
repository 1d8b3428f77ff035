"""What a run does that finds an earlier one, whole or cut short, in its folder: a small clip is enough."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest

from recon import pipeline
from recon.inspection.findings import as_reason, finding
from tests.makers.recon import tiny
from tests.makers.runs import STAGES, computed, reconstruct, twin_bytes
from twin.runs.threads import threads
from twin.storage import load

UP = ("--up", "0,-1,-0.07")  # of the first picture: the clip is too small to tell


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A door is opened."""
    return tiny.write_recording(tmp_path_factory.mktemp("again") / "clip", frames=30, scale=2, pattern=47.0)


@pytest.fixture(scope="module")
def finished(recording: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("again") / "run"
    assert reconstruct(recording, folder, *UP) == 0
    assert [p.joint.kind for p in load(folder).parts] == ["revolute"]
    return folder


@pytest.fixture
def run(finished: Path, tmp_path: Path) -> Path:
    """A copy of the finished run that a test may change."""
    shutil.copytree(finished, tmp_path / "run")
    return tmp_path / "run"


def test_a_second_run_computes_nothing_and_changes_nothing(recording: Path, run: Path) -> None:
    before = twin_bytes(run)
    assert reconstruct(recording, run, *UP) == 0
    assert computed(run) == {}
    assert twin_bytes(run) == before


def test_the_config_that_a_run_wrote_repeats_it(recording: Path, run: Path, tmp_path: Path) -> None:
    """Every stage has the key that it had, so that nothing is computed."""
    before, config = twin_bytes(run), tmp_path / "config.toml"
    shutil.move(run / "config.toml", config)
    assert reconstruct(recording, run, *UP, "--config", str(config)) == 0
    assert computed(run) == {}
    assert twin_bytes(run) == before
    assert (run / "config.toml").read_bytes() == config.read_bytes()


def test_an_interrupted_run_ends_with_the_same_bytes(
    recording: Path, finished: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What a killed process leaves: the first stages, and half of another in a temporary folder. The number
    of threads is another."""
    monkeypatch.setenv("OMP_NUM_THREADS", "2" if threads() == 1 else "1")
    resumed = tmp_path / "run"
    for stage in sorted((finished / "stages").glob("[0-9]*"))[:9]:
        shutil.copytree(stage, resumed / "stages" / stage.name)
    half = resumed / "stages" / ".10_labels.tmp"
    half.mkdir()
    (half / "arrays.npz").write_bytes(b"PK")
    assert reconstruct(recording, resumed, *UP) == 0
    assert list(computed(resumed)) == STAGES[9:]
    assert twin_bytes(resumed) == twin_bytes(finished)


def test_a_changed_setting_recomputes_what_depends_on_it(recording: Path, run: Path) -> None:
    """A name that the user gave stays."""
    from recon.config import ReconConfig

    rename(run, "wine")
    voxel = ReconConfig().fusion.static_voxel
    assert reconstruct(recording, run, *UP, "--set", f"fusion.static_voxel={voxel * 1.01}") == 0
    reasons = computed(run)
    assert list(reasons) == ["fusion", "up", "contact", "texture", "verdict", "handle", "completion"]
    assert f"static_voxel changed from {voxel}" in reasons["fusion"]
    assert [p.name for p in load(run).parts] == ["wine"]


def rename(run: Path, name: str) -> None:
    """The only part, as a user does it."""
    file = run / "twin" / "twin.json"
    document = json.loads(file.read_text())
    (part,) = document["parts"]
    part["name"] = name
    file.write_text(json.dumps(document))


def test_a_fault_of_the_recording_makes_the_twin_doubtful(
    recording: Path, run: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Only what may have spoilt the twin: small pictures are a fault, too."""
    cut = finding("Cut", 12, 1)
    monkeypatch.setattr(pipeline, "quick_findings", lambda _: (cut, finding("Small", 96, 72)))
    shutil.rmtree(run / "stages" / "01_inspect")
    assert reconstruct(recording, run, *UP) == 2
    assert list(computed(run)) == ["inspect", "verdict", "handle", "completion"]
    found = load(run).verdict
    assert found is not None
    assert found.of_all.reasons == (as_reason(cut),)
