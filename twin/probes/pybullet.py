"""PyBullet reads URDF."""

from __future__ import annotations

import re
import tempfile
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import pybullet as bullet

from .common import Array, edited_urdf, keep, pose, rotation_xyzw, stepped, tensor, without_step_error

VERSION = version("pybullet")
KINDS = {bullet.JOINT_REVOLUTE: "revolute", bullet.JOINT_PRISMATIC: "prismatic"}
STEP = 2e-3  # s, the largest


def read(path: Path, fmt: str, job: dict[str, Any]) -> dict[str, Any]:
    """Measure every part of the model in `path`; its dynamics are those of a copy without joint limits."""
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
        with tempfile.TemporaryDirectory() as folder:
            bullet.resetSimulation()
            body, info, _, found = _load(edited_urdf(path, Path(folder), visuals=True, limits=False), job)
        moving = [i[0] for i in info if i[3] >= 0]
        _free(body, len(info), moving)
        mass = _mass_matrix(body, moving, found, job["state"])
        keep(out, "mass_diagonal", np.diag(mass)[[moving.index(j) for j in found.values()]], list(found))
        _rollout(body, found, job, out)
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
    """Pose of a link's frame, from that of the centre of mass: its own answer is in single precision."""
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


def _free(body: int, links: int, moving: list[int]) -> None:
    """Let the body move by its joints' damping and inertia alone."""
    for link in range(-1, links):
        bullet.setCollisionFilterGroupMask(body, link, 0, 0)
        # it slows every body by 4 % a second unless told not to
        bullet.changeDynamics(body, link, linearDamping=0.0, angularDamping=0.0, maxJointVelocity=1e4)
    for j in moving:
        # a motor that holds it still
        bullet.setJointMotorControl2(body, j, bullet.VELOCITY_CONTROL, force=0.0)


def _mass_matrix(body: int, moving: list[int], found: dict[str, int], state: list[float]) -> Array:
    """Joint-space inertia (n, n): the inverse of the answer to a small force on each joint, without weight.

    Its own calculateMassMatrix refuses models whose tensors its rounding made unsymmetric by 1e-15 kg m2.
    """
    force, step = 1e-6, 1e-3
    bullet.setGravity(0.0, 0.0, 0.0)
    bullet.setTimeStep(step)
    answers = []
    for pushed in moving:
        _set(body, found, state)
        bullet.setJointMotorControl2(body, pushed, bullet.TORQUE_CONTROL, force=force)
        bullet.stepSimulation()
        answers.append([bullet.getJointState(body, j)[1] / (step * force) for j in moving])
    return np.asarray(np.linalg.inv(np.array(answers).T))


def _rollout(body: int, found: dict[str, int], job: dict[str, Any], out: dict[str, Any]) -> None:
    bullet.setGravity(0.0, 0.0, -9.81)

    def simulate(step: float) -> Array:
        bullet.setTimeStep(step)
        for j, q, v in zip(found.values(), job["position"], job["velocity"], strict=True):
            bullet.resetJointState(body, j, q, v)
        return stepped(
            job["times"],
            step,
            bullet.stepSimulation,
            lambda: [bullet.getJointState(body, j)[0] for j in found.values()],
        )

    keep(out, "rollout", without_step_error(simulate, STEP, enough=1e-4), list(found))
