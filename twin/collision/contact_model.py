"""A MuJoCo model of bare collision shapes, whose contacts say where they meet."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from twin import geometry as geo
from twin.collision.convex import hull_of
from twin.scene import Collision, Mesh, Revolute, Twin


def model_of(
    twin: Twin, shapes: Sequence[Sequence[Collision | None]], moving: set[int], margin: float
) -> Any:
    """A model of the bare shapes in which only what moves meets what stays.

    Body frames are the world at state 0, geoms are called geom_<owner>_<index>; none stands for None.
    """
    import mujoco

    spec = mujoco.MjSpec()
    spec.compiler.degree = False
    bodies: dict[int | None, Any] = {None: spec.worldbody}
    order = list(twin.parts)
    while order:
        part = order.pop(0)
        if part.parent not in bodies:
            order.append(part)
            continue
        body = bodies[part.parent].add_body(
            name=f"body_{part.id}", mass=1.0, inertia=[1.0, 1.0, 1.0], explicitinertial=True
        )
        bodies[part.id] = body
        kind = (
            mujoco.mjtJoint.mjJNT_HINGE if isinstance(part.joint, Revolute) else mujoco.mjtJoint.mjJNT_SLIDE
        )
        pivot = part.joint.pivot if isinstance(part.joint, Revolute) else np.zeros(3)
        body.add_joint(name=f"joint_{part.id}", type=kind, axis=part.joint.axis, pos=pivot)
    for i, owner in enumerate(shapes):
        body = bodies[None if i == 0 else twin.parts[i - 1].id]
        groups = {"contype": 1, "conaffinity": 2} if i in moving else {"contype": 2, "conaffinity": 1}
        for k, piece in enumerate(owner):
            if piece is not None:
                _add_geom(spec, body, f"geom_{i}_{k}", piece, margin=margin, **groups)
    return spec.compile()


def _add_geom(spec: Any, body: Any, name: str, piece: Collision, **options: Any) -> None:
    import mujoco

    if isinstance(piece, Mesh):
        hull = hull_of(piece.vertices)  # what engines take, however a stated mesh is wound
        if hull is None:
            return  # flat: it stands for no body
        spec.add_mesh(name=name, uservert=hull.vertices.ravel(), userface=hull.faces.ravel())
        body.add_geom(name=name, type=mujoco.mjtGeom.mjGEOM_MESH, meshname=name, **options)
    else:
        body.add_geom(
            name=name, type=mujoco.mjtGeom.mjGEOM_BOX, size=piece.size / 2, pos=piece.T_world_box[:3, 3],
            quat=geo.quat_wxyz_from_matrix(piece.T_world_box[:3, :3]), **options,
        )  # fmt: skip
