"""Makes collision shapes give way where a moving part would touch them.

MuJoCo's own collision detection finds the contacts over each part's range. The shape that has to give way loses what lies
beyond the contact plane; a large shape is split first, so that only its piece at the contact gives way.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from twin import geometry as geo
from twin.convex import Hull, clip, hull_of
from twin.geometry import Array
from twin.scene import Box, Collision, Mesh, Part, Revolute, Twin

_ROUNDS = 60  # a round takes about 0.1 s; each splits or cuts every shape in the way once
_KEEP = 0.4  # a clip may not take more than this share of a large shape: the shape is split instead
_LARGE = 0.12  # m
_REACH = 0.05  # m to each side of a contact: the piece that is split off


@dataclass(frozen=True)
class Touch:
    """Shape `index` of `owner` (0 static, then parts) comes nearer than allowed: it must keep to normal . x <= offset."""

    owner: int
    index: int
    depth: float
    point: Array
    normal: Array
    offset: float


def sweep_states(part: Part, step: float) -> Array:
    """States (n,) from lower to upper, no point of the part's mesh moving further than `step` between two."""
    j = part.joint
    radius = 1.0
    if isinstance(j, Revolute) and len(part.mesh.vertices):
        away = part.mesh.vertices - j.pivot
        radius = float(np.linalg.norm(away - np.outer(away @ j.axis, j.axis), axis=1).max())
    return np.linspace(
        j.lower, j.upper, int(np.clip(np.ceil((j.upper - j.lower) * radius / step), 2, 100)) + 1
    )


def make_clear(
    twin: Twin, shapes: list[list[Collision]], clearance: float, step: float
) -> list[list[Collision]]:
    """Cut shapes (static first, then one list per part) until parts keep `clearance` from others over their range.

    Static shapes give way to parts; of two parts, the later one in the twin. A part and its parent may touch.
    """
    shapes = [list(s) for s in shapes]
    for _ in range(_ROUNDS):
        touches = find_touches(twin, shapes, clearance, step)
        if not touches:
            return shapes
        _give_way(shapes, touches, clearance)
    for owner, index in sorted(
        {(t.owner, t.index) for t in find_touches(twin, shapes, clearance, step)}, reverse=True
    ):
        if owner == 0:  # could not be cut free in all rounds
            del shapes[0][index]
    return shapes


def _give_way(shapes: list[list[Collision]], touches: list[Touch], clearance: float) -> None:
    for t in sorted(touches, key=lambda t: (t.owner, t.index), reverse=True):
        piece = shapes[t.owner][t.index]
        hull = hull_of(piece.corners if isinstance(piece, Box) else piece.vertices)
        left = None if hull is None else clip(hull, -t.normal, -t.offset + 1e-5)
        new: list[Collision] = []
        if hull is not None and (left is None or left.volume < (1 - _KEEP) * hull.volume):
            pieces = _split_around(hull, t.point)
            if pieces:
                shapes[t.owner][t.index : t.index + 1] = [p.mesh for p in pieces]
                continue
            left = left if left is not None and left.volume > 0.2 * hull.volume else None
        if left is not None and np.linalg.svd(left.vertices - left.vertices.mean(0))[1][2] > clearance / 4:
            new = [left.mesh]
        shapes[t.owner][t.index : t.index + 1] = new


def _split_around(hull: Hull, point: Array) -> list[Hull]:
    """Split a large hull beside a point on it, across its longest direction; [] when it is not large."""
    _, _, axes = np.linalg.svd(hull.vertices - hull.vertices.mean(axis=0), full_matrices=False)
    spans = np.ptp(hull.vertices @ axes.T, axis=0)
    k = int(np.argmax(spans))
    if spans[k] < _LARGE:
        return []
    axis, at = axes[k], float(axes[k] @ point)
    along = hull.vertices @ axis
    cuts = [c for c in (at - _REACH, at + _REACH) if along.min() + 0.01 < c < along.max() - 0.01]
    edges = [-np.inf, *cuts, np.inf]
    out = []
    for low, high in pairwise(edges):
        piece: Hull | None = hull
        if np.isfinite(low):
            piece = clip(hull, axis, low)
        if piece is not None and np.isfinite(high):
            piece = clip(piece, -axis, -high)
        if piece is not None:
            out.append(piece)
    return out if len(out) > 1 else []


def find_touches(twin: Twin, shapes: list[list[Collision]], clearance: float, step: float) -> list[Touch]:
    """The deepest touch of every shape that comes nearer than `clearance`, one part opened at a time."""
    import mujoco

    model = _model(twin, shapes, clearance)
    data = mujoco.MjData(model)
    names = [model.geom(g).name.split("_") for g in range(model.ngeom)]
    owner = np.array([int(n[1]) for n in names])
    index = np.array([int(n[2]) for n in names])
    worst: dict[tuple[int, int], Touch] = {}
    for part in twin.parts:
        address = int(model.joint(f"joint_{part.id}").qposadr[0])
        for state in sweep_states(part, step):
            data.qpos[:] = 0.0
            data.qpos[address] = state
            mujoco.mj_kinematics(model, data)
            mujoco.mj_collision(model, data)
            for c in data.contact:
                a, b = c.geom
                if owner[a] > owner[b]:  # a is the one that stays, unless it is static
                    a, b, sign = b, a, -1.0
                else:
                    sign = 1.0
                gives = a if owner[a] == 0 else b
                toward = (
                    sign * c.frame[:3] * (1.0 if gives == a else -1.0)
                )  # from the one that gives to the other
                key = (int(owner[gives]), int(index[gives]))
                if c.dist < clearance - 1e-5 and (key not in worst or c.dist < worst[key].depth):
                    surface = c.pos + toward * c.dist / 2  # the other's surface
                    worst[key] = _touch(
                        twin, key, float(c.dist), surface, toward, clearance, part, float(state)
                    )
    return [worst[k] for k in sorted(worst)]


def _touch(
    twin: Twin, key: tuple[int, int], depth: float, surface: Array, toward: Array, clearance: float, part: Part, state: float
) -> Touch:  # fmt: skip
    """The touch in the coordinates of state 0 of the shape that gives way."""
    back = np.eye(4)
    if key[0] > 0:
        back = geo.invert_pose(twin.part_pose(twin.parts[key[0] - 1].id, {part.id: state}))
    point = geo.transform(back, surface[None])[0]
    normal = geo.rotate(back, toward)
    return Touch(key[0], key[1], depth, point, normal, float(normal @ point) - clearance)


def _model(twin: Twin, shapes: list[list[Collision]], margin: float) -> Any:
    """A model of the bare shapes; body frames are the world at state 0, geoms are called geom_<owner>_<index>."""
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
        for k, piece in enumerate(owner):
            _add_geom(spec, body, f"geom_{i}_{k}", piece, margin)
    return spec.compile()


def _add_geom(spec: Any, body: Any, name: str, piece: Collision, margin: float) -> None:
    import mujoco

    if isinstance(piece, Mesh):
        spec.add_mesh(name=name, uservert=piece.vertices.ravel(), userface=piece.faces.ravel())
        body.add_geom(name=name, type=mujoco.mjtGeom.mjGEOM_MESH, meshname=name, margin=margin)
    else:
        body.add_geom(
            name=name, type=mujoco.mjtGeom.mjGEOM_BOX, size=piece.size / 2, pos=piece.T_world_box[:3, 3],
            quat=geo.quat_wxyz_from_matrix(piece.T_world_box[:3, :3]), margin=margin,
        )  # fmt: skip
