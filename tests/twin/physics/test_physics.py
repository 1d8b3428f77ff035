"""Parts get physics from the table of materials, every number with its source."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.scenes.boards import cabinet_twin
from twin.errors import ConfigError, SceneError
from twin.physics import keep_known, read_materials, with_physics
from twin.physics.edit import given, set_physics
from twin.physics.joints import resistance


def test_with_physics_fills_what_is_missing_and_names_its_sources() -> None:
    twin = cabinet_twin()
    bare = replace(twin, parts=tuple(replace(p, inertial=None, physics=None) for p in twin.parts))
    full = with_physics(bare)
    for p, truth in zip(full.parts, twin.parts, strict=True):
        low, high = p.inertial.mass.interval
        assert low < truth.inertial.mass.value < high, "the exact mass lies in the interval"
        assert p.inertial.mass.value == pytest.approx(truth.inertial.mass.value, rel=0.25)
        assert "furniture_board" in p.inertial.mass.source
        assert "furniture_board" in p.physics.density.source
        law = read_materials().joints[p.joint.kind]
        assert vars(p.physics).items() >= resistance(p.joint, p.inertial, law).items()
        assert {q.origin for q in p.physics.numbers.values()} == {"default"}
        assert p.inertial.mass.origin == "geometry"
        assert p.inertial.inertia_source == p.inertial.mass.source
        assert p.inertial.inertia_interval is not None
        assert p.inertial.com_interval is not None
    assert with_physics(twin).part("door").inertial is twin.part("door").inertial
    glass = with_physics(twin, {"door": "glass"}, renew=True)
    assert glass.part("door").physics.density.value == 2500.0
    assert glass.part("drawer").physics.density.value == 700.0


def test_unknown_names_and_empty_meshes_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="did you mean 'plywood'"):
        with_physics(cabinet_twin(), {"door": "plywod"})
    with pytest.raises(SceneError, match="its parts are: door"):
        with_physics(cabinet_twin(), {"dor": "glass"})
    (tmp_path / "m.toml").write_text('default = "x"\n[materials]\n[joints]\n')
    with pytest.raises(ConfigError, match=r"m\.toml"):
        read_materials(tmp_path / "m.toml")


def test_the_table_states_a_source_for_every_number() -> None:
    table = read_materials()
    rows = [q for m in table.materials.values() for q in (m.density, m.thickness, m.friction)]
    rows += [q for j in table.joints.values() for q in (j.friction, j.decay)]
    assert all(len(q.source) > 8 and q.interval[0] < q.interval[1] for q in rows)
    assert {q.origin for q in rows} <= {"default", "measured"}
    assert set(table.joints) == {"revolute", "prismatic"}


def test_what_the_user_found_out_survives_a_twin_made_again() -> None:
    old = cabinet_twin()
    weighed = set_physics(
        old, "door", {"mass": given("mass", 3.2, measured=True), "damping": given("damping", 0.1)}
    ).twin
    again = keep_known(with_physics(old, renew=True), weighed)
    door, drawer = again.part("door"), again.part("drawer")
    assert door.inertial.mass == weighed.part("door").inertial.mass
    assert np.trace(door.inertial.inertia) < np.trace(
        with_physics(old, renew=True).part("door").inertial.inertia
    )
    assert door.physics.damping.value == 0.1
    assert door.physics.friction.origin == "default"
    expected = resistance(door.joint, door.inertial, read_materials().joints["revolute"])
    assert door.physics.frictionloss == expected["frictionloss"], (
        "what nobody stated follows the weighed mass"
    )
    assert drawer.inertial.mass.origin == "geometry"
    assert with_physics(weighed, renew=True).part("door").inertial.mass.value == 3.2
    elsewhere = replace(weighed, recorded=replace(weighed.recorded, fingerprint="another"))
    assert keep_known(old, elsewhere) is old
    as_slide = replace(weighed, parts=(replace(weighed.part("door"), joint=old.part("drawer").joint),))
    assert keep_known(old, as_slide).part("door").inertial.mass.value != 3.2
