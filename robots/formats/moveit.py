"""moveit_msgs/CartesianTrajectory as YAML: the tool's poses, velocities, accelerations in the base frame.

A base that moves is no frame to give poses in: they are given in that of its stance, which stands still.

Source of the fields: moveit/moveit_msgs (ros2), msg/CartesianTrajectory.msg, CartesianTrajectoryPoint.msg and
CartesianPoint.msg; geometry_msgs/msg/{Pose,Twist,Accel}.msg.
"""

from __future__ import annotations

import numpy as np

from robots.formats.ros2 import XYZW, header, standing, xyz
from robots.formats.trajectory_export import (
    PlannedMotion,
    number,
    seconds_nanoseconds,
    smooth_quaternions_wxyz,
    yaml_bytes,
)
from twin import geometry as geo
from twin.geometry import Array

FILES = ("cartesian_trajectory.yaml",)


def render(source: PlannedMotion) -> dict[str, bytes]:
    """The message; positions in m, quaternions xyzw, velocities and accelerations in the axes of the base."""
    t, poses = source.trajectory, source.T_base_tool
    quaternions = smooth_quaternions_wxyz(poses[:, :3, :3])
    linear, angular = velocities(t.times, poses)
    resting = np.all(t.qd == 0, axis=1)
    linear[resting] = angular[resting] = 0.0  # differences of samples can't tell that it stops exactly there
    linear_rate, angular_rate = (np.gradient(v, t.times, axis=0) for v in (linear, angular))
    points = [
        {
            "point": {
                "pose": {
                    "position": xyz(poses[k, :3, 3]),
                    "orientation": {axis: number(quaternions[k, i]) for i, axis in XYZW},
                },
                "velocity": {"linear": xyz(linear[k]), "angular": xyz(angular[k])},
                "acceleration": {"linear": xyz(linear_rate[k]), "angular": xyz(angular_rate[k])},
            },
            "time_from_start": seconds_nanoseconds(float(t.times[k])),
        }
        for k in range(len(t.times))
    ]
    robot = source.robot
    document = {"header": header(robot.base_body), "tracked_frame": robot.tool, "points": points}
    about = f"moveit_msgs/msg/CartesianTrajectory: {source.title}"
    axes = f"{robot.tool}: z out of the hand, y the direction in which the fingers close, between the finger pads"
    units = "m, rad, s; orientations are unit quaternions"
    return {FILES[0]: yaml_bytes(document, [*source.remarks, about, axes, standing(source), units])}


def velocities(times: Array, poses: Array) -> tuple[Array, Array]:
    """Linear (n, 3) m/s and angular (n, 3) rad/s velocity of poses (n, 4, 4) at times (n,), outer frame.

    Second-order differences on uneven steps (Fornberg 1988, as numpy.gradient); rotations by their rotation
    vectors from each sample to its neighbours, weighted in the same way.
    """
    linear = np.gradient(poses[:, :3, 3], times, axis=0)
    r = poses[:, :3, :3]
    step = geo.log_so3(r[1:] @ np.swapaxes(r[:-1], -1, -2)) / np.diff(times)[:, None]
    h = np.diff(times)[:, None]
    inner = (step[:-1] * h[1:] + step[1:] * h[:-1]) / (h[:-1] + h[1:])
    return np.asarray(linear), np.concatenate([step[:1], inner, step[-1:]])
