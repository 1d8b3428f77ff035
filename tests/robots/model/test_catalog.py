"""Robots as data: robot files, where their models are found, arms from URDF, and the verb that shows them."""

from __future__ import annotations

import dataclasses
import json
import logging
from pathlib import Path

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import robots
from benchmarks.scenes import furniture
from robots.config import PlanConfig
from robots.model.catalog import names, resolve
from robots.model.kinematics import read_chain
from robots.model.mjcf import compiled
from robots.model.model_files import locate
from robots.model.spec import load_spec
from twin.cli.main import run
from twin.errors import InputError


def copied(name: str, folder: Path) -> Path:
    source = resolve(name).model
    (folder / source.name).write_bytes(source.read_bytes())
    path = folder / f"{name}.toml"
    path.write_bytes(source.with_suffix(".toml").read_bytes())
    return path


def changed(name: str, folder: Path, old: str, new: str) -> Path:
    path = copied(name, folder)
    text = path.read_text(encoding="utf-8")
    assert text.count(old) == 1
    path.write_text(text.replace(old, new), encoding="utf-8")
    return path


@pytest.mark.parametrize("name", names())
def test_a_copied_robot_file_is_the_same_robot(name, tmp_path: Path):
    mine, bundled = load_spec(copied(name, tmp_path)), resolve(name)
    assert mine.model == tmp_path / bundled.model.name
    for field in dataclasses.fields(mine):
        if field.name != "model":
            assert np.array_equal(getattr(mine, field.name), getattr(bundled, field.name)), field.name


@pytest.mark.parametrize("name", names())
def test_every_bundled_robot_names_what_its_model_has(name):
    spec = resolve(name)
    chain = read_chain(compiled(spec), spec)
    inside = (spec.home >= chain.lower) & (spec.home <= chain.upper)
    assert inside.all()
    assert chain.base == (3 if spec.planar else 0)


@pytest.mark.parametrize(
    ("name", "old", "new", "message"),
    [
        ("franka", "palm = ", "plam = ", r"unknown key 'tool.plam'.*did you mean 'tool.palm'"),
        ("franka", "[gripper]", "[griper]", r"unknown key 'griper'.*did you mean 'gripper'"),
        ("franka", "stroke = 0.08", "", r"lacks the key 'stroke'"),
        ("franka", "stroke = 0.08", "stroke = -1.0", r"stroke must be positive, got -1.0"),
        ("franka", "stroke = 0.08", 'stroke = "wide"', r"value of the wrong kind"),
        ("franka", "stroke = 0.08", "stroke = ", r"is not TOML"),
        ("franka", 'kind = "fixed"', 'kind = "flying"', r"base kind 'flying'; known kinds: fixed, planar"),
        ("franka", 'kind = "parallel"', 'kind = "hook"', r"gripper kind 'hook'; known kinds: parallel, claw"),
        ("franka", 'kind = "fixed"', 'kind = "planar"', r"lacks the key 'joints'"),
        ("spot", "lever = ", "levers = ", r"unknown key 'gripper.levers'.*'gripper.lever'"),
        ("spot", "open = -1.4", "open = 0.0", r"a claw has one joint"),
        ("spot", 'joints = ["base_x", "base_y", "base_yaw"]', 'joints = ["base_x"]', r"7 arm joints and 9"),
        ("spot", "distance = [0.70, 1.30]", "distance = [1.3, 0.7]", r"nearest < farthest"),
        ("spot", 'model = "spot.xml"', 'model = "/etc/passwd"', r"must be a path below"),
        ("spot", 'model = "spot.xml"', 'model = "../spot.xml"', r"must be a path below"),
        ("spot", 'model = "spot.xml"', 'model = "dog.xml"', r"dog.xml, which is not beside it"),
    ],
)
def test_a_bad_robot_file_says_what_is_wrong(name, old, new, message, tmp_path: Path):
    with pytest.raises(InputError) as e:
        load_spec(changed(name, tmp_path, old, new))
    text = f"{e.value.problem}; {e.value.remedy}"
    import re

    assert re.search(message, text), text


def test_a_model_is_taken_from_where_the_user_said_first(tmp_path: Path, monkeypatch, caplog):
    beside, checkout, cache = tmp_path / "a", tmp_path / "b", tmp_path / "c/mujoco_menagerie"
    for folder in (beside, checkout, cache):
        (folder / "maker_arm").mkdir(parents=True)
        (folder / "maker_arm/arm.xml").write_text("<mujoco/>")
    monkeypatch.setenv("FUNTWIN_MENAGERIE", str(checkout))
    monkeypatch.setenv("ROBOT_DESCRIPTIONS_CACHE", str(tmp_path / "c"))
    found = []
    with caplog.at_level(logging.INFO, logger="robots.model.model_files"):
        for _ in range(3):
            path = locate("maker_arm/arm.xml", beside)
            found.append(path)
            path.unlink()
    assert found == [f / "maker_arm/arm.xml" for f in (beside, checkout, cache)]
    assert [str(f) in m for f, m in zip((checkout, cache), caplog.messages, strict=True)] == [True, True]
    with pytest.raises(InputError, match="not beside it"):
        locate("maker_arm/arm.xml", beside)
    monkeypatch.setenv("FUNTWIN_MENAGERIE", str(tmp_path / "nowhere"))
    with pytest.raises(InputError, match="which is no folder"):
        locate("maker_arm/arm.xml", beside)


def test_a_model_inside_an_installed_package_is_found_without_importing_it(tmp_path: Path):
    import mink as package

    assert locate("mink/__init__.py", tmp_path) == Path(str(package.__file__))


def urdf_of_franka() -> str:
    """The bundled Franka's links and joints as URDF, with shapes on hand and fingers only."""
    model = mujoco.MjModel.from_xml_path(str(resolve("franka").model))
    links, joints = ['<link name="root"/>'], []
    boxes: dict[int, list[int]] = {}
    for g in range(model.ngeom):
        if model.geom_type[g] == mujoco.mjtGeom.mjGEOM_BOX:
            boxes.setdefault(int(model.geom_bodyid[g]), []).append(g)
    for b in range(2, model.nbody):
        name, parent = model.body(b).name, int(model.body_parentid[b])
        x, y, z = model.body_ipos[b]
        i = Rotation.from_quat(model.body_iquat[b], scalar_first=True)
        t = i.as_matrix() @ np.diag(model.body_inertia[b]) @ i.as_matrix().T
        shapes = "".join(
            f'<collision><origin xyz="{" ".join(map(str, model.geom_pos[g]))}"/>'
            f'<geometry><box size="{" ".join(map(str, 2 * model.geom_size[g]))}"/></geometry></collision>'
            for g in boxes.get(b, [])
        )
        links.append(
            f'<link name="{name}"><inertial><origin xyz="{x} {y} {z}"/><mass value="{model.body_mass[b]}"/>'
            f'<inertia ixx="{t[0, 0]}" iyy="{t[1, 1]}" izz="{t[2, 2]}" ixy="{t[0, 1]}" ixz="{t[0, 2]}" '
            f'iyz="{t[1, 2]}"/></inertial>{shapes}</link>'
        )
        rpy = Rotation.from_quat(model.body_quat[b], scalar_first=True).as_euler("xyz")
        origin = f'<origin xyz="{" ".join(map(str, model.body_pos[b]))}" rpy="{" ".join(map(str, rpy))}"/>'
        above = f'<parent link="{"root" if parent == 1 else model.body(parent).name}"/><child link="{name}"/>'
        if model.body_jntnum[b] == 0:
            joints.append(f'<joint name="to_{name}" type="fixed">{origin}{above}</joint>')
            continue
        j = int(model.body_jntadr[b])
        kind = "revolute" if model.jnt_type[j] == mujoco.mjtJoint.mjJNT_HINGE else "prismatic"
        low, high = model.jnt_range[j]
        joints.append(
            f'<joint name="{model.joint(j).name}" type="{kind}">{origin}{above}'
            f'<axis xyz="{" ".join(map(str, model.jnt_axis[j]))}"/>'
            f'<limit lower="{low}" upper="{high}" effort="87" velocity="2"/></joint>'
        )
    return f'<robot name="mine">{"".join(links)}{"".join(joints)}</robot>'


@pytest.fixture
def urdf_arm(tmp_path: Path) -> Path:
    (tmp_path / "mine.urdf").write_text(urdf_of_franka(), encoding="utf-8")
    text = resolve("franka").model.with_suffix(".toml").read_text(encoding="utf-8")
    text = text.replace("franka", "mine").replace("mine.xml", "mine.urdf").replace('"link0"', '"world"')
    text = text.replace('site = "tool"', 'site = "tool"\nbody = "hand"\nposition = [0.0, 0.0, 0.1034]')
    text = text.replace(
        "[base]",
        "stiffness = [600, 600, 600, 600, 250, 150, 50]\ndamping = [50, 50, 50, 50, 30, 25, 15]\n\n[base]",
    )
    path = tmp_path / "mine.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_a_urdf_arm_has_the_kinematics_of_the_arm_it_describes(urdf_arm):
    mine, franka = resolve(urdf_arm), resolve("franka")
    chains = [read_chain(compiled(s), s) for s in (mine, franka)]
    q = np.random.default_rng(0).uniform(chains[1].lower, chains[1].upper, (20, 7))
    assert np.abs(chains[0].forward(q)[0] - chains[1].forward(q)[0]).max() < 1e-6
    model = compiled(mine)
    assert model.jnt_actgravcomp[:7].all(), "what carries the arm counts against its torque limits"
    assert model.neq == 1, "fingers close together"
    assert np.array_equal(model.actuator_forcerange[:7, 1], mine.effort)
    assert model.actuator("gripper").forcerange[1] == mine.force


def test_a_urdf_arm_opens_a_drawer(urdf_arm):
    twin = furniture.drawer()
    config = PlanConfig(candidates=150, finalists=2)
    trajectory = robots.plan(twin, 2, urdf_arm, config=config)
    report = robots.replay(twin, trajectory, robot=urdf_arm, video=False)
    assert report.ok, report.reason


def test_stiffness_is_refused_where_it_makes_no_servos(tmp_path: Path):
    path = changed("spot", tmp_path, "[base]", "stiffness = [1, 1, 1, 1, 1, 1]\n[base]")
    with pytest.raises(InputError, match="fixed arm with a parallel gripper only"):
        load_spec(path)


def test_a_robot_model_that_is_no_model_is_one_line(tmp_path: Path):
    path = copied("franka", tmp_path)
    broken = {"<mujoco>": "not well-formed", "<html/>": "can't be read", "<mujoco><worldbody><body><joint/></body></worldbody></mujoco>": "refuses"}  # fmt: skip
    for text, message in broken.items():
        (tmp_path / "franka.xml").write_text(text, encoding="utf-8")
        with pytest.raises(InputError, match=message) as e:
            compiled(load_spec(path))
        assert "\n" not in str(e.value)


def test_twin_robots_lists_shows_and_refuses(capsys):
    assert run(["robots", "list", "--json"]) == 0
    assert sorted(json.loads(capsys.readouterr().out)["robots"]) == names()
    assert run(["robots", "show", "spot", "--json"]) == 0
    shown = json.loads(capsys.readouterr().out)["robot"]
    assert shown["base_joints"] == ["base_x", "base_y", "base_yaw"]
    assert shown["upper"][4] == pytest.approx(0.523599)
    assert run(["robots", "show", "spto"]) == 1
    assert "did you mean 'spot'" in capsys.readouterr().err
    assert run(["robots", "show"]) == 1
    assert "known robots: franka, spot" in capsys.readouterr().err


def test_fetching_needs_a_package_that_is_named(capsys, monkeypatch):
    monkeypatch.setattr("robots.model.catalog.find_spec", lambda _: None)
    assert run(["robots", "fetch", "spot"]) == 1
    error = capsys.readouterr().err
    assert "install the package robot_descriptions into" in error
    assert len(error.strip().splitlines()) == 1
