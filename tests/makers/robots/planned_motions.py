"""Trajectories in closed form: an arm opens a door, alone and on a mobile base; both also closing."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import robots
from benchmarks.scenes import furniture
from robots.formats import PlannedMotion
from robots.model.kinematics import read_chain
from robots.model.mjcf import compiled
from robots.planning.timing import quintic
from robots.trajectory import RobotTrajectory
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
    stands = geo.make_pose(geo.exp_so3([0, 0, 0.7]), [0.4, -0.6, 0.5])
    limits = np.stack([robot.home - 2, robot.home + 2])
    return joined(pieces, twin, robot, T_world_base=stands, pedestal=0.5, limits=limits)


def mobile_base():
    """Spot moves and turns its base while its arm moves; the tool is where the arm carries it."""
    twin = furniture.door("left")
    robot, upper = robots.resolve("spot"), twin.part(2).joint.upper
    chain = read_chain(compiled(robot), robot)
    stands = geo.make_pose(geo.exp_so3([0, 0, -1.1]), [-0.9, -0.7, 0.01])
    a = robot.home + np.array([0.10, -0.05, 0.20, 0.3, 0.1, -0.1, 0.2, -0.1, 0.4])
    b = a + np.array([-0.40, 0.30, 1.3, -0.5, 0.2, 0.2, -0.3, 0.3, -0.6])
    beside, clear = a + 0.01, b - 0.01  # the hand moves while the claw closes and opens
    c, d = a - 0.02, b + 0.03

    def carried(q0, q1):
        return lambda u: stands @ chain.forward((q0 + u * (q1 - q0))[None])[0][0]

    pieces = [
        piece("approach", 0.8, (c, beside), 0.1, carried(c, beside), lambda _: 0.0),
        piece("close", 1.0, (beside, a), 0.0, carried(beside, a), lambda _: 0.0),
        piece("move", 4.0123456789, (a, b), 0.0, carried(a, b), lambda u: u * upper),
        piece("hold", 0.5, (b, b), 0.0, carried(b, b), lambda _: upper),
        piece("open", 0.8, (b, clear), 0.1, carried(b, clear), lambda _: upper),
        piece("retreat", 0.8, (clear, d), 0.1, carried(clear, d), lambda _: upper),
    ]
    limits = np.stack([chain.lower, chain.upper])
    return joined(pieces, twin, robot, T_world_base=stands, pedestal=0.0, limits=limits)


def joined(pieces, twin, robot, **where):
    """The motion made of the pieces, one after the other."""
    part = twin.part(2)
    start, columns = 0.0, {key: [] for key in pieces[0]}
    for k, p in enumerate(pieces):
        skip = 1 if k else 0  # a phase begins one sample after the last one's end
        for key, values in p.items():
            columns[key].append(values[skip:] + start if key == "times" else values[skip:])
        start += p["times"][-1]
    arrays = {key: np.concatenate(v) for key, v in columns.items() if key != "phases"}
    phases = tuple(x for p in columns["phases"] for x in p)
    arrays["qd"][-1] = 0.0
    trajectory = RobotTrajectory(
        robot=robot.name, twin=twin.name, part_id=part.id, part=part.name, joint_names=robot.arm_joints,
        **arrays, phases=phases, position_error=np.zeros(len(phases)), velocity_limits=robot.velocity,
        goal=part.joint.upper, grasp="bar", score=1.0, clearance=0.02, **where,
    )  # fmt: skip
    return PlannedMotion(trajectory, part, robot)


def closing(source):
    """The same motion backwards: what was opened is closed."""
    t = source.trajectory
    order = {"retreat": "approach", "open": "close", "hold": "close", "move": "move", "close": "open", "approach": "retreat"}  # fmt: skip
    # a sample belongs to the phase that leads to it: backwards, that is the phase of the sample after it
    phases = tuple(order[p] for p in (t.phases[-1], *reversed(t.phases[1:])))
    opened = np.isin(phases, ["approach", "open", "retreat"])
    flipped = {key: getattr(t, key)[::-1] for key in ("q", "part_state", "T_world_tool", "position_error")}
    backwards = replace(
        t, **flipped, times=t.times[-1] - t.times[::-1], qd=-t.qd[::-1], phases=phases,
        gripper=np.where(opened, t.gripper.max(), 0.0), start=t.goal, goal=t.start,
    )  # fmt: skip
    return PlannedMotion(backwards, source.part, source.robot)


SOURCES = {
    "arm opens": door,
    "arm closes": lambda: closing(door()),
    "mobile base opens": mobile_base,
    "mobile base closes": lambda: closing(mobile_base()),
}


def stacked(rotations, translations):
    """Poses (n, 4, 4) of rotations (n, 3, 3) and translations (n, 3)."""
    poses = np.tile(np.eye(4), (len(translations), 1, 1))
    poses[:, :3, :3], poses[:, :3, 3] = rotations, translations
    return poses


def contents(folder):
    """Every file of a folder by its path in it."""
    return {p.relative_to(folder).as_posix(): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


@cache
def read_yaml(path):
    """A YAML file, by libyaml where PyYAML has it: ten times as fast."""
    yaml = pytest.importorskip("yaml")
    return yaml.load(path.read_text(encoding="utf-8"), getattr(yaml, "CSafeLoader", yaml.SafeLoader))
