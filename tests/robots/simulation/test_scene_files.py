"""A replay leaves its scene behind: robot, twin, keyframes and actuators in a folder that plain MuJoCo loads
from anywhere."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest
import trimesh

import robots
from benchmarks.scenes import furniture
from robots.config import PlanConfig
from robots.model.catalog import resolve
from robots.scene.world import build_world
from robots.trajectory import RobotTrajectory
from twin.inferred import Completion, Inferred, box_mesh
from twin.scene import Twin

FAST = PlanConfig(candidates=200, finalists=2, rehearse=False)
OURS = Path(__file__).parents[3] / "assets" / "robots"


@pytest.fixture(scope="module")
def twin() -> Twin:
    return robots.completed(furniture.drawer())


def replayed(twin: Twin, robot: str, folder: Path) -> tuple[RobotTrajectory, Path]:
    """The trajectory, and the scene of its replay in a folder that was moved since."""
    trajectory = robots.plan(twin, "part", robot, config=FAST)
    robots.replay(twin, trajectory, folder / "there", robot=robot, video=False)
    shutil.move(folder / "there", folder / "elsewhere")
    return trajectory, folder / "elsewhere" / "scene.xml"


@pytest.fixture(scope="module", params=["franka", "spot"])
def scene(twin: Twin, request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory):
    trajectory, path = replayed(twin, request.param, tmp_path_factory.mktemp("replay"))
    return trajectory, mujoco.MjModel.from_xml_path(str(path))


def driven(model: mujoco.MjModel) -> list[int]:
    """How many actuators drive each joint, by itself or in a tendon."""
    count = [0] * model.njnt
    for k in range(model.nu):
        target = int(model.actuator_trnid[k, 0])
        if model.actuator_trntype[k] == mujoco.mjtTrn.mjTRN_JOINT:
            count[target] += 1
        else:
            start, n = int(model.tendon_adr[target]), int(model.tendon_num[target])
            for w in range(start, start + n):
                count[int(model.wrap_objid[w])] += 1
    return count


def test_each_joint_of_a_replayed_scene_has_one_actuator(scene) -> None:
    _, model = scene
    assert driven(model) == [1] * model.njnt
    assert model.joint("part_joint").id >= 0
    assert model.actuator("part_joint").id >= 0


def test_the_keyframes_of_a_replayed_scene_hold(scene) -> None:
    """With the controls of each, arm and part stay where it has them."""
    trajectory, model = scene
    part = int(model.joint("part_joint").qposadr[0])
    assert [model.key(k).name for k in range(model.nkey)] == ["start", "grasp", "goal"]
    assert [model.key_qpos[k, part] for k in range(3)] == pytest.approx([0.0, 0.0, trajectory.goal], abs=1e-6)
    arm = [int(model.joint(f"robot/{n}").qposadr[0]) for n in trajectory.joint_names]
    data = mujoco.MjData(model)
    for k in range(model.nkey):
        mujoco.mj_resetDataKeyframe(model, data, k)
        while data.time < 0.5:
            mujoco.mj_step(model, data)
        assert np.abs(data.qpos[arm] - model.key_qpos[k, arm]).max() < 0.02, model.key(k).name
        assert data.qpos[part] == pytest.approx(model.key_qpos[k, part], abs=0.01), model.key(k).name


def test_a_replayed_scene_is_the_one_that_was_simulated(twin: Twin, scene) -> None:
    trajectory, model = scene
    world = build_world(twin, resolve(trajectory.robot), trajectory.T_world_base, trajectory.pedestal).model
    for b in range(1, world.nbody):
        name = world.body(b).name
        assert model.body(name).mass[0] == pytest.approx(world.body_mass[b], rel=1e-5), name
    for j in range(world.njnt):
        mine = model.joint(world.joint(j).name)
        np.testing.assert_allclose(mine.range, world.jnt_range[j], rtol=1e-5)
    assert model.opt.timestep == world.opt.timestep
    shown = {model.geom(g).group[0] for g in range(model.ngeom) if model.geom(g).name == "stand/pedestal"}
    assert shown <= {0, 1, 2}, "a viewer shows the pedestal"


def test_what_an_inferred_piece_says_of_itself_is_read_again(twin: Twin, tmp_path: Path) -> None:
    """MuJoCo writes texts with one of the characters that XML escapes so that it can't read them."""
    reason = 'at the front\'s edge, "as deep" & < 1 m'
    board = Inferred("back", "board", box_mesh(np.eye(4), np.full(3, 0.1)), "assumed", reason)
    static = replace(twin.static, completion=Completion(twin.static.mesh, (board,), twin.static.collision))
    told = replace(twin, static=static)
    scene = mujoco.MjSpec.from_file(str(replayed(told, "franka", tmp_path)[1]))
    assert {t.name: t.data for t in scene.texts} == {"cabinet_inferred_back": f"assumed: {reason}"}


def test_the_meshes_of_a_users_robot_lie_beside_its_scene(twin: Twin, tmp_path: Path) -> None:
    own = tmp_path / "own"
    (own / "shapes").mkdir(parents=True)
    trimesh.creation.icosphere(2, 0.05).export(own / "shapes" / "ball.stl")
    text = (OURS / "franka.xml").read_text(encoding="utf-8")
    text = text.replace("<worldbody>", '<asset><mesh name="ball" file="ball.stl"/></asset><worldbody>', 1)
    text = text.replace("<compiler ", '<compiler meshdir="shapes" ', 1)
    ball = '<geom type="mesh" mesh="ball" contype="0" conaffinity="0" group="2" density="0"/>'
    head, _, rest = text.partition('<body name="link0"')
    inside, _, tail = rest.partition(">")
    (own / "franka.xml").write_text(f'{head}<body name="link0"{inside}>{ball}{tail}', encoding="utf-8")
    (own / "franka.toml").write_text((OURS / "franka.toml").read_text(encoding="utf-8"), encoding="utf-8")
    _, path = replayed(twin, str(own / "franka.toml"), tmp_path)
    shutil.rmtree(own)
    model = mujoco.MjModel.from_xml_path(str(path))
    assert model.mesh("robot/ball").id >= 0
    assert sorted(p.name for p in (path.parent / "assets").glob("robot_*")) == ["robot_0_ball.stl"]
