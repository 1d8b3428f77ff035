"""A contact off its part is told by every verb that would trust it, and can still be read and mended."""

from __future__ import annotations

import json
import logging
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.scenes.boards import cabinet_twin
from twin.cli import main as cli
from twin.contacts import allowed, contact_off, contacts_off, distance_to
from twin.errors import PlanningError
from twin.exporters import export
from twin.lint import lint
from twin.lint.rules.twins import TWIN_RULES
from twin.scene import Twin
from twin.storage import load, save


def shifted(metres: float, width: float | None = None) -> Twin:
    """The cabinet whose door is held that far in front of its handle."""
    twin = cabinet_twin()
    door = twin.part("door")
    contact = door.contact
    out = contact.rotation[:, 2]
    moved = replace(
        contact, point=contact.point + metres * out, width=contact.width if width is None else width
    )
    return replace(twin, parts=(replace(door, contact=moved), twin.part("drawer")))


@pytest.mark.parametrize("seed", range(5))
def test_distance_to_the_surface_is_that_of_the_nearest_of_many_samples(seed: int) -> None:
    rng, mesh = np.random.default_rng(seed), cabinet_twin().part("door").mesh
    point = mesh.area_centroid + rng.normal(size=3) * 0.3
    corners = mesh.vertices[mesh.faces][rng.integers(0, len(mesh.faces), 60_000)]
    weights = rng.dirichlet(np.ones(3), len(corners))
    nearest = np.linalg.norm((corners * weights[:, :, None]).sum(axis=1) - point, axis=1).min()
    assert distance_to(mesh, point) <= nearest
    assert distance_to(mesh, point) == pytest.approx(nearest, abs=0.02)


def test_the_tolerance_is_a_hand_and_half_of_what_it_holds() -> None:
    held = cabinet_twin().part("door").contact
    assert allowed(replace(held, width=0.06)) - allowed(replace(held, width=0.02)) == pytest.approx(0.02)
    assert contacts_off(cabinet_twin()) == ()
    assert contact_off(shifted(0.05).part("door")) is None, "a fist in front of the handle"
    assert contact_off(shifted(0.10, width=0.012).part("door")).distance == pytest.approx(0.10, abs=0.001)
    assert contact_off(shifted(0.10, width=0.08).part("door")) is None


def run(capsys: pytest.CaptureFixture[str], *argv: object) -> tuple[int, str]:
    code = cli.run([*map(str, argv)])
    out, err = capsys.readouterr()
    return code, " ".join((out + err).split())


def test_a_contact_half_a_metre_off_is_told_by_export_check_and_lint(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    twin = shifted(0.5)
    save(replace(twin, parts=(twin.part("door"),)), tmp_path / "twin")
    assert load(tmp_path).part("door").contact is not None, "it can be read, to be mended"
    code, told = run(capsys, "export", tmp_path, "--format", "mjcf", "--json")
    assert code == 0
    assert "the contact of door is 0.50 m off the part" in told
    assert "contact.point" in told
    code, told = run(capsys, "check", tmp_path, "--format", "mjcf", "--json")
    assert code == 2
    assert "0.50 m off the part" in told
    assert '"contacts": { "ok": false' in told
    code, told = run(capsys, "lint", tmp_path, "--json")
    (finding,) = [f for f in json.loads(told)["findings"] if f["rule"] == "contact-off-part"]
    assert code == 2
    assert (finding["element"], finding["value"], finding["severity"]) == ("door", "0.50 m", "error")
    assert run(capsys, "lint", tmp_path, "--ignore", "contact-off-part")[0] == 0
    document = json.loads((tmp_path / "twin" / "twin.json").read_text())
    document["parts"][0]["contact"]["point"] = cabinet_twin().part("door").contact.point.tolist()
    (tmp_path / "twin" / "twin.json").write_text(json.dumps(document))
    for argv in (["export"], ["check"]):
        assert run(capsys, *argv, tmp_path, "--format", "mjcf")[0] == 0
    assert run(capsys, "lint", tmp_path)[0] == 0


def test_every_rule_for_twins_finds_its_fault_and_nothing_else(tmp_path: Path) -> None:
    """What benchmarks/lint_faults does for the rules of files."""
    faults = {"contact-off-part": shifted(0.5)}
    assert set(faults) == set(TWIN_RULES)
    for name, faulty in faults.items():
        save(faulty, tmp_path / name / "twin")
        export(faulty, tmp_path / name / "export", ["urdf"])
        assert {f.rule for f in lint([tmp_path / name]).findings} == {name}


def test_a_replay_tells_of_a_contact_off_its_part_once(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The step tells of it in its warnings; the planner's log told it again on a terminal."""
    save(shifted(0.5), tmp_path / "twin")
    (tmp_path / "manifest.json").write_text('{"format": "funtwin-run/1", "stages": []}')

    def plan(*_: object, **__: object) -> None:
        logging.getLogger("robots.grasp.where_to_hold").warning("the contact of door is 0.50 m off the part")
        raise PlanningError("no base is free", "clear the scene")

    monkeypatch.setattr("robots.plan", plan, raising=False)
    terminal = logging.StreamHandler(sys.stderr)  # what logging does by itself outside of pytest
    monkeypatch.setattr(logging.getLogger("robots.grasp.where_to_hold"), "handlers", [terminal])
    _, told = run(capsys, "replay", tmp_path, "--part", "door")
    assert told.count("the contact of door is 0.50 m off the part") == 1
    assert logging.getLogger("robots.grasp.where_to_hold").level == logging.NOTSET
