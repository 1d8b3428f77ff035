"""The bundled Spot against an independent computation of the published table (Pinocchio), and what it
opens."""

from __future__ import annotations

from dataclasses import replace

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import robots
from benchmarks.scenes import furniture
from robots.config import PlanConfig
from robots.floor import find_floor
from robots.grasp.holds import find_holds
from robots.grasp.tool_path import make_grasps
from robots.model.catalog import resolve
from robots.model.kinematics import read_chain
from robots.planning.base_search import Base, _starts
from robots.planning.clearance import ClearanceCheck
from robots.planning.joint_path import POSITION_TOLERANCE
from robots.scene.world import ROBOT, build_world
from robots.task import Task
from tests.makers.robots.replays import check_open_hand_gets_no_hold, check_opened
from tests.makers.robots.spot_table import ARM, HAND, INERTIALS, TOOL_AXES
from twin import geometry as geo
from twin.errors import InputError
from twin.scene import StaticPart

pin = pytest.importorskip("pinocchio")

FAST = PlanConfig(candidates=150, finalists=2)


def reference() -> pin.Model:
    """Planar base and arm, from the table alone; frame "tool" has the hand's axes, x out of it."""
    model = pin.Model()
    body = pin.SE3(np.eye(3), np.array([0.0, 0.0, 0.515]))
    parent = model.addJoint(0, pin.JointModelPX(), body, "base_x")
    parent = model.addJoint(parent, pin.JointModelPY(), pin.SE3.Identity(), "base_y")
    parent = model.addJoint(parent, pin.JointModelRZ(), pin.SE3.Identity(), "base_yaw")
    for name, kind, origin, *_ in ARM:
        joint = getattr(pin, f"JointModel{kind}")()
        parent = model.addJoint(parent, joint, pin.SE3(np.eye(3), np.array(origin)), name)
    hand = pin.SE3(np.eye(3), np.array(HAND))
    model.addFrame(pin.Frame("tool", parent, 0, hand, pin.FrameType.OP_FRAME))
    return model


@pytest.fixture(scope="module")
def spot():
    spec = resolve("spot")
    model = mujoco.MjModel.from_xml_path(str(spec.model))
    return spec, model, read_chain(model, spec)


@pytest.fixture(scope="module")
def drawer():
    twin = furniture.drawer(error=0.02, seed=1)
    return twin, robots.plan(twin, "part", "spot", config=FAST)


@pytest.fixture(scope="module")
def door():
    twin = furniture.door("left")
    return twin, robots.plan(twin, 2, "spot", config=FAST)


def samples(chain, n=30):
    return np.random.default_rng(5).uniform(chain.lower, chain.upper, (n, 9))


def test_forward_kinematics_and_jacobian_are_the_published_tables(spot):
    spec, model, chain = spot
    ref = reference()
    rdata, data, frame = ref.createData(), mujoco.MjData(model), ref.getFrameId("tool")
    q = samples(chain)
    poses, jacobians = chain.forward(q)
    to_tool = TOOL_AXES[:3, :3].T
    for k in range(len(q)):
        pin.framesForwardKinematics(ref, rdata, q[k])
        expected = rdata.oMf[frame].homogeneous @ TOOL_AXES
        data.qpos[:9] = q[k]
        mujoco.mj_kinematics(model, data)
        site = data.site(spec.tool)
        assert np.abs(poses[k] - expected).max() < 1e-12
        assert np.abs(site.xpos - expected[:3, 3]).max() < 1e-12
        assert np.abs(site.xmat.reshape(3, 3) - expected[:3, :3]).max() < 1e-12
        local = pin.computeFrameJacobian(ref, rdata, q[k], frame, pin.ReferenceFrame.LOCAL)
        assert np.abs(jacobians[k][:3] - to_tool @ local[:3]).max() < 1e-12
        assert np.abs(jacobians[k][3:] - to_tool @ local[3:]).max() < 1e-12


def test_gravity_torque_is_pinocchios_from_the_same_masses(spot):
    spec, model, chain = spot
    data, ref = mujoco.MjData(model), pin.buildModelFromMJCF(str(spec.model))
    rdata = ref.createData()
    largest = 0.0
    for q in samples(chain, 10):
        full = np.append(q, -0.3)
        data.qpos[:], data.qvel[:] = full, 0.0
        mujoco.mj_forward(model, data)
        expected = pin.computeGeneralizedGravity(ref, rdata, full)
        assert np.abs(data.qfrc_bias - expected).max() < 1e-6
        # arm and claw are compensated; the slides and the turn of the base don't feel gravity
        assert np.abs(data.qfrc_gravcomp - expected).max() < 1e-6
        largest = max(largest, np.abs(expected[3:9]).max())
    assert 10 < largest < 0.5 * 181.8  # the real arm carries itself with ease


def test_limits_and_masses_are_the_published_ones(spot):
    spec, model, chain = spot
    assert spec.arm_joints[3:] == tuple(row[0] for row in ARM)
    assert np.allclose(chain.lower[3:], [row[3] for row in ARM])
    assert np.allclose(chain.upper[3:], [row[4] for row in ARM])
    assert np.allclose(spec.effort[3:], [row[5] for row in ARM])
    assert np.allclose(model.actuator_forcerange[:9, 1], spec.effort)
    assert np.allclose(model.jnt_actfrcrange[3:9, 1], spec.effort[3:])
    arm = model.body_subtreemass[model.body("shoulder").id]
    assert arm == pytest.approx(2.596 + 1.450 + 0.980 + 0.785 + 0.200, abs=2e-3)
    assert model.body("body").mass[0] == pytest.approx(32.86 + 4 * (1.68 + 2.34 + 0.35))
    assert spec.force <= 130  # the real claw's peak
    assert model.actuator(spec.gripper_actuator).forcerange[1] == pytest.approx(spec.force * spec.lever)


def test_masses_centres_and_inertias_are_the_published_ones(spot):
    _, model, _ = spot
    for name, mass, centre, moments, rpy in INERTIALS:
        body = model.body(name)
        assert body.mass[0] == pytest.approx(mass, abs=1e-4)
        assert np.abs(body.ipos - centre).max() < 1e-4
        ours, theirs = geo.matrix_from_quat_wxyz(body.iquat), Rotation.from_euler("xyz", rpy).as_matrix()
        ours, theirs = ours @ np.diag(body.inertia) @ ours.T, theirs @ np.diag(moments) @ theirs.T
        assert np.abs(ours - theirs).max() < 1e-2 * max(moments)


def test_the_claw_closes_on_its_tool_point(spot):
    """Jaws meet where spec.fixed_jaw says, and open by the stroke at the tool point."""
    spec, model, _ = spot
    data = mujoco.MjData(model)
    data.qpos[9] = spec.jaws(0.0)[0]
    mujoco.mj_kinematics(model, data)
    low, high = model.geom("lower_jaw_blade").id, model.geom("upper_jaw_blade").id
    assert abs(mujoco.mj_geomDistance(model, data, low, high, 1.0, None)) < 0.006
    tool = data.site(spec.tool)
    frame = geo.make_pose(tool.xmat.reshape(3, 3), tool.xpos)
    face = geo.make_pose(data.geom_xmat[low].reshape(3, 3), data.geom_xpos[low])
    in_tool = geo.invert_pose(frame) @ face
    assert in_tool[1, 3] + model.geom_size[low][2] == pytest.approx(-spec.fixed_jaw, abs=1e-9)
    data.qpos[9] = spec.jaws(spec.stroke)[0]
    mujoco.mj_kinematics(model, data)
    assert mujoco.mj_geomDistance(model, data, low, high, 1.0, None) > 0.06


@pytest.mark.parametrize("thickness", [0.006, 0.014, 0.03, 0.096])
def test_the_jaw_that_does_not_move_lies_on_the_handle_it_holds_and_clears_it_before(spot, thickness):
    """In the tool's y, where `beside` puts a handle and `room` takes the hand; jaws measured in the model,
    opened."""
    spec, model, _ = spot
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    frame = geo.make_pose(data.site(spec.tool).xmat.reshape(3, 3), data.site(spec.tool).xpos)
    low = model.geom("lower_jaw_blade").id
    face = (geo.invert_pose(frame) @ np.append(data.geom_xpos[low], 1.0))[1] + model.geom_size[low][2]
    middle = -spec.beside(thickness)
    assert middle - thickness / 2 == pytest.approx(face, abs=1e-9)
    room = spec.room(thickness)
    clear = middle + room - thickness / 2 - face, face + spec.stroke - (middle + room + thickness / 2)
    assert min(clear) >= min(0.006, (spec.stroke - thickness) / 2) - 1e-9


def test_spot_stands_on_the_floor_and_keeps_to_itself(spot):
    spec, model, _ = spot
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    assert np.allclose(data.qpos[:9], spec.home)
    mujoco.mj_forward(model, data)
    assert data.ncon == 0
    feet = [g for g in range(model.ngeom) if model.geom_type[g] == mujoco.mjtGeom.mjGEOM_SPHERE]
    lowest = sorted(data.geom_xpos[g][2] - model.geom_size[g][0] for g in feet)[:4]
    assert np.allclose(lowest, 0.0, atol=1e-3)


def test_spot_opens_a_drawer_though_the_contact_is_off(drawer):
    twin, trajectory = drawer
    report = robots.replay(twin, trajectory, video=False)
    check_opened(report)
    assert report.grip_force_max == pytest.approx(resolve("spot").force), (
        "N at the tool point, not N m at the jaw"
    )
    again = robots.replay(twin, trajectory, video=False)
    assert again.to_json() == report.to_json()


def test_spot_opens_a_door(door):
    twin, trajectory = door
    check_opened(robots.replay(twin, trajectory, video=False))


def test_only_the_claw_moves_the_part(drawer):
    twin, trajectory = drawer
    world = build_world(twin, resolve("spot"), trajectory.T_world_base, trajectory.pedestal)
    assert world.model.neq == 0
    assert world.model.nu == 10
    check_open_hand_gets_no_hold(twin, trajectory, 0.1)


def test_the_base_stays_on_the_floor_and_inside_its_limits(door):
    twin, trajectory = door
    assert trajectory.pedestal == 0.0
    assert trajectory.T_world_base[2, 3] == pytest.approx(find_floor(twin).height, abs=1e-9)
    assert np.all(np.abs(trajectory.qd) <= trajectory.velocity_limits)
    assert trajectory.joint_names[:3] == ("base_x", "base_y", "base_yaw")
    assert trajectory.position_error.max() <= POSITION_TOLERANCE


def test_the_stance_does_not_give_way(door):
    """The servos hold the base within 5 mm and 0.5 degrees of the plan while the door pulls on the arm."""
    twin, trajectory = door
    world = build_world(twin, resolve("spot"), trajectory.T_world_base, trajectory.pedestal)
    from robots.simulation.replay import simulate

    record, _ = simulate(world, trajectory, robots.ReplayConfig())
    wanted, _, _ = trajectory.at(record.times)
    error = np.abs(record.q - wanted)[:, :3].max(axis=0)
    assert error[:2].max() < 0.005
    assert error[2] < np.deg2rad(0.5)


def test_an_arm_trajectory_is_not_replayed_by_another_robot(door):
    twin, trajectory = door
    with pytest.raises(InputError, match="planned for"):
        robots.replay(twin, trajectory, robot="franka", video=False)


def test_the_claw_comes_with_room_for_both_jaws_and_closes_on_the_handle(spot):
    """Its lower jaw does not move: the hand brings it to the handle while the upper one closes, and away
    again."""
    spec = spot[0]
    twin = furniture.drawer()
    trajectory = robots.plan(twin, 2, "spot", config=replace(FAST, rehearse=False))
    phases = np.array(trajectory.phases)
    tool = trajectory.T_world_tool
    across = tool[0, :3, 1]
    for phase, ends in (("close", (0, -1)), ("open", (-1, 0))):
        path = tool[phases == phase][:, :3, 3] @ across
        assert path[ends[1]] - path[ends[0]] == pytest.approx(spec.room(0.014), abs=1e-3)
    thickness = 0.014
    assert spec.beside(thickness) == pytest.approx(spec.fixed_jaw - thickness / 2)
    assert 0.006 < spec.room(thickness) < (spec.stroke - thickness) / 2 + 1e-9
    assert spec.room(spec.stroke) == 0.0


def test_feet_stand_on_the_floor(drawer):
    twin, trajectory = drawer
    assert trajectory.pedestal == 0.0
    assert trajectory.T_world_base[2, 3] == pytest.approx(find_floor(twin).height, abs=1e-6)
    assert not any(r.pedestal for r in trajectory.rejected)


@pytest.mark.parametrize("robot", ["spot", "franka"])
def test_inverse_kinematics_starts_turned_towards_the_target(robot):
    """A target turned about the shoulder's vertical axis turns that joint alone; a mobile base stays where it
    was put."""
    spec = resolve(robot)
    chain = read_chain(mujoco.MjModel.from_xml_path(str(spec.model)), spec)
    shoulder, turn = (3 if spec.planar else 0), 0.3
    mount = geo.make_pose(translation=chain.fixed[: shoulder + 1, :3, 3].sum(axis=0))
    target = geo.make_pose(Rotation.from_euler("y", 80, degrees=True).as_matrix(), [0.8, 0.05, 0.6])
    T = mount @ geo.make_pose(geo.exp_so3([0.0, 0.0, turn])) @ geo.invert_pose(mount)
    before, after = (np.concatenate(_starts(t[None], chain, spec)) for t in (target, T @ target))
    assert len({tuple(q) for q in before.round(6)}) == len(before) >= 3
    off = before - spec.home  # a branch of the wrist to either side
    np.testing.assert_allclose(off[:, shoulder + 1 :].mean(axis=0), 0.0, atol=1e-9)
    if spec.planar:
        assert np.all(np.ptp(off[:, [-3, -1]], axis=0) > 2.0)
    before[:, shoulder] += turn
    np.testing.assert_allclose(before, after, atol=1e-9)


def test_only_fingers_may_be_near_and_only_to_the_part_they_hold(spot):
    twin = furniture.door("left")
    check = ClearanceCheck(twin, twin.parts[0], spot[0], Task(0.0, 1.0), (), FAST)
    world = check._world
    finger, part = int(np.flatnonzero(world.finger)[0]), int(np.flatnonzero(world.geom_part == 2)[0])
    static = int(np.flatnonzero((world.geom_part == 0) & (world.owner != ROBOT))[0])
    arm = int(np.flatnonzero((world.owner == ROBOT) & ~world.finger)[0])
    for a, b, allowed in (
        (finger, part, True),
        (finger, static, False),
        (arm, part, False),
        (part, static, False),
    ):
        assert check._allowed(a, b) == check._allowed(b, a) == allowed


def test_a_jaw_that_would_meet_something_half_way_is_seen(spot):
    """A peg that neither the open nor the closed claw touches, where the jaw passes while it closes."""
    spec, twin = spot[0], furniture.drawer()
    plan = robots.plan(twin, 2, "spot", config=replace(FAST, rehearse=False))
    part, moving = twin.parts[0], np.flatnonzero([p == "move" for p in plan.phases])
    q = np.stack([plan.q[0], *plan.q[np.linspace(moving[0], moving[-1], 8).astype(int)], plan.q[-1]])
    base = Base(plan.T_world_base, 0.0, 0, q, 0.0, 0.0, 1.0, 1.0, 1.0)
    grasps = make_grasps(find_holds(part.mesh, part.contact, spec)[0], part.joint, spec)

    def reason(twin):
        return ClearanceCheck(twin, part, spec, Task(0.0, plan.goal), grasps, FAST).checked(base).reason

    def free(crowded, opening):
        check = ClearanceCheck(crowded, part, spec, Task(0.0, plan.goal), grasps, FAST)
        check._world.move_base(plan.T_world_base)
        return check._nearest(q[1], 0.0, opening)[0] > 0

    def with_peg(at):
        peg = furniture.box(at, [0.004, 0.004, 0.004])
        return replace(twin, static=StaticPart("s", twin.static.mesh, (*twin.static.collision, peg)))

    assert reason(twin) is None
    around = np.random.default_rng(0).uniform([-0.01, 0.02, -0.06], [0.01, 0.10, 0.02], (200, 3))
    pegs = (with_peg(p) for p in geo.transform(plan.T_world_tool[moving[0]], around))
    met_half_way = next(t for t in pegs if free(t, 0.014) and free(t, spec.stroke) and reason(t))
    assert "upper_jaw" in reason(met_half_way).numbers["bodies"]
