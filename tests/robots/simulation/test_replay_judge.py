"""The benchmark's judge of limits finds what is planted, and finds nothing where nothing is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import robots
from benchmarks.scenes import furniture
from robots.config import PlanConfig, ReplayConfig
from robots.scene.world import build_world
from robots.simulation.replay import simulate
from twin.scene import StaticPart

pytest.importorskip("pinocchio")
from benchmarks.replay_judge import Judge

FAST = PlanConfig(candidates=150, finalists=2, rehearse=False)


@pytest.fixture(scope="module", params=["franka", "spot"])
def planned(request):
    twin = furniture.drawer()
    return twin, robots.plan(twin, 2, request.param, config=FAST)


def judged(twin, trajectory, control="position", **limits):
    spec = replace(robots.resolve(trajectory.robot), **limits)
    world = build_world(twin, spec, trajectory.T_world_base, trajectory.pedestal)
    judge = Judge(world, trajectory.T_world_base, spec)
    record, _ = simulate(world, trajectory, ReplayConfig(control=control), judge)
    return judge.found, record


@pytest.mark.parametrize("control", ["position", "impedance"])
def test_pinocchio_needs_the_torques_that_mujoco_gave(planned, control):
    """Contact forces, inertia, rotors and damping: all of them are in both, or the difference shows."""
    twin, trajectory = planned
    found, record = judged(twin, trajectory, control)
    assert found.broken == []
    effort = robots.resolve(trajectory.robot).effort
    assert found.torque == pytest.approx((np.abs(record.torque) / effort).max(), abs=0.02)
    assert found.disagreement < 0.05
    assert found.torque > 0.05


def test_a_limit_that_is_not_kept_is_named(planned):
    twin, trajectory = planned
    spec = robots.resolve(trajectory.robot)
    found, _ = judged(twin, trajectory, velocity=0.01 * spec.velocity)
    assert any(text.startswith("velocity") for text in found.broken)
    found, _ = judged(twin, trajectory, effort=0.03 * spec.effort)
    assert any(text.startswith("torque") for text in found.broken)


def test_an_arm_inside_the_scene_is_seen(planned):
    """A wall through the hand as it starts."""
    twin, trajectory = planned
    hand = trajectory.T_world_tool[0]
    wall = furniture.box(hand[:3, 3] - 0.10 * hand[:3, 2], [0.3, 0.03, 0.3])
    static = StaticPart("cabinet", twin.static.mesh, (*twin.static.collision, wall))
    found, _ = judged(replace(twin, static=static), trajectory)
    assert any("static scene" in text for text in found.broken)
