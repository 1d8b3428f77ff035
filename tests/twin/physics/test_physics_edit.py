"""Numbers from the user: what they change, what they keep, and what is refused without touching the file."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from benchmarks.scenes.boards import cabinet_twin
from twin.cli import main as cli
from twin.errors import InputError
from twin.physics import with_physics
from twin.physics.edit import given, set_physics
from twin.quantities import Inertial
from twin.scene import Twin
from twin.storage import load, save, update


@pytest.fixture(scope="module")
def filled() -> Twin:
    twin = cabinet_twin()
    return with_physics(
        replace(twin, parts=tuple(replace(p, inertial=None, physics=None) for p in twin.parts))
    )


@pytest.fixture
def run(tmp_path: Path, filled: Twin) -> Path:
    save(filled, tmp_path / "run" / "twin")
    return tmp_path / "run"


def inertial(twin: Twin, name: str) -> Inertial:
    found = twin.part(name).inertial
    assert found is not None
    return found


def test_a_weighed_mass_scales_the_tensor_and_keeps_the_rest(filled: Twin) -> None:
    edited = set_physics(filled, "door", {"mass": given("mass", 3.2, measured=True, note="scale")})
    old, new = inertial(filled, "door"), inertial(edited.twin, "door")
    assert (new.mass.value, new.mass.source) == (3.2, "measured: scale")
    assert new.mass.interval == pytest.approx((3.136, 3.264))
    assert np.allclose(new.inertia, old.inertia * 3.2 / old.mass.value, rtol=1e-12)
    assert np.array_equal(new.com, old.com)
    assert new.inertia_source == old.inertia_source
    assert (
        new.inertia_interval[1] - new.inertia_interval[0] < old.inertia_interval[1] - old.inertia_interval[0]
    )
    assert edited.twin.part("drawer") is filled.part("drawer")
    before, after = filled.part("door").physics, edited.twin.part("door").physics
    assert (after.friction, after.density) == (before.friction, before.density)
    grown = 3.2 / old.mass.value
    assert after.damping.value == pytest.approx(grown * before.damping.value)
    assert after.frictionloss.value == pytest.approx(grown * before.frictionloss.value)
    assert {c.name for c in edited.changes} == {"mass", "principal moments", "damping", "frictionloss"}
    stated = set_physics(filled, "door", {"frictionloss": given("frictionloss", 0.3)}).twin
    kept = set_physics(stated, "door", {"mass": given("mass", 3.2)}).twin.part("door").physics
    assert kept.frictionloss == stated.part("door").physics.frictionloss
    assert edited.warnings == ()


def test_a_mass_that_the_surface_can_not_have_is_kept_and_doubted(filled: Twin) -> None:
    edited = set_physics(filled, "door", {"mass": given("mass", 3200.0)})  # grams
    assert inertial(edited.twin, "door").mass.value == 3200.0
    assert "lies outside" in edited.warnings[0]
    assert "unit" in edited.warnings[0]


def test_a_material_changes_what_nobody_measured(filled: Twin) -> None:
    weighed = set_physics(
        filled, "door", {"mass": given("mass", 4.0, measured=True), "friction": given("friction", 0.4)}
    ).twin
    glass = set_physics(weighed, "door", {}, "glass").twin
    physics = glass.part("door").physics
    assert inertial(glass, "door").mass == inertial(weighed, "door").mass
    assert "glass" in inertial(glass, "door").inertia_source
    assert physics.density.value == 2500.0
    assert "named by the user" in physics.density.source
    assert physics.friction == weighed.part("door").physics.friction
    unweighed = set_physics(filled, "drawer", {}, "plywood").twin
    assert inertial(unweighed, "drawer").mass.origin == "geometry"
    assert inertial(unweighed, "drawer").mass.value < inertial(filled, "drawer").mass.value


@pytest.mark.parametrize(
    ("value", "interval", "message"),
    [
        (0.0, None, "must be positive, got 0"),
        (-1.0, None, "must be positive, got -1"),
        (float("nan"), None, "must be positive, got nan"),
        (float("inf"), None, "must be positive, got inf"),
        (3.0, (3.2, 3.1), "reversed"),
        (3.0, (float("nan"), 4.0), "not finite"),
        (3.0, (3.1, 3.2), "must lie inside"),
        (3.0, (-1.0, 3.2), "nothing negative"),
    ],
)
def test_values_that_can_not_be_are_refused(
    value: float, interval: tuple[float, float] | None, message: str
) -> None:
    with pytest.raises(InputError, match=message):
        given("mass", value, interval)


def test_a_joint_may_be_free_of_resistance() -> None:
    assert given("damping", 0.0).interval == (0.0, 0.0)
    with pytest.raises(InputError, match="zero or more"):
        given("damping", -0.1)


def call(capsys: pytest.CaptureFixture[str], *argv: object) -> tuple[int, dict[str, Any], str]:
    code = cli.run(["physics", *map(str, argv), "--json"])
    out, err = capsys.readouterr()
    return code, json.loads(out), err


def test_the_verb_sets_and_shows(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    before = {p: p.read_bytes() for p in run.rglob("*") if p.is_file()}
    code, told, _ = call(
        capsys, "set", run, "--part", "door", "--mass", 3.2, "--mass-interval", 3.1, 3.3, "--damping", 0.2
    )
    assert code == 0
    assert {c["quantity"] for c in told["changes"]} == {
        "mass", "principal moments", "damping", "frictionloss"
    }  # fmt: skip
    changed = {p.name for p, data in before.items() if p.read_bytes() != data}
    assert changed == {"twin.json"}
    left = {p for p in run.rglob("*") if p.is_file() and "twin_found" not in p.parts} - set(before)
    assert left == {run / "edits.json"}, "nothing else is left behind"
    code, shown, _ = call(capsys, "show", run)
    assert code == 0
    assert shown["parts"]["door"]["inertial"]["mass_interval"] == [3.1, 3.3]
    assert shown["parts"]["door"]["inertial"]["source"] == "user: given by the user"
    assert shown["parts"]["door"]["physics"]["damping"]["interval"] == pytest.approx([0.16, 0.24])
    assert set(shown["parts"]) == {"door", "drawer"}
    assert cli.run(["physics", "show", str(run), "--part", "drawer"]) == 0
    text = capsys.readouterr().out
    assert "principal moments" in text
    assert "geometry:" in text
    assert "3.2 kg" not in text


@pytest.mark.parametrize(
    ("argv", "message"),
    [
        (["--part", "dor", "--mass", "3"], "did you mean 'door'?"),
        (["--mass", "3"], "parts: door, drawer"),
        (["--part", "door", "--mass", "0"], "must be positive"),
        (["--part", "door", "--mass", "nan"], "must be positive"),
        (["--part", "door", "--mass", "heavy"], "invalid float"),
        (["--part", "door", "--mass", "3", "--mass-interval", "4", "2"], "reversed"),
        (["--part", "door", "--mass-interval", "2", "4"], "without --mass"),
        (["--part", "door", "--material", "glas"], "did you mean 'glass'?"),
        (["--part", "door", "--mass", "3", "--note", "two\nlines"], "one line"),
        (["--part", "door"], "nothing to set"),
    ],
)
def test_bad_input_is_one_line_and_changes_nothing(
    argv: list[str], message: str, run: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before = (run / "twin" / "twin.json").read_bytes()
    assert cli.run(["physics", "set", str(run), *argv]) == 1
    err = capsys.readouterr().err
    assert message in err
    assert err.count("\n") == 1
    assert (run / "twin" / "twin.json").read_bytes() == before


def test_a_failed_write_leaves_the_old_twin(run: Path, filled: Twin, monkeypatch: pytest.MonkeyPatch) -> None:
    before = (run / "twin" / "twin.json").read_bytes()
    other = set_physics(filled, "door", {"mass": given("mass", 3.2)}).twin

    def full(self: Path, target: Path) -> None:
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as m:
        m.setattr(Path, "replace", full)
        with pytest.raises(InputError, match="No space left"):
            update(filled, other, run)
    assert (run / "twin" / "twin.json").read_bytes() == before
    assert sorted(p.name for p in (run / "twin").glob(".*")) == []
    update(filled, other, run)
    assert inertial(load(run), "door").mass.value == 3.2


def test_values_of_another_twin_are_refused(run: Path, filled: Twin) -> None:
    renamed = replace(filled, parts=(replace(filled.part("door"), name="gate"),))
    with pytest.raises(InputError, match=r"gate\.ply is not what .* holds"):
        update(filled, renamed, run)


def test_an_export_of_the_earlier_mass_is_told_and_caught(
    run: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    from twin.exporters import export
    from twin.verification import check

    files = export(load(run), run / "export", ["urdf"])
    assert check(load(run), {"urdf": files["urdf"]}).ok
    code, told, _ = call(capsys, "set", run, "--part", "door", "--mass", 3.2)
    assert code == 0
    assert told["stale"] == ["urdf"]
    failed = {(r.part, r.field) for r in check(load(run), {"urdf": files["urdf"]}).failures}
    assert {("door", "mass"), ("door", "inertia")} <= failed
    assert {part for part, _ in failed} == {"door"}
