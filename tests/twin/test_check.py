"""The check passes what is true and catches every planted lie."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import twin as funtwin
from tests.twin.random_twins import random_twin
from tests.twin.scenes import cabinet_twin
from twin.check import _inputs, check, check_many
from twin.errors import InputError
from twin.export import Exported, export
from twin.scene import Twin
from twin.storage import save


@pytest.fixture(scope="module")
def cabinet(tmp_path_factory: pytest.TempPathFactory) -> tuple[Twin, Exported]:
    twin = cabinet_twin(nested=True, lid=True)
    return twin, export(twin, tmp_path_factory.mktemp("check"))


def test_the_cabinet_agrees_everywhere_without_a_warning(cabinet: tuple[Twin, Exported]) -> None:
    report = funtwin.check(*cabinet)
    assert report.warnings == ()
    assert report.failures == ()
    assert report.ok
    seen = {(r.format, r.consumer) for r in report.rows}
    assert seen == {
        ("urdf", "mujoco"), ("mjcf", "mujoco"), ("usd", "mujoco"),
        ("urdf", "pinocchio"), ("mjcf", "pinocchio"), ("urdf", "yourdfpy"),
    }  # fmt: skip
    for fields in (
        {r.field for r in report.rows if (r.format, r.consumer, r.part) == (*s, "door")} for s in seen
    ):
        assert {
            "type",
            "axis_deg",
            "pivot_m",
            "lower",
            "upper",
            "mass",
            "com_m",
            "inertia",
            "motion",
        } <= fields
    json.dumps(report.to_dict(), allow_nan=False)


def test_random_twins_agree_everywhere(tmp_path: Path) -> None:
    twins = [random_twin(seed) for seed in range(6)]
    for twin, report in zip(
        twins, check_many([(t, export(t, tmp_path / t.name)) for t in twins]), strict=True
    ):
        assert report.warnings == (), twin.name
        assert report.failures == (), twin.name
        assert report.unexpected == (), twin.name


def physics_file(main: Path) -> Path:
    """Where an exported format states its physics: the main file, for USD a layer of the asset."""
    inside = main.parent / main.stem / "simready_usd" / "Payload" / "Physics.usda"
    return inside if main.suffix == ".usda" else main


def planted(files: Exported, folder: Path, changes: dict[str, list[tuple[str, str]]]) -> dict[str, Path]:
    """Copies of exported folders with texts replaced (each must be there)."""
    out = {}
    for fmt, edits in changes.items():
        shutil.copytree(files[fmt].parent, folder / fmt)
        main = folder / fmt / files[fmt].name
        path = physics_file(main)
        text = path.read_text()
        for old, new in edits:
            assert old in text, old
            text = text.replace(old, new, 1)
        path.write_text(text)
        out[fmt] = main
    return out


def test_every_planted_lie_is_caught(cabinet: tuple[Twin, Exported], tmp_path: Path) -> None:
    twin, files = cabinet
    urdf, mjcf, usd = (physics_file(files[f]).read_text() for f in ("urdf", "mjcf", "usd"))
    pivot = urdf.split('name="door_joint"')[1].split('xyz="')[1].split('"')[0]
    x, rest = pivot.split(" ", 1)
    mass = mjcf.split('body name="door"')[1].split(' mass="')[1].split('"')[0]
    limit = usd.split('"door_joint"')[1].split("upperLimit = ")[1].split("\n")[0]
    com = usd.split('over "drawer" (')[1].split("centerOfMass = (")[1].split(",")[0]
    lies = {
        "urdf": [(f'xyz="{pivot}"', f'xyz="{float(x) + 1e-4!r} {rest}"')],
        "mjcf": [(f' mass="{mass}"', f' mass="{float(mass) * 1.0001!r}"')],
        "usd": [
            (
                f"upperLimit = {limit}",
                f"upperLimit = {np.deg2rad(float(limit)):.6f}",
            ),  # radians where degrees belong
            (f"centerOfMass = ({com},", f"centerOfMass = ({float(com) + 1e-3},"),
        ],
    }
    report = check(twin, planted(files, tmp_path, lies))
    assert not report.ok
    caught = {(r.format, r.consumer, r.part, r.field) for r in report.failures}
    for consumer in ("mujoco", "pinocchio", "yourdfpy"):
        assert ("urdf", consumer, "door", "pivot_m") in caught
    for consumer in ("mujoco", "pinocchio"):
        assert ("mjcf", consumer, "door", "mass") in caught
    assert ("usd", "mujoco", "door", "upper") in caught
    assert ("usd", "mujoco", "drawer", "com_m") in caught
    told = {f for f, _, p, _ in caught if p in ("drawer", "lid")} - {"usd"}
    assert not told, "what was not touched still agrees"


def test_warnings_damage_and_collisions_fail_the_check(
    cabinet: tuple[Twin, Exported], tmp_path: Path
) -> None:
    twin, files = cabinet
    size = files["urdf"].read_text().split('name="door_collision_0"')[1].split('size="')[1].split('"')[0]
    thick = " ".join(["0.6", "0.08", size.split()[2]])
    lies = {
        "usd": [
            (
                "float physics:staticFriction",
                "float physics:restitution = 0.5\n            float physics:staticFriction",
            )
        ],
        "urdf": [(f'size="{size}"', f'size="{thick}"')],
        "mjcf": [("</mujoco>", "")],
    }
    report = check(twin, planted(files, tmp_path, lies))
    assert not report.ok
    assert any(w.startswith("usd/mujoco") and "WARNING" in w for w in report.warnings)
    assert any(w.startswith("mjcf/mujoco: can't be loaded") for w in report.warnings)
    assert any(r.field == "self_collision_m" and r.part == "door" for r in report.failures)


def test_a_run_folder_is_found_and_what_is_missing_is_named(
    cabinet: tuple[Twin, Exported], tmp_path: Path
) -> None:
    twin, _ = cabinet
    save(twin, tmp_path / "run" / "twin")
    with pytest.raises(InputError, match="nothing exported"):
        check(tmp_path / "run")
    export(twin, tmp_path / "run" / "export", formats=("urdf",))
    assert _inputs(tmp_path / "run", None)[1] == _inputs(tmp_path / "run" / "twin", None)[1]
    report = check(tmp_path / "run" / "twin")
    assert report.ok
    assert {r.format for r in report.rows} == {"urdf"}
    with pytest.raises(InputError, match="does not exist"):
        check(twin, {"urdf": tmp_path / "none.urdf"})
    with pytest.raises(InputError, match="has no mass"):
        check(
            replace(twin, parts=(replace(twin.parts[0], inertial=None),)),
            {"urdf": tmp_path / "run" / "export" / "urdf" / "cabinet.urdf"},
        )
