"""Torques that a motion asks of the arm: its own weight and inertia, and the part that it carries along.

The part is one degree of freedom. What moves it is taken as a force at the tool point along the tool's way,
the smallest that does the same work; grip and friction forces across it cancel in the hand.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import mujoco
import numpy as np

from robots.model.spec import RobotSpec
from twin.geometry import Array
from twin.physics import inertia_about, inertial_of, physics_of, weight_load
from twin.quantities import Catch, Inertial, Quantity
from twin.scene import Part, Twin

_SETS_IN = 0.1  # of the highest rate, at which dry friction is fully fed forward (chosen by us)


@dataclass(frozen=True, eq=False)
class Terms:
    """Joint torques (n, j) in N m along a path that takes T seconds: still + viscous / T + inertial / T^2."""

    still: Array
    viscous: Array
    inertial: Array

    def shortest(self, limit: Array) -> float:
        """The least T with every torque within +- limit (j,); infinite if `still` alone is not."""
        a = np.concatenate([self.inertial, -self.inertial]).ravel()
        b = np.concatenate([self.viscous, -self.viscous]).ravel()
        c = (np.concatenate([self.still, -self.still]) - limit).ravel()
        if np.any(c >= 0):
            return float("inf")
        # First x = 1 / T > 0 at which a x^2 + b x + c leaves the negative; this form holds for a = 0 too.
        root = np.sqrt(np.maximum(b * b - 4 * a * c, 0.0))
        crosses = (b * b - 4 * a * c >= 0) & (b + root > 0)
        rate = np.full(len(c), np.inf)
        rate[crosses] = -2 * c[crosses] / (b[crosses] + root[crosses])
        return float(1.0 / rate.min())


@dataclass(frozen=True, eq=False)
class PartLoad:
    """How a part resists: generalised force (N or N m) along its joint.

    inertia: kg or kg m^2. damping: N s/m or N m s/rad. friction: N or N m. catch: of the closed part. Source
    of the values: the part's physics and inertial properties.
    """

    part: Part
    inertia: float
    damping: float
    friction: float
    catch: Catch | None = None

    def still(self, states: Array, direction: float) -> Array:
        """Force (n,) that moves the part slowly against dry friction, weight and catch; for a direction of 0
        what its weight alone asks for."""
        slowly = np.array([direction * self.friction + weight_load(self.part, s) for s in states])
        return slowly + self.caught(states) if direction else slowly

    def caught(self, states: Array) -> Array:
        """Force (n,) with which the catch pulls the part shut while it moves."""
        return np.array([0.0 if self.catch is None else self.catch.pull(float(s)) for s in states])


def with_payload(twin: Twin, part: Part) -> Part:
    """The part with mass, centre and inertia of its payload added: the parts it carries, all at state 0.

    A part that another one carries is moved while that one rests: nothing of its parent is added.
    """
    carried, grown = {part.id}, True
    while grown:
        more = {p.id for p in twin.parts if p.parent in carried} - carried
        carried, grown = carried | more, bool(more)
    if len(carried) == 1:
        return part
    bodies = [p for p in twin.parts if p.id in carried]
    masses = np.array([inertial_of(p).mass.value for p in bodies])
    centres = np.array([inertial_of(p).com for p in bodies])
    total, centre = float(masses.sum()), masses @ centres / masses.sum()
    arms = centres - centre
    tensor = sum(inertial_of(p).inertia for p in bodies) + sum(
        m * (a @ a * np.eye(3) - np.outer(a, a)) for m, a in zip(masses, arms, strict=True)
    )
    mass = Quantity(total, "geometry: with its payload", (total, total))
    return replace(part, inertial=Inertial(mass, centre, tensor, mass.source))


def part_load(part: Part) -> PartLoad:
    """What a part's physics say about the force to move it, without its payload (see `with_payload`)."""
    resists, own = inertia_about(part.joint, inertial_of(part)), physics_of(part)
    return PartLoad(part, resists, own.damping.value, own.frictionloss.value, own.catch)


class ArmDynamics:
    """Inverse dynamics of one robot, base level and at rest (MuJoCo's recursive Newton-Euler).

    MuJoCo's `mj_rne` leaves out reflected rotor inertia and joint damping; both are added.
    """

    def __init__(self, spec: RobotSpec, model: mujoco.MjModel) -> None:
        self._model, self._data = model, mujoco.MjData(model)
        ids = [model.joint(j).id for j in spec.arm_joints]
        self._qpos, self._dof = model.jnt_qposadr[ids], model.jnt_dofadr[ids]
        self._site = model.site(spec.tool).id

    def torque(self, q: Array, qd: Array, qdd: Array) -> Array:
        """Joint torques (n, j) in N m of a motion q, qd, qdd (n, j); gravity is -z of the base."""
        m, d = self._model, self._data
        full, out = np.zeros(m.nv), np.empty_like(q)
        for k in range(len(q)):
            self._place(q[k])
            d.qvel[:], d.qacc[:] = 0.0, 0.0
            d.qvel[self._dof], d.qacc[self._dof] = qd[k], qdd[k]
            mujoco.mj_comVel(m, d)
            mujoco.mj_rne(m, d, 1, full)
            out[k] = full[self._dof]
        armature, viscous = m.dof_armature[self._dof], m.dof_damping[self._dof]
        return np.asarray(out + armature * qdd + viscous * qd)

    def work(self, q: Array, direction: Array) -> tuple[Array, Array]:
        """For tool velocities J direction (n, 3): J^T J direction (n, j) and their squared lengths (n,)."""
        m, d = self._model, self._data
        jacobian = np.zeros((3, m.nv))
        torque, square = np.empty_like(q), np.empty(len(q))
        for k in range(len(q)):
            self._place(q[k])
            mujoco.mj_jacSite(m, d, jacobian, None, self._site)
            j = jacobian[:, self._dof]
            tool = j @ direction[k]
            torque[k], square[k] = j.T @ tool, tool @ tool
        return torque, square

    def _place(self, q: Array) -> None:
        self._data.qpos[:] = self._model.qpos0
        self._data.qpos[self._qpos] = q
        mujoco.mj_kinematics(self._model, self._data)
        mujoco.mj_comPos(self._model, self._data)

    def terms(
        self,
        q: Array,
        first: Array,
        second: Array,
        rate: Array,
        acceleration: Array,
        states: Array,
        load: PartLoad | None,
    ) -> Terms:
        """Torques along a path over a share s that takes one second.

        Args:
            q: (n, j) configuration.
            first: (n, j) its first derivative by s.
            second: (n, j) its second derivative by s.
            rate: (n,) of s.
            acceleration: (n,) of s.
            states: (n,) of the part, linear in s.
            load: the part, None for empty hands.
        """
        none = np.zeros_like(q)
        qd, qdd = first * rate[:, None], first * acceleration[:, None] + second * (rate**2)[:, None]
        still = self.torque(q, none, none)
        viscous = self._model.dof_damping[self._dof] * qd
        inertial = self.torque(q, qd, qdd) - still - viscous
        way = float(states[-1] - states[0])
        if load is None or way == 0.0:
            return Terms(still, viscous, inertial)
        per_force = self._per_force(q, first / way)
        return Terms(
            still + load.still(states, np.sign(way))[:, None] * per_force,
            viscous + (load.damping * way * rate)[:, None] * per_force,
            inertial + (load.inertia * way * acceleration)[:, None] * per_force,
        )

    def _per_force(self, q: Array, direction: Array) -> Array:
        """Torques (n, j) that give a force of 1 along the part's joint; direction: (n, j) dq / d(state).

        d(tool)/d(state) = t = J direction; the force that gives `f` along the joint is f t / |t|^2.
        """
        torque, square = self.work(q, direction)
        return np.asarray(torque / np.maximum(square, 1e-6)[:, None])

    def beyond_gravity(
        self,
        q: Array,
        first: Array,
        second: Array,
        rate: Array,
        acceleration: Array,
        states: Array,
        load: PartLoad | None,
    ) -> Array:
        """Torques (n, j) of the same motion that gravity compensation does not give: the arm's inertia and
        damping, and the part. Its dry friction and its catch set in with the motion: what does not move yet
        must not be pushed."""
        qd, qdd = first * rate[:, None], first * acceleration[:, None] + second * (rate**2)[:, None]
        arm = self.torque(q, qd, qdd) - self.torque(q, np.zeros_like(q), np.zeros_like(q))
        way = float(states[-1] - states[0])
        if load is None or way == 0.0:
            return arm
        moving = np.clip(rate / (_SETS_IN * max(float(rate.max()), 1e-9)), 0.0, 1.0)
        force = load.still(states, 0.0) + (np.sign(way) * load.friction + load.caught(states)) * moving
        force = force + way * (load.damping * rate + load.inertia * acceleration)
        return np.asarray(arm + force[:, None] * self._per_force(q, first / way))
