"""Names of files and elements that the export adds never meet those of the twin and its parts."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
from pxr import Usd, UsdPhysics

from benchmarks.scenes.boards import cabinet_twin
from twin.cli import main as cli
from twin.exporters import Exported, export
from twin.lint import LintReport, lint
from twin.lint.rules import RULES
from twin.names import is_legal_name, scene_file
from twin.scene import Twin
from twin.storage import save
from twin.verification.process import ask

# What the export, the formats and their readers call things, and what it appends to a part's name.
OURS = (
    "a", "A", "scene", "Scene", "scene_", "main", "Main", "floor", "sky", "Joints", "Materials", "Keyframes", "PhysicsScene",
    "Geometry", "Payload", "Textures", "universe", "root_joint", "closed", "open", "geometry_0", "base_link", "README", "assets",
    "meshes", "surface", "texture", "simready_usd", "runnables", "mujoco", "robot", "joint", "box", "None", "nan", "def", "class",
)  # fmt: skip
ADDED = (
    "_visual", "_collision_0", "_collision", "_grasp", "_grasp_", "_joint", "_grasp_joint", "_material", "_texture", "_look",
    "_contact", "_to_world", "_grasp_site", "_physx", "_scene", "_",
)  # fmt: skip
SIMULATED = [n for n, r in RULES.items() if r.simulates]


def hostile_twin(seed: int) -> Twin:
    """A cabinet of five bodies whose names are ours, or another body's with one of our endings."""
    rng = np.random.default_rng([seed, 7])
    pool: list[str] = []
    while len(pool) < 5:
        stem = str(rng.choice(pool if pool and rng.random() < 0.6 else list(OURS)))
        name = stem + str(rng.choice(["", *ADDED]))
        if is_legal_name(name) and name.lower() not in {n.lower() for n in pool}:
            pool.append(name)
    twin = cabinet_twin(name=str(rng.choice([*OURS, *pool])), nested=True, lid=True)
    parts = tuple(replace(p, name=n) for p, n in zip(twin.parts, pool[1:], strict=True))
    return replace(twin, static=replace(twin.static, name=pool[0]), parts=parts)


def require_whole(twin: Twin, exported: Exported, folder: Path) -> list[tuple[str, Path]]:
    """Files for a disk that knows no case, stages in which every body and joint is itself; returns what
    engines shall load."""
    below = [str(p.relative_to(folder)).lower() for p in folder.rglob("*")]
    assert len(set(below)) == len(below)
    for stage_file in (exported["usd"], exported["usd"].with_name(f"{twin.name}_physx.usda")):
        stage = Usd.Stage.Open(str(stage_file))
        bodies = {p.GetName() for p in stage.Traverse() if p.HasAPI(UsdPhysics.RigidBodyAPI)}
        assert bodies == {twin.static.name, *(p.name for p in twin.parts)}
        joints = {p.GetName(): UsdPhysics.Joint(p) for p in stage.Traverse() if p.IsA(UsdPhysics.Joint)}
        for part in twin.parts:
            (target,) = joints[f"{part.name}_joint"].GetBody1Rel().GetTargets()
            assert target.name == part.name
    assert {f: p.stem for f, p in exported.items()} == dict.fromkeys(exported, twin.name)
    scene = exported["mjcf"].with_name(scene_file(twin.name))
    return [*exported.items(), ("scene", scene)]


def refusals(asked: list[tuple[Twin, str, Path]]) -> list[Any]:
    """What MuJoCo, Pinocchio and yourdfpy say against files."""
    found = []
    for engine, formats in {
        "mujoco": ("urdf", "mjcf", "usd", "scene"),
        "pinocchio": ("urdf", "mjcf"),
        "yourdfpy": ("urdf",),
    }.items():
        jobs = [
            {
                "path": str(path), "format": fmt.replace("scene", "mjcf"), "parts": [p.name for p in twin.parts], "states": [[0.1] * len(twin.parts)],
                **dict.fromkeys(("state", "position", "velocity"), [0.1] * len(twin.parts)), "times": [0.01],
            }
            for twin, fmt, path in asked if fmt in formats
        ]  # fmt: skip
        said = zip(jobs, ask(engine, jobs), strict=True)
        found += [
            (engine, j["path"], a["error"], a["warnings"]) for j, a in said if a["error"] or a["warnings"]
        ]
    return found


def test_random_names_that_are_ours_load_everywhere(tmp_path: Path) -> None:
    asked = []
    for seed in range(8):
        twin = hostile_twin(seed)
        whole = require_whole(twin, export(twin, tmp_path / str(seed)), tmp_path / str(seed))
        asked += [(twin, fmt, path) for fmt, path in whole]
    assert refusals(asked) == []


@pytest.mark.slow
def test_many_random_names_that_are_ours_load_everywhere(tmp_path: Path) -> None:
    asked = []
    for seed in range(8, 80):
        twin = hostile_twin(seed)
        whole = require_whole(twin, export(twin, tmp_path / str(seed)), tmp_path / str(seed))
        asked += [(twin, fmt, path) for fmt, path in whole]
    assert refusals(asked) == []


@pytest.mark.parametrize("name", ["scene", "Scene", "main"])
def test_a_twin_named_like_our_files_and_classes_keeps_its_model_and_its_scene(
    name: str, tmp_path: Path
) -> None:
    twin = cabinet_twin(name=name)
    exported = export(twin, tmp_path / "export")
    assert exported["mjcf"].name == f"{name}.xml"
    model = mujoco.MjModel.from_xml_path(str(exported["mjcf"]))
    scene = mujoco.MjModel.from_xml_path(str(exported["mjcf"].with_name(scene_file(name))))
    assert (model.njnt, scene.njnt) == (2, 2)
    assert mujoco.mj_name2id(scene, mujoco.mjtObj.mjOBJ_GEOM, "floor") >= 0
    assert f"`{scene_file(name)}`" in (tmp_path / "export" / "mjcf" / "README.md").read_text()
    save(twin, tmp_path / "twin")
    if name == "scene":
        assert cli.run(["check", str(tmp_path)]) == 0
    looked = {Path(f).name for f in lint([tmp_path], ignore=SIMULATED).files}
    assert looked == {f"{name}.urdf", f"{name}.xml", scene_file(name), f"{name}.usda"}


def test_lint_of_a_run_looks_at_the_scene_as_well(tmp_path: Path) -> None:
    twin = cabinet_twin()
    exported = export(twin, tmp_path / "export", formats=["mjcf"])
    scene = exported["mjcf"].with_name("scene.xml")
    assert lint([tmp_path]) == LintReport((str(exported["mjcf"]), str(scene)), ())
    scene.write_text(scene.read_text().replace('<include file="cabinet.xml"', '<include file="none.xml"'))
    broken = lint([tmp_path])
    assert {Path(f.file).name for f in broken.findings} == {"scene.xml"}
    assert not broken.ok
