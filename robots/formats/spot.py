"""Spot's impedance control of the arm: bosdyn.api.ArmImpedanceCommand.Request in protobuf's JSON, by leg.

Where the plan moves a mobile base, each leg has the body's bosdyn.api.SE2TrajectoryCommand.Request too.

Source of the fields: Spot SDK, protos/bosdyn/api/{arm_command,basic_command,trajectory,geometry}.proto.
Largest stiffness and damping: the SDK's example arm_impedance_control. Force and torque caps: the defaults
that arm_command.proto states.

The command is about the tool alone, so any robot's trajectory can be given to Spot. The task frame is the
tool frame at the trajectory's first sample (the hand 10 cm in front of the handle, opened): whoever sends the
command sets `rootTformTask` to where that is, by default the pose in the base frame of the plan.

A mobile base takes the frame "body" along, so the files of a plan that moves it are about "odom". They are
written as if it were Spot's "flat_body" at the first sample; one transform, odom_tform_flat_body read when
Spot stands there, makes them right: in front of rootTformTask and of every pose of the body.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Any

import numpy as np

from robots.formats.trajectory_export import PlannedMotion, number, smooth_quaternions_wxyz
from twin import geometry as geo
from twin.errors import ConfigError
from twin.geometry import Array

LEGS = ("approach", "close", "move", "open", "retreat")
ARM_FILES = tuple(f"spot/arm_impedance_{k}_{leg}.json" for k, leg in enumerate(LEGS, 1))
BODY_FILES = tuple(f"spot/body_{k}_{leg}.json" for k, leg in enumerate(LEGS, 1))
FILES = ARM_FILES + BODY_FILES
STEP = 0.1  # s between points, chosen by us: the robot interpolates, and short messages arrive sooner

_STILL = 1e-6  # m and parts of an axis: the digits that are written tell no motion below it

# Ours: z out of the hand, y the closing direction. Spot's wrist (link_wr1): x out of the hand, y the jaw's
# hinge, so the jaw closes along z. Origin: the SDK's default tool, in front of the palm plate.
WRIST_T_TOOL = geo.make_pose([[0, 0, 1], [1, 0, 0], [0, 1, 0]], [0.19557, 0, 0])


@dataclass(frozen=True)
class Impedance:
    """Diagonal stiffness (N/m, N m/rad) and damping (N s/m, N m s/rad) (tool frame), caps (N, N m).

    Defaults: the largest stiffness and damping that Spot takes, and its own caps. ConfigError beyond these.
    """

    stiffness: tuple[float, ...] = (500.0, 500.0, 500.0, 60.0, 60.0, 60.0)
    damping: tuple[float, ...] = (2.5, 2.5, 2.5, 1.0, 1.0, 1.0)
    max_force: float = 60.0
    max_torque: float = 15.0

    def __post_init__(self) -> None:
        most = {"stiffness": (500.0,) * 3 + (60.0,) * 3, "damping": (2.5,) * 3 + (1.0,) * 3}
        for key, limits in most.items():
            values = getattr(self, key)
            if len(values) != 6 or any(not 0 <= v <= m for v, m in zip(values, limits, strict=True)):
                raise ConfigError(f"{key} {values} must hold six numbers from 0 to {limits}")
        if not (0 < self.max_force <= 60 and 0 < self.max_torque <= 15):
            raise ConfigError(
                f"caps {self.max_force} N, {self.max_torque} N m must be in (0, 60] and (0, 15]"
            )


def render(source: PlannedMotion) -> dict[str, bytes]:
    """A command for each leg on which the hand moves. Fingers close between approach and move and open before
    the retreat, a claw's while the hand moves sideways, so that the fixed jaw comes to the handle."""
    t = source.trajectory
    phases = np.array(t.phases)
    impedance = Impedance()
    start = t.T_world_tool[0]
    frame, root = "body", source.T_base_tool[0]
    body: Array | None = None
    if source.base:
        # where the body is from its first stance; that stance's frame is on the floor, where Spot has none
        body = geo.invert_pose(source.T_base_body[0]) @ source.T_base_body
        frame, root = "odom", geo.invert_pose(source.T_base_body[0]) @ root
    files = {}
    for arm_path, body_path, leg in zip(ARM_FILES, BODY_FILES, LEGS, strict=True):
        at = np.flatnonzero(phases == leg)
        if len(at) == 0:
            continue
        # the rest before a leg ends where the leg begins; its last sample is the leg's first point
        at = np.concatenate([[max(at[0] - 1, 0)], at]) if at[0] else at
        poses = geo.invert_pose(start) @ t.T_world_tool[at]
        if np.abs(poses - poses[0]).max() < _STILL:
            continue
        keep = thinned(t.times[at])
        times = t.times[at][keep]
        files[arm_path] = _json(request(_points(times, poses[keep]), frame, root, impedance))
        if body is not None:
            files[body_path] = _json(body_trajectory(times, body[at][keep], frame))
    return files


def request(
    points: list[dict[str, Any]], frame: str, root_T_task: Array, impedance: Impedance
) -> dict[str, Any]:
    """The arm's message as a mapping, keys in lowerCamelCase as protobuf's JSON has them."""
    return {
        "rootFrameName": frame,
        "rootTformTask": _pose(root_T_task),
        "wristTformTool": _pose(WRIST_T_TOOL),
        "taskTformDesiredTool": {"points": points},
        "diagonalStiffnessMatrix": {"values": list(impedance.stiffness)},
        "diagonalDampingMatrix": {"values": list(impedance.damping)},
        "maxForceMag": impedance.max_force,
        "maxTorqueMag": impedance.max_torque,
        "disableSafetyCheck": False,
    }


def body_trajectory(times: Array, poses: Array, frame: str) -> dict[str, Any]:
    """The body's message as a mapping: times (n,) s, level poses (n, 4, 4). No endTime: the robot's clock."""
    turns = np.unwrap(np.arctan2(poses[:, 1, 0], poses[:, 0, 0]))
    points = [
        {
            "pose": {"position": {"x": number(x), "y": number(y)}, "angle": number(turn)},
            "timeSinceReference": _since(time, times),
        }
        for time, (x, y), turn in zip(times, poses[:, :2, 3], turns, strict=True)
    ]
    return {"se2FrameName": frame, "trajectory": {"points": points}}


def thinned(times: Array) -> Array:
    """Indices of the samples nearest to every `STEP` seconds, first and last included."""
    wanted = np.linspace(times[0], times[-1], max(2, int(np.ceil((times[-1] - times[0]) / STEP - 1e-9)) + 1))
    return np.unique(np.abs(times[:, None] - wanted).argmin(axis=0))


def _points(times: Array, poses: Array) -> list[dict[str, Any]]:
    quaternions = smooth_quaternions_wxyz(poses[:, :3, :3])
    return [
        {"pose": _pose(pose, q), "timeSinceReference": _since(time, times)}
        for time, pose, q in zip(times, poses, quaternions, strict=True)
    ]


def _since(time: float, times: Array) -> str:
    return f"{number(time - times[0]):.9f}s"


def _json(message: dict[str, Any]) -> bytes:
    return (json.dumps(message, indent=1, allow_nan=False) + "\n").encode()


def _pose(pose: Array, quaternion_wxyz: Array | None = None) -> dict[str, Any]:
    w, x, y, z = (
        smooth_quaternions_wxyz(pose[None, :3, :3])[0] if quaternion_wxyz is None else quaternion_wxyz
    )
    return {
        "position": {axis: number(v) for axis, v in zip("xyz", pose[:3, 3], strict=True)},
        "rotation": {"x": number(x), "y": number(y), "z": number(z), "w": number(w)},
    }
