"""Armature, damping and dry friction of a joint follow from what the part weighs, from a 1-gram lid to a
200-kg door."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest

import robots
from benchmarks.scenes import furniture
from benchmarks.scenes.boards import Board, boards_inertial, boards_mesh, cabinet_twin, opening_motion
from robots import resolve
from robots.scene.world import build_world, completed
from twin import geometry as geo
from twin.exporters import export
from twin.exporters.tree import build_tree
from twin.physics import read_materials, with_physics
from twin.physics.edit import given, set_physics
from twin.physics.joints import armature, inertia_about, resistance
from twin.physics.simulation import GRAVITY
from twin.quantities import Inertial, Quantity
from twin.scene import ContactPath, Part, Prismatic, Revolute, StaticPart, Twin
from twin.verification.behaviour import behave
from twin.verification.expected import armatures


def random_body(rng: np.random.Generator) -> Inertial:
    """A box of 1 g to 200 kg, 2 cm to 2 m wide, somewhere and turned anyhow."""
    size = np.exp(rng.uniform(np.log(0.02), np.log(2.0), 3))
    mass = float(np.exp(rng.uniform(np.log(1e-3), np.log(200.0))))
    turn = geo.exp_so3(rng.normal(size=3))
    tensor = turn @ np.diag(mass / 12 * (np.sum(size**2) - size**2)) @ turn.T
    quantity = Quantity(mass, "geometry: chosen", (0.7 * mass, 1.4 * mass))
    return Inertial(quantity, rng.normal(size=3), (tensor + tensor.T) / 2)


def mujoco_inertia(body: Inertial, joint: Prismatic | Revolute) -> float:
    """The same from MuJoCo's own dynamics."""
    spec = mujoco.MjSpec()
    moved = spec.worldbody.add_body(explicitinertial=True, mass=body.mass.value, ipos=body.com)
    t = body.inertia
    moved.fullinertia = [t[0, 0], t[1, 1], t[2, 2], t[0, 1], t[0, 2], t[1, 2]]
    turning = isinstance(joint, Revolute)
    kind = mujoco.mjtJoint.mjJNT_HINGE if turning else mujoco.mjtJoint.mjJNT_SLIDE
    moved.add_joint(type=kind, axis=joint.axis, pos=joint.pivot if turning else [0, 0, 0])
    return float(spec.compile().dof_M0[0])


@pytest.mark.parametrize("seed", range(40))
def test_armature_is_at_most_a_hundredth_and_damping_and_friction_grow_with_the_part(seed: int) -> None:
    rng = np.random.default_rng(seed)
    body, axis = random_body(rng), geo.unit(rng.normal(size=3))
    joint = Revolute(axis, 0.0, 1.0, pivot=rng.normal(size=3)) if seed % 2 else Prismatic(axis, 0.0, 1.0)
    own = mujoco_inertia(body, joint)
    assert inertia_about(joint, body) == pytest.approx(own, rel=1e-6)
    assert 0 < armature(joint, body) <= 0.01 * own * (1 + 1e-6)
    law = read_materials().joints[joint.kind]
    got = resistance(joint, body, law)
    assert own / got["damping"].value == pytest.approx(law.decay.value, rel=1e-6), "the stated decay time"
    weight = body.mass.value * GRAVITY
    lever = np.sqrt(own / body.mass.value) if seed % 2 else 1.0
    assert got["frictionloss"].value == pytest.approx(law.friction.value * weight * lever, rel=1e-6)
    for q in got.values():
        assert q.origin == "default"
        assert q.interval[0] <= q.value <= q.interval[1]
    heavier = body.with_mass(replace(body.mass, value=1.4 * body.mass.value))
    assert resistance(joint, heavier, law)["damping"].value <= got["damping"].interval[1]


def bare(twin: Twin) -> Twin:
    return replace(twin, parts=tuple(replace(p, inertial=None, physics=None) for p in twin.parts))


def test_exports_and_replays_take_joints_from_one_table_and_stated_numbers_stay() -> None:
    ready = completed(bare(furniture.door()))
    (part,) = ready.parts
    assert part.inertial is not None
    law = read_materials().joints["revolute"]
    assert vars(part.physics).items() >= resistance(part.joint, part.inertial, law).items()
    (link,) = build_tree(ready).moving
    world = build_world(ready, resolve("franka"), np.eye(4), 0.0)
    dof = world.part_dof[part.id]
    replayed = [float(x[dof]) for x in (world.model.dof_damping, world.model.dof_frictionloss, world.model.dof_armature)]  # fmt: skip
    assert replayed == pytest.approx([link.joint.damping, link.joint.frictionloss, link.joint.armature])
    assert link.joint.armature == pytest.approx(armatures(ready)[0])
    assert (
        float(world.model.geom_friction[world.model.geom("cabinet_collision_0").id, 0])
        == build_tree(ready).root.friction
    )
    stated = cabinet_twin()
    assert with_physics(stated).part("door").physics == stated.part("door").physics


def board_twin(width: float, height: float, mass: float, lid: bool) -> Twin:
    """One board of that mass on a hinge along its edge: a lid that opens upwards, or a door."""
    thick = 0.002 if lid else 0.018
    size = (width, width, thick) if lid else (width, thick, height)
    board = Board((0.0, 0.0, 0.0), size)
    inertial = boards_inertial([board], np.eye(4), mass / float(np.prod(board.size)))
    axis = [0.0, -1.0, 0.0] if lid else [0.0, 0.0, -1.0]
    joint = Revolute(np.array(axis), 0.0, 1.2, pivot=np.zeros(3))
    contact = ContactPath(np.array([0.9 * width, 0.0, 0.0]), np.eye(3), 0.01, (1, 2), "closed form")
    part = Part(2, "part", boards_mesh([board]), joint, opening_motion(1.2), inertial, contact=contact, collision=(board.box(np.eye(4)),))  # fmt: skip
    ground = Board((-1.0, 1.0, -1.1), (1.0, 2.0, -1.0))
    return with_physics(
        Twin("board", StaticPart("ground", boards_mesh([ground]), (ground.box(np.eye(4)),)), (part,))
    )


@pytest.mark.parametrize(
    ("width", "height", "mass", "lid"),
    [
        (0.03, 0.03, 0.005, True),
        (0.03, 0.03, 0.001, False),
        (0.6, 2.2, 16.6, False),
        (0.9, 2.1, 40.0, False),
        (1.2, 2.4, 200.0, False),
    ],
)
def test_a_lid_of_3_cm_and_a_wardrobe_door_behave_when_exported(
    width: float, height: float, mass: float, lid: bool, tmp_path: Path
) -> None:
    twin = board_twin(width, height, mass, lid)
    (part,) = twin.parts
    ratio = armatures(twin)[0] / mujoco_inertia(part.inertial, part.joint)
    assert ratio <= 0.01 * (1 + 1e-6), "was 3,000 for the lid"
    report = behave(twin, export(twin, tmp_path, formats=("mjcf",)))
    assert report.warnings == ()
    too_heavy = {"demonstration_m"} if mass > 100 else set()  # one hand does not swing 200 kg open in 3 s
    assert {r.quantity for r in report.failures} <= too_heavy, report.failures


@pytest.mark.parametrize(("make", "mass"), [(furniture.lid, 0.005), (furniture.door, 40.0)])
def test_a_robot_opens_a_lid_of_5_grams_and_a_door_of_40_kg(make: Callable[[], Twin], mass: float) -> None:
    twin = set_physics(make(), 2, {"mass": given("mass", mass)}).twin
    plan = robots.plan(twin, 2, config=robots.PlanConfig(candidates=150, finalists=2))
    report = robots.replay(twin, plan, video=False)
    assert report.ok, report.reason
