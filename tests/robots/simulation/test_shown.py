"""A replay in the page: links and parts stand where MuJoCo has them in the replay's own scene.xml."""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
import trimesh

import robots
from benchmarks.scenes import furniture
from robots.config import PlanConfig
from robots.simulation import shown
from tests.makers.browser import Tab, browser
from twin import geometry as geo
from twin.geometry import Array
from twin.page import render
from twin.report.replayed import load_replayed
from twin.scene import Twin
from twin.storage import save

FAST = PlanConfig(candidates=200, finalists=2, rehearse=False)
MOMENTS = (0.0, 0.45, 0.9)  # of the replay's length
BASE64_MB = 1.5
# between samples links go straight from one to the next: a 25th of a second
AT_SAMPLES, BETWEEN = (1e-4, 0.02), (1e-3, 0.1)  # m, degrees


@pytest.fixture(scope="module")
def twin() -> Twin:
    return robots.completed(furniture.drawer())


@pytest.fixture(scope="module", params=["franka", "spot"])
def run(twin: Twin, request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run with a twin, a replay and its page."""
    folder: Path = tmp_path_factory.mktemp(request.param)
    save(twin, folder / "twin")
    trajectory = robots.plan(twin, "part", request.param, config=FAST)
    robots.replay(twin, trajectory, folder / "replay" / request.param / "part", video=False)
    render(folder)
    return folder


@pytest.fixture(scope="module")
def tab(run: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Tab]:
    with browser(tmp_path_factory.mktemp("profile")) as tab:
        tab.size(1400, 1000)
        tab.open((run / "report.html").as_uri())
        assert tab.run("funtwin.ready") is True
        yield tab


def replay_in(run: Path) -> Path:
    (folder,) = (run / "replay").glob("*/*")
    return folder


def told_in(run: Path) -> dict[str, Any]:
    """What the page's scripts are told of the replay."""
    text = (run / "report.html").read_text(encoding="utf-8")
    told = re.search(r'<script type="application/json" id="told">(.*?)</script>', text, re.DOTALL)
    assert told is not None
    (replay,) = json.loads(told[1])["replays"]
    return dict(replay)


def by_mujoco(run: Path, time: float) -> tuple[mujoco.MjModel, mujoco.MjData]:
    """The replay's scene.xml with all its joints where the replay had them at a time, kinematics made."""
    replayed = load_replayed(replay_in(run))
    assert replayed is not None
    model = mujoco.MjModel.from_xml_path(str(replay_in(run) / "scene.xml"))
    data = mujoco.MjData(model)
    for name, states in replayed.joints.items():
        data.qpos[model.joint(name).qposadr[0]] = np.interp(time, replayed.times, states)
    mujoco.mj_kinematics(model, data)
    return model, data


def apart(T: Array, model: mujoco.MjModel, data: mujoco.MjData, name: str) -> tuple[float, float]:
    """Metres and degrees from a pose (4, 4) to a body's."""
    body = model.body(name).id
    turned = T[:3, :3].T @ data.xmat[body].reshape(3, 3)
    return (
        float(np.linalg.norm(T[:3, 3] - data.xpos[body])),
        float(np.rad2deg(np.linalg.norm(geo.log_so3(turned)))),
    )


def drawn_bodies(model: mujoco.MjModel) -> set[str]:
    """Bodies of the robot that have shapes, and what it stands on."""
    return {model.body(b).name for b in model.geom_bodyid if model.body(b).name.startswith("robot/")} | {
        "stand/pedestal"
    }


@pytest.mark.parametrize("share", MOMENTS)
def test_links_in_the_page_are_where_mujoco_has_them(run: Path, share: float) -> None:
    told = told_in(run)
    k = round(share * (len(told["times"]) - 1))
    model, data = by_mujoco(run, told["times"][k])
    assert set(told["links"]) == drawn_bodies(model)
    for name, link in told["links"].items():
        quaternion = np.roll(np.array(link["quaternions"][k]), 1)
        T = geo.make_pose(geo.matrix_from_quat_wxyz(geo.unit(quaternion)), np.array(link["positions"][k]))
        off = apart(T, model, data, name)
        assert off[0] < AT_SAMPLES[0], name
        assert off[1] < AT_SAMPLES[1], name


def test_the_replay_in_the_page_is_what_its_report_tells(run: Path) -> None:
    told = told_in(run)
    report = json.loads((replay_in(run) / "report.json").read_text())
    states = np.array(told["states"]["part"])
    assert report["ok"]
    assert states[-1] == pytest.approx(report["state_final"], abs=1e-3)
    assert states.max() == pytest.approx(report["state_peak"], abs=1e-3)
    np.testing.assert_allclose(told["times"], 0.04 * np.arange(len(states)), atol=1e-9)
    assert told["times"][-1] == pytest.approx(report["duration"], abs=0.041)
    plan = json.loads((replay_in(run) / "trajectory.json").read_text())
    replayed = load_replayed(replay_in(run))
    assert replayed is not None
    for k, name in enumerate(plan["joint_names"]):  # it begins where the plan does
        assert replayed.joints[f"robot/{name}"][0] == pytest.approx(plan["q"][0][k], abs=2e-5)
    robot = report["robot"].capitalize()
    assert told["title"] == f"{robot} opens part"


def test_a_robot_takes_little_of_the_page(run: Path) -> None:
    """By how much the page is smaller without what the replay left for it."""
    whole = (run / "report.html").stat().st_size
    bare = run.parent / f"{run.name}_bare"
    shutil.copytree(run, bare)
    for name in ("motion.json", "robot.glb"):
        (replay_in(bare) / name).unlink()
    assert 10_000 < whole - render(bare).stat().st_size < BASE64_MB * 1e6


def pose_of(tab: Tab, name: str) -> Array:
    """World pose (4, 4) of a link as three.js has it."""
    columns = tab.run(
        "(() => {const {node} = funtwin.replays.shown; node.updateMatrixWorld(true);"
        f" return node.children.find((n) => n.userData.link === '{name}').matrixWorld.toArray();}})()"
    )
    return np.array(columns).reshape(4, 4).T


def watch(tab: Tab, value: str) -> None:
    """Choose what is played, as a hand does, and wait until it is there."""
    wanted = "null" if value == "" else value
    tab.run(
        f"(() => {{const s = document.querySelector('#clock select'); s.value = '{value}';"
        " s.dispatchEvent(new Event('change'));})()"
    )
    tab.until(
        f"funtwin.replays.asked === {wanted} && Boolean(funtwin.replays.shown) === {str(bool(value)).lower()}"
        f" && funtwin.clock.track.film === {str(not value).lower()}"
    )


def scrub(tab: Tab, time: float) -> Array:
    """Move the slider of time, as a hand does; the picture of the scene then."""
    tab.run(
        f"(() => {{const s = document.querySelector('#clock input[name=time]'); s.value = {time};"
        " s.dispatchEvent(new Event('input'));})()"
    )
    tab.run("funtwin.still()")
    return np.asarray(tab.picture("#view"), np.float64)


def fastest(told: dict[str, Any], third: int) -> float:
    """The time midway between two samples at which some link moves most, in a third of the replay."""
    at = np.array([link["positions"] for link in told["links"].values()])
    steps = np.linalg.norm(np.diff(at, axis=1), axis=2).max(axis=0)
    first = third * len(steps) // 3
    k = first + int(np.argmax(steps[first : (third + 1) * len(steps) // 3]))
    return float(np.mean(told["times"][k : k + 2]))


@pytest.mark.parametrize("third", [0, 1, 2])
def test_links_on_the_screen_are_where_mujoco_has_them(tab: Tab, run: Path, third: int) -> None:
    told = told_in(run)
    watch(tab, "0")
    scrub(tab, fastest(told, third))
    shown_at = tab.run("funtwin.clock.time")
    model, data = by_mujoco(run, shown_at)
    for name in told["links"]:
        off = apart(pose_of(tab, name), model, data, name)
        assert off[0] < BETWEEN[0], name
        assert off[1] < BETWEEN[1], name
    state = tab.run("funtwin.told.parts[0].state")
    assert state == pytest.approx(data.qpos[model.joint("part_joint").qposadr[0]], abs=1e-4)
    watch(tab, "")


def test_a_robot_is_off_at_first_and_seen_once_it_is_chosen(tab: Tab, run: Path) -> None:
    length = told_in(run)["times"][-1]
    assert tab.run("funtwin.replays.shown") is None
    assert tab.run("document.querySelector('#clock select').value") == ""
    tab.run("funtwin.clock.go(0); funtwin.still()")
    without = tab.picture("#view").astype(float)
    watch(tab, "0")
    first = scrub(tab, 0.0)
    tab.run("funtwin.replays.shown.node.visible = false; funtwin.draw()")
    hidden = tab.picture("#view").astype(float)
    tab.run("funtwin.replays.shown.node.visible = true")
    assert (np.abs(first - hidden).max(axis=-1) > 8).mean() > 0.02, "the robot covers much of the picture"
    later = scrub(tab, 0.5 * length)
    assert (np.abs(later - first).max(axis=-1) > 8).mean() > 0.01, "arm and part have moved"
    assert np.array_equal(scrub(tab, 0.0), first)
    watch(tab, "")
    tab.run("funtwin.clock.go(0); funtwin.still()")
    assert np.array_equal(tab.picture("#view"), without)
    assert tab.complaints == []


def test_a_replay_plays_on_to_its_end_and_begins_again(tab: Tab, run: Path) -> None:
    length = told_in(run)["times"][-1]
    watch(tab, "0")
    assert float(tab.run("document.querySelector('#clock input[name=time]').max")) == pytest.approx(length)
    scrub(tab, length - 0.2)
    tab.run("document.querySelector('#clock button').click()")
    tab.until(f"funtwin.clock.time < {length - 0.4}")
    tab.run("document.querySelector('#clock button').click()")
    assert tab.run("funtwin.clock.playing") is False
    watch(tab, "")


def test_states_are_told_as_the_run_counts_them_where_a_carrier_stood_open(tmp_path: Path) -> None:
    """A basket is moved while its drawer stands open by .3 m, which the replay calls its state 0."""
    bare = furniture.drawer()
    drawer = bare.parts[0]
    pulled = replace(
        drawer.motion, frames=np.arange(5), times=np.arange(5) / 10.0, state=np.array([0.0, 0.3, 0.3, 0.3, 0.3]),
        intervals=((0, 1),),
    )  # fmt: skip
    tray = furniture.laden_door(1.0).part("pull_out")
    basket = replace(
        tray, id=9, name="basket", parent=drawer.id, motion=replace(tray.motion, intervals=((2, 4),))
    )
    both = replace(bare, parts=(replace(drawer, motion=pulled), basket))
    trajectory = robots.plan(both, "basket", config=FAST)
    robots.replay(both, trajectory, tmp_path, video=False)
    replayed = load_replayed(tmp_path)
    assert replayed is not None
    assert replayed.states[drawer.name][0] == pytest.approx(0.3, abs=1e-4)
    assert replayed.states["basket"][0] == pytest.approx(0.0, abs=1e-4)
    assert (replayed.start, replayed.part) == (pytest.approx(0.0), "basket")


def faces_in(glb: bytes) -> int:
    """Triangles of a .glb, as trimesh reads it."""
    scene = trimesh.load(trimesh.util.wrap_as_stream(glb), file_type="glb", force="scene")
    return sum(len(g.faces) for g in scene.geometry.values())


def test_heavy_meshes_become_light_and_keep_their_shape() -> None:
    ball = trimesh.creation.icosphere(6, 0.1)
    spec = mujoco.MjSpec()
    spec.add_mesh(name="ball", uservert=ball.vertices.ravel(), userface=ball.faces.ravel())
    body = spec.worldbody.add_body(name="robot/link", pos=[1, 0, 0])
    body.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname="ball", pos=[0, 0.5, 0])
    glb = shown._glb(spec.compile(), {"robot/link": [0]})
    assert len(ball.faces) > 80_000
    assert 6_000 < faces_in(glb) <= 12_240
    scene = trimesh.load(trimesh.util.wrap_as_stream(glb), file_type="glb", force="scene")
    (mesh,) = scene.geometry.values()
    distance = np.linalg.norm(mesh.vertices - [0, 0.5, 0], axis=1)
    assert np.abs(distance - 0.1).max() < 5e-4


def test_meshes_of_loose_triangles_take_no_more_of_the_page_than_they_may() -> None:
    """The most bytes a triangle: no corner is another's, nothing can be shared."""
    rng = np.random.default_rng(0)
    corners = rng.random((40_000, 1, 3)) + 0.01 * rng.standard_normal((40_000, 3, 3))
    spec = mujoco.MjSpec()
    spec.add_mesh(
        name="loose", uservert=corners.ravel(), userface=np.arange(120_000),
        inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL,
    )  # fmt: skip
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname="loose")
    glb = shown._glb(spec.compile(), {"robot/link": [0]})
    assert faces_in(glb) > 6_000
    assert len(glb) * 4 / 3 < BASE64_MB * 1e6


KINDS = {
    "BOX": ([0.1, 0.2, 0.3], 8 * 0.1 * 0.2 * 0.3),
    "SPHERE": ([0.2, 0, 0], 4 / 3 * np.pi * 0.2**3),
    "ELLIPSOID": ([0.1, 0.2, 0.3], 4 / 3 * np.pi * 0.1 * 0.2 * 0.3),
    "CAPSULE": ([0.1, 0.3, 0], np.pi * 0.01 * 0.6 + 4 / 3 * np.pi * 0.001),
    "CYLINDER": ([0.1, 0.3, 0], np.pi * 0.01 * 0.6),
}


@pytest.mark.parametrize("kind", KINDS)
def test_each_kind_of_shape_has_its_size_and_place(kind: str) -> None:
    """Volume within what a polygon of 16 corners lacks, extents by the shape's half sizes, and its middle."""
    size, volume = KINDS[kind]
    spec = mujoco.MjSpec()
    spec.worldbody.add_geom(
        type=getattr(mujoco.mjtGeom, f"mjGEOM_{kind}"), size=size, pos=[1, 2, 3], quat=[0.5, 0.5, 0.5, 0.5]
    )
    mesh = shown._shape(spec.compile(), 0).to_trimesh()
    assert mesh.volume == pytest.approx(volume, rel=0.06)
    np.testing.assert_allclose(mesh.bounds.mean(axis=0), [1, 2, 3], atol=0.01)
    high = {"SPHERE": [0.2] * 3, "CAPSULE": [0.1, 0.1, 0.4]}.get(
        kind, size if kind != "CYLINDER" else [0.1, 0.1, 0.3]
    )
    np.testing.assert_allclose(np.ptp(mesh.bounds, axis=0) / 2, np.roll(high, 1), rtol=0.03)  # x goes to y
