"""Spot's impedance control of the arm: bosdyn.api.ArmImpedanceCommand.Request in protobuf's JSON, one file a leg.

Source of the fields: Spot SDK, protos/bosdyn/api/{arm_command,trajectory,geometry}.proto. Largest stiffness and damping:
the SDK's example arm_impedance_control. Force and torque caps: the defaults that arm_command.proto states.

The command is about the tool alone, so any robot's trajectory can be given to Spot. The task frame is the tool frame at
the trajectory's first sample (the hand 10 cm in front of the handle, opened): whoever sends the command sets
`rootTformTask` to where that is for the robot at hand, by default the pose in the base frame of the plan.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Any

import numpy as np

from robots.formats.handover import Handover, number, smooth_quaternions_wxyz
from twin import geometry as geo
from twin.errors import ConfigError
from twin.geometry import Array

LEGS = ("approach", "move", "retreat")
FILES = tuple(f"spot/arm_impedance_{k}_{leg}.json" for k, leg in enumerate(LEGS, 1))
STEP = 0.1  # s between points, chosen by us: the robot interpolates, and short messages arrive sooner

# Ours: z out of the hand, y the closing direction. Spot's wrist (link_wr1): x out of the hand, y the jaw's hinge, so the
# jaw closes along z. Origin: the SDK's default tool, in front of the palm plate.
WRIST_T_TOOL = geo.make_pose([[0, 0, 1], [1, 0, 0], [0, 1, 0]], [0.19557, 0, 0])


@dataclass(frozen=True)
class Impedance:
    """Diagonal stiffness (N/m, N m/rad) and damping (N s/m, N m s/rad) in the tool frame, caps of force (N), torque (N m).

    Defaults: the largest stiffness and damping that Spot takes, and the caps that it uses by itself.
    Raises ConfigError outside of these.
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


def render(source: Handover) -> dict[str, bytes]:
    """A command for each leg that the trajectory has; in between the hand rests and closes (after 1) or opens (after 2)."""
    t = source.trajectory
    phases = np.array(t.phases)
    impedance = Impedance()
    start = t.T_world_tool[0]
    base = source.T_base_tool[0]
    files = {}
    for path, leg in zip(FILES, LEGS, strict=True):
        at = np.flatnonzero(phases == leg)
        if len(at) == 0:
            continue
        # the rest before a leg ends where the leg begins; its last sample is the leg's first point
        at = np.concatenate([[max(at[0] - 1, 0)], at]) if at[0] else at
        poses = geo.invert_pose(start) @ t.T_world_tool[at]
        keep = thinned(t.times[at])
        points = _points(t.times[at][keep], poses[keep])
        text = json.dumps(request(points, base, impedance), indent=1, allow_nan=False)
        files[path] = (text + "\n").encode()
    return files


def request(points: list[dict[str, Any]], root_T_task: Array, impedance: Impedance) -> dict[str, Any]:
    """The message as a mapping, keys in lowerCamelCase as protobuf's JSON has them."""
    return {
        "rootFrameName": "body",
        "rootTformTask": _pose(root_T_task),
        "wristTformTool": _pose(WRIST_T_TOOL),
        "taskTformDesiredTool": {"points": points},
        "diagonalStiffnessMatrix": {"values": list(impedance.stiffness)},
        "diagonalDampingMatrix": {"values": list(impedance.damping)},
        "maxForceMag": impedance.max_force,
        "maxTorqueMag": impedance.max_torque,
        "disableSafetyCheck": False,
    }


def thinned(times: Array) -> Array:
    """Indices of the samples nearest to every `STEP` seconds, first and last included."""
    wanted = np.linspace(times[0], times[-1], max(2, int(np.ceil((times[-1] - times[0]) / STEP - 1e-9)) + 1))
    return np.unique(np.abs(times[:, None] - wanted).argmin(axis=0))


def _points(times: Array, poses: Array) -> list[dict[str, Any]]:
    quaternions = smooth_quaternions_wxyz(poses[:, :3, :3])
    return [
        {"pose": _pose(pose, q), "timeSinceReference": f"{number(time - times[0]):.9f}s"}
        for time, pose, q in zip(times, poses, quaternions, strict=True)
    ]


def _pose(pose: Array, quaternion_wxyz: Array | None = None) -> dict[str, Any]:
    w, x, y, z = (
        smooth_quaternions_wxyz(pose[None, :3, :3])[0] if quaternion_wxyz is None else quaternion_wxyz
    )
    return {
        "position": {axis: number(v) for axis, v in zip("xyz", pose[:3, 3], strict=True)},
        "rotation": {"x": number(x), "y": number(y), "z": number(z), "w": number(w)},
    }
