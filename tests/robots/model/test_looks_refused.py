"""Visuals of a checkout that doesn't fit the robot: not worn, with one warning that says why, or a clear
error in the robot's file."""

from __future__ import annotations

import logging
import re
from pathlib import Path

import numpy as np
import pytest

import robots
from robots.model.joint_frames import APART, TURNED
from robots.model.skin import find_skin, skin_of
from robots.model.spec import load_spec
from tests.makers.robots.checkout import NAMES, Changes, moved, only_checkout, write_checkout
from tests.robots.model.test_catalog import changed, copied
from twin import geometry as geo
from twin.cli.main import run
from twin.errors import InputError


@pytest.fixture(autouse=True)
def checkout(tmp_path: Path, monkeypatch) -> Path:
    return only_checkout(tmp_path, monkeypatch)


def refused(name: str, caplog) -> str:
    """The one warning with which a skin is refused."""
    spec = robots.resolve(name)
    caplog.clear()
    with caplog.at_level(logging.INFO):
        assert skin_of(spec) is None
    (warning,) = [r.getMessage() for r in caplog.records if r.levelno >= logging.WARNING]
    assert "\n" not in warning
    assert warning.startswith(f"{name} is drawn with its own shapes: ")
    return warning


LARGE = 1.5  # of what is allowed
WRONG = {
    "a longer link": ("franka", Changes(moved={"link4": moved(LARGE * APART)}), r"its joint 'joint\d' lies \d\.\d mm and 0\.0° off ours, 1 mm and 0\.5° are allowed"),
    "a tilted axis": ("franka", Changes(moved={"link5": moved(0, LARGE * np.rad2deg(TURNED), (1, 0, 0))}), "off ours"),
    "another zero": ("franka", Changes(moved={"link6": moved(0, 20)}), "off ours"),
    "another zero of the first joint": ("franka", Changes(moved={"link1": moved(0, 20)}), "'joint1' has its zero"),
    "another zero of a finger": ("franka", Changes(moved={"left_finger": geo.make_pose(None, [0, 0.02, 0])}), "'finger_joint1' has its zero"),
    "another zero of a claw": ("spot", Changes(moved={"arm_link_fngr": moved(0, 20, (0, 1, 0))}), "'arm_f1x' has its zero"),
    "another zero of a shoulder": ("spot", Changes(moved={"arm_link_sh0": moved(0, 90)}), "'arm_sh0' has its zero"),
    "a joint that turns the other way": ("spot", Changes(backwards=("arm_el1",)), "180.0° off ours"),
    "a joint that slides": ("franka", Changes(slides=("joint4",)), "turns where ours slides, or slides"),
    "a joint of another name": ("franka", Changes(joints={"joint4": "elbow"}), "joint 'elbow' is none of ours.*looks.hold.elbow"),
    "a leg's joint of another name": ("spot", Changes(joints={"fl_hy": "fl.hy"}), "names the joint 'fl_hy', which it lacks"),
    "a body that nobody wears": ("franka", Changes(body='<body name="lamp"><geom size="0.1" contype="0" conaffinity="0"/></body>'), "'lamp' has visuals"),
}  # fmt: skip


@pytest.mark.parametrize("case", WRONG)
def test_a_skin_that_does_not_fit_is_not_worn(case, checkout, caplog):
    name, changes, message = WRONG[case]
    write_checkout(checkout, robots.resolve(name), changes)
    assert re.search(message, refused(name, caplog)), caplog.messages


@pytest.mark.parametrize("name", NAMES)
def test_what_lies_within_the_tolerance_is_worn(name, checkout):
    joint = {"franka": "link4", "spot": "arm_link_el0"}[name]
    write_checkout(checkout, robots.resolve(name), Changes(moved={joint: moved(0.4 * APART, 0.02)}))
    assert skin_of(robots.resolve(name)) is not None


def test_bodies_that_are_named_wrongly_are_refused(checkout, tmp_path, caplog):
    """The forearm's visuals on the elbow would turn with the wrong joint."""
    write_checkout(checkout, robots.resolve("franka"))
    path = copied("franka", tmp_path)
    text = path.read_text(encoding="utf-8")
    path.write_text(
        text.replace('link4 = "link4"', 'link4 = "link5"').replace('link5 = "link5"', 'link5 = "link4"')
    )
    with pytest.raises(InputError, match=r"does not move as our 'link[45]' does"):
        find_skin(load_spec(path))


def spoiled(checkout: Path, how: str) -> str:
    """A checkout with one fault; what the warning names."""
    file = write_checkout(checkout, robots.resolve("franka"))
    mesh = file.parent / "assets/link3_1.obj"
    if how == "a missing mesh":
        mesh.unlink()
        return "link3_1.obj"
    if how == "a mesh that git-lfs did not fetch":
        mesh.write_text("version https://git-lfs.github.com/spec/v1\nsize 12\n")
        return "link3_1"
    if how == "a missing include":
        file.with_name("parts.xml").unlink()
        return "parts.xml"
    if how == "no XML":
        file.write_text("404: Not Found")
        return "not well-formed"
    file.write_text('<!DOCTYPE mujoco [<!ENTITY a "a">]>' + file.read_text())
    return "document type"


@pytest.mark.parametrize("how", ["a missing mesh", "a mesh that git-lfs did not fetch", "a missing include", "no XML", "entities"])  # fmt: skip
def test_a_checkout_that_is_not_whole_costs_one_warning(how, checkout, caplog):
    named = spoiled(checkout, how)
    assert named in refused("franka", caplog)


def test_without_a_checkout_nothing_is_said_aloud(checkout, caplog, monkeypatch):
    with caplog.at_level(logging.INFO):
        assert skin_of(robots.resolve("spot")) is None
    assert [r.levelno for r in caplog.records if r.name.endswith("skin")] == [logging.INFO]
    assert "boston_dynamics_spot/spot_arm.xml is not on this machine" in caplog.text
    monkeypatch.setenv("FUNTWIN_MENAGERIE", str(checkout / "nowhere"))
    assert "which is no folder" in refused("spot", caplog)


def test_the_cache_of_robot_descriptions_is_a_checkout(tmp_path, monkeypatch):
    monkeypatch.delenv("FUNTWIN_MENAGERIE")
    monkeypatch.setenv("ROBOT_DESCRIPTIONS_CACHE", str(tmp_path))
    file = write_checkout(tmp_path / "mujoco_menagerie", robots.resolve("franka"))
    skin = skin_of(robots.resolve("franka"))
    assert skin is not None
    assert skin.source == file


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('model = "franka_emika_panda/panda.xml"', "", r"looks lacks the key 'model'; compare it"),
        ('model = "franka_emika_panda/panda.xml"', 'model = "../panda.xml"', "must be a path below"),
        ('model = "franka_emika_panda/panda.xml"', "model = 3", "looks model must be a path, got 3"),
        ("[looks.bodies]", "[looks.body]", r"unknown key 'looks.body'.*did you mean 'looks.bodies'"),
        ('link0 = "link0"', "link0 = 0", "looks bodies.link0 must be the name of a body or a list"),
        ('link0 = "link0"', 'link0 = "link1"', "looks names 'link1' twice; each body is worn by one"),
        ("[looks.bodies]", 'left_out = ["hand"]\n[looks.bodies]', "looks names 'hand' twice"),
        ("[looks.bodies]", 'hold = { a = "b" }\n[looks.bodies]', "hold.a must be a number"),
        ("[looks.bodies]", "hold = { a = nan }\n[looks.bodies]", "hold.a must be a finite number"),
        ("[looks.bodies]", "hold = 3\n[looks.bodies]", "hold must be a table of names, got 3"),
        ("[looks.bodies]", "joints = { joint1 = 1 }\n[looks.bodies]", "joints.joint1 must be the name"),
    ],
)  # fmt: skip
def test_a_bad_section_says_what_is_wrong(old, new, message, tmp_path):
    with pytest.raises(InputError) as e:
        load_spec(changed("franka", tmp_path, old, new))
    assert re.search(message, str(e.value)), str(e.value)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('link0 = "link0"', 'link0 = "lnk0"', "names the body 'lnk0', which it lacks; did you mean 'link0'"),
        ('link0 = "link0"', 'lnk0 = "link0"', "names the body 'lnk0', which our model lacks"),
        ("[looks.bodies]", "hold = { joint1 = 0.0 }\n[looks.bodies]", "'joint1', which moves with ours"),
        ("[looks.bodies]", 'joints = { joint1 = "j1" }\n[looks.bodies]', "names the joint 'j1'"),
        ("[looks.bodies]", 'joints = { j1 = "joint1" }\n[looks.bodies]', "'j1', which our model lacks"),
    ],
)  # fmt: skip
def test_names_that_a_model_lacks_are_told(old, new, message, checkout, tmp_path):
    write_checkout(checkout, robots.resolve("franka"))
    with pytest.raises(InputError, match=message):
        find_skin(load_spec(changed("franka", tmp_path, old, new)))


def test_joints_of_other_names_are_told_by_the_robot_file(checkout, tmp_path):
    write_checkout(checkout, robots.resolve("franka"), Changes(joints={"joint4": "elbow"}))
    path = changed("franka", tmp_path, "[looks.bodies]", 'joints = { joint4 = "elbow" }\n[looks.bodies]')
    assert find_skin(load_spec(path)) is not None


def test_the_verb_tells_what_a_robot_wears(checkout, capsys):
    assert run(["robots", "show", "franka"]) == 0
    assert "looks: its own shapes" in capsys.readouterr().out
    file = write_checkout(checkout, robots.resolve("franka"))
    assert run(["robots", "show", "franka"]) == 0
    assert str(file.parent) in capsys.readouterr().out.replace("\n", "")
    file.write_text("<mujoco/>")
    assert run(["robots", "show", "franka"]) == 0
    assert "looks: its own shapes:" in capsys.readouterr().out
