"""The examples run as they stand, each by itself; what needs a program that is not here is read, not run."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

import robots
import twin as tw
from benchmarks.scenes import furniture
from robots.config import PlanConfig
from twin.cli.table import VERBS
from twin.engines import engine

ROOT = Path(__file__).parents[2]
EXAMPLES = ROOT / "examples"


def ran(*command: object, **env: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [str(c) for c in command],
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, **env},
        timeout=120,
    )


@pytest.fixture(scope="module")
def exported(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    return dict(tw.export(furniture.door(), tmp_path_factory.mktemp("door"), ["urdf", "mjcf", "usd"]))


def test_a_controller_of_ones_own_opens_the_drawer_in_the_scene_of_a_replay(tmp_path: Path) -> None:
    twin = robots.completed(furniture.drawer())
    plan = robots.plan(twin, "part", config=PlanConfig(candidates=200, finalists=2, rehearse=False))
    robots.replay(twin, plan, tmp_path / "replay", video=False)
    done = ran(sys.executable, EXAMPLES / "mujoco_controller.py", tmp_path / "replay")
    assert done.returncode == 0, done.stderr
    reached = float(done.stdout.split("ends at ")[1].split(",")[0])
    assert reached > 0.95 * plan.goal, done.stdout


def test_a_force_at_the_handle_opens_a_twin_in_mujoco(exported: dict[str, Path]) -> None:
    done = ran(sys.executable, EXAMPLES / "mujoco_twin.py", exported["mjcf"].parent / "scene.xml", "door", 10)
    assert done.returncode == 0, done.stderr
    opened, upper = done.stdout.split("open by ")[1].split(" after")[0].split(" of ")
    assert float(opened) > 0.9 * float(upper), done.stdout


@pytest.mark.parametrize("name", ["pybullet", "sapien"])
def test_a_twin_loads_in_another_engine_and_stays_where_it_is_left(
    name: str, exported: dict[str, Path], tmp_path: Path
) -> None:
    if not engine(name).installed:
        pytest.skip(f"twin engines --install {name} was not run")
    path = exported["urdf"]
    if name == "sapien":  # its visuals need a graphics card
        bare = re.sub("<visual.*?</visual>", "", path.read_text(encoding="utf-8"), flags=re.DOTALL)
        path = path.with_name("bare.urdf")
        path.write_text(bare, encoding="utf-8")
    done = ran(engine(name).folder / "bin" / "python", EXAMPLES / f"{name}_load.py", path, PYTHONPATH="")
    assert done.returncode == 0, done.stderr
    assert float(done.stdout.split("stays open at ")[1]) == pytest.approx(1.257, abs=0.05), done.stdout


def test_the_file_that_isaac_sim_is_given_is_exported(exported: dict[str, Path]) -> None:
    text = (EXAMPLES / "isaac_sim.py").read_text(encoding="utf-8")
    compile(text, "isaac_sim.py", "exec")
    assert "NAME_physx.usda" in text
    assert (exported["usd"].parent / f"{exported['usd'].stem}_physx.usda").is_file()


def test_a_loop_goes_on_after_what_is_refused_and_ends_with_two(tmp_path: Path) -> None:
    """With a stand-in for the program that notes how it is called and refuses what is called bad."""
    command, notes = tmp_path / "bin" / "twin", tmp_path / "calls"
    command.parent.mkdir()
    command.write_text(
        f'#!/bin/sh\necho "$@" >> {notes}\ncase "$2" in *bad*) exit 1;; esac\n', encoding="utf-8"
    )
    command.chmod(0o755)
    out = tmp_path / "out"
    (out / "good").mkdir(parents=True)
    path = f"{command.parent}{os.pathsep}{os.environ['PATH']}"
    done = ran("bash", EXAMPLES / "import_many.sh", out, "bad.urdf", "good.xml", PATH=path)
    assert done.returncode == 2, done.stderr
    assert done.stdout.splitlines() == ["bad.urdf: 1", "good.xml: 0"]
    calls = [line.split() for line in notes.read_text(encoding="utf-8").splitlines()]
    assert [c[0] for c in calls] == ["import", "import", "export", "check"]
    assert {c[0] for c in calls} <= set(VERBS)
