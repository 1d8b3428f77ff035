"""What every format is written from: a trajectory with the part that it moves and the robot that moves it."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from robots.model.kinematics import Chain, read_chain
from robots.model.mjcf import compiled
from robots.model.spec import RobotSpec
from robots.trajectory import RobotTrajectory
from twin import geometry as geo
from twin.errors import InputError
from twin.geometry import Array
from twin.scene import Part, Twin

_DECIMALS = 9  # a nanometre, a nanoradian, a nanosecond


@dataclass(frozen=True, eq=False)
class PlannedMotion:
    """A trajectory, the part that it moves and the robot that it was planned for.

    Raises InputError when they don't belong together.
    """

    trajectory: RobotTrajectory
    part: Part
    robot: RobotSpec

    def __post_init__(self) -> None:
        t, p, r = self.trajectory, self.part, self.robot
        if (t.part_id, t.part) != (p.id, p.name):
            raise InputError(
                f"the trajectory moves part {t.part!r} ({t.part_id}), not {p.name!r} ({p.id})",
                "give the part that it was planned for, or plan again",
            )
        if t.joint_names != r.arm_joints:
            raise InputError(
                f"the trajectory was planned for {t.robot!r} and moves {', '.join(t.joint_names)}; "
                f"robot {r.name!r} has {', '.join(r.arm_joints)}",
                "give the robot that it was planned for",
            )

    @property
    def state_unit(self) -> str:
        """Unit of the part's state: "rad" of a revolute joint, "m" of a prismatic one."""
        return "rad" if self.part.joint.kind == "revolute" else "m"

    @property
    def verb(self) -> str:
        """What is done to the part: "open" or "close"."""
        return "open" if self.trajectory.goal > self.trajectory.start else "close"

    @property
    def title(self) -> str:
        """One line: who does what to which part."""
        t = self.trajectory
        return f"{t.robot} {self.verb}s {t.part} of {t.twin}"

    @property
    def remarks(self) -> list[str]:
        """What is told first where a format has room for it: the verdict on the part, if it has one."""
        return [] if self.part.verdict is None else [f"verdict: {self.part.verdict.text}"]

    @property
    def T_base_tool(self) -> Array:
        """Tool poses (n, 4, 4) in the base's stance, which stands still where the plan has it."""
        return np.asarray(geo.invert_pose(self.trajectory.T_world_base) @ self.trajectory.T_world_tool)

    @property
    def base(self) -> int:
        """How many of the joints, the leading ones, move the base: 3 of a planar base, 0 of a fixed one."""
        return len(self.robot.base_joints)

    @property
    def joint_units(self) -> tuple[str, ...]:
        """Unit of each joint's position: "m" of a slide, "rad" of a hinge."""
        if not self.robot.planar:
            return ("rad",) * len(self.robot.arm_joints)
        return tuple("m" if slides else "rad" for slides in self._chain.slides)

    @property
    def T_base_body(self) -> Array:
        """Poses (n, 4, 4), in the frame of the base's stance, of the body that a planar base carries."""
        return self._body_motion[0]

    @property
    def body_velocity(self) -> Array:
        """That body's velocity (n, 6), linear m/s and angular rad/s, in the axes of the stance."""
        return self._body_motion[1]

    @property
    def body(self) -> str:
        """Name of the body on which the arm is mounted: the one that a planar base carries, else the base."""
        if not self.robot.planar:
            return self.robot.base_body
        model = compiled(self.robot)
        last = model.joint(self.robot.base_joints[-1]).id
        return str(model.body(model.jnt_bodyid[last]).name)

    @cached_property
    def _chain(self) -> Chain:
        return read_chain(compiled(self.robot), self.robot)

    @cached_property
    def _body_motion(self) -> tuple[Array, Array]:
        n, chain, t = self.base, self._chain, self.trajectory
        cut = {name: getattr(chain, name)[:n] for name in ("fixed", "axes", "lower", "upper", "slides")}
        poses, jacobian = replace(chain, **cut, last=np.eye(4)).forward(t.q[:, :n])
        local = (jacobian @ t.qd[:, :n, None]).reshape(-1, 2, 3)
        return poses, (local @ np.swapaxes(poses[:, :3, :3], -1, -2)).reshape(-1, 6)


def require_trust(part: Part, accept_doubtful: bool = False, twin: Twin | None = None) -> None:
    """Raises InputError for a part whose verdict is worse than trusted, unless accepted: a robot would obey.

    A part without a verdict was stated by somebody, or made before there were verdicts. twin: whose reasons
    against all of it, such as an unsure up, count against the part as well.
    """
    whole = None if twin is None or twin.verdict is None else twin.verdict.of_all
    for name, verdict in ((part.name, part.verdict), ("the twin", whole)):
        if not accept_doubtful and verdict is not None and verdict.main is not None:
            raise InputError(
                f"{name} is {verdict.level}: {verdict.main.text}",
                f"{verdict.main.help}; or take it as it is with --accept-doubtful "
                "(in Python accept_doubtful=True)",
            )


def number(value: float) -> float:
    """Rounded to nine decimals, without a negative zero."""
    return round(float(value), _DECIMALS) + 0.0


def seconds_nanoseconds(seconds: float) -> dict[str, int]:
    """`builtin_interfaces/Duration`: whole seconds, and nanoseconds 0..999999999."""
    sec, nanosec = divmod(round(seconds * 1e9), 1_000_000_000)
    return {"sec": sec, "nanosec": nanosec}


def smooth_quaternions_wxyz(rotations: Array) -> Array:
    """Unit quaternions (n, 4), order wxyz, of rotations (n, 3, 3); each of the sign nearer to the one before.

    The first has w >= 0. Readers interpolate between neighbours, so a change of sign is a full turn to them.
    """
    q = geo.quat_wxyz_from_matrix(rotations)
    steps = np.where(np.sum(q[1:] * q[:-1], axis=1) < 0, -1.0, 1.0)
    first = -1.0 if q[0, 0] < 0 else 1.0
    return np.asarray(q * (first * np.cumprod([1.0, *steps]))[:, None])


def yaml_bytes(message: Mapping[str, Any], comments: Sequence[str]) -> bytes:
    """A ROS message as YAML: one line for each field, and for each element of an array of messages.

    Strings are quoted and numbers written without exponent, which YAML 1.1 readers take for text (1e-05).
    """
    lines = [f"# {c}" for c in comments]
    for key, value in message.items():
        if isinstance(value, list) and value and isinstance(value[0], dict):
            lines += [f"{key}:", *(f"- {_flow(v)}" for v in value)]
        else:
            lines.append(f"{key}: {_flow(value)}")
    return ("\n".join(lines) + "\n").encode()


def _flow(value: Any) -> str:
    if isinstance(value, dict):
        return "{" + ", ".join(f"{k}: {_flow(v)}" for k, v in value.items()) + "}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(_flow, value)) + "]"
    if isinstance(value, float):
        return f"{number(value):.{_DECIMALS}f}"
    return json.dumps(value)
