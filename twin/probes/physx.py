"""PhysX, the engine of Isaac Sim, reads USD: the stage with its runtime, beside the main one. In float32.

It has no names for the parts of a joint's frame, so tree, axis and pivot are measured: every joint is moved
by itself and the links' poses tell the rest.
"""

from __future__ import annotations

import re
import tempfile
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from ovphysx import PhysX, PhysXConfig
from ovphysx.types import TensorType

from .common import Array, keep, pose, rotation_xyzw, stepped, tensor, without_step_error

VERSION = version("ovphysx")
PHYSX = PhysX(PhysXConfig(num_threads=1), device="cpu")  # more threads only wait for each other
STEP = 2e-3  # s
_NUDGE = 0.5  # rad or m: how far a joint is moved to see what moves
_WITHOUT_CONTACT = """#usda 1.0
(
    subLayers = [@{stage}@]
    metersPerUnit = 1
    kilogramsPerUnit = 1
    upAxis = "Z"
)

over "{name}" (
    prepend apiSchemas = ["PhysxArticulationAPI"]
)
{{
    bool physxArticulation:enabledSelfCollisions = 0
}}
"""


def tidy(said: list[str]) -> list[str]:
    """What its log says of the stage; files opened, its set-up and stages' removal are left out."""
    return [x for x in said if re.match(r"\[(Warning|Error)\] \[omni\.physx(\.tensors)?\.plugin\]", x)]


def read(path: Path, fmt: str, job: dict[str, Any]) -> dict[str, Any]:  # noqa: ARG001  (USD alone)
    """Measure every part of the stage that goes with `path`."""
    own = path.with_name(f"{path.stem}_physx{path.suffix}")
    with tempfile.TemporaryDirectory() as folder:
        quiet = Path(folder) / path.name
        quiet.write_text(_WITHOUT_CONTACT.format(stage=own if own.is_file() else path, name=path.stem))
        stage, _ = PHYSX.add_usd(str(quiet))
        PHYSX.wait_all()
    try:
        return _measure(_Articulation(PHYSX, f"/{path.stem}"), job)
    finally:
        PHYSX.remove_usd(stage)
        PHYSX.wait_all()


class _Articulation:
    """The stage's one articulation."""

    def __init__(self, physx: Any, pattern: str) -> None:
        self.physx, self.pattern = physx, pattern
        self._bound: dict[str, Any] = {}
        some = self._binding("DOF_POSITION")
        self.joints, self.links = list(some.dof_names), list(some.body_names)

    def _binding(self, name: str) -> Any:
        if name not in self._bound:
            kind = getattr(TensorType, f"ARTICULATION_{name}")
            self._bound[name] = self.physx.create_tensor_binding(pattern=self.pattern, tensor_type=kind)
        return self._bound[name]

    def get(self, name: str) -> Array:
        binding = self._binding(name)
        values = np.zeros(binding.shape, np.float32)
        binding.read(values)
        return values[0].astype(np.float64)

    def put(self, name: str, values: Array) -> None:
        self._binding(name).write(np.ascontiguousarray(values[None], np.float32))

    def placed(self, state: Array) -> Array:
        """Poses (links, 4, 4) in a state of all joints."""
        self.put("DOF_POSITION", state)
        self.put("DOF_VELOCITY", np.zeros(len(state)))
        self.physx.update_articulations_kinematic()
        return np.stack([pose(rotation_xyzw(p[3:]), p[:3]) for p in self.get("LINK_POSE")])


def _measure(a: _Articulation, job: dict[str, Any]) -> dict[str, Any]:
    parts = job["parts"]
    index = [a.joints.index(f"{n}_joint") for n in parts]
    body = [a.links.index(n) for n in parts]
    still = np.zeros(len(a.joints))
    closed = a.placed(still)
    moved = np.stack([a.placed(still + _NUDGE * (np.arange(len(still)) == j)) for j in index])
    follows = np.array([[np.abs(m[b] - closed[b]).max() > 1e-4 for b in body] for m in moved])  # joint, body
    out = {n: _part(a, k, index, body, closed, moved[k], follows) for k, n in enumerate(parts)}
    for row in job["states"]:
        now = a.placed(_all(still, index, row))
        for k, n in enumerate(parts):
            out[n]["motion"].append((now[body[k]] @ np.linalg.inv(closed[body[k]])).tolist())
    a.placed(_all(still, index, job["state"]))
    diagonal = np.diag(a.get("MASS_MATRIX")) + a.get("DOF_ARMATURE")  # PhysX keeps the two apart
    keep(out, "mass_diagonal", diagonal[index], parts)
    keep(
        out,
        "rollout",
        without_step_error(lambda step: _simulate(a, index, job, step), STEP, enough=1e-3),
        parts,
    )
    return out


def _all(still: Array, index: list[int], values: list[float]) -> Array:
    state = still.copy()
    state[index] = values
    return state


def _part(
    a: _Articulation, k: int, index: list[int], body: list[int], closed: Array, moved: Array, follows: Array
) -> dict[str, Any]:
    j, b = index[k], body[k]
    above = [i for i in range(len(body)) if follows[i, k] and i != k]
    parent = max(above, key=lambda i: int(follows[:, i].sum()), default=None)
    still = next(n for n in a.links if a.links.index(n) not in body)
    kind, axis, pivot = _joint(moved[b] @ np.linalg.inv(closed[b]))
    lower, upper = a.get("DOF_LIMIT")[j]
    com = a.get("BODY_COM_POSE")[b]
    friction = a.get("DOF_FRICTION_PROPERTIES")[j]
    return {
        "parent": still if parent is None else a.links[body[parent]],
        "type": kind,
        "axis": axis.tolist(),
        "pivot": pivot.tolist(),
        "lower": float(lower),
        "upper": float(upper),
        "damping": float(a.get("DOF_DAMPING")[j] + friction[2]),
        "frictionloss": float(friction[1]),
        "armature": float(a.get("DOF_ARMATURE")[j]),
        "mass": float(a.get("BODY_MASS")[b]),
        "com": (closed[b] @ np.append(com[:3], 1.0))[:3].tolist(),
        "inertia": tensor(closed[b][:3, :3], a.get("BODY_INERTIA")[b].reshape(3, 3)),
        "motion": [],
    }


def _joint(motion: Array) -> tuple[str, Array, Array]:
    """Kind, unit axis and a point on it of what moves a body from state 0 by `_NUDGE`."""
    r, t = motion[:3, :3], motion[:3, 3]
    skew = np.array([r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]]) / 2
    if np.linalg.norm(skew) < 1e-3:
        return "prismatic", t / np.linalg.norm(t), np.zeros(3)
    point = np.linalg.lstsq(np.eye(3) - r, t, rcond=1e-4)[0].astype(np.float64)
    return "revolute", skew / np.linalg.norm(skew), point


def _simulate(a: _Articulation, index: list[int], job: dict[str, Any], step: float) -> Array:
    """Course (t, n) without limits and dry friction."""
    a.put("DOF_LIMIT", np.tile([-1e4, 1e4], (len(a.joints), 1)))
    a.put("DOF_FRICTION_PROPERTIES", np.zeros((len(a.joints), 3)))
    still = np.zeros(len(a.joints))
    a.placed(_all(still, index, job["position"]))
    a.put("DOF_VELOCITY", _all(still, index, job["velocity"]))

    def read() -> Array:
        a.physx.wait_all()
        return a.get("DOF_POSITION")[index]

    return stepped(job["times"], step, lambda: a.physx.step(step, 0.0), read)
