"""yourdfpy reads URDF. It has no dynamics."""

from __future__ import annotations

from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import yourdfpy

from .common import around, bounds, tensor

VERSION = version("yourdfpy")


def read(path: Path, fmt: str, job: dict[str, Any]) -> dict[str, Any]:
    """Measure every part of the model in `path`, meshes included."""
    del fmt
    parts = job["parts"]
    robot = yourdfpy.URDF.load(str(path), load_collision_meshes=True, build_collision_scene_graph=True)
    if not robot.validate():
        raise ValueError(f"yourdfpy finds the file invalid: {robot.errors}")
    robot.update_cfg({f"{n}_joint": 0.0 for n in parts})
    out: dict[str, Any] = {}
    rest = {n: np.array(robot.get_transform(n, "world")) for n in parts}
    for n in parts:
        joint, inertial = robot.joint_map[f"{n}_joint"], robot.link_map[n].inertial
        place = rest[n] @ (np.eye(4) if inertial.origin is None else inertial.origin)
        out[n] = {
            "parent": joint.parent,
            "type": joint.type,
            "axis": (rest[n][:3, :3] @ joint.axis).tolist(),
            "pivot": rest[n][:3, 3].tolist(),
            "lower": float(joint.limit.lower),
            "upper": float(joint.limit.upper),
            "damping": float(joint.dynamics.damping),
            "frictionloss": float(joint.dynamics.friction),
            "mass": float(inertial.mass),
            "com": place[:3, 3].tolist(),
            "inertia": tensor(place[:3, :3], inertial.inertia),
            "motion": [],
        }
        found = []
        for shape, mesh in robot.scene.geometry.items():
            node, place = shape, robot.scene.graph.get(shape)[0]
            if robot.scene.graph.transforms.parents[node] == n:
                found.append(bounds(mesh.vertices, place))
        if found:
            out[n]["bounds"] = around(found)
    for row in job["states"]:
        robot.update_cfg({f"{n}_joint": s for n, s in zip(parts, row, strict=True)})
        for n in parts:
            out[n]["motion"].append((robot.get_transform(n, "world") @ np.linalg.inv(rest[n])).tolist())
    return out
