"""Wrong orders to `twin replay` and `twin trajectory`: one line with what exists and what to try, and nothing
is written."""

from __future__ import annotations

import re
from functools import partial
from pathlib import Path

import pytest

import robots
from benchmarks.scenes import furniture
from robots.config import PlanConfig
from robots.formats import native
from robots.model.catalog import resolve
from tests.makers.robots import planned_motions
from tests.makers.robots.planned_motions import contents
from twin.cli.main import run
from twin.storage import save


@pytest.fixture
def drawer(tmp_path: Path) -> Path:
    save(furniture.drawer(), tmp_path / "run/twin")
    return tmp_path / "run"


def refused(order, folder: Path, capsys) -> str:
    """The line that an order is refused with; the folder must stay as it is."""
    before = contents(folder)
    assert run([str(word) for word in order]) == 1
    told = capsys.readouterr()
    assert contents(folder) == before
    assert told.err.count("\n") == 1
    assert told.err.startswith("twin: ")
    assert "Traceback" not in told.err + told.out
    return told.err


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--part", "dor"], "no part 'dor'; its parts are: part (id 2)"),
        (["--part", "prt"], "did you mean 'part'?"),
        (["--robot", "frnka"], "known robots: franka, spot; did you mean 'franka'?"),
        (["--robot", "nowhere.toml"], "robot file nowhere.toml can't be read"),
        (["--contact", "0,-1,0.6"], "is 0.97 m off part 'part'; give a point on it: it spans"),
        (["--contact", "0,-1"], "write three numbers in m"),
        (["--contact", "nan,0,0.6"], "write three numbers in m"),
        (["--goal", "1.5"], "goal '1.5' of part 'part' is no share of its range"),
        (["--goal", "close", "--from-state", "0"], "which is no way to go"),
        (["--trials", "0"], "ask for one or more"),
        (["--trials", "-3"], "ask for one or more"),
        (["--trials", "5", "--seed", "-1"], "give 0 or more"),
        (["--stiffness", "0"], "options: replay.stiffness = 0.0 must be above 0 and at most 100"),
        (["--stiffness", "nan"], "options: replay.stiffness = nan must be above 0"),
    ],
)
def test_a_wrong_order_is_one_line(options, message, drawer, capsys):
    assert message in refused(["replay", drawer, *options], drawer, capsys)


def test_a_folder_is_no_robot_but_its_files_are_named(drawer, tmp_path, capsys):
    (tmp_path / "arms").mkdir()
    (tmp_path / "arms/mine.toml").write_text("")
    told = refused(["replay", drawer, "--robot", tmp_path / "arms"], tmp_path, capsys)
    assert "is a folder; give a .toml robot file (in it: mine.toml)" in told


def test_nothing_to_hold_is_one_line(tmp_path, capsys):
    block = furniture.box([0, 0, 1], [0.4, 0.4, 0.4])
    twin = furniture.twin_of([block], furniture.drawer().parts[0].joint, [furniture.floor()], None)
    save(twin, tmp_path / "run/twin")
    told = refused(["replay", tmp_path / "run"], tmp_path, capsys)
    assert "no bar, knob or rim" in told
    assert "--contact X,Y,Z" in told


DOCTYPE = '<!DOCTYPE mujoco [<!ENTITY x SYSTEM "file:///etc/passwd">]>\n'


@pytest.mark.parametrize(
    ("toml", "xml", "message"),
    [
        (lambda t: t[: t.index("[gripper]")], None, "has no [gripper] section; a robot without a gripper"),
        (lambda t: t.replace('or = "gripper"', 'or = "claw"'), None, "'claw', which its model arm.xml does not have"),
        (None, lambda _: None, "names the model arm.xml, which is not beside it"),
        (None, lambda x: x[:3000], "is not well-formed XML"),
        (None, lambda _: "<mujoco><worldbody><geom size='1'/></worldbody></mujoco>", "which its model arm.xml does not have"),
        (None, lambda _: "<html/>", "can't be read"),
        (None, lambda x: DOCTYPE + x, "declares a document type (line 1); remove the DOCTYPE"),
    ],
)  # fmt: skip
def test_a_broken_robot_is_one_line(toml, xml, message, drawer, tmp_path, capsys):
    model = resolve("franka").model
    text = model.with_suffix(".toml").read_text(encoding="utf-8").replace("franka.xml", "arm.xml")
    (tmp_path / "arm.toml").write_text(toml(text) if toml else text, encoding="utf-8")
    shape = (xml or str)(model.read_text(encoding="utf-8"))
    if shape is not None:
        (tmp_path / "arm.xml").write_text(shape, encoding="utf-8")
    assert message in refused(["replay", drawer, "--robot", tmp_path / "arm.toml"], tmp_path, capsys)


def test_a_goal_out_of_reach_is_a_missed_goal_with_its_reason(tmp_path, capsys, monkeypatch):
    few = partial(robots.plan, config=PlanConfig(candidates=100, finalists=1))
    monkeypatch.setattr("robots.plan", few, raising=False)
    save(furniture.drawer(travel=3.0), tmp_path / "run/twin")
    assert run(["replay", str(tmp_path / "run")]) == 2
    told = " ".join(capsys.readouterr().out.split())
    assert "franka can't open part 'part'" in told
    assert re.search(r"unreachable at state \d\.\d\d m: reach \d\.\d\d m short", told)
    assert not (tmp_path / "run/replay").exists()


def test_a_trajectory_is_handed_over_for_its_own_robot_and_part_only(tmp_path, capsys):
    source = planned_motions.mobile_base()
    save(furniture.door("left"), tmp_path / "run/twin")
    order = ["trajectory", tmp_path / "run", "--format", "ros2", "-o", tmp_path / "out"]
    told = refused([*order, "--robot", "spot"], tmp_path, capsys)
    assert "no trajectory of spot for door yet; run `twin replay" in told
    native.save(source.trajectory, tmp_path / "run/replay/franka/door")
    told = refused([*order, "--robot", "franka"], tmp_path, capsys)
    assert "was planned for 'spot' and moves base_x, base_y" in told
    (tmp_path / "run/replay/franka/door/trajectory.json").write_text("{}")
    told = refused([*order, "--robot", "franka"], tmp_path, capsys)
    assert "is not of format" in told
    assert "twin replay" in told
