"""PhysX, in an environment of its own, reads what the USD asset says to it."""

from __future__ import annotations

from pathlib import Path

import pytest

from benchmarks.scenes.boards import cabinet_twin
from benchmarks.scenes.random_twins import random_twin
from twin import engines
from twin.exporters import export
from twin.verification import check, check_many
from twin.verification.expected import armatures

pytestmark = pytest.mark.skipif(
    not engines.engine("physx").installed, reason="twin engines --install physx was not run"
)


def test_physx_agrees_and_notices_a_changed_number(tmp_path: Path) -> None:
    twin = cabinet_twin(nested=True, lid=True)
    files = export(twin, tmp_path, formats=("usd",))
    report = check(twin, files, ("physx",))
    assert report.warnings == ()
    assert report.failures == ()
    assert {r.field for r in report.rows} >= {"tree", "axis_deg", "damping", "frictionloss", "armature", "mass_diagonal", "rollout"}  # fmt: skip
    own = files["usd"].parent / "cabinet" / "simready_usd" / "runnables" / "physics" / "physx.usda"
    text, heavier = own.read_text(), float(armatures(twin)[1])
    assert "staticFrictionEffort = 0.3" in text
    own.write_text(
        text.replace("FrictionEffort = 0.3", "FrictionEffort = 0.31", 2).replace(
            f"armature = {heavier:.9g}"[:18], f"armature = {2 * heavier:.9g}"[:18]
        )
    )
    caught = {(r.part, r.field) for r in check(twin, files, ("physx",)).failures}
    assert {("door", "frictionloss"), ("drawer", "armature"), ("drawer", "mass_diagonal")} <= caught
    assert not [p for p, _ in caught if p in ("flap", "lid")]


@pytest.mark.slow
def test_physx_agrees_on_random_twins(tmp_path: Path) -> None:
    twins = [random_twin(seed) for seed in range(20)]
    sources = [(t, export(t, tmp_path / str(k), formats=("usd",))) for k, t in enumerate(twins)]
    for report in check_many(sources, ("physx",)):
        assert report.warnings == ()
        assert report.failures == ()
