"""The compliant hand: a spring at the tool, capped, that gives way where stiff joints would not."""

from __future__ import annotations

from dataclasses import replace

import mujoco
import numpy as np
import pytest

import robots
from benchmarks.scenes import furniture
from robots.config import PlanConfig, ReplayConfig
from robots.model.kinematics import read_chain
from robots.model.mjcf import compiled
from robots.scene.world import build_world
from robots.simulation.impedance import FORCE_CAP, ROTATION, TRANSLATION, Impedance
from robots.simulation.replay import simulate
from robots.simulation.report import measure
from robots.trials.perturbation import draw, perturbed, spread_of
from robots.trials.report import LADDER
from tests.makers.robots.replays import check_open_hand_gets_no_hold, check_opened
from twin import geometry as geo
from twin.errors import ConfigError

FAST = PlanConfig(candidates=150, finalists=2)
SOFT = ReplayConfig(control="impedance")


@pytest.fixture(scope="module", params=["franka", "spot"])
def planned(request):
    twin = furniture.door()
    return twin, robots.plan(twin, 2, request.param, config=FAST), robots.resolve(request.param)


def at_rest(twin, trajectory, spec):
    """The scene at the first sample, and the controller."""
    world = build_world(twin, spec, trajectory.T_world_base, trajectory.pedestal)
    chain = read_chain(compiled(spec), spec)
    controller = Impedance(world, trajectory, chain, np.zeros(1))
    data = mujoco.MjData(world.model)
    data.qpos[world.arm_qpos] = trajectory.q[0]
    return world, controller, data


def wrench_at_tool(world, data):
    """The tool wrench (6,) in tool axes that the motors' torques stand for, by the arm's Jacobian."""
    mujoco.mj_forward(world.model, data)
    jacobian = np.zeros((6, world.model.nv))
    mujoco.mj_jacSite(world.model, data, jacobian[:3], jacobian[3:], world.tool)
    first = len(world.spec.base_joints)
    turn = data.site_xmat[world.tool].reshape(3, 3)
    j = np.concatenate([turn.T @ jacobian[:3], turn.T @ jacobian[3:]])[:, world.arm_dof[first:]]
    wrench, *_ = np.linalg.lstsq(j.T, data.ctrl[world.arm_ctrl[first:]], rcond=None)
    return wrench


def test_the_door_opens_softly_and_the_grip_does_it(planned):
    twin, trajectory, spec = planned
    check_opened(robots.replay(twin, trajectory, video=False, config=SOFT))
    if spec.name == "franka":
        check_open_hand_gets_no_hold(twin, trajectory, spec.stroke)


def test_on_its_way_the_hand_feels_nothing(planned):
    world, controller, data = at_rest(*planned)
    mujoco.mj_forward(world.model, data)
    controller.command(data, 0)
    assert np.abs(wrench_at_tool(world, data)).max() < 1e-6


@pytest.mark.parametrize("axis", range(6))
def test_a_small_displacement_meets_a_spring_of_the_preset(planned, axis):
    twin, trajectory, spec = planned
    world, _, data = at_rest(twin, trajectory, spec)
    shift = np.zeros(6)
    shift[axis] = 0.004
    moved = geo.make_pose(geo.exp_so3(shift[3:]), shift[:3])  # of what is wanted, in tool axes
    still = replace(trajectory, effort=np.zeros_like(trajectory.effort))
    mujoco.mj_forward(world.model, data)
    controller = Impedance(world, still, read_chain(compiled(spec), spec), np.zeros(1))
    tool = geo.make_pose(data.site_xmat[world.tool].reshape(3, 3), data.site_xpos[world.tool]) @ moved
    controller._position[0], controller._turn[0] = tool[:3, 3], geo.quat_wxyz_from_matrix(tool[:3, :3])
    controller.command(data, 0)
    expected = shift * np.repeat([TRANSLATION, ROTATION], 3)
    assert np.abs(wrench_at_tool(world, data) - expected).max() < 1e-3 * np.abs(expected).max() + 1e-6


def test_a_bent_elbow_is_drawn_back_without_the_tool_feeling_it():
    twin, spec = furniture.door(), robots.resolve("franka")
    trajectory = robots.plan(twin, 2, config=replace(FAST, rehearse=False))
    world, controller, data = at_rest(twin, trajectory, spec)
    mujoco.mj_forward(world.model, data)
    jacobian = np.zeros((6, world.model.nv))
    mujoco.mj_jacSite(world.model, data, jacobian[:3], jacobian[3:], world.tool)
    bend = 1e-3 * np.linalg.svd(jacobian[:, world.arm_dof])[2][-1]  # leaves the tool where it is
    data.qpos[world.arm_qpos] += bend
    mujoco.mj_forward(world.model, data)
    controller.command(data, 0)
    torque = data.ctrl[world.arm_ctrl]
    assert torque @ bend < -0.5 * 10.0 * bend @ bend
    assert np.abs(wrench_at_tool(world, data)).max() < 0.05 * np.linalg.norm(torque)


def test_a_lids_weight_is_carried_by_what_is_fed_forward():
    twin = furniture.lid()
    trajectory = robots.plan(twin, 2, config=FAST)
    reached = [
        robots.replay(twin, t, video=False, config=SOFT).reached
        for t in (trajectory, replace(trajectory, effort=np.zeros_like(trajectory.effort)))
    ]
    assert reached[0] > 0.98
    assert reached[1] < reached[0] - 0.02


def test_far_off_its_way_the_hand_pulls_with_the_cap(planned):
    world, controller, data = at_rest(*planned)
    mujoco.mj_forward(world.model, data)
    controller._position[0] = data.site_xpos[world.tool] + [0.3, 0.2, 0.1]
    controller.command(data, 0)
    wrench = wrench_at_tool(world, data)
    assert np.linalg.norm(wrench[:3]) == pytest.approx(FORCE_CAP, rel=1e-3)
    direction = data.site_xmat[world.tool].reshape(3, 3) @ wrench[:3] / FORCE_CAP
    assert direction @ geo.unit([0.3, 0.2, 0.1]) == pytest.approx(1.0, abs=1e-3)


def test_where_the_twin_is_wrong_the_compliant_hand_presses_less(planned):
    """5 degrees, 2 cm and 1 cm off: both controls on the same real parts."""
    twin, trajectory, spec = planned
    part = twin.parts[0]
    loads = {}
    for control in ("position", "impedance"):
        world = build_world(twin, spec, trajectory.T_world_base, trajectory.pedestal)
        reports = []
        for k in range(4):
            real = draw(part, spread_of(part), LADDER[-1], 3, k)
            record, _ = simulate(perturbed(world, part, real), trajectory, ReplayConfig(control=control))
            reports.append(measure(record, trajectory, replace(part, joint=real.joint), spec, 0.0, None))
        loads[control] = np.mean([max(r.torque_share) for r in reports])
    assert loads["impedance"] < 0.9 * loads["position"]


def test_another_control_is_refused_by_name():
    with pytest.raises(ConfigError, match="'soft' must be one of 'position', 'impedance'"):
        ReplayConfig(control="soft")


def test_a_scene_is_as_it_was_after_a_replay_whatever_drove_the_arm(planned):
    """One scene replayed stiffly, at half the stiffness, softly and stiffly again: first and last are the
    same."""
    twin, trajectory, spec = planned
    world = build_world(twin, spec, trajectory.T_world_base, trajectory.pedestal)
    stiff = ReplayConfig(control="position")
    configs = (stiff, ReplayConfig(control="position", stiffness=0.5), SOFT, stiff)
    first, half, soft, last = (simulate(world, trajectory, c)[0].torque for c in configs)
    assert np.array_equal(first, last)
    assert not np.array_equal(first, half)
    assert not np.array_equal(first, soft)
