"""The chain around its stages: keys, and what a twin made again keeps."""

from __future__ import annotations

import json
import sys
import types
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.scenes.boards import cabinet_twin
from recon import pipeline
from recon.config import ReconConfig
from recon.interaction.joints.type_selection import TypeHint
from recon.interaction.parts.config import MotionConfig
from recon.pipeline import _provenance, _run, reconstruct
from recon.readers import open_recording
from recon.recording import Intrinsics, Recording
from recon.windows.windows import Window
from tests.makers.recon import tiny
from tests.makers.runs import STAGES
from twin.errors import InputError, MissingDependencyError
from twin.files.text import read_json
from twin.level import DOUBTED
from twin.physics.edit import given, set_physics
from twin.runs.manifest import MANIFEST
from twin.runs.stages import Run
from twin.scene import Twin
from twin.storage import load, save


def still() -> Recording:
    """Ten black pictures."""
    return Recording.from_arrays(
        np.zeros((10, 4, 6, 3), np.uint8), np.ones((10, 4, 6)), Intrinsics(6, 4, 5.0, 5.0, 2.5, 1.5), fps=10
    )


@pytest.mark.parametrize("hints", [(), (TypeHint("revolute", 5, 35, "seer-1"),)])
def test_a_run_without_hints_has_the_keys_it_had(hints: tuple[TypeHint, ...]) -> None:
    """The settings that make up the key of the stage, which hints join only when there are some."""
    config = ReconConfig()
    seen: dict[str, object] = {}

    class Stop(Exception): ...

    class Recorder:
        def loop(self, _: str) -> None: ...

        def stage(self, name: str, _: int, settings: object, *_more: object, **_items: object) -> object:
            seen[name] = settings
            if name == "motion":
                raise Stop
            return types.SimpleNamespace(value=(Window(0, 9),) if name == "windows" else None)

    with pytest.raises(Stop):
        _run(Recorder(), still(), config, hints, None)  # type: ignore[arg-type]
    assert seen["motion"] == (
        ((config.motion, config.joints), hints) if hints else (config.motion, config.joints)
    )


def test_provenance_keeps_what_gravity_doubts_and_nothing_where_it_does_not() -> None:
    assert DOUBTED not in _provenance(ReconConfig(), (), ())
    assert _provenance(ReconConfig(), (), ("wall and floor may be exchanged",))[DOUBTED] == [
        "wall and floor may be exchanged"
    ]


def test_a_missing_extra_is_told_before_the_recording_is_opened(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "sklearn.cluster", None)
    config = ReconConfig(motion=MotionConfig(method="clusters"))
    with pytest.raises(MissingDependencyError, match="scikit-learn"):
        reconstruct(tmp_path / "none", config)
    with pytest.raises(InputError, match="none"):
        reconstruct(tmp_path / "none", ReconConfig())


def test_progress_on_request_counts_the_stages(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def run_of_one_stage(run: Run, *_: object) -> Twin:
        return run.stage("tracks", 1, None, [], cabinet_twin).value

    monkeypatch.setattr(pipeline, "_run", run_of_one_stage)
    reconstruct(still(), progress=True)
    assert f", 2 of {len(STAGES)}" in capsys.readouterr().err


def test_a_weighed_mass_outlives_another_reconstruction(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    recording = open_recording(
        tiny.write_recording(tmp_path / "r", ("door",), frames=60, scale=1, still=True)
    )
    twin, out = cabinet_twin(), tmp_path / "run"
    monkeypatch.setattr(pipeline, "_run", lambda *_: twin)
    save(set_physics(twin, "door", {"mass": given("mass", 3.2, measured=True)}).twin, out / "twin")
    assert reconstruct(recording, out=out).part("door").inertial.mass.value == 3.2
    assert load(out).part("door").inertial.mass.value == 3.2
    assert load(out).part("drawer").inertial.mass == twin.part("drawer").inertial.mass
    (out / "twin" / "twin.json").write_text("{}")
    assert reconstruct(recording, out=out) is twin
    assert "the earlier twin can't be read and is kept in" in read_json(out / MANIFEST)["warnings"][-1]


def test_the_manifest_says_where_the_recording_is_from_the_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(pipeline, "_run", lambda *_: cabinet_twin())
    tiny.write_recording(tmp_path / "data" / "r", ("door",), frames=60, scale=1, still=True)
    monkeypatch.chdir(tmp_path / "data")
    out = tmp_path / "runs" / "run"
    reconstruct(open_recording(Path("r")), out=out)
    assert read_json(out / MANIFEST)["recording"] == "../../data/r"
    assert str(tmp_path) not in (out / "twin" / "twin.json").read_text()
    elsewhere = replace(open_recording(Path("r")), source="a camera", path=None)
    reconstruct(elsewhere, out=tmp_path / "b")
    assert "recording" not in read_json(tmp_path / "b" / MANIFEST)


def test_a_twin_that_the_user_changed_outlives_another_reconstruction(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    recording = open_recording(
        tiny.write_recording(tmp_path / "r", ("door",), frames=60, scale=1, still=True)
    )
    twin, out = cabinet_twin(), tmp_path / "run"
    found = [twin]
    monkeypatch.setattr(pipeline, "_run", lambda *_: found[0])
    file = out / "twin" / "twin.json"

    def change(**keys: object) -> None:
        document = json.loads(file.read_text())
        document["parts"][0]["joint"] |= keys
        file.write_text(json.dumps(document))

    reconstruct(recording, out=out)
    (out / "twin" / "notes.md").write_text("mine")
    change(upper=1.25, bought=1987)
    edited = file.read_bytes()
    # the same result: what stands there stays, and is what the caller gets
    assert reconstruct(recording, out=out).part("door").joint.upper == 1.25
    assert file.read_bytes() == edited
    assert "stays as it is" in read_json(out / MANIFEST)["warnings"][-1]
    # another result: the new twin takes the place, the changed one stays beside it
    door = replace(twin.part("door"), joint=replace(twin.part("door").joint, upper=1.0))
    found[0] = replace(twin, parts=(door, *twin.parts[1:]))
    assert reconstruct(recording, out=out).part("door").joint.upper == 1.0
    assert (out / "twin_before_1" / "twin.json").read_bytes() == edited
    assert "twin_before_1" in read_json(out / MANIFEST)["warnings"][-1]
    now = json.loads(file.read_text())["parts"][0]["joint"]
    assert (now["upper"], now["bought"]) == (1.0, 1987)
    assert (out / "twin" / "notes.md").read_text() == "mine"
    # unchanged since, another result: nothing to keep
    found[0] = twin
    reconstruct(recording, out=out)
    assert not (out / "twin_before_2").exists()


def test_settings_of_somebody_else_are_not_replaced(tmp_path: Path) -> None:
    recording = open_recording(
        tiny.write_recording(tmp_path / "r", ("door",), frames=60, scale=1, still=True)
    )
    (tmp_path / "config.toml").write_text("mine = true")
    with pytest.raises(InputError, match="no run folder"):
        reconstruct(recording, out=tmp_path)
    assert (tmp_path / "config.toml").read_text() == "mine = true"
    assert sorted(p.name for p in tmp_path.iterdir()) == ["config.toml", "r"]
