"""Parts that other parts carry, and what a part resists with, judged by MuJoCo's mass matrix and bias
forces."""

from __future__ import annotations

from dataclasses import replace

import mujoco
import numpy as np
import pytest

import robots
from benchmarks.scenes import furniture
from robots.config import PlanConfig
from robots.model.catalog import resolve
from robots.model.dynamics import part_load, with_payload
from robots.planning.joint_path import moves_alone
from robots.scene.as_handled import as_handled
from robots.scene.world import build_world, completed
from robots.simulation.replay import simulate
from twin import geometry as geo
from twin.physics import physics_of, with_physics
from twin.scene import Prismatic, Twin

FAST = PlanConfig(candidates=150, finalists=2)


def tilted(twin: Twin) -> Twin:
    """The same twin, its hinge leaning, so that weight works on it."""
    (part, *others) = twin.parts
    axis = geo.unit(part.joint.axis + np.array([0.2, -0.3, 0.0]))
    return replace(twin, parts=(replace(part, joint=replace(part.joint, axis=axis)), *others))


def stacked() -> Twin:
    """Three deep: a lid is carried by the pull-out of a door that leans."""
    twin = tilted(furniture.laden_door(5.0))
    lid = replace(furniture.lid(0.7).parts[0], id=4, name="lid", parent=3, contact=None)
    return replace(twin, parts=(*twin.parts, lid))


TWINS = {
    "drawer": furniture.drawer,
    "door": furniture.door,
    "lid": furniture.lid,
    "slider": furniture.sliding_door,
    "leaning door": lambda: tilted(furniture.door()),
    "laden door": lambda: tilted(furniture.laden_door()),
    "three deep": stacked,
}


@pytest.mark.parametrize("case", TWINS)
def test_the_load_is_what_the_scene_resists_with(case):
    """Inertia: the mass matrix' diagonal. Weight: the bias force, at rest, with all other parts at state
    0."""
    twin = TWINS[case]()
    world = build_world(twin, resolve("franka"), np.eye(4), 0.0)
    model, data = world.model, mujoco.MjData(world.model)
    full = np.zeros((model.nv, model.nv))
    for part in twin.parts:
        load, dof = part_load(with_payload(twin, part)), world.part_dof[part.id]
        states = np.linspace(0.0, part.joint.upper, 4)
        still = load.still(states, 1.0) - physics_of(part).frictionloss.value
        for state, force in zip(states, still, strict=True):
            data.qpos[:] = model.qpos0
            data.qpos[world.part_qpos[part.id]] = state
            mujoco.mj_forward(model, data)
            mujoco.mj_fullM(model, data, full)
            assert load.inertia == pytest.approx(full[dof, dof] - model.dof_armature[dof], rel=1e-9)
            assert force == pytest.approx(data.qfrc_bias[dof], abs=1e-9)


def test_a_payload_counts_for_what_carries_it_and_not_the_other_way_round():
    twin = furniture.laden_door(8.0)
    door, tray = twin.parts
    alone = replace(twin, parts=(door,))
    assert with_payload(twin, tray) is tray
    assert with_payload(alone, door) is door
    laden = with_payload(twin, door)
    assert laden.inertial.mass.value == pytest.approx(8.0 + door.inertial.mass.value, rel=1e-9)
    assert part_load(laden).inertia > 4 * part_load(door).inertia
    still = replace(twin, parts=(door, replace(tray, parent=None)))
    assert with_payload(still, door) is door


def test_a_load_on_a_door_makes_it_slower():
    config = replace(FAST, rehearse=False, torque_share=0.6, tool_speed=1.5)
    seconds = []
    for mass in (1.0, 200.0):
        trajectory = robots.plan(furniture.laden_door(mass), "door", config=config)
        seconds.append(np.ptp(trajectory.times[[p == "move" for p in trajectory.phases]]))
    assert seconds[1] > 1.3 * seconds[0]


def test_a_part_moves_alone_by_the_weight_of_its_payload():
    """A light slider on a slope stays by friction; laden, it does not, and the hand must not let go."""
    twin = furniture.laden_door(8.0)
    tray = twin.part("pull_out")
    uphill = Prismatic(geo.unit(np.array([0, -1.0, 0.03])), 0.0, 0.3)
    light = replace(tray, id=2, name="light", parent=None, joint=uphill, inertial=None, physics=None)
    both = with_physics(replace(twin, parts=(light, replace(tray, id=3, parent=2))))
    light = both.part("light")
    assert not moves_alone(light, 0.3)
    assert moves_alone(with_payload(both, light), 0.3)


@pytest.mark.parametrize("goal", ["open", "close"])
@pytest.mark.parametrize("part", ["door", "pull_out"])
def test_a_nested_part_is_opened_and_closed_while_the_other_rests(part, goal):
    twin = furniture.laden_door(8.0)
    trajectory = robots.plan(twin, part, goal=goal, config=FAST)
    for control, most in (
        ("position", 0.02),
        ("impedance", 0.03),
    ):  # a hand that gives way pulls a little aside
        config = robots.ReplayConfig(control=control)
        report = robots.replay(twin, trajectory, video=False, config=config)
        assert report.ok, report.reason
        world = build_world(completed(twin), resolve("franka"), trajectory.T_world_base, trajectory.pedestal)
        _, frames = simulate(world, trajectory, config)
        (other,) = (p for p in twin.parts if p.name != part)
        strayed = np.abs(frames[:, world.part_qpos[other.id]]).max()
        assert strayed < most, "nothing holds the other part but its friction: rad or m"


def test_a_basket_is_moved_in_the_drawer_that_stands_open_as_when_it_was_handled():
    """A slide in a drawer, moved to the side while the drawer stands open: shut, the cabinet is around it."""
    twin = furniture.drawer()
    drawer = twin.parts[0]
    states = np.array([0.0, 0.3, 0.3, 0.3, 0.3])
    pulled = replace(
        drawer.motion, frames=np.arange(5), times=np.arange(5) / 10.0, state=states, intervals=((0, 1),)
    )
    tray = furniture.laden_door(1.0).part("pull_out")
    handled = replace(tray.motion, intervals=((2, 4),))
    basket = replace(tray, id=9, name="basket", parent=drawer.id, motion=handled)
    both = replace(twin, parts=(replace(drawer, motion=pulled), basket))
    stood, _ = as_handled(both, "basket")
    open_by = drawer.joint.axis * 0.3
    np.testing.assert_allclose(stood.part("basket").mesh.vertices, basket.mesh.vertices + open_by, atol=1e-12)
    np.testing.assert_allclose(
        stood.part(drawer.id).mesh.vertices, drawer.mesh.vertices + open_by, atol=1e-12
    )
    assert stood.part(drawer.id).joint.lower == pytest.approx(drawer.joint.lower - 0.3)
    assert as_handled(stood, "basket")[0] is stood
    assert as_handled(both, drawer.id)[0] is both
    stated = replace(both, parts=(both.parts[0], replace(basket, motion=replace(handled, intervals=()))))
    assert as_handled(stated, "basket")[0] is stated
    with_basket = robots.plan(both, "basket", config=replace(FAST, rehearse=False))
    held = with_basket.T_world_tool[with_basket.phases.index("move"), :3, 3]
    assert held == pytest.approx(basket.contact.point + open_by, abs=0.03)
    report = robots.replay(both, with_basket, video=False)
    assert report.ok, report.reason
