"""Pinocchio reads URDF and MJCF."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from .common import Array, around, bounds, keep, pose, tensor
from .stiff import integrated

VERSION = pin.__version__


def read(path: Path, fmt: str, job: dict[str, Any]) -> dict[str, Any]:
    """Measure every part of the model in `path`. Its accelerations are integrated here: it can't simulate."""
    model = pin.buildModelFromUrdf(str(path)) if fmt == "urdf" else pin.buildModelFromMJCF(str(path))
    data = model.createData()
    zero = np.zeros(model.nq)
    pin.forwardKinematics(model, data, zero)
    ids = {n: model.getJointId(f"{n}_joint") for n in job["parts"]}
    missing = [n for n, k in ids.items() if k >= model.njoints]
    if missing:
        raise ValueError(f"joint {missing[0]}_joint is missing")
    links = {
        int(f.parentJoint): f.name for f in model.frames if f.type == pin.FrameType.BODY and f.name in ids
    }
    out = {n: _part(model, data, k, links) for n, k in ids.items()}
    rest = {n: data.oMi[k].inverse() for n, k in ids.items()}
    index = [model.joints[k].idx_q for k in ids.values()]
    for row in job["states"]:
        pin.forwardKinematics(model, data, _full(model, index, row))
        for n, k in ids.items():
            out[n]["motion"].append((data.oMi[k] * rest[n]).homogeneous.tolist())
    inertia = pin.crba(model, data, _full(model, index, job["state"]))
    keep(out, "mass_diagonal", np.diag(inertia)[index], list(ids))

    def acceleration(q: Array, v: Array) -> Array:
        return np.asarray(pin.aba(model, data, q, v, -model.damping * v))

    start = [_full(model, index, job[x]) for x in ("position", "velocity")]
    course = integrated(acceleration, start[0], start[1], job["times"])
    keep(out, "rollout", course[:, index], list(ids))
    _bounds(model, path, fmt, ids, out)
    return out


def _full(model: Any, index: list[int], values: list[float]) -> Array:
    """Values of the parts in the model's order."""
    q = np.zeros(model.nq)
    q[index] = values
    return q


def _part(model: Any, data: Any, k: int, links: dict[int, str]) -> dict[str, Any]:
    # in the joint's frame; a model of one joint gives a plain column
    jacobian = pin.computeJointJacobian(model, data, np.zeros(model.nq), k).reshape(6, -1)
    world = data.oMi[k].toActionMatrix() @ jacobian
    v = model.joints[k].idx_v
    turning, moving = world[3:, v], world[:3, v]
    revolute = bool(np.linalg.norm(turning) > 0.5)
    place, body, index = data.oMi[k], model.inertias[k], model.joints[k].idx_q
    return {
        "parent": links.get(int(model.parents[k]), ""),
        "type": "revolute" if revolute else "prismatic",
        "axis": (turning if revolute else moving).tolist(),
        "pivot": np.cross(turning, moving).tolist(),
        "lower": float(model.lowerPositionLimit[index]),
        "upper": float(model.upperPositionLimit[index]),
        "damping": float(model.damping[v]),
        "frictionloss": float(model.upperDryFrictionLimit[v]),
        "armature": float(model.armature[v]),
        "mass": float(body.mass),
        "com": place.act(body.lever).tolist(),
        "inertia": tensor(place.rotation, body.inertia),
        "motion": [],
    }


def _bounds(model: Any, path: Path, fmt: str, ids: dict[str, int], out: dict[str, Any]) -> None:
    visual = pin.GeometryType.VISUAL
    if fmt == "urdf":
        shapes = pin.buildGeomFromUrdf(model, str(path), visual, package_dirs=[str(path.parent)])
    else:
        shapes = pin.buildGeomFromMJCF(model, str(path), visual)
    data = model.createData()
    pin.forwardKinematics(model, data, np.zeros(model.nq))
    found: dict[str, list[list[list[float]]]] = {}
    for shape in shapes.geometryObjects:
        n = model.frames[shape.parentFrame].name
        # not the magnet of a catch, which nobody sees
        if n in ids and hasattr(shape.geometry, "num_vertices"):
            vertices = np.array([shape.geometry.vertex(i) for i in range(shape.geometry.num_vertices)])
            place = data.oMi[ids[n]] * shape.placement
            box = bounds(vertices * shape.meshScale, pose(place.rotation, place.translation))
            found.setdefault(n, []).append(box)
    for n, boxes in found.items():
        out[n]["bounds"] = around(boxes)
