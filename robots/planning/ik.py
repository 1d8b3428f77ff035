"""Precise inverse kinematics along a path (mink with the daqp solver), inside the joint limits."""

from __future__ import annotations

from dataclasses import dataclass

import mink
import mujoco
import numpy as np

from robots.model.spec import RobotSpec
from twin import geometry as geo
from twin.geometry import Array

_STEPS = 12  # at most, a waypoint; neighbours differ by little, so 3-5 are the rule
_LIMIT_MARGIN = 0.02  # rad kept free of each joint limit, so that a compliant arm does not run into its stops
_BASE_COST = 0.05  # of a planar base's way from its hint (1/m, 1/rad), beside 1 for the tool


@dataclass(frozen=True, eq=False)
class PathSolution:
    """q: (n, joints) rad. position_error: (n,) m. angle_error: (n, 3) rad about the tool axes."""

    q: Array
    position_error: Array
    angle_error: Array


class PathSolver:
    """Inverse kinematics of one robot, base at the origin."""

    def __init__(self, spec: RobotSpec, model: mujoco.MjModel) -> None:
        self._spec = spec
        self._configuration = mink.Configuration(model)
        self._address = np.array([model.jnt_qposadr[model.joint(j).id] for j in spec.arm_joints])
        self._posture = np.full(model.nv, 3e-3)
        for name in spec.base_joints:  # the base keeps to its rough way, the arm makes up for the rest
            self._posture[model.jnt_dofadr[model.joint(name).id]] = _BASE_COST
        self._limits = [mink.ConfigurationLimit(model, min_distance_from_limits=_LIMIT_MARGIN)]

    def follow(self, targets: Array, freedom: Array, hint: Array) -> PathSolution:
        """Joint path along tool poses.

        Args:
            targets: (n, 4, 4) tool poses in the base frame, neighbours close to each other.
            freedom: (3,) orientation costs about the tool axes, beside a position cost of 1 (1/m).
            hint: (n, joints) rough solution; it settles the redundancy.
        """
        tool = mink.FrameTask(self._spec.tool, "site", position_cost=1.0, orientation_cost=freedom, gain=1.0)
        posture = mink.PostureTask(self._configuration.model, cost=self._posture)
        solution = PathSolution(np.empty_like(hint), np.empty(len(targets)), np.empty((len(targets), 3)))
        q = hint[0]
        for k, target in enumerate(targets):
            tool.set_target(mink.SE3.from_matrix(target))
            posture.set_target(self._full(hint[k]))
            q = self._solve(q, tool, posture)
            achieved = self._configuration.get_transform_frame_to_world(self._spec.tool, "site").as_matrix()
            error = geo.invert_pose(achieved) @ target
            solution.q[k] = q
            solution.position_error[k] = np.linalg.norm(error[:3, 3])
            solution.angle_error[k] = geo.log_so3(error[:3, :3])
        return solution

    def _solve(self, q: Array, tool: mink.FrameTask, posture: mink.PostureTask) -> Array:
        self._configuration.update(self._full(q))
        for _ in range(_STEPS):
            velocity = mink.solve_ik(
                self._configuration, [tool, posture], 1.0, "daqp", damping=1e-6, limits=self._limits
            )
            self._configuration.integrate_inplace(velocity, 1.0)
            if np.abs(velocity[self._address]).max() < 1e-5:
                break
        return np.array(self._configuration.q[self._address])

    def _full(self, q: Array) -> Array:
        full = np.array(self._configuration.model.qpos0)
        full[self._address] = q
        return full
