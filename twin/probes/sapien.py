"""SAPIEN reads URDF. PhysX computes in single precision."""

from __future__ import annotations

import tempfile
from importlib.metadata import version
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np
import sapien

from .common import Array, edited_urdf, keep, pose, rotation_xyzw, stepped, tensor, without_step_error

VERSION = version("sapien")
STEP = 2e-3  # s, the largest


def read(path: Path, fmt: str, job: dict[str, Any]) -> dict[str, Any]:
    """Measure every part of the model in `path`. Visuals are taken out first: SAPIEN needs a GPU for them."""
    del fmt
    system = sapien.physx.PhysxCpuSystem()
    scene = sapien.Scene([system])
    with tempfile.TemporaryDirectory() as folder:
        loader = scene.create_urdf_loader()
        model = loader.load(str(edited_urdf(path, Path(folder), visuals=False, limits=True)))
    _weightless(model, path)
    parts = job["parts"]
    links = {k.name: k for k in model.links}
    joints = {j.name: j for j in model.active_joints}
    order = list(joints)
    index = [order.index(f"{n}_joint") for n in parts]

    def put(values: list[float], speed: list[float] | None = None) -> None:
        q, v = np.zeros(len(order)), np.zeros(len(order))
        q[index], v[index] = values, speed or 0.0
        model.set_qpos(q)
        model.set_qvel(v)

    put([0.0] * len(parts))
    out = {n: _part(joints[f"{n}_joint"], links[n]) for n in parts}
    rest = {n: _pose(links[n].entity.pose) for n in parts}
    for row in job["states"]:
        put(row)
        for n in parts:
            out[n]["motion"].append((_pose(links[n].entity.pose) @ np.linalg.inv(rest[n])).tolist())
    q = np.zeros(len(order))
    q[index] = job["state"]
    mass = model.create_pinocchio_model().compute_generalized_mass_matrix(q)
    keep(out, "mass_diagonal", np.diag(mass)[index], parts)
    for (
        k
    ) in model.links:  # SAPIEN slows every body by 5 % a second, and stops it at 10 m/s, unless told not to
        k.linear_damping = k.angular_damping = 0.0
        k.max_linear_velocity = k.max_angular_velocity = 1e4
        for shape in k.collision_shapes:
            shape.set_collision_groups([0, 0, 0, 0])
    for j in model.active_joints:
        j.set_friction(0.0)
        j.set_limits([[-1e4, 1e4]])
        j.set_max_velocity(1e4)
    model.set_sleep_threshold(0.0)

    def simulate(step: float) -> Array:
        scene.set_timestep(step)
        put(job["position"], job["velocity"])
        return stepped(job["times"], step, scene.step, lambda: model.get_qpos()[index])

    keep(out, "rollout", without_step_error(simulate, STEP, enough=1e-3), parts)
    return out


def _weightless(model: Any, path: Path) -> None:
    """Take away what SAPIEN gives to links which the file says weigh nothing: 1e-6 kg and 1e-6 kg m2."""
    root = ET.parse(path).getroot()  # noqa: S314  (a file that was just exported, in a process of its own)
    masses = {x.get("name"): float(m.get("value", 1)) for x in root.iter("link") for m in x.iter("mass")}
    for k in model.links:
        if masses.get(k.name) == 0.0:
            k.set_mass(1e-12)
            k.set_inertia([1e-15] * 3)


def _pose(p: Any) -> Array:
    w, x, y, z = map(float, p.q)
    return pose(rotation_xyzw([x, y, z, w]), np.asarray(p.p, dtype=np.float64))


def _part(joint: Any, link: Any) -> dict[str, Any]:
    frame = _pose(link.entity.pose) @ _pose(joint.pose_in_child)
    center = _pose(link.entity.pose) @ _pose(link.cmass_local_pose)
    return {
        "parent": joint.parent_link.name,
        "type": joint.type.removesuffix("_unwrapped"),
        "axis": frame[:3, 0].tolist(),
        "pivot": frame[:3, 3].tolist(),
        "lower": float(joint.limit[0][0]),
        "upper": float(joint.limit[0][1]),
        "damping": float(joint.damping),
        "frictionloss": float(joint.friction),
        "mass": float(link.mass),
        "com": center[:3, 3].tolist(),
        "inertia": tensor(center[:3, :3], np.asarray(link.inertia, dtype=np.float64)),
        "motion": [],
    }
