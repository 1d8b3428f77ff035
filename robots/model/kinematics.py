"""Forward and inverse kinematics and Jacobian of a serial arm for many configurations at once (numpy).

The joints of a planar base, two slides and a hinge, come first: base and arm are solved at once.

The planner screens hundreds of base poses with it; the final path comes from `robots.planning.ik`. The chain
is read from the compiled MJCF model, so there is one description of the arm.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import mujoco
import numpy as np
from numpy.typing import NDArray

from robots.model.spec import RobotSpec
from twin import geometry as geo
from twin.errors import InputError
from twin.geometry import Array

# A mobile base moves where the arm alone would end at its limits, and no farther: beside errors of weight 1
# (1/m), a metre of way costs what 3 cm of error do, and it damps steps as much as an arm joint with a lever
# of 17 cm would take (chosen by us).
_BASE_PULL = 1e-3
_BASE_DAMPING = 3e-2


@dataclass(frozen=True, eq=False)
class Chain:
    """n joints from the base to the tool: T_base_tool = prod_i(fixed_i exp(axes_i q_i)) last.

    fixed: (n, 4, 4); axes: (n, 3) unit, in the joint's own frame; last: (4, 4); lower, upper: (n,) rad or m;
    slides: (n,) True where a joint slides; base: how many leading joints move a planar base.
    """

    fixed: Array
    axes: Array
    last: Array
    lower: Array
    upper: Array
    slides: NDArray[np.bool_]
    base: int = 0

    def forward(self, q: Array) -> tuple[Array, Array]:
        """Poses T_base_tool (B, 4, 4) and Jacobians (B, 6, n) in tool axes (linear, angular), q (B, n)."""
        batch, n = q.shape
        r = np.broadcast_to(np.eye(3), (batch, 3, 3))
        p = np.zeros((batch, 3))
        origins, directions = np.empty((batch, n, 3)), np.empty((batch, n, 3))
        sine, versine = np.sin(q), 1 - np.cos(q)
        for i, step in enumerate(self._steps):
            moved = (r.reshape(-1, 3) @ step).reshape(batch, 3, -1)
            p = p + moved[:, :, 0]
            r = moved[:, :, 2:5]
            origins[:, i], directions[:, i] = p, moved[:, :, 1]
            if self.slides[i]:
                p = p + directions[:, i] * q[:, i, None]
            else:  # Rodrigues' formula
                r = (
                    r
                    + sine[:, i, None, None] * moved[:, :, 5:8]
                    + versine[:, i, None, None] * moved[:, :, 8:]
                )
        p = p + r @ self.last[:3, 3]
        r = r @ self.last[:3, :3]
        linear = np.cross(directions, p[:, None] - origins)
        angular = directions
        if self.slides.any():
            linear = np.where(self.slides[:, None], directions, linear)
            angular = np.where(self.slides[:, None], 0.0, directions)
        jacobian = np.concatenate([linear @ r, angular @ r], axis=2).transpose(0, 2, 1)
        pose = np.zeros((batch, 4, 4))
        pose[:, :3, :3], pose[:, :3, 3], pose[:, 3, 3] = r, p, 1.0
        return pose, jacobian

    @cached_property
    def _steps(self) -> tuple[Array, ...]:
        """Of each joint (3, 11): its origin, its axis, the rotation F before it, F K and F K^2, where K is
        the cross product of its axis: a rotation times all of it takes one product of matrices."""
        out = []
        for pose, axis in zip(self.fixed, self.axes, strict=True):
            before, k = pose[:3, :3], geo.skew(axis)
            out.append(np.column_stack([pose[:3, 3], before @ axis, before, before @ k, before @ k @ k]))
        return tuple(out)

    def solve(self, q: Array, target: Array, weights: Array, steps: int) -> tuple[Array, Array]:
        """Damped least squares towards `target` (B, 4, 4) from q (B, n), inside the limits.

        weights: (6,) of the error in tool axes (1/m, 1/rad). A weak pull to mid-range settles the redundancy
        (chosen by us). Returns q (B, n) and the weighted error (B, 6) in m and rad after `steps` steps.
        """
        w2 = weights**2
        middle, span = (self.lower + self.upper) / 2, self.upper - self.lower
        pull = 3e-5 / (span / 2) ** 2
        pull[: self.base] = _BASE_PULL
        damping = np.full(q.shape[1], 3e-5)
        damping[: self.base] = _BASE_DAMPING
        damping = np.diag(damping + pull)
        for _ in range(steps):
            error, jacobian = self._error(q, target)
            jw = jacobian.transpose(0, 2, 1) * w2
            hessian = jw @ jacobian + damping
            gradient = (jw @ error[:, :, None])[:, :, 0] + pull * (middle - q)
            step = np.linalg.solve(hessian, gradient[:, :, None])[:, :, 0]
            largest = np.abs(step).max(axis=1, keepdims=True)
            q = np.clip(q + step * np.minimum(1.0, 0.4 / np.maximum(largest, 1e-9)), self.lower, self.upper)
        error, _ = self._error(q, target)
        return q, error * (weights > 0)

    def _error(self, q: Array, target: Array) -> tuple[Array, Array]:
        pose, jacobian = self.forward(q)
        rt = pose[:, :3, :3].transpose(0, 2, 1)
        linear = (rt @ (target[:, :3, 3] - pose[:, :3, 3])[:, :, None])[:, :, 0]
        return np.concatenate([linear, geo.log_so3(rt @ target[:, :3, :3])], axis=1), jacobian

    def manipulability(self, q: Array) -> Array:
        """sqrt(det(J J^T)) (B,) of the arm without its base, Yoshikawa 1985; 0 at a singularity."""
        _, j = self.forward(q)
        j = j[:, :, self.base :]
        return np.sqrt(np.maximum(np.linalg.det(j @ j.transpose(0, 2, 1)), 0.0))

    def limit_margin(self, q: Array) -> Array:
        """Smallest distance (...,) in rad of the arm's part of q (..., n) from its limits."""
        return np.asarray(np.minimum(q - self.lower, self.upper - q)[..., self.base :].min(axis=-1))


def read_chain(model: mujoco.MjModel, spec: RobotSpec) -> Chain:
    """The arm of `spec` in a compiled model of the robot alone.

    Raises InputError when a named body, joint or site does not exist or the joints are no chain of hinges.
    """
    base = _id(model, mujoco.mjtObj.mjOBJ_BODY, spec.base_body, spec)
    site = _id(model, mujoco.mjtObj.mjOBJ_SITE, spec.tool, spec)
    for name in (spec.gripper_actuator, *spec.arm_actuators):
        _id(model, mujoco.mjtObj.mjOBJ_ACTUATOR, name, spec)
    for name in spec.gripper_joints:
        _id(model, mujoco.mjtObj.mjOBJ_JOINT, name, spec)
    for name in spec.finger_bodies:
        _id(model, mujoco.mjtObj.mjOBJ_BODY, name, spec)
    joints = [_id(model, mujoco.mjtObj.mjOBJ_JOINT, j, spec) for j in spec.arm_joints]
    fixed: list[Array] = []
    pose = np.eye(4)
    for body in _bodies_from(model, base, int(model.site_bodyid[site])):
        pose = pose @ _pose(model.body_pos[body], model.body_quat[body])
        for j in range(model.body_jntadr[body], model.body_jntadr[body] + model.body_jntnum[body]):
            if len(fixed) == len(joints) or j != joints[len(fixed)]:
                raise InputError(
                    f"robot {spec.name!r}: arm.joints must list the joints from base to tool in order; "
                    f"{model.joint(j).name!r} comes after {len(fixed)} of them"
                )
            slide = model.jnt_type[j] == mujoco.mjtJoint.mjJNT_SLIDE and len(fixed) < len(spec.base_joints)
            hinge = model.jnt_type[j] == mujoco.mjtJoint.mjJNT_HINGE
            if not (slide or hinge) or np.any(model.jnt_pos[j]):
                raise InputError(
                    f"robot {spec.name!r}: joint {model.joint(j).name!r} must be a hinge at its body's origin"
                )
            fixed.append(pose)
            pose = np.eye(4)
    if len(fixed) != len(joints):
        raise InputError(
            f"robot {spec.name!r}: {len(fixed)} of {len(joints)} arm joints lead to the tool site"
        )
    last = pose @ _pose(model.site_pos[site], model.site_quat[site])
    limits = model.jnt_range[joints]
    return Chain(
        np.stack(fixed),
        model.jnt_axis[joints].copy(),
        last,
        limits[:, 0].copy(),
        limits[:, 1].copy(),
        model.jnt_type[joints] == mujoco.mjtJoint.mjJNT_SLIDE,
        len(spec.base_joints),
    )


def _bodies_from(model: mujoco.MjModel, base: int, body: int) -> list[int]:
    chain: list[int] = []
    while body not in (base, 0):
        chain.append(body)
        body = int(model.body_parentid[body])
    return chain[::-1]


def _pose(position: Array, quat_wxyz: Array) -> Array:
    return geo.make_pose(geo.matrix_from_quat_wxyz(quat_wxyz), position)


def _id(model: mujoco.MjModel, kind: mujoco.mjtObj, name: str, spec: RobotSpec) -> int:
    found = mujoco.mj_name2id(model, kind, name)
    if found < 0:
        raise InputError(
            f"robot {spec.name!r} names {name!r}, which its model {spec.model.name} does not have",
            f"{kind.name.removeprefix('mjOBJ_').lower()} names must match the MJCF file",
        )
    return int(found)
