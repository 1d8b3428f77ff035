"""MuJoCo reads URDF, MJCF and USD."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from .common import Array, around, bounds, keep, pose, tensor
from .stiff import integrated

VERSION = mujoco.__version__
KINDS = {int(mujoco.mjtJoint.mjJNT_HINGE): "revolute", int(mujoco.mjtJoint.mjJNT_SLIDE): "prismatic"}


def read(path: Path, fmt: str, job: dict[str, Any]) -> dict[str, Any]:
    """Measure every part of the model in `path`."""
    if fmt == "usd":
        import_module("mujoco._usd")  # registers the schemas: before any other use of pxr in this process
    model = mujoco.MjSpec.from_file(str(path)).compile()
    data = mujoco.MjData(model)
    bodies = {_last(model.body(b).name): b for b in range(model.nbody)}
    joints = {_last(model.joint(j).name): j for j in range(model.njnt)}
    found = {n: (bodies[n], joints[f"{n}_joint"]) for n in job["parts"]}
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    out = {n: _part(model, data, b, j) for n, (b, j) in found.items()}
    _motion(model, data, found, job["states"], out)
    _mass_diagonal(model, data, found, job["state"], out)
    _rollout(model, data, found, job, out)
    if fmt == "urdf":  # the only format in which MuJoCo looks at contact between a part and the static scene
        _sweep(model, data, found, out)
    return out


def _last(name: str) -> str:
    """Last component of a name: those from USD are paths."""
    return str(name).split("/")[-1]


def _part(model: Any, data: Any, b: int, j: int) -> dict[str, Any]:
    dof, parent = int(model.jnt_dofadr[j]), int(model.body_parentid[b])
    touching = [g for g in range(model.ngeom) if model.geom_bodyid[g] == b and model.geom_contype[g]]
    friction = model.geom_friction[touching, 0]
    return {
        "parent": _last(model.body(parent).name) if parent else "",
        "type": KINDS[int(model.jnt_type[j])],
        "axis": data.xaxis[j].tolist(),
        "pivot": data.xanchor[j].tolist(),
        "lower": float(model.jnt_range[j, 0]),
        "upper": float(model.jnt_range[j, 1]),
        "damping": float(model.dof_damping[dof]),
        "frictionloss": float(model.dof_frictionloss[dof]),
        "armature": float(model.dof_armature[dof]),
        "friction": [float(friction.min()), float(friction.max())] if len(friction) else None,
        "mass": float(model.body_mass[b]),
        "com": data.xipos[b].tolist(),
        "inertia": tensor(data.ximat[b].reshape(3, 3), model.body_inertia[b]),
        "bounds": _bounds(model, data, b),
        "motion": [],
    }


def _bounds(model: Any, data: Any, body: int) -> list[list[float]] | None:
    """Bounds (2, 3) of the visual meshes in the world, null without one."""
    found = []
    for g in range(model.ngeom):
        if model.geom_bodyid[g] == body and model.geom_contype[g] == 0 and model.geom_dataid[g] >= 0:
            mesh = model.mesh(int(model.geom_dataid[g]))
            start, count = int(mesh.vertadr[0]), int(mesh.vertnum[0])
            vertices = model.mesh_vert[start : start + count]
            found.append(bounds(vertices, pose(data.geom_xmat[g].reshape(3, 3), data.geom_xpos[g])))
    return around(found)


def _pose(data: Any, body: int) -> Array:
    return pose(data.xmat[body].reshape(3, 3), data.xpos[body])


def _address(model: Any, found: dict[str, tuple[int, int]]) -> tuple[Array, Array]:
    """Indices of the parts' joints in qpos and in qvel."""
    joints = [j for _, j in found.values()]
    return model.jnt_qposadr[joints], model.jnt_dofadr[joints]


def _motion(
    model: Any, data: Any, found: dict[str, tuple[int, int]], states: list[list[float]], out: dict[str, Any]
) -> None:
    rest = {n: np.linalg.inv(_pose(data, b)) for n, (b, _) in found.items()}
    for row in states:
        data.qpos[_address(model, found)[0]] = row
        mujoco.mj_kinematics(model, data)
        for n, (b, _) in found.items():
            out[n]["motion"].append((_pose(data, b) @ rest[n]).tolist())


def _mass_diagonal(
    model: Any, data: Any, found: dict[str, tuple[int, int]], state: list[float], out: dict[str, Any]
) -> None:
    places, dofs = _address(model, found)
    data.qpos[places] = state
    mujoco.mj_forward(model, data)
    full = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, full)
    keep(out, "mass_diagonal", np.diag(full)[dofs], list(found))


def _rollout(
    model: Any, data: Any, found: dict[str, tuple[int, int]], job: dict[str, Any], out: dict[str, Any]
) -> None:
    """Its accelerations, without contacts, limits and dry friction: its own integrators have a fixed step."""
    places, dofs = _address(model, found)
    flags = model.opt.disableflags
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
    mujoco.mj_resetData(model, data)

    def acceleration(q: Array, v: Array) -> Array:
        data.qpos[places], data.qvel[dofs] = q, v
        mujoco.mj_forward(model, data)
        return np.array(data.qacc[dofs])

    course = integrated(acceleration, job["position"], job["velocity"], job["times"])
    keep(out, "rollout", course, list(found))
    model.opt.disableflags = flags
    mujoco.mj_resetData(model, data)


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
