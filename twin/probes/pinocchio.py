"""Pinocchio reads URDF and MJCF."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin


def read(path: Path, fmt: str, parts: list[str], states: list[list[float]]) -> dict[str, Any]:
    """Measure every part of the model in `path`."""
    model = pin.buildModelFromUrdf(str(path)) if fmt == "urdf" else pin.buildModelFromMJCF(str(path))
    data = model.createData()
    zero = np.zeros(model.nq)
    pin.forwardKinematics(model, data, zero)
    ids = {n: model.getJointId(f"{n}_joint") for n in parts}
    out: dict[str, Any] = {}
    rest = {}
    for n, k in ids.items():
        if k >= model.njoints:
            raise ValueError(f"joint {n}_joint is missing")
        # in the joint's frame; a model of one joint gives a plain column
        jacobian = pin.computeJointJacobian(model, data, zero, k).reshape(6, -1)
        world = data.oMi[k].toActionMatrix() @ jacobian
        column = world[:, model.joints[k].idx_v]
        turning, moving = column[3:], column[:3]
        revolute = bool(np.linalg.norm(turning) > 0.5)
        place, body = data.oMi[k], model.inertias[k]
        index = model.joints[k].idx_q
        out[n] = {
            "type": "revolute" if revolute else "prismatic",
            "axis": (turning if revolute else moving).tolist(),
            "pivot": np.cross(turning, moving).tolist(),
            "lower": float(model.lowerPositionLimit[index]),
            "upper": float(model.upperPositionLimit[index]),
            "mass": float(body.mass),
            "com": place.act(body.lever).tolist(),
            "inertia": (place.rotation @ body.inertia @ place.rotation.T).tolist(),
            "motion": [],
        }
        rest[n] = place.inverse()
    for row in states:
        q = np.zeros(model.nq)
        for n, s in zip(parts, row, strict=True):
            q[model.joints[ids[n]].idx_q] = s
        pin.forwardKinematics(model, data, q)
        for n, k in ids.items():
            out[n]["motion"].append((data.oMi[k] * rest[n]).homogeneous.tolist())
    return out
