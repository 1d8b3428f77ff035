"""Newton reads URDF, MJCF and USD. It computes in single precision."""

from __future__ import annotations

from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import warp as wp

wp.config.log_level = wp.LOG_WARNING  # it would tell of every kernel that it loads
wp.init()
import newton  # noqa: E402  (after the setting)

from .common import Array, around, bounds, keep, pose, rotation_xyzw, stepped, tensor, without_step_error  # noqa: E402

VERSION = version("newton")
KINDS = {int(newton.JointType.REVOLUTE): "revolute", int(newton.JointType.PRISMATIC): "prismatic"}
STEP = 1e-2  # s, the largest


def read(path: Path, fmt: str, job: dict[str, Any]) -> dict[str, Any]:
    """Measure every part of the model in `path`."""
    builder = newton.ModelBuilder()
    getattr(builder, f"add_{fmt}")(str(path))
    model = builder.finalize(device="cpu")
    parts = job["parts"]
    bodies = {_last(label): k for k, label in enumerate(model.body_label)}
    joints = {_last(label): k for k, label in enumerate(model.joint_label)}
    found = {n: (bodies[n], joints[f"{n}_joint"]) for n in parts}
    start = {n: int(model.joint_q_start.numpy()[j]) for n, (_, j) in found.items()}
    index = list(start.values())

    def placed(values: list[float]) -> Array:
        """Poses (bodies, 4, 4) in the state `values` of the parts."""
        state = _state(model, index, values)
        return np.stack([_pose(p) for p in state.body_q.numpy()])

    closed = placed([0.0] * len(parts))
    out = {n: _part(model, b, j, closed) for n, (b, j) in found.items()}
    for row in job["states"]:
        now = placed(row)
        for n, (b, _) in found.items():
            out[n]["motion"].append((now[b] @ np.linalg.inv(closed[b])).tolist())
    state = _state(model, index, job["state"])
    # from the Jacobian about the centres of mass: about the world's origin, the default, digits are lost
    mass = newton.eval_mass_matrix(model, state, J=newton.eval_jacobian(model, state)).numpy()
    # one articulation: the file's model
    keep(
        out,
        "mass_diagonal",
        np.diag(mass[0])[[int(model.joint_qd_start.numpy()[j]) for _, j in found.values()]],
        parts,
    )
    keep(
        out,
        "rollout",
        without_step_error(lambda step: _simulate(model, index, job, step), STEP, enough=1e-3),
        parts,
    )
    return out


def _last(label: str) -> str:
    return str(label).split("/")[-1]


def _pose(p: Any) -> Array:
    """Pose from x, y, z and a quaternion x, y, z, w."""
    return pose(rotation_xyzw(p[3:7]), p[:3])


def _state(model: Any, index: list[int], position: list[float], velocity: list[float] | None = None) -> Any:
    state = model.state()
    q, v = model.joint_q.numpy(), model.joint_qd.numpy()
    q[index], v[index] = position, velocity or 0.0
    state.joint_q.assign(q)
    state.joint_qd.assign(v)
    newton.eval_fk(model, state.joint_q, state.joint_qd, state)
    return state


def _part(model: Any, b: int, j: int, closed: Array) -> dict[str, Any]:
    parent, dof = int(model.joint_parent.numpy()[j]), int(model.joint_qd_start.numpy()[j])
    frame = (closed[parent] if parent >= 0 else np.eye(4)) @ _pose(model.joint_X_p.numpy()[j])
    shapes = [k for k in range(model.shape_count) if int(model.shape_body.numpy()[k]) == b]
    flags = model.shape_flags.numpy()
    # 0: the magnet of a catch, which meets nothing but its plate
    groups = model.shape_collision_group.numpy()
    touching = [k for k in shapes if flags[k] & int(newton.ShapeFlags.COLLIDE_SHAPES) and groups[k] != 0]
    friction = model.shape_material_mu.numpy()[touching]
    return {
        "parent": _last(model.body_label[parent]) if parent >= 0 else "",
        "type": KINDS.get(int(model.joint_type.numpy()[j]), str(model.joint_type.numpy()[j])),
        "axis": (frame[:3, :3] @ model.joint_axis.numpy()[dof]).tolist(),
        "pivot": frame[:3, 3].tolist(),
        "lower": float(model.joint_limit_lower.numpy()[dof]),
        "upper": float(model.joint_limit_upper.numpy()[dof]),
        "damping": float(model.joint_damping.numpy()[dof] + model.joint_target_kd.numpy()[dof]),
        "frictionloss": float(model.joint_friction.numpy()[dof]),
        "armature": float(model.joint_armature.numpy()[dof]),
        "friction": [float(friction.min()), float(friction.max())] if len(friction) else None,
        "mass": float(model.body_mass.numpy()[b]),
        "com": (closed[b] @ np.append(model.body_com.numpy()[b], 1.0))[:3].tolist(),
        "inertia": tensor(closed[b][:3, :3], model.body_inertia.numpy()[b]),
        "bounds": _bounds(model, [k for k in shapes if k not in touching], closed[b]),
        "motion": [],
    }


def _bounds(model: Any, shown: list[int], place: Array) -> list[list[float]] | None:
    """Bounds of the shapes that are shown and touch nothing, null without one."""
    found = []
    for k in shown:
        source = model.shape_source[k]
        if isinstance(source, newton.Mesh):
            scale = model.shape_scale.numpy()[k]
            T = place @ _pose(model.shape_transform.numpy()[k])
            found.append(bounds(np.asarray(source.vertices) * scale, T))
    return around(found)


def _simulate(model: Any, index: list[int], job: dict[str, Any], step: float) -> Array:
    """Course (t, n) by its Featherstone solver, without limits; it knows no dry friction."""
    model.joint_limit_ke.zero_()
    model.joint_limit_kd.zero_()
    solver = newton.solvers.SolverFeatherstone(model, angular_damping=0.0)
    now, then = _state(model, index, job["position"], job["velocity"]), model.state()

    def advance() -> None:
        nonlocal now, then
        now.clear_forces()
        solver.step(now, then, None, None, step)
        now, then = then, now

    return stepped(job["times"], step, advance, lambda: now.joint_q.numpy()[index])
