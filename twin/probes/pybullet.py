"""PyBullet reads URDF."""

from __future__ import annotations

import re
import tempfile
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import pybullet as bullet

from .common import Array, edited_urdf, keep, pose, rotation_xyzw, tensor, without_step_error

VERSION = version("pybullet")
KINDS = {bullet.JOINT_REVOLUTE: "revolute", bullet.JOINT_PRISMATIC: "prismatic"}
STEP = 4e-4  # s


def read(path: Path, fmt: str, job: dict[str, Any]) -> dict[str, Any]:
    """Measure every part of the model in `path`; the rollout is that of a copy without joint limits."""
    del fmt
    client = bullet.connect(bullet.DIRECT)
    try:
        body, info, links, found = _load(path, job)
        _set(body, found, [0.0] * len(found))
        out = {n: _part(body, info, j, links[n]) for n, j in found.items()}
        rest = {j: _frame(body, j) for j in found.values()}
        for row in job["states"]:
            _set(body, found, row)
            for n, j in found.items():
                out[n]["motion"].append((_frame(body, j) @ np.linalg.inv(rest[j])).tolist())
        moving = [i[0] for i in info if i[3] >= 0]  # the order of its state vectors
        index = [moving.index(j) for j in found.values()]
        q = np.zeros(len(moving))
        q[index] = job["state"]
        keep(out, "mass_diagonal", np.diag(_mass_matrix(body, len(info), q))[index], list(found))
        with tempfile.TemporaryDirectory() as folder:
            bullet.resetSimulation()
            body, info, _, found = _load(edited_urdf(path, Path(folder), visuals=True, limits=False), job)
        _rollout(body, len(info), found, job, out)
        return out
    finally:
        bullet.disconnect(client)


def tidy(lines: list[str]) -> list[str]:
    """Its warnings, one a line: it breaks lines anywhere, and says what is wrong and then with which link."""
    pieces = [x.strip() for x in re.split(r"b3(?:Warning|Error)\[[^]]*\]:", " ".join(lines)) if x.strip()]
    out: list[str] = []
    for piece in pieces:
        if out and out[-1].endswith("local inertial frame"):
            out[-1] += f": {piece}"
        else:
            out.append(piece)
    return out


def _load(path: Path, job: dict[str, Any]) -> tuple[int, list[Any], dict[str, int], dict[str, int]]:
    """The body, what it knows of every joint, its links by name, and the joints of the parts."""
    flags = bullet.URDF_USE_INERTIA_FROM_FILE  # else it makes up tensors from the collision shapes
    body = bullet.loadURDF(str(path), useFixedBase=True, flags=flags)
    info = [bullet.getJointInfo(body, j) for j in range(bullet.getNumJoints(body))]
    joints = {i[1].decode(): i[0] for i in info}
    return body, info, {i[12].decode(): i[0] for i in info}, {n: joints[f"{n}_joint"] for n in job["parts"]}


def _set(body: int, found: dict[str, int], states: list[float]) -> None:
    for j, s in zip(found.values(), states, strict=True):
        bullet.resetJointState(body, j, s)


def _frame(body: int, link: int) -> Array:
    """Pose of a link's frame. Its own answer for it is in single precision, so it is taken from that of the centre of mass."""
    state, dynamics = (
        bullet.getLinkState(body, link, computeForwardKinematics=1),
        bullet.getDynamicsInfo(body, link),
    )
    center = pose(rotation_xyzw(state[1]), state[0])
    return center @ np.linalg.inv(pose(rotation_xyzw(dynamics[4]), dynamics[3]))


def _part(body: int, info: list[Any], j: int, link: int) -> dict[str, Any]:
    joint, state, dynamics = (
        info[j],
        bullet.getLinkState(body, link, computeForwardKinematics=1),
        bullet.getDynamicsInfo(body, link),
    )
    center = rotation_xyzw(state[1])
    # its axis is given in the frame of the centre of mass; the joint's frame is the link's
    return {
        "parent": "" if joint[16] < 0 else info[joint[16]][12].decode(),
        "type": KINDS.get(joint[2], str(joint[2])),
        "axis": (center @ np.array(joint[13])).tolist(),
        "pivot": _frame(body, link)[:3, 3].tolist(),
        "lower": float(joint[8]),
        "upper": float(joint[9]),
        "damping": float(joint[6]),
        "frictionloss": float(joint[7]),
        "mass": float(dynamics[0]),
        "com": list(state[0]),
        "inertia": tensor(center, dynamics[2]),
        "motion": [],
    }


def _mass_matrix(body: int, links: int, q: Array) -> Array:
    """Joint-space inertia (n, n) at q. It refuses a tensor which its own rounding makes unsymmetric by 1e-15 kg m2, as that of
    a heavy link: such a model is asked again with lighter links, and the answer, linear in mass, made heavier by as much."""
    weights = [bullet.getDynamicsInfo(body, link)[:3] for link in range(links)]
    for lighter in (1.0, 1e-3, 1e-6):
        for link, (mass, _, moments) in enumerate(weights):
            moments = [m * lighter for m in moments]
            bullet.changeDynamics(body, link, mass=mass * lighter, localInertiaDiagonal=moments)
        try:
            return np.array(bullet.calculateMassMatrix(body, q.tolist())) / lighter
        except SystemError:
            continue
    raise ValueError("PyBullet computes no mass matrix")


def _rollout(body: int, links: int, found: dict[str, int], job: dict[str, Any], out: dict[str, Any]) -> None:
    for link in range(-1, links):
        bullet.setCollisionFilterGroupMask(body, link, 0, 0)
        # it slows every body by 4 % a second unless told not to
        bullet.changeDynamics(body, link, linearDamping=0.0, angularDamping=0.0, maxJointVelocity=1e4)
    for j in found.values():
        bullet.setJointMotorControl2(
            body, j, bullet.VELOCITY_CONTROL, force=0.0
        )  # a motor that holds it still
    bullet.setGravity(0.0, 0.0, -9.81)

    def simulate(step: float) -> Array:
        bullet.setTimeStep(step)
        course, done = [], 0
        for j, q, v in zip(found.values(), job["position"], job["velocity"], strict=True):
            bullet.resetJointState(body, j, q, v)
        for until in job["times"]:
            for _ in range(round(until / step) - done):
                bullet.stepSimulation()
            done = round(until / step)
            course.append([bullet.getJointState(body, j)[0] for j in found.values()])
        return np.array(course)

    keep(out, "rollout", without_step_error(simulate, STEP), list(found))
