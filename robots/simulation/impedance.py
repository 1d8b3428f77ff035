"""Compliant control of the hand: a spring and a damper at the tool, as in arms with impedance control.

The preset is that of Spot's `ArmImpedanceCommand` at its highest stiffness and default caps (bosdyn.api,
version 5): 500 N/m and 60 N m/rad in the tool's axes, at most 60 N and 15 N m. What moving the arm and the
part is known to take is fed forward on top.
"""

from __future__ import annotations

import math

import mujoco
import numpy as np

from robots.model.kinematics import Chain
from robots.scene.world import World
from robots.trajectory import RobotTrajectory
from twin import geometry as geo
from twin.geometry import Array

TRANSLATION = 500.0  # N/m
ROTATION = 60.0  # N m/rad
FORCE_CAP = 60.0  # N
TORQUE_CAP = 15.0  # N m
# Critical damping of the mass and inertia at the hand of a 15 to 25 kg arm. Chosen by us.
_MASS = 4.0  # kg
_INERTIA = 0.10  # kg m^2
# Of what the tool does not feel: an elbow must not drift.
_SLACK = 10.0  # N m/rad
_SLACK_DAMPING = 2.0  # N m s/rad
_REGULAR = 1e-6 * np.eye(6)  # keeps the inverse of J J^T finite at a singularity
EVERY = 2  # steps between commands: 250 Hz (chosen by us)


class Impedance:
    """Turns a scene's arm servos into motors and commands them; a planar base keeps its servos."""

    def __init__(
        self, world: World, trajectory: RobotTrajectory, chain: Chain, times: Array, share: float = 1.0
    ) -> None:
        """share: of the preset's stiffness; damping by its root, caps stay. times: (n,) s of the steps."""
        self._w, self._share, self._first = world, share, chain.base
        self._q, self._qd, _ = trajectory.at(times)
        self._effort = trajectory.effort_at(times)
        tool = np.concatenate(
            [chain.forward(part)[0] for part in np.array_split(self._q, len(times) // 500 + 1)]
        )
        wanted = trajectory.T_world_base @ tool
        self._position, self._turn = wanted[:, :3, 3], geo.quat_wxyz_from_matrix(wanted[:, :3, :3])
        self._stiffness = share * np.repeat([TRANSLATION, ROTATION], 3)
        self._damping = 2.0 * np.sqrt(self._stiffness * np.repeat([_MASS, _INERTIA], 3))
        self._quat = np.zeros(4)
        self._jacobian = np.zeros((6, world.model.nv))
        motors = world.arm_ctrl[self._first :]
        world.model.actuator_gainprm[motors, 0] = 1.0
        world.model.actuator_biasprm[motors] = 0.0

    def command(self, data: mujoco.MjData, k: int) -> None:
        """Set the motors' torques for step k."""
        w, first = self._w, self._first
        dofs = w.arm_dof[first:]
        mujoco.mj_jacSite(w.model, data, self._jacobian[:3], self._jacobian[3:], w.tool)
        turn = data.site_xmat[w.tool].reshape(3, 3)
        j = self._jacobian[:, dofs]
        j = np.concatenate([turn.T @ j[:3], turn.T @ j[3:]])
        error = np.empty(6)
        error[:3] = turn.T @ (self._position[k] - data.site_xpos[w.tool])
        mujoco.mju_mat2Quat(self._quat, data.site_xmat[w.tool])
        mujoco.mju_subQuat(error[3:], self._turn[k], self._quat)  # in the tool's own axes
        lag = self._qd[k, first:] - data.qvel[dofs]
        wrench = self._stiffness * error + self._damping * (j @ lag)
        wrench[:3] *= min(1.0, FORCE_CAP / max(math.hypot(*wrench[:3]), 1e-9))
        wrench[3:] *= min(1.0, TORQUE_CAP / max(math.hypot(*wrench[3:]), 1e-9))
        slack = _SLACK * (self._q[k, first:] - data.qpos[w.arm_qpos[first:]]) + _SLACK_DAMPING * lag
        # what of it the tool would feel is taken out: N = 1 - J^+ J
        slack -= j.T @ np.linalg.solve(j @ j.T + _REGULAR, j @ slack)
        data.ctrl[w.arm_ctrl[first:]] = j.T @ wrench + slack + self._effort[k, first:]
