"""trajectory_msgs/JointTrajectory as YAML, for `ros2 topic pub` or a joint trajectory controller.

Source of the fields: ros2/common_interfaces, trajectory_msgs/msg/JointTrajectory.msg and JointTrajectoryPoint.msg,
std_msgs/msg/Header.msg, builtin_interfaces/msg/{Time,Duration}.msg.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from robots.formats.handover import Handover, number, seconds_nanoseconds, yaml_bytes
from twin.geometry import Array

FILES = ("joint_trajectory.yaml", "gripper_trajectory.yaml")


def render(source: Handover) -> dict[str, bytes]:
    """The arm's trajectory and the gripper's, which share their clock.

    Positions are in rad, velocities in rad/s, finger positions in m. Accelerations and efforts stay empty: a controller
    that is given positions and velocities interpolates with cubics, which is what the replay did too. A stamp
    of 0 means "start on receipt". The fingers' last metres are a command, not a place: 0 asks for full grip force.
    """
    t, robot = source.trajectory, source.robot
    opening = np.repeat(t.gripper[:, None] / len(robot.gripper_joints), len(robot.gripper_joints), axis=1)
    about = f"trajectory_msgs/msg/JointTrajectory: {t.robot} opens {t.part} of {t.twin}"
    where = f"frame_id is the robot's base; it stands at {_place(t.T_world_base)} of the twin's world"
    arm = message(robot.base_body, t.joint_names, t.times, t.q, t.qd)
    hand = message(robot.base_body, robot.gripper_joints, t.times, opening, None)
    grip = f"m of each finger; 0 closes with the full force, in the replay {robot.force:g} N"
    return {
        FILES[0]: yaml_bytes(arm, [about, where, "rad, rad/s"]),
        FILES[1]: yaml_bytes(hand, [about, "the gripper, on the arm's clock", grip]),
    }


def message(
    frame: str, joints: Sequence[str], times: Array, positions: Array, velocities: Array | None
) -> dict[str, Any]:
    """The message as a mapping: times (n,) s, positions and velocities (n, j)."""
    points = [
        {
            "positions": [number(v) for v in positions[k]],
            "velocities": [] if velocities is None else [number(v) for v in velocities[k]],
            "accelerations": [],
            "effort": [],
            "time_from_start": seconds_nanoseconds(float(times[k])),
        }
        for k in range(len(times))
    ]
    return {"header": header(frame), "joint_names": list(joints), "points": points}


def header(frame: str) -> dict[str, Any]:
    """std_msgs/Header of a message that holds from its receipt on."""
    return {"stamp": {"sec": 0, "nanosec": 0}, "frame_id": frame}


def _place(pose: Array) -> str:
    x, y, z = (number(v) for v in pose[:3, 3])
    yaw = number(np.arctan2(pose[1, 0], pose[0, 0]))
    return f"x {x:.6f} y {y:.6f} z {z:.6f} m, yaw {yaw:.6f} rad"
