"""The one intermediate model that all writers read: links, joint frames, inertials, shapes.

Every link frame has the axes of the twin's world at state 0, so axes, tensors and meshes need no rotation: the frame of a
revolute part sits on its hinge, at the foot of its mesh's centroid; that of a prismatic part at the centroid.
The root link is the static scene and its frame is the world.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from twin import geometry as geo
from twin.errors import SceneError
from twin.geometry import Array
from twin.scene import Box, Collision, Mesh, Part, Revolute, Twin

# URDF demands effort and velocity limits; nothing was measured. Chosen by us, far above what a person's hand does.
EFFORT_LIMIT = {"revolute": 100.0, "prismatic": 200.0}  # N m, N
VELOCITY_LIMIT = {"revolute": 6.0, "prismatic": 3.0}  # rad/s, m/s
# Added joint inertia that keeps light parts well-conditioned; chosen by us: a hundredth of a cabinet door.
ARMATURE = {"revolute": 1e-3, "prismatic": 1e-2}  # kg m^2, kg


@dataclass(frozen=True, eq=False)
class TreeJoint:
    """Joint of a link to its parent, at the link's origin. Axis (3,) unit, limits m or rad, SI damping and friction."""

    name: str
    kind: Literal["revolute", "prismatic"]
    axis: Array
    lower: float
    upper: float
    damping: float
    frictionloss: float


@dataclass(frozen=True, eq=False)
class Link:
    """One rigid body; everything is in the link's frame.

    parent: name of the parent link, None for the root. offset (3,): origin in the parent's frame. mass None: static.
    inertia (3, 3) about com (3,). grasp (4, 4): frame of the contact path, columns as in ContactPath, and the width (m)
    of what is held there.
    """

    name: str
    parent: str | None
    offset: Array
    visual: Mesh
    collision: tuple[Collision, ...]
    friction: float
    joint: TreeJoint | None = None
    mass: float | None = None
    com: Array | None = None
    inertia: Array | None = None
    grasp: Array | None = None
    grasp_width: float = 0.0


@dataclass(frozen=True, eq=False)
class Tree:
    """Links, the root first and every parent before its children, in depth-first order; source names what it was made from."""

    name: str
    links: tuple[Link, ...]
    source: str = "twin.json"

    @property
    def root(self) -> Link:
        return self.links[0]

    def children(self, name: str) -> list[Link]:
        return [k for k in self.links if k.parent == name]

    @property
    def moving(self) -> list[Link]:
        return [k for k in self.links if k.joint is not None]


def build_tree(twin: Twin) -> Tree:
    """Turn a twin into links. Raises SceneError when a part lacks what simulation needs."""
    root = Link(
        name=twin.static.name,
        parent=None,
        offset=np.zeros(3),
        visual=twin.static.mesh,
        collision=twin.static.collision,
        friction=_static_friction(twin),
    )
    links = [root]

    def add(parent_id: int | None, parent_name: str, parent_origin: Array) -> None:
        for part in twin.parts:
            if part.parent == parent_id:
                origin = link_origin(part)
                links.append(_link(part, parent_name, origin, origin - parent_origin))
                add(part.id, part.name, origin)

    add(None, root.name, np.zeros(3))
    source = twin.recorded.source if twin.recorded is not None else ""
    return Tree(twin.name, tuple(links), source or "twin.json")


def link_origin(part: Part) -> Array:
    """World position (3,) of a part's link frame at state 0."""
    center = part.mesh.area_centroid if len(part.mesh.vertices) else np.zeros(3)
    if isinstance(part.joint, Revolute):
        return geo.nearest_point_on_line(center, part.joint.pivot, part.joint.axis)
    return center


def _static_friction(twin: Twin) -> float:
    """The scene's friction is not estimated: take the parts' mean, or the table's usual 0.6."""
    values = [p.physics.friction.value for p in twin.parts if p.physics is not None]
    return float(np.mean(values)) if values else 0.6


def _link(part: Part, parent: str, origin: Array, offset: Array) -> Link:
    if part.inertial is None or part.physics is None:
        raise SceneError(
            f"part {part.name!r} has no mass or friction", "call twin.physics.with_physics first"
        )
    joint = part.joint
    if joint.upper <= joint.lower:
        raise SceneError(
            f"part {part.name!r} has the empty range {joint.lower}..{joint.upper}",
            "set its limits in twin.json",
        )
    to_link = geo.make_pose(translation=-origin)
    contact = part.contact
    return Link(
        name=part.name,
        parent=parent,
        offset=offset,
        visual=part.mesh.transformed(to_link),
        collision=tuple(_moved(c, to_link) for c in part.collision),
        friction=part.physics.friction.value,
        joint=TreeJoint(
            name=f"{part.name}_joint",
            kind=joint.kind,
            axis=geo.unit(joint.axis),
            lower=float(joint.lower),
            upper=float(joint.upper),
            damping=part.physics.damping.value,
            frictionloss=part.physics.frictionloss.value,
        ),
        mass=part.inertial.mass.value,
        com=part.inertial.com - origin,
        inertia=part.inertial.inertia,
        grasp=None if contact is None else geo.make_pose(contact.rotation, contact.point - origin),
        grasp_width=0.0 if contact is None else contact.width,
    )


def _moved(piece: Collision, pose: Array) -> Collision:
    return piece.transformed(pose) if isinstance(piece, Mesh) else Box(pose @ piece.T_world_box, piece.size)


def numbers(values: object) -> str:
    """Numbers for a text format, with as many digits as it takes to read back the same double."""
    return " ".join(repr(float(v) + 0.0) for v in np.asarray(values, dtype=np.float64).ravel())
