"""A robot wears the visuals of the real one where they are on the machine: they follow its bodies and change
no number."""

from __future__ import annotations

import logging
from pathlib import Path

import mujoco
import numpy as np
import pytest

import robots
from benchmarks.scenes import furniture
from robots.config import PlanConfig
from robots.film.video import draw
from robots.model.mjcf import compiled, robot_model
from robots.model.skin import skin_of
from robots.model.spec import load_spec
from robots.model.wear import wear
from robots.scene.world import World, build_world
from robots.simulation.replay import simulate
from tests.makers.robots.checkout import LINKS, NAMES, Changes, only_checkout, write_checkout
from tests.robots.model.test_catalog import copied
from tests.robots.planning.test_replay import can_draw
from twin import geometry as geo

BASE = geo.make_pose(geo.exp_so3([0, 0, 0.7]), [0.3, -0.9, 0.4])
CONFIG = robots.ReplayConfig(video_size=(161, 121), video_frames=4)


@pytest.fixture(autouse=True)
def checkout(tmp_path: Path, monkeypatch) -> Path:
    return only_checkout(tmp_path, monkeypatch)


def scene(name: str, dressed: bool, visual: bool = True) -> World:
    spec = robots.resolve(name)
    skin = skin_of(spec) if dressed else None
    assert (skin is not None) == dressed
    return build_world(furniture.drawer(), spec, BASE, 0.4, visual=visual, skin=skin)


def drawn(model: mujoco.MjModel, data: mujoco.MjData, geom: int) -> np.ndarray:
    """Vertices (v, 3) of a mesh geom in the world."""
    mesh = int(model.geom_dataid[geom])
    start, count = int(model.mesh_vertadr[mesh]), int(model.mesh_vertnum[mesh])
    pose = geo.make_pose(data.geom_xmat[geom].reshape(3, 3), data.geom_xpos[geom])
    return geo.transform(pose, model.mesh_vert[start : start + count])


def in_body(name: str, data: mujoco.MjData, model: mujoco.MjModel, points: np.ndarray) -> np.ndarray:
    body = model.body(name).id
    return geo.transform(
        geo.invert_pose(geo.make_pose(data.xmat[body].reshape(3, 3), data.xpos[body])), points
    )


def worn(world: World) -> np.ndarray:
    """Geoms that come from the skin."""
    model = world.model
    return np.array([
        g for g in range(model.ngeom)
        if model.geom_dataid[g] >= 0 and model.mesh(model.geom_dataid[g]).name.startswith("robot/looks/")
    ])  # fmt: skip


def other_frames(name: str) -> Changes:
    """Their bodies have frames of their own, but for what only frames can tell: the first body and the
    fingers."""
    told = {"link0", "left_finger", "right_finger", "body", "arm_link_fngr"}
    rng = np.random.default_rng(3)
    return Changes(
        {
            link.name: geo.make_pose(geo.exp_so3(rng.normal(size=3)), 0.1 * rng.normal(size=3))
            for link in LINKS[name] if link.name not in told
        }
    )  # fmt: skip


@pytest.mark.parametrize("frames", ["published frames", "other frames"])
@pytest.mark.parametrize("name", NAMES)
def test_visuals_stand_where_the_real_robots_stand_at_every_joint_state(name, frames, checkout):
    """Truth: the other model alone, moved by the same joint states, told from the body that both begin
    with."""
    spec = robots.resolve(name)
    file = write_checkout(checkout, spec, other_frames(name) if frames == "other frames" else None)
    theirs = mujoco.MjModel.from_xml_path(str(file))
    world = scene(name, dressed=True)
    model, rng = world.model, np.random.default_rng(1)
    data, real = mujoco.MjData(model), mujoco.MjData(theirs)
    anchor, root = ("robot/body", "body") if spec.planar else ("robot/link0", "link0")
    joints = [*spec.arm_joints[len(spec.base_joints) :], *spec.gripper_joints]
    for joint, state in spec.looks.hold.items():
        real.joint(joint).qpos[:] = state
    pieces = worn(world)
    assert len(pieces) == sum(link.visuals for link in LINKS[name])
    for _ in range(5):
        for joint in joints:
            low, high = model.joint(f"robot/{joint}").range
            state = rng.uniform(low, high)
            data.joint(f"robot/{joint}").qpos[:], real.joint(joint).qpos[:] = state, state
        for joint in spec.base_joints:
            data.joint(f"robot/{joint}").qpos[:] = rng.uniform(-1, 1)
        mujoco.mj_kinematics(model, data)
        mujoco.mj_kinematics(theirs, real)
        for g in pieces:
            mesh = int(model.mesh(model.geom_dataid[g]).name.rpartition("/")[2])
            (other,) = np.flatnonzero((theirs.geom_dataid == mesh) & (theirs.geom_group == 2))
            mine = in_body(anchor, data, model, drawn(model, data, g))
            wanted = in_body(root, real, theirs, drawn(theirs, real, other))
            # legs stand by figures of four digits; all else is exact to the meshes' single precision
            assert np.abs(mine - wanted).max() < 2e-6
            assert model.mat(model.geom_matid[g]).rgba == pytest.approx(
                theirs.mat(theirs.geom_matid[other]).rgba
            )


def test_spots_legs_stand_where_ours_do(checkout):
    """The joint states in spot.toml put each foot of the published legs on the foot of our own shapes."""
    spec = robots.resolve("spot")
    theirs = mujoco.MjModel.from_xml_path(str(write_checkout(checkout, spec)))
    real = mujoco.MjData(theirs)
    for joint, state in spec.looks.hold.items():
        real.joint(joint).qpos[:] = state
    mujoco.mj_kinematics(theirs, real)
    ours = mujoco.MjModel.from_xml_path(str(spec.model))
    feet = ours.geom_pos[(ours.geom_type == mujoco.mjtGeom.mjGEOM_SPHERE) & (ours.geom_pos[:, 2] < -0.4)]
    assert len(feet) == 4
    for leg in ("fl", "fr", "hl", "hr"):
        body = real.body(f"{leg}_lleg")
        foot = body.xmat.reshape(3, 3) @ [0, 0, -0.3365] + body.xpos - real.body("body").xpos
        assert np.linalg.norm(feet - foot, axis=1).min() < 1e-3


@pytest.mark.parametrize("name", NAMES)
def test_a_skin_shows_and_touches_nothing_and_weighs_nothing(name, checkout):
    write_checkout(checkout, robots.resolve(name))
    bare, dressed = scene(name, dressed=False), scene(name, dressed=True)
    pieces = worn(dressed)
    a, b = bare.model, dressed.model
    assert not b.geom_contype[pieces].any()
    assert not b.geom_conaffinity[pieces].any()
    assert set(b.geom_group[pieces].tolist()) == {2}
    own = np.setdiff1d(np.arange(b.ngeom), pieces)
    for field in ("contype", "conaffinity", "bodyid", "pos", "quat", "size", "friction", "solref", "solimp"):
        assert np.array_equal(getattr(a, f"geom_{field}"), getattr(b, f"geom_{field}")[own]), field
    mounted = np.array([b.body(b.geom_bodyid[g]).name.startswith("robot/") for g in own])
    assert set(b.geom_group[own[mounted]].tolist()) == {5}, "our shapes are hidden"
    assert np.array_equal(a.geom_group[~mounted], b.geom_group[own[~mounted]]), "the scene's are not"
    for field in ("body_mass", "body_inertia", "body_ipos", "body_iquat", "dof_armature", "dof_invweight0", "jnt_range", "actuator_gainprm"):  # fmt: skip
        assert np.array_equal(getattr(a, field), getattr(b, field)), field


def test_a_body_that_takes_its_mass_from_its_shapes_keeps_it(checkout, tmp_path):
    inertial = '<inertial mass="0.73" pos="-0.01 0 0.03" diaginertia="0.001 0.0025 0.0017"/>'
    path = copied("franka", tmp_path)
    file = path.with_suffix(".xml")
    text = file.read_text()
    assert inertial in text
    file.write_text(text.replace(inertial, '<geom type="sphere" size="0.05" mass="0.73"/>'))
    spec = load_spec(path)
    write_checkout(checkout, spec)
    skin = skin_of(spec)
    assert skin is not None
    robot = robot_model(spec)
    wear(robot, skin, 5)
    bare, dressed = compiled(spec), robot.compile()
    assert bare.body("hand").mass == 0.73
    for field in ("body_mass", "body_inertia", "body_ipos"):
        assert np.array_equal(getattr(bare, field), getattr(dressed, field)), field


@pytest.fixture(scope="module")
def opened():
    twin = furniture.drawer()
    return twin, robots.plan(twin, 2, config=PlanConfig(candidates=150, finalists=2))


def test_no_number_of_a_replay_changes_with_the_skin(opened, checkout):
    twin, trajectory = opened
    write_checkout(checkout, robots.resolve("franka"))
    spec = robots.resolve("franka")
    records = []
    for skin in (None, skin_of(spec)):
        world = build_world(twin, spec, trajectory.T_world_base, trajectory.pedestal, visual=True, skin=skin)
        records.append(simulate(world, trajectory, CONFIG))
    (bare, states), (dressed, same_states) = records
    assert bare.touching.max() == 2, "the hand held the handle"
    assert np.array_equal(states, same_states)
    assert bare.contacts == dressed.contacts
    for field in ("times", "phase", "state", "speed", "q", "torque", "tool", "grip", "touching"):
        assert np.array_equal(getattr(bare, field), getattr(dressed, field)), field


@pytest.mark.skipif(not can_draw(), reason="no OpenGL without a screen on this machine")
def test_of_a_replays_files_the_film_alone_shows_the_skin(opened, checkout, tmp_path, caplog):
    twin, trajectory = opened
    robots.replay(twin, trajectory, tmp_path / "bare", config=CONFIG)
    file = write_checkout(checkout, robots.resolve("franka"))
    with caplog.at_level(logging.INFO):
        robots.replay(twin, trajectory, tmp_path / "dressed", config=CONFIG)
    assert f"visuals of franka from {file.parent}" in caplog.messages
    names, same = (
        sorted(p.relative_to(tmp_path / folder) for p in (tmp_path / folder).rglob("*") if p.is_file())
        for folder in ("bare", "dressed")
    )
    assert names == same
    equal = {
        n: (tmp_path / "bare" / n).read_bytes() == (tmp_path / "dressed" / n).read_bytes() for n in names
    }
    assert [n.name for n, e in equal.items() if not e] == ["replay.mp4"]


@pytest.mark.skipif(not can_draw(), reason="no OpenGL without a screen on this machine")
def test_the_picture_shows_their_colours_in_place_of_ours(opened, checkout):
    twin, trajectory = opened
    spec = robots.resolve("franka")
    write_checkout(checkout, spec)
    pictures = []
    for skin in (None, skin_of(spec)):
        world = build_world(twin, spec, trajectory.T_world_base, trajectory.pedestal, visual=True, skin=skin)
        frame = np.zeros((1, world.model.nq))
        frame[0, world.arm_qpos] = trajectory.q[0]
        pictures.append(draw(world, trajectory, twin.parts[0], frame, (320, 240))[0].astype(int))

    def share(image: np.ndarray, channel: int) -> float:
        others = np.delete(image, channel, axis=2).max(axis=2)
        return float((image[..., channel] > others + 40).mean())

    assert share(pictures[0], 1) == 0.0
    assert share(pictures[1], 1) > 0.002, "their shells are green"
    white = [float((p.min(axis=2) > 150).mean()) for p in pictures]
    assert white[1] < white[0], "our white capsules are gone"


def test_textures_and_primitives_are_worn_too(checkout):
    file = write_checkout(
        checkout,
        robots.resolve("franka"),
        Changes(body='<geom class="visual" type="capsule" size="0.05 0.1" mesh="" material="painted"/>'.replace(' mesh=""', "")),
    )  # fmt: skip
    parts = file.with_name("parts.xml")
    painted = (
        '<texture name="t" type="2d" builtin="checker" width="8" height="4" rgb1="1 0 0" rgb2="0 0 1"/>'
        '<material name="painted" texture="t" texrepeat="2 3" emission="0.3"/></asset>'
    )
    parts.write_text(parts.read_text().replace("</asset>", painted))
    skin = skin_of(robots.resolve("franka"))
    assert skin is not None
    theirs, ours = skin.model, scene("franka", dressed=True).model
    (g,) = np.flatnonzero((ours.geom_type == mujoco.mjtGeom.mjGEOM_CAPSULE) & (ours.geom_group == 2))
    assert ours.geom_size[g].tolist() == [0.05, 0.1, 0]
    mine, other = ours.mat(ours.geom_matid[g]), theirs.mat("painted")
    assert mine.emission == other.emission
    assert mine.texrepeat.tolist() == [2, 3]
    pixels = [
        m.tex_data[m.tex_adr[k] : m.tex_adr[k] + 8 * 4 * 3]
        for m, k in ((ours, int(mine.texid[1])), (theirs, int(other.texid[1])))
    ]
    assert np.array_equal(*pixels)
    assert len(np.unique(pixels[0])) > 1
