"""Up is told by what is level and plumb, contradicted by two witnesses that agree, and by one never."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.scenes.boards import cabinet_twin
from tests.makers.twin.rested import left_at, only
from twin import geometry as geo
from twin.cli.main import run
from twin.exporters import export
from twin.level import AGREE_DEG, DOUBTED, TILT_DEG, UP, Witness, doubts_about_up, judged, level_evidence
from twin.mesh import sample_surface
from twin.physics import with_physics
from twin.scene import Mesh, StaticPart
from twin.storage import save
from twin.verification import proofs
from twin.verification.behaviour import BehaviourReport


def tilted(degrees: float, seed: int = 0) -> np.ndarray:
    """A pose whose up leans by so much to some side."""
    rng = np.random.default_rng(seed)
    side = geo.unit(np.array([*rng.normal(size=2), 0.0]))
    return geo.make_pose(
        geo.exp_so3(np.deg2rad(degrees) * side) @ geo.exp_so3([0.0, 0.0, rng.uniform(-3, 3)])
    )


@pytest.mark.parametrize(("degrees", "seed"), [(0.0, 0), (1.5, 1), (2.5, 2), (5.0, 3), (10.0, 4), (20.0, 5)])
def test_a_leaning_cabinet_contradicts_up_from_two_degrees_on(degrees: float, seed: int) -> None:
    found = level_evidence(cabinet_twin(tilted(degrees, seed), lid=True))
    assert len(found.witnesses) >= 5
    assert found.tilt_deg == pytest.approx(degrees, abs=0.05)
    assert found.contradicted == (degrees > TILT_DEG)
    assert found.agree == len(found.witnesses)
    assert f"{found.tilt_deg:.1f} deg" in found.text
    assert bool(doubts_about_up(cabinet_twin(tilted(degrees, seed)))) == found.contradicted


def test_noise_of_a_scan_is_not_taken_for_a_lean() -> None:
    twin = cabinet_twin(tilted(3.0, 7))
    points, _ = sample_surface(twin.static.mesh, 10, np.random.default_rng(0))
    assert len(points) == 10
    rng = np.random.default_rng(1)
    for degrees in (0.0, 3.0):
        mesh = cabinet_twin(tilted(degrees, 7)).static.mesh
        rough = Mesh(mesh.vertices + rng.normal(scale=0.002, size=mesh.vertices.shape), mesh.faces)
        found = level_evidence(replace(cabinet_twin(tilted(degrees, 7)), static=StaticPart("carcass", rough)))
        assert found.tilt_deg == pytest.approx(degrees, abs=0.5)
        assert found.contradicted == (degrees > TILT_DEG)


def leaning(axis: list[float], degrees: float, about: list[float]) -> np.ndarray:
    return geo.exp_so3(np.deg2rad(degrees) * np.array(about)) @ np.array(axis)


LEVEL = [
    Witness("floor", UP),
    Witness("wall", np.array([1.0, 0, 0])),
    Witness("wall 2", np.array([0, 1.0, 0])),
]


def test_one_witness_never_contradicts() -> None:
    for degrees in (3.0, 8.0, 40.0, 90.0):
        drawer = Witness("drawer", leaning([0, -1.0, 0], degrees, [1.0, 0, 0]), level_only=True)
        assert not judged([drawer]).contradicted
        assert not judged([*LEVEL, drawer]).contradicted
    assert not judged([]).contradicted
    assert judged([]).text.startswith("nothing level or plumb")


def test_two_that_agree_do_and_two_that_do_not_agree_do_not() -> None:
    turned = [leaning(list(w.direction), 6.0, [1.0, 0, 0]) for w in LEVEL]
    floor, back = Witness("floor", turned[0]), Witness("back", turned[2])
    both = judged([floor, back])
    assert both.contradicted
    assert both.tilt_deg == pytest.approx(6.0, abs=1e-6)
    assert set(both.against) == {"floor", "back"}
    other = Witness("back", leaning([0, 1.0, 0], 13.0, [1.0, 0, 0]))
    assert not judged([floor, other]).contradicted
    assert not judged([*LEVEL, Witness("sloping roof", leaning([0, 0, 1.0], 30.0, [1.0, 0, 0]))]).contradicted


def test_drawers_tell_a_wall_that_was_taken_for_the_floor() -> None:
    """Planes fit as well when up is turned by 90 degrees; what slides does not."""
    up_and_down = [Witness(f"drawer {k}", UP, level_only=True) for k in range(2)]
    assert judged([*LEVEL, *up_and_down]).contradicted
    assert judged([*LEVEL, *up_and_down]).tilt_deg == pytest.approx(90.0, abs=1e-6)
    assert not judged([*LEVEL, up_and_down[0]]).contradicted


@pytest.mark.parametrize("seed", range(30))
def test_witnesses_within_two_degrees_contradict_nothing(seed: int) -> None:
    """Also where some of them agree better on an up that is turned by 90 degrees."""
    rng = np.random.default_rng(seed)
    found = []
    for k in range(rng.integers(1, 9)):
        axis = np.eye(3)[rng.integers(3)]
        off = geo.exp_so3(np.deg2rad(rng.uniform(0, 1.9)) * geo.unit(rng.normal(size=3))) @ axis
        found.append(Witness(f"w{k}", off, level_only=bool(abs(axis[2]) < 0.5 and rng.random() < 0.5)))
    told = judged(found)
    assert not told.contradicted
    assert told.tilt_deg < TILT_DEG + AGREE_DEG


def test_the_same_mesh_gives_the_same_evidence() -> None:
    twin = cabinet_twin(tilted(5.0))
    one, other = level_evidence(twin), level_evidence(twin)
    assert [w.name for w in one.witnesses] == [w.name for w in other.witnesses]
    assert np.array_equal(one.up, other.up)


def test_export_and_check_tell_and_a_lid_that_needs_a_catch_is_not_raised(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    leaning = only(left_at(cabinet_twin(tilted(6.0), lid=True), "lid", np.deg2rad(50.0)), "lid")
    twin = with_physics(leaning)
    assert twin.part("lid").physics.frictionloss.origin == "default"  # type: ignore[union-attr]
    (doubt,) = doubts_about_up(twin)
    files = export(twin, tmp_path / "export", ("mjcf",))
    assert f"all: {doubt}" in files.warnings
    assert any("lid rested at 50 deg" in w and "up is in doubt" in w for w in files.warnings)
    save(twin, tmp_path / "twin")
    monkeypatch.setattr(proofs, "behave", lambda *_: BehaviourReport(()))
    assert run(["check", str(tmp_path), "--format", "mjcf", "--engines", "mujoco", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["up"]["contradicted"]
    assert told["up"]["tilt_deg"] == pytest.approx(6.0, abs=0.05)
    assert doubt in told["warnings"]


def test_what_the_reconstruction_said_is_a_doubt() -> None:
    twin = cabinet_twin()
    assert doubts_about_up(twin) == ()
    assert doubts_about_up(replace(twin, provenance={DOUBTED: ["pitched by about 45 degrees"]})) == (
        "pitched by about 45 degrees",
    )
