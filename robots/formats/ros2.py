"""trajectory_msgs/JointTrajectory as YAML, for `ros2 topic pub` or a joint trajectory controller.

The joints of a planar base are no arm's: the way of the body that they carry is a file of its own, a
trajectory_msgs/MultiDOFJointTrajectory, the message in which MoveIt too keeps planar joints apart from single
ones.

Source of the fields: ros2/common_interfaces, trajectory_msgs/msg/{JointTrajectory,JointTrajectoryPoint,
MultiDOFJointTrajectory,MultiDOFJointTrajectoryPoint}.msg, geometry_msgs/msg/{Transform,Twist}.msg,
std_msgs/msg/Header.msg, builtin_interfaces/msg/{Time,Duration}.msg.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from robots.formats.trajectory_export import (
    PlannedMotion,
    number,
    seconds_nanoseconds,
    smooth_quaternions_wxyz,
    yaml_bytes,
)
from twin.geometry import Array

FILES = ("joint_trajectory.yaml", "gripper_trajectory.yaml", "base_trajectory.yaml")


def render(source: PlannedMotion) -> dict[str, bytes]:
    """The arm's trajectory, the gripper's and, of a planar base, that of the body; they share their clock.

    Positions are in rad, velocities in rad/s, fingers that slide in m. Accelerations and efforts stay empty:
    a controller interpolates positions and velocities with cubics, as the replay did. A stamp of 0 means
    "start on receipt". The fingers' last value is a command, not a place: closed asks for full grip force.
    """
    t, robot, n = source.trajectory, source.robot, source.base
    about = f"trajectory_msgs/msg/JointTrajectory: {source.title}"
    where = (
        standing(source) if n == 0 else f"frame_id is the body that base_trajectory.yaml moves: {source.body}"
    )
    arm = message(source.body, t.joint_names[n:], t.times, t.q[:, n:], t.qd[:, n:])
    jaws = np.stack([robot.jaws(float(opening)) for opening in t.gripper])
    hand = message(source.body, robot.gripper_joints, t.times, jaws, None)
    unit, closed = (
        ("m of each finger", 0.0) if robot.gripper_kind == "parallel" else ("rad", robot.jaw_closed)
    )
    grip = f"{unit}; {closed:g} closes with the full force, in the replay {robot.force:g} N"
    files = {
        FILES[0]: yaml_bytes(arm, [*source.remarks, about, where, "rad, rad/s"]),
        FILES[1]: yaml_bytes(hand, [*source.remarks, about, "the gripper, on the arm's clock", grip]),
    }
    if n:
        about = f"trajectory_msgs/msg/MultiDOFJointTrajectory: {source.title}"
        axes = f"poses and velocities of {source.body} in frame_id, on the arm's clock; m, rad, s"
        files[FILES[2]] = yaml_bytes(base_message(source), [*source.remarks, about, standing(source), axes])
    return files


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


def base_message(source: PlannedMotion) -> dict[str, Any]:
    """The body's way in the frame of the stance; its one joint is named after it."""
    t, poses, velocities = source.trajectory, source.T_base_body, source.body_velocity
    quaternions = smooth_quaternions_wxyz(poses[:, :3, :3])
    points = [
        {
            "transforms": [
                {
                    "translation": xyz(poses[k, :3, 3]),
                    "rotation": {axis: number(quaternions[k, i]) for i, axis in XYZW},
                }
            ],
            "velocities": [{"linear": xyz(velocities[k, :3]), "angular": xyz(velocities[k, 3:])}],
            "accelerations": [],
            "time_from_start": seconds_nanoseconds(float(t.times[k])),
        }
        for k in range(len(t.times))
    ]
    return {"header": header(source.robot.base_body), "joint_names": [source.body], "points": points}


XYZW = ((1, "x"), (2, "y"), (3, "z"), (0, "w"))  # where a message's names are in a quaternion wxyz


def xyz(vector: Array) -> dict[str, Any]:
    """A message of a vector (3,)."""
    return {axis: number(v) for axis, v in zip("xyz", vector, strict=True)}


def header(frame: str) -> dict[str, Any]:
    """std_msgs/Header of a message that holds from its receipt on."""
    return {"stamp": {"sec": 0, "nanosec": 0}, "frame_id": frame}


def standing(source: PlannedMotion) -> str:
    """A comment that tells what `frame_id` is and where it stands; it is a frame that does not move."""
    pose = source.trajectory.T_world_base
    x, y, z = (number(v) for v in pose[:3, 3])
    yaw = number(np.arctan2(pose[1, 0], pose[0, 0]))
    what = (
        "a fixed frame on the floor, which the robot's body leaves as it moves"
        if source.base
        else "the robot's base"
    )
    floor = source.trajectory.floor
    told = f"; floor {floor.text}" if floor is not None else ""
    return f"frame_id is {what}; it stands at x {x:.6f} y {y:.6f} z {z:.6f} m, yaw {yaw:.6f} rad of the twin's world{told}"
