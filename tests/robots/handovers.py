"""A trajectory in closed form that opens a door, to be handed over."""

from __future__ import annotations

import numpy as np

import robots
from robots.formats import Handover
from robots.timing import quintic
from robots.trajectory import RobotTrajectory
from tests.robots import furniture
from twin import geometry as geo


def piece(phase, seconds, q, gripper, tools, states):
    """One phase: joints (2, j) from and to, tool poses and part states as functions of the share 0..1."""
    t, share, rate = quintic(seconds, 0.02)
    q0, q1 = q
    n = len(t)
    return {
        "times": t, "q": q0 + share[:, None] * (q1 - q0), "qd": rate[:, None] * (q1 - q0),
        "gripper": np.full(n, gripper), "phases": (phase,) * n, "part_state": np.array([states(u) for u in share]),
        "T_world_tool": np.stack([tools(u) for u in share]),
    }  # fmt: skip


def door():
    """A door in closed form: the tool comes straight, turns with the door, leaves straight."""
    twin = furniture.door("left")
    part, robot = twin.part(2), robots.resolve("franka")
    joint = part.joint
    grip = geo.make_pose(np.array([[0, -1, 0], [0, 0, 1], [-1, 0, 0]]).T, part.contact.point)
    back = geo.make_pose(translation=[0, 0, -0.1])
    end = joint.pose(joint.upper) @ grip
    a, b = robot.home, robot.home + np.array([0.6, 0.3, -0.2, 0.4, 0.1, 0.2, -0.5])
    c, d = a - 0.1, b - 0.1

    def along(pose, u):
        return pose @ geo.make_pose(translation=back[:3, 3] * (1 - u))

    pieces = [
        piece("approach", 0.8, (c, a), 0.08, lambda u: along(grip, u), lambda _: 0.0),
        piece("close", 1.0, (a, a), 0.0, lambda _: grip, lambda _: 0.0),
        piece("move", 4.0123456789, (a, b), 0.0, lambda u: joint.pose(u * joint.upper) @ grip, lambda u: u * joint.upper),
        piece("hold", 0.5, (b, b), 0.0, lambda _: end, lambda _: joint.upper),
        piece("open", 0.8, (b, b), 0.08, lambda _: end, lambda _: joint.upper),
        piece("retreat", 0.8, (b, d), 0.08, lambda u: along(end, 1 - u), lambda _: joint.upper),
    ]  # fmt: skip
    start, columns = 0.0, {key: [] for key in pieces[0]}
    for k, p in enumerate(pieces):
        skip = 1 if k else 0  # a phase begins one sample after the last one's end
        for key, values in p.items():
            columns[key].append(values[skip:] + start if key == "times" else values[skip:])
        start += p["times"][-1]
    joined = {key: np.concatenate(v) for key, v in columns.items() if key != "phases"}
    phases = tuple(x for p in columns["phases"] for x in p)
    joined["qd"][-1] = 0.0
    trajectory = RobotTrajectory(
        robot="franka", twin=twin.name, part_id=part.id, part=part.name, joint_names=robot.arm_joints,
        **joined, phases=phases, position_error=np.zeros(len(phases)),
        T_world_base=geo.make_pose(geo.exp_so3([0, 0, 0.7]), [0.4, -0.6, 0.5]), pedestal=0.5,
        limits=np.stack([robot.home - 2, robot.home + 2]), velocity_limits=robot.velocity, goal=joint.upper,
        grasp="bar", score=1.0, clearance=0.02,
    )  # fmt: skip
    return Handover(trajectory, part, robot)


def stacked(rotations, translations):
    """Poses (n, 4, 4) of rotations (n, 3, 3) and translations (n, 3)."""
    poses = np.tile(np.eye(4), (len(translations), 1, 1))
    poses[:, :3, :3], poses[:, :3, 3] = rotations, translations
    return poses


def contents(folder):
    """Every file of a folder by its path in it."""
    return {p.relative_to(folder).as_posix(): p.read_bytes() for p in folder.rglob("*") if p.is_file()}
