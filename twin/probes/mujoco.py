"""MuJoCo reads URDF, MJCF and USD."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

KINDS = {int(mujoco.mjtJoint.mjJNT_HINGE): "revolute", int(mujoco.mjtJoint.mjJNT_SLIDE): "prismatic"}


def read(path: Path, fmt: str, parts: list[str], states: list[list[float]]) -> dict[str, Any]:
    """Measure every part of the model in `path`."""
    if fmt == "usd":
        import_module("mujoco._usd")  # registers the schemas: before any other use of pxr in this process
    model = mujoco.MjSpec.from_file(str(path)).compile()
    data = mujoco.MjData(model)
    bodies = {model.body(b).name.split("/")[-1]: b for b in range(model.nbody)}
    joints = {model.joint(j).name.split("/")[-1]: j for j in range(model.njnt)}
    out: dict[str, Any] = {}
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    for name in parts:
        b, j = bodies[name], joints[f"{name}_joint"]
        dof = int(model.jnt_dofadr[j])
        turn = data.ximat[b].reshape(3, 3)
        out[name] = {
            "type": KINDS[int(model.jnt_type[j])],
            "axis": data.xaxis[j].tolist(),
            "pivot": data.xanchor[j].tolist(),
            "lower": float(model.jnt_range[j, 0]),
            "upper": float(model.jnt_range[j, 1]),
            "damping": float(model.dof_damping[dof]),
            "frictionloss": float(model.dof_frictionloss[dof]),
            "mass": float(model.body_mass[b]),
            "com": data.xipos[b].tolist(),
            "inertia": (turn @ np.diag(model.body_inertia[b]) @ turn.T).tolist(),
            "bounds": _bounds(model, data, b),
            "motion": [],
        }
    _motion(model, data, {n: (bodies[n], joints[f"{n}_joint"]) for n in parts}, states, out)
    if fmt == "urdf":  # the only format in which MuJoCo looks at contact between a part and the static scene
        _sweep(model, data, {n: (bodies[n], joints[f"{n}_joint"]) for n in parts}, out)
    return out


def _bounds(model: Any, data: Any, body: int) -> list[list[float]] | None:
    """Bounds (2, 3) of the visual mesh in the world, null without one."""
    for g in range(model.ngeom):
        if model.geom_bodyid[g] == body and model.geom_contype[g] == 0 and model.geom_dataid[g] >= 0:
            mesh = model.mesh(int(model.geom_dataid[g]))
            start, count = int(mesh.vertadr[0]), int(mesh.vertnum[0])
            v = model.mesh_vert[start : start + count].astype(np.float64)
            world = v @ data.geom_xmat[g].reshape(3, 3).T + data.geom_xpos[g]
            return [world.min(axis=0).tolist(), world.max(axis=0).tolist()]
    return None


def _pose(data: Any, body: int) -> Any:
    t = np.eye(4)
    t[:3, :3], t[:3, 3] = data.xmat[body].reshape(3, 3), data.xpos[body]
    return t


def _motion(
    model: Any, data: Any, found: dict[str, tuple[int, int]], states: list[list[float]], out: dict[str, Any]
) -> None:
    rest = {n: np.linalg.inv(_pose(data, b)) for n, (b, _) in found.items()}
    for row in states:
        for (_, j), s in zip(found.values(), row, strict=True):
            data.qpos[model.jnt_qposadr[j]] = s
        mujoco.mj_kinematics(model, data)
        for n, (b, _) in found.items():
            out[n]["motion"].append((_pose(data, b) @ rest[n]).tolist())


def _sweep(model: Any, data: Any, found: dict[str, tuple[int, int]], out: dict[str, Any]) -> None:
    """Greatest depth (m) of a contact of each part while it alone opens, in 11 states."""
    for n, (b, j) in found.items():
        deepest = 0.0
        for s in np.linspace(model.jnt_range[j, 0], model.jnt_range[j, 1], 11):
            data.qpos[:] = 0.0
            data.qpos[model.jnt_qposadr[j]] = s
            mujoco.mj_kinematics(model, data)
            mujoco.mj_comPos(model, data)
            mujoco.mj_collision(model, data)
            for c in data.contact:
                if b in (model.geom_bodyid[c.geom[0]], model.geom_bodyid[c.geom[1]]):
                    deepest = max(deepest, -float(c.dist))
        out[n]["collision"] = deepest
