"""Were the robot's limits kept? Asked of Pinocchio and of the contacts that MuJoCo reports, not of the
planner's own code."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np
import pinocchio as pin

from robots.model.spec import RobotSpec
from robots.scene.world import PREFIX, ROBOT, STATIC, World
from twin import geometry as geo
from twin.geometry import Array

_EVERY = 2


@dataclass
class Judgement:
    """Largest values over a replay, each joint's as a share of its limit. beyond: rad or m by which a joint
    left its range. depth: m of overlap of robot and static scene. disagreement: N m between Pinocchio's
    torque and MuJoCo's."""

    torque: float = 0.0
    velocity: float = 0.0
    beyond: float = -np.inf
    depth: float = 0.0
    disagreement: float = 0.0

    @property
    def broken(self) -> list[str]:
        """The limits that were not kept."""
        found = []
        if self.torque > 1.0 + 1e-6:
            found.append(f"torque {self.torque:.3f} of the limit")
        if self.velocity > 1.0:
            found.append(f"velocity {self.velocity:.2f} of the limit")
        if self.beyond > 1e-6:
            found.append(f"joint {self.beyond:.4f} beyond its range")
        if self.depth > 0.002:
            found.append(f"{1000 * self.depth:.1f} mm into the static scene")
        return found


class Judge:
    """Looks at every second step (4 ms) of a simulation: `simulate(world, trajectory, config, judge)`.

    The motor torques are those that Pinocchio's recursive Newton-Euler needs for the accelerations that
    MuJoCo found, under the contact wrenches that MuJoCo reports on each link, plus the joints' own damping.
    """

    def __init__(self, world: World, T_world_base: Array, spec: RobotSpec) -> None:
        self.found, self._steps = Judgement(), 0
        self._w, self._spec, self._m = world, spec, world.model
        self._d = mujoco.MjData(world.model)
        self._pin = pin.buildModelFromMJCF(str(spec.model))
        self._pin.armature = np.zeros(self._pin.nv)  # the replay's model holds it; added below, once
        self._pd = self._pin.createData()
        self._base = pin.SE3(geo.invert_pose(T_world_base))
        joints = [j for j in range(self._m.njnt) if self._m.joint(j).name.startswith(PREFIX)]
        self._qpos, self._dof = self._m.jnt_qposadr[joints], self._m.jnt_dofadr[joints]
        names = [self._m.joint(j).name.removeprefix(PREFIX) for j in joints]
        self._arm = [names.index(n) for n in spec.arm_joints]
        self._body = [self._joint_of(b) for b in range(self._m.nbody)]
        self._check_same_robot()

    def _joint_of(self, body: int) -> int:
        """Pinocchio's joint that moves a body; 0 for what does not move."""
        name = self._m.body(body).name
        if not name.startswith(PREFIX) or not self._pin.existFrame(name.removeprefix(PREFIX)):
            return 0
        return int(self._pin.frames[self._pin.getFrameId(name.removeprefix(PREFIX))].parentJoint)

    def _check_same_robot(self) -> None:
        """Both programs must mean the same joint by the same number: the tool is in the same place for
        both."""
        q = np.random.default_rng(0).uniform(self._pin.lowerPositionLimit, self._pin.upperPositionLimit)
        self._d.qpos[self._qpos] = q
        mujoco.mj_kinematics(self._m, self._d)
        pin.framesForwardKinematics(self._pin, self._pd, q)
        theirs = self._base.inverse() * self._pd.oMf[self._pin.getFrameId(self._spec.tool)]
        if np.abs(theirs.translation - self._d.site_xpos[self._w.tool]).max() > 1e-9:
            raise ValueError(f"Pinocchio reads another robot from {self._spec.model} than MuJoCo")

    def __call__(self, data: mujoco.MjData) -> None:
        """Take one state."""
        self._steps += 1
        if self._steps % _EVERY:
            return
        d = self._d
        d.qpos[:], d.qvel[:], d.ctrl[:], d.time = data.qpos, data.qvel, data.ctrl, data.time
        d.qacc_warmstart[:] = data.qacc_warmstart
        mujoco.mj_forward(data.model, d)  # the simulation's own: it knows how the arm is driven
        q, v, a = d.qpos[self._qpos], d.qvel[self._dof], d.qacc[self._dof]
        pin.forwardKinematics(self._pin, self._pd, q)
        tau = pin.rnea(self._pin, self._pd, q, v, a, self._wrenches(d))
        tau = tau + self._m.dof_armature[self._dof] * a + self._m.dof_damping[self._dof] * v
        tau, v, q = tau[self._arm], v[self._arm], q[self._arm]
        found, spec = self.found, self._spec
        found.torque = max(found.torque, float((np.abs(tau) / spec.effort).max()))
        found.velocity = max(found.velocity, float((np.abs(v) / spec.velocity).max()))
        low, high = (x[self._arm] for x in (self._pin.lowerPositionLimit, self._pin.upperPositionLimit))
        found.beyond = max(found.beyond, float(np.maximum(low - q, q - high).max()))
        said = d.qfrc_actuator[self._dof][self._arm]
        found.disagreement = max(found.disagreement, float(np.abs(tau - said).max()))

    def _wrenches(self, d: mujoco.MjData) -> pin.StdVec_Force:
        """Contact forces on Pinocchio's joints, each in its own frame."""
        m, w = self._m, self._w
        total = [np.zeros(6) for _ in range(self._pin.njoints)]
        local = np.zeros(6)
        for k in range(d.ncon):
            pair = [int(g) for g in d.contact.geom[k]]
            owners = {int(w.owner[g]) for g in pair}
            if owners == {ROBOT, STATIC}:
                self.found.depth = max(self.found.depth, -float(d.contact.dist[k]))
            mujoco.mj_contactForce(m, d, k, local)
            turn = d.contact.frame[k].reshape(3, 3).T
            force, torque = turn @ local[:3], turn @ local[3:]
            torque = torque + np.cross(d.contact.pos[k], force)  # about the world's origin
            for geom, sign in zip(pair, (-1.0, 1.0), strict=True):
                joint = self._body[int(m.geom_bodyid[geom])]
                if joint:
                    total[joint] += sign * np.concatenate([force, torque])
        forces = pin.StdVec_Force()
        for joint, wrench in enumerate(total):
            in_base = self._base.act(pin.Force(wrench))
            forces.append(self._pd.oMi[joint].actInv(in_base))
        return forces
