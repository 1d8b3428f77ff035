"""The chain around its stages: keys, and what a twin made again keeps."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from recon import pipeline
from recon.config import ReconConfig
from recon.joint_type import TypeHint
from recon.pipeline import _run, reconstruct
from recon.recording import open_recording
from tests.recon import tiny
from tests.twin.scenes import cabinet_twin
from twin.physics.edit import given, set_physics
from twin.stages import MANIFEST, read_json
from twin.storage import load, save


@pytest.mark.parametrize("hints", [(), (TypeHint("revolute", 5, 35, "seer-1"),)])
def test_a_run_without_hints_has_the_keys_it_had(hints: tuple[TypeHint, ...]) -> None:
    """The settings that make up the key of the stage, which hints join only when there are some."""
    config = ReconConfig()
    seen: dict[str, object] = {}

    class Stop(Exception): ...

    class Recorder:
        def stage(self, name: str, _: int, settings: object, *_more: object) -> None:
            seen[name] = settings
            if name == "motion":
                raise Stop

    with pytest.raises(Stop):
        _run(Recorder(), None, config, hints)  # type: ignore[arg-type]
    assert seen["motion"] == ((config.motion, hints) if hints else config.motion)


def test_a_weighed_mass_outlives_another_reconstruction(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    recording = open_recording(
        tiny.write_recording(tmp_path / "r", ("door",), frames=40, scale=1, still=True)
    )
    twin, out = cabinet_twin(), tmp_path / "run"
    monkeypatch.setattr(pipeline, "_run", lambda *_: twin)
    save(set_physics(twin, "door", {"mass": given("mass", 3.2, measured=True)}).twin, out / "twin")
    assert reconstruct(recording, out=out).part("door").inertial.mass.value == 3.2
    assert load(out).part("door").inertial.mass.value == 3.2
    assert load(out).part("drawer").inertial.mass == twin.part("drawer").inertial.mass
    (out / "twin" / "twin.json").write_text("{}")
    assert reconstruct(recording, out=out) is twin
    assert "the earlier twin is replaced" in read_json(out / MANIFEST)["warnings"][-1]


def test_the_manifest_says_where_the_recording_is_from_the_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(pipeline, "_run", lambda *_: cabinet_twin())
    tiny.write_recording(tmp_path / "data" / "r", ("door",), frames=40, scale=1, still=True)
    monkeypatch.chdir(tmp_path / "data")
    out = tmp_path / "runs" / "run"
    reconstruct(open_recording(Path("r")), out=out)
    assert read_json(out / MANIFEST)["recording"] == "../../data/r"
    assert str(tmp_path) not in (out / "twin" / "twin.json").read_text()
    elsewhere = replace(open_recording(Path("r")), source="a camera", path=None)
    reconstruct(elsewhere, out=tmp_path / "b")
    assert "recording" not in read_json(tmp_path / "b" / MANIFEST)
