"""Robots and catches: what a catch asks for is in the plan, the scene holds the part with it, and what is too
strong is told."""

from __future__ import annotations

from dataclasses import replace

import mujoco
import numpy as np
import pytest

import robots
from benchmarks.scenes import furniture
from robots.config import PlanConfig
from robots.model.catalog import resolve
from robots.model.dynamics import part_load
from robots.planning.joint_path import moves_alone
from robots.scene.world import build_world, completed
from robots.trials.perturbation import perturbed
from tests.makers.robots.drawn import nominal
from tests.makers.robots.replays import check_opened
from twin.errors import PlanningError
from twin.physics.catches import lever_of, set_catch
from twin.quantities import Catch, Quantity
from twin.scene import Twin

FAST = PlanConfig(candidates=150, finalists=2)
DOOR, DRAWER = (7.2, 0.05), (25.0, 0.01)  # N m and rad, N and m


def caught(twin: Twin, force: float, width: float) -> Twin:
    """The twin, complete, with a catch on its part."""
    twin = completed(twin)
    numbers = (Quantity(v, "user: given", (v, v)) for v in (force, width))
    return set_catch(twin, 2, Catch(*numbers)).twin


@pytest.mark.parametrize(("make", "catch"), [(furniture.door, DOOR), (furniture.drawer, DRAWER)])
def test_what_a_catch_holds_is_opened(make, catch):
    twin = caught(make(), *catch)
    check_opened(robots.replay(twin, robots.plan(twin, 2, config=FAST), video=False))


def test_what_a_catch_holds_is_closed():
    twin = caught(furniture.door(), *DOOR)
    report = robots.replay(twin, robots.plan(twin, 2, goal="close", config=FAST), video=False)
    assert report.ok, report.reason
    assert report.state_final == pytest.approx(0.0, abs=1e-3), "the catch pulls it shut"


def test_a_hand_that_is_too_weak_leaves_it_shut_and_says_so():
    bare = completed(furniture.drawer())
    trajectory = robots.plan(bare, 2, config=replace(FAST, rehearse=False))
    report = robots.replay(caught(bare, 500.0, 0.01), trajectory, video=False)
    assert not report.ok
    assert report.opening_peak < 0.02
    with pytest.raises(PlanningError, match="is too weak at state"):
        robots.plan(caught(bare, 2000.0, 0.01), 2, config=replace(FAST, rehearse=False))


def test_its_force_is_asked_for_within_its_width_alone():
    part = caught(furniture.door(), *DOOR).parts[0]
    bare = completed(furniture.door()).parts[0]
    states = np.array([0.0, 0.02, 0.049, 0.051, 0.5])
    for direction in (1.0, -1.0):
        more = part_load(part).still(states, direction) - part_load(bare).still(states, direction)
        assert more == pytest.approx([7.2, 7.2, 7.2, 0.0, 0.0])
    assert part_load(part).still(states, 0.0) == pytest.approx(part_load(bare).still(states, 0.0))


def test_it_shuts_a_part_that_is_let_go_within_its_width():
    part = caught(furniture.door(), *DOOR).parts[0]
    assert moves_alone(part, 0.03)
    assert not moves_alone(part, 0.0), "there it holds"
    assert not moves_alone(part, 0.5)


def test_a_part_whose_contact_is_off_is_caught_where_it_was():
    """A trial shifts the part's shapes by the error of the contact, not the magnet that holds it."""
    twin = caught(furniture.door(), *DOOR)
    part, spec = twin.parts[0], resolve("franka")
    lever = lever_of(part)
    assert lever is not None
    world = build_world(twin, spec, np.eye(4), 0.0)
    shifted = perturbed(world, part, replace(nominal(part), contact=np.array([0.01, 0.02, -0.01])))
    for scene in (world, shifted):
        data = mujoco.MjData(scene.model)
        mujoco.mj_forward(scene.model, data)
        names = [{scene.model.geom(g).name for g in pair} for pair in data.contact.geom]
        magnets = [k for k, pair in enumerate(names) if pair == {"door_catch", "door_catch_plate"}]
        assert len(magnets) == 1
        assert data.contact.dist[magnets[0]] == pytest.approx(0.0, abs=1e-9)
        assert data.contact.adhesion[magnets[0]] == pytest.approx(7.2 / lever, rel=0.01)
