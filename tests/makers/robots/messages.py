"""Message definitions of other projects as tables of fields, and a judge that knows nothing of our writers.

A type ending in [] is an array; [6] fixes its length. ROS: every field must be there. Protobuf's JSON: fields
may be left out, and none may be there that the definition lacks.
"""

from __future__ import annotations

import re
from typing import Any

# ros2/common_interfaces: std_msgs, geometry_msgs, trajectory_msgs; ros2/rcl_interfaces: builtin_interfaces;
# moveit/moveit_msgs, branch ros2.
ROS: dict[str, dict[str, str]] = {
    "Time": {"sec": "int32", "nanosec": "uint32"},
    "Duration": {"sec": "int32", "nanosec": "uint32"},
    "Header": {"stamp": "Time", "frame_id": "string"},
    "Vector3": {"x": "float64", "y": "float64", "z": "float64"},
    "Point": {"x": "float64", "y": "float64", "z": "float64"},
    "Quaternion": {"x": "float64", "y": "float64", "z": "float64", "w": "float64"},
    "Pose": {"position": "Point", "orientation": "Quaternion"},
    "Transform": {"translation": "Vector3", "rotation": "Quaternion"},
    "Twist": {"linear": "Vector3", "angular": "Vector3"},
    "Accel": {"linear": "Vector3", "angular": "Vector3"},
    "JointTrajectory": {
        "header": "Header",
        "joint_names": "string[]",
        "points": "JointTrajectoryPoint[]",
    },
    "JointTrajectoryPoint": {
        "positions": "float64[]",
        "velocities": "float64[]",
        "accelerations": "float64[]",
        "effort": "float64[]",
        "time_from_start": "Duration",
    },
    "MultiDOFJointTrajectory": {
        "header": "Header",
        "joint_names": "string[]",
        "points": "MultiDOFJointTrajectoryPoint[]",
    },
    "MultiDOFJointTrajectoryPoint": {
        "transforms": "Transform[]",
        "velocities": "Twist[]",
        "accelerations": "Twist[]",
        "time_from_start": "Duration",
    },
    "CartesianTrajectory": {
        "header": "Header",
        "tracked_frame": "string",
        "points": "CartesianTrajectoryPoint[]",
    },
    "CartesianTrajectoryPoint": {"point": "CartesianPoint", "time_from_start": "Duration"},
    "CartesianPoint": {"pose": "Pose", "velocity": "Twist", "acceleration": "Accel"},
}

# What each file of a format holds.
ROS_FILES = {
    "joint_trajectory.yaml": "JointTrajectory",
    "gripper_trajectory.yaml": "JointTrajectory",
    "base_trajectory.yaml": "MultiDOFJointTrajectory",
    "cartesian_trajectory.yaml": "CartesianTrajectory",
}
SPOT_FILES = {
    "arm_impedance": "ArmImpedanceCommand.Request",
    "body": "SE2TrajectoryCommand.Request",
}

# Spot SDK 5: protos/bosdyn/api/{arm_command,basic_command,trajectory,geometry}.proto, in protobuf's JSON
# spelling.
BOSDYN: dict[str, dict[str, str]] = {
    "ArmImpedanceCommand.Request": {
        "rootFrameName": "string",
        "rootTformTask": "SE3Pose",
        "wristTformTool": "SE3Pose",
        "taskTformDesiredTool": "SE3Trajectory",
        "feedForwardWrenchAtToolInDesiredTool": "Wrench",
        "diagonalStiffnessMatrix": "Vector",
        "diagonalDampingMatrix": "Vector",
        "maxForceMag": "float64",
        "maxTorqueMag": "float64",
        "disableSafetyCheck": "bool",
    },
    "SE3Trajectory": {
        "points": "SE3TrajectoryPoint[]",
        "referenceTime": "timestamp",
        "posInterpolation": "string",
        "angInterpolation": "string",
    },
    "SE3TrajectoryPoint": {"pose": "SE3Pose", "velocity": "SE3Velocity", "timeSinceReference": "seconds"},
    "SE2TrajectoryCommand.Request": {
        "endTime": "timestamp",
        "se2FrameName": "string",
        "trajectory": "SE2Trajectory",
    },
    "SE2Trajectory": {
        "points": "SE2TrajectoryPoint[]",
        "referenceTime": "timestamp",
        "interpolation": "string",
    },
    "SE2TrajectoryPoint": {"pose": "SE2Pose", "timeSinceReference": "seconds"},
    "SE2Pose": {"position": "Vec2", "angle": "float64"},
    "Vec2": {"x": "float64", "y": "float64"},
    "SE3Pose": {"position": "Vec3", "rotation": "Quaternion"},
    "SE3Velocity": {"linear": "Vec3", "angular": "Vec3"},
    "Wrench": {"force": "Vec3", "torque": "Vec3"},
    "Vec3": {"x": "float64", "y": "float64", "z": "float64"},
    "Quaternion": {"x": "float64", "y": "float64", "z": "float64", "w": "float64"},
    "Vector": {"values": "float64[]"},
}

_SCALARS = {
    "float64": lambda v: isinstance(v, float),
    "string": lambda v: isinstance(v, str),
    "bool": lambda v: isinstance(v, bool),
    "int32": lambda v: type(v) is int and -(2**31) <= v < 2**31,
    "uint32": lambda v: type(v) is int and 0 <= v < 2**32,
    "seconds": lambda v: isinstance(v, str) and bool(re.fullmatch(r"\d+(\.\d{1,9})?s", v)),
}


def faults(
    value: Any, kind: str, definitions: dict[str, dict[str, str]], where: str = "", *, complete: bool = True
) -> list[str]:
    """Where and how a parsed message differs from its definition; empty when it conforms."""
    where = where or kind
    if kind.endswith("[]"):
        if not isinstance(value, list):
            return [f"{where} is no array"]
        inner = (
            faults(v, kind[:-2], definitions, f"{where}[{k}]", complete=complete) for k, v in enumerate(value)
        )
        return [f for found in inner for f in found]
    if kind in _SCALARS:
        return [] if _SCALARS[kind](value) else [f"{where} = {value!r} is no {kind}"]
    if not isinstance(value, dict):
        return [f"{where} is no {kind}"]
    fields = definitions[kind]
    found = [f"{where}.{name} is not in {kind}" for name in value if name not in fields]
    if complete:
        found += [f"{where} lacks {name}" for name in fields if name not in value]
    for name in fields.keys() & value.keys():
        found += faults(value[name], fields[name], definitions, f"{where}.{name}", complete=complete)
    return found
