"""The reference obeys the laws of mechanics, and a comparison tells what agrees, what does not, and what is
known."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from benchmarks.scenes.boards import cabinet_twin
from benchmarks.scenes.random_twins import NAMES, random_twin
from twin import geometry as geo
from twin.geometry import Array
from twin.scene import Quantity, Revolute, Twin
from twin.verification.compare import FIELDS, Truth, compare, tolerance
from twin.verification.exceptions import TABLE, expected_to_say, unsupported
from twin.verification.expected import GRAVITY, TIMES, Dynamics, armatures, filled
from twin.verification.rows import CheckReport
from twin.verification.tables import notes, summary


def potential(twin: Twin, q: Array) -> float:
    """Energy of the weights, from the poses of the scene alone."""
    states = {p.id: float(s) for p, s in zip(twin.parts, q, strict=True)}
    return -sum(
        i.mass.value * GRAVITY @ geo.transform(twin.part_pose(p.id, states), i.com[None])[0]
        for p, (i, _) in zip(twin.parts, filled(twin), strict=True)
    )


def kinetic(twin: Twin, q: Array, v: Array) -> float:
    """Energy of the motion, from the poses of the scene a moment before and after."""
    h, total = 1e-5, 0.0
    for part, (inertial, _) in zip(twin.parts, filled(twin), strict=True):
        a, b = (
            twin.part_pose(part.id, {p.id: float(s) for p, s in zip(twin.parts, q + t * v, strict=True)})
            for t in (-h, h)
        )
        speed = (geo.transform(b, inertial.com[None]) - geo.transform(a, inertial.com[None]))[0] / (2 * h)
        spin = geo.log_so3(b[:3, :3] @ a[:3, :3].T) / (2 * h)
        now = twin.part_pose(part.id, {p.id: float(s) for p, s in zip(twin.parts, q, strict=True)})[:3, :3]
        total += 0.5 * inertial.mass.value * speed @ speed
        total += 0.5 * spin @ (now @ inertial.inertia @ now.T) @ spin
    return float(total)


@pytest.mark.parametrize("seed", range(5))
def test_the_mass_matrix_is_that_of_the_moving_bodies(seed: int) -> None:
    twin = random_twin(seed, count=5)
    rng = np.random.default_rng(seed)
    d, q, v = Dynamics(twin, np.zeros(5), np.zeros(5)), rng.normal(size=5), rng.normal(size=5)
    assert 0.5 * v @ d.mass_matrix(q) @ v == pytest.approx(kinetic(twin, q, v), rel=1e-7)
    np.testing.assert_allclose(d.mass_matrix(q), d.mass_matrix(q).T, rtol=1e-9, atol=1e-12)
    heavier = Dynamics(twin, np.full(5, 0.3), np.zeros(5)).mass_matrix(q)
    np.testing.assert_allclose(heavier - d.mass_matrix(q), 0.3 * np.eye(5), atol=1e-9)


@pytest.mark.parametrize("seed", range(5))
def test_the_motion_obeys_lagrange(seed: int) -> None:
    """d/dt dT/dq' - dT/dq + dV/dq + damping q' = 0, with T and V differentiated by steps."""
    twin, n, h = random_twin(seed, count=4), 4, 1e-5
    rng = np.random.default_rng(seed)
    q, v, damping = rng.normal(size=n), rng.normal(size=n), rng.uniform(0.1, 5, n)
    d = Dynamics(twin, np.array([0.0, 0.1, 0.0, 2.0]), damping)
    a = d.acceleration(q, v)
    steps = h * np.eye(n)
    slope = np.array([(d.mass_matrix(q + s) - d.mass_matrix(q - s)) / (2 * h) for s in steps])  # dM/dq_k
    fall = np.array([(potential(twin, q + s) - potential(twin, q - s)) / (2 * h) for s in steps])
    terms = [
        d.mass_matrix(q) @ a,
        np.einsum("kij,j,k->i", slope, v, v),
        -0.5 * np.einsum("kij,i,j->k", slope, v, v),
    ]
    terms += [fall, damping * v]
    np.testing.assert_allclose(np.sum(terms, axis=0) / np.abs(terms).sum(axis=0), 0.0, atol=1e-6)


def test_a_drawer_that_slides_freely_slows_down_by_the_exponential() -> None:
    """m x'' = -d x' has the course x0 + v m / d (1 - exp(-d t / m))."""
    twin = cabinet_twin()
    drawer = replace(twin, parts=(twin.part("drawer"),))
    (inertial, _), damping = filled(drawer)[0], 8.0
    mass, t = inertial.mass.value + armatures(drawer)[0], np.array(TIMES)
    d = Dynamics(drawer, armatures(drawer), np.array([damping]))
    got = d.rollout(np.array([0.15]), np.array([0.4]))[:, 0]
    np.testing.assert_allclose(
        got, 0.15 + 0.4 * mass / damping * (1 - np.exp(-damping * t / mass)), atol=1e-9
    )


def test_a_lid_swings_like_a_pendulum() -> None:
    """I a'' = m g times the lever arm, to second order in time at the start."""
    twin = cabinet_twin(lid=True)
    lid = replace(twin, parts=(twin.part("lid"),))
    (inertial, _), joint = filled(lid)[0], lid.parts[0].joint
    assert isinstance(joint, Revolute)
    arm = inertial.com - joint.pivot
    moment = float(joint.axis @ np.cross(arm, inertial.mass.value * GRAVITY))
    own = float(joint.axis @ inertial.inertia @ joint.axis)
    own += inertial.mass.value * float(arm @ arm - (arm @ joint.axis) ** 2)
    a = Dynamics(lid, np.zeros(1), np.zeros(1)).acceleration(np.zeros(1), np.zeros(1))
    assert a[0] == pytest.approx(moment / own, rel=1e-12)


def test_random_twins_hold_everything_that_is_hard() -> None:
    twins = [random_twin(seed) for seed in range(200)]
    parts = [p for t in twins for p in t.parts]
    assert {len(t.parts) for t in twins} == {1, 2, 3, 4, 5, 6}
    assert any(t.part(p.parent).parent is not None for t in twins for p in t.parts if p.parent is not None)
    assert any(np.allclose(p.joint.axis, -np.eye(3)[k]) for p in parts for k in range(3))
    masses = [p.inertial.mass.value for p in parts if p.inertial]
    assert min(masses) < 3e-3
    assert max(masses) > 1e3
    assert any(p.joint.lower < -0.3 for p in parts)
    assert any(p.joint.lower == 0 for p in parts)
    assert any(not n.isascii() for n in NAMES)
    names = {p.name for p in parts}
    assert {"door", "door_2", "part_world", "part_2nd_shelf", "Tur", "x_joint"} <= names
    assert {p.joint.kind for p in parts} == {"revolute", "prismatic"}
    assert random_twin(7).parts[0].name == random_twin(7).parts[0].name


def ideal(truth: Truth, armature: Any = None, friction: float | None = None) -> dict[str, dict[str, Any]]:
    """What an engine would measure that reads everything."""
    twin = truth.twin
    added = armatures(twin) if armature is None else armature
    diagonal, rollout = truth.dynamics(added, np.array([x.damping.value for _, x in filled(twin)]))
    out: dict[str, dict[str, Any]] = {}
    for k, (p, (inertial, physics)) in enumerate(zip(twin.parts, filled(twin), strict=True)):
        v = p.mesh.vertices
        out[p.name] = {
            "parent": "" if p.parent is None else twin.part(p.parent).name, "type": p.joint.kind, "axis": p.joint.axis,
            "pivot": p.joint.pivot if isinstance(p.joint, Revolute) else None, "lower": p.joint.lower, "upper": p.joint.upper,
            "damping": physics.damping.value, "frictionloss": physics.frictionloss.value, "armature": added[k],
            "friction": [physics.friction.value if friction is None else friction] * 2, "mass": inertial.mass.value,
            "com": inertial.com, "inertia": inertial.inertia, "bounds": [v.min(0), v.max(0)], "motion": truth.motion[k],
            "mass_diagonal": diagonal[k], "rollout": rollout[:, k], "collision": 0.0,
        }  # fmt: skip
    return out


def test_what_is_in_the_table_is_known_and_an_engine_that_has_learnt_it_is_reported() -> None:
    twin = cabinet_twin(nested=True)
    truth = Truth(twin)
    as_known = compare("mujoco", "urdf", truth, ideal(truth, np.zeros(3), friction=1.0))
    assert {r.status for r in as_known if r.field in ("armature", "friction")} == {"known"}
    assert all(r.ok for r in as_known)
    learnt = CheckReport(tuple(compare("mujoco", "urdf", truth, ideal(truth))), ())
    assert {r.field for r in learnt.unexpected} == {"armature", "friction"}
    assert learnt.ok, "an unexpected pass is not a failure"
    assert any("mujoco now takes friction from urdf" in n for n in notes(learnt))
    assert "unexpected" not in summary(CheckReport(tuple(as_known), ()))
    assert {r["status"] for r in learnt.to_dict()["rows"]} == {"ok", "unexpected pass"}


def test_agreement_by_chance_is_no_unexpected_pass() -> None:
    """A twin whose friction is what the engine uses instead can't tell whether the engine reads it."""
    twin = cabinet_twin()
    one = Quantity(1.0, "chosen", (0.5, 1.5))
    parts = tuple(
        replace(p, physics=replace(filled(twin)[k][1], friction=one)) for k, p in enumerate(twin.parts)
    )
    truth = Truth(replace(twin, parts=parts))
    rows = compare("mujoco", "urdf", truth, ideal(truth, np.zeros(2)))
    assert {r.status for r in rows if r.field == "friction"} == {"known"}


@pytest.mark.parametrize("field", [f for f in FIELDS if f != "loads"])
def test_a_field_that_an_engine_no_longer_tells_fails(field: str) -> None:
    asked = {
        "tree": "parent",
        "axis_deg": "axis",
        "pivot_m": "pivot",
        "com_m": "com",
        "mesh_bounds_m": "bounds",
    }
    fmt = "urdf" if field == "self_collision_m" else "mjcf"
    asked["self_collision_m"] = "collision"
    truth = Truth(cabinet_twin())
    got = ideal(truth, np.zeros(2) if fmt == "urdf" else None)
    assert all(r.ok for r in compare("mujoco", fmt, truth, got))
    del got["door"][asked.get(field, field)]
    (row,) = [r for r in compare("mujoco", fmt, truth, got) if not r.ok]
    assert (row.part, row.field, row.measured) == ("door", field, "nothing")
    assert CheckReport((row,), ()).to_dict()["rows"][0]["difference"] is None


def test_the_table_names_what_it_says_once() -> None:
    keys = [(e.engine, e.format, e.field) for e in TABLE]
    assert len(set(keys)) == len(keys)
    assert all(e.reason for e in TABLE)
    assert unsupported("drake", "urdf", "friction") is not None
    assert unsupported("drake", "mjcf", "friction") is None
    assert expected_to_say("drake", "mjcf", "The tag 'site' found as a child of 'body'")
    assert not expected_to_say("drake", "urdf", "The tag 'site' found as a child of 'body'")
    assert tolerance("newton", "mass") == 10 * tolerance("mujoco", "mass")
    assert tolerance("newton", "tree") == 0.0
