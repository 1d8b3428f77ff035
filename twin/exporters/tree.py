"""The one intermediate model that all writers read: links, joint frames, inertials, shapes.

Every link frame has the axes of the twin's world at state 0, so axes, tensors and meshes need no rotation: the frame of a
revolute part sits on its hinge, at the foot of its mesh's centroid; that of a prismatic part at the centroid.
The root link is the static scene and its frame is the world.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from twin import geometry as geo
from twin.errors import SceneError
from twin.exporters.visual import drawn
from twin.geometry import Array
from twin.inferred import Completion
from twin.names import legal_name
from twin.physics import armature, inertial_of, physics_of, static_friction
from twin.scene import Box, Collision, Mesh, Part, Revolute, StaticPart, Twin
from twin.verdict import Verdict, verdict_line

# URDF demands effort and velocity limits; nothing was measured. Chosen by us, far above what a person's hand does.
EFFORT_LIMIT = {"revolute": 100.0, "prismatic": 200.0}  # N m, N
VELOCITY_LIMIT = {"revolute": 6.0, "prismatic": 3.0}  # rad/s, m/s
# Far above double precision and far below any scene, chosen by us: m or rad of limits, share of a tensor's trace; kg m^2.
_ROUNDING, _LEAST = 1e-9, 1e-9
_BOARD = 12.6  # kg/m^2: 18 mm of furniture board, as in assets/materials.toml
_NOTHING = Mesh(np.zeros((0, 3)), np.zeros((0, 3), np.int32))


@dataclass(frozen=True, eq=False)
class TreeJoint:
    """Joint of a link to its parent, at the link's origin. Axis (3,) unit, limits m or rad, SI damping, friction and armature.

    holds: its friction stands for what held the part at rest in the recording, and must not creep.
    """

    name: str
    kind: Literal["revolute", "prismatic"]
    axis: Array
    lower: float
    upper: float
    damping: float
    frictionloss: float
    armature: float
    holds: bool


@dataclass(frozen=True, eq=False)
class Visual:
    """Something that is drawn of a link, in its frame: `<link>_visual`, what was seen, or `<link>_inferred_<piece>`.

    basis: "seen", or what an inferred piece rests on; role and reason as of that piece. color: (r, g, b) in 0..1 of a piece, which is
    plain; None where the mesh has its own.
    """

    name: str
    mesh: Mesh
    basis: Literal["seen", "evidence", "assumed"] = "seen"
    role: str = "part"
    reason: str = ""
    color: tuple[float, float, float] | None = None


@dataclass(frozen=True, eq=False)
class Region:
    """Free space inside furniture: a box in its link's frame."""

    name: str
    box: Box


@dataclass(frozen=True, eq=False)
class Link:
    """One rigid body; everything is in the link's frame.

    parent: name of the parent link, None for what stands still. offset (3,): origin in the parent's frame. visuals: what is drawn.
    shapes: name -> collision shape. mass in kg, inertia (3, 3) about com (3,). grasp (4, 4): frame of the contact path, columns as in
    ContactPath, and the width (m) of what is held there. kind: what it is, in one word.
    """

    name: str
    parent: str | None
    offset: Array
    visuals: tuple[Visual, ...]
    shapes: Mapping[str, Collision]
    friction: float
    mass: float
    com: Array
    inertia: Array
    joint: TreeJoint | None = None
    grasp: Array | None = None
    grasp_width: float = 0.0
    regions: tuple[Region, ...] = ()
    kind: str = ""

    @property
    def collision(self) -> tuple[Collision, ...]:
        """The collision shapes."""
        return tuple(self.shapes.values())

    @property
    def drawn(self) -> Array:
        """Vertices (n, 3) m of all that is drawn."""
        return np.concatenate([v.mesh.vertices for v in self.visuals]) if self.visuals else np.zeros((0, 3))


@dataclass(frozen=True, eq=False)
class Tree:
    """Links, the root first and every parent before its children, in depth-first order; source names what it was made from.

    verdict: on the twin, None where it has none; told: the line that says it, or why there is none. whole: with the inferred layer.
    """

    name: str
    links: tuple[Link, ...]
    source: str = "twin.json"
    verdict: Verdict | None = None
    told: str = ""
    whole: bool = False

    @property
    def root(self) -> Link:
        return self.links[0]

    @property
    def standing(self) -> list[Link]:
        """The links that stand still: the root, and the room where it is apart."""
        return [k for k in self.links if k.parent is None]

    def children(self, name: str) -> list[Link]:
        return [k for k in self.links if k.parent == name]

    @property
    def moving(self) -> list[Link]:
        return [k for k in self.links if k.joint is not None]


def build_tree(twin: Twin, visual: bool = True) -> Tree:
    """Turn a twin into links. Raises SceneError when a part lacks what simulation needs.

    visual: with what is drawn, which nothing touches and whose making takes a third of the time; else links show nothing.
    """
    require_ranges(twin)
    mass, com, inertia = _static_mass(twin)
    static = twin.static
    root = Link(
        name=static.name,
        parent=None,
        offset=np.zeros(3),
        visuals=_visuals(static, None) if visual else (),
        shapes=_named_shapes(static, None),
        friction=static_friction(twin),
        mass=mass,
        com=com,
        inertia=inertia,
        regions=_regions(static, None),
        kind="furniture",
    )
    links = [root]
    layer = static.completion
    if layer is not None and layer.room is not None:
        links.append(_room(root, layer, [static.name, *(p.name for p in twin.parts)], visual))

    def add(parent_id: int | None, parent_name: str, parent_origin: Array) -> None:
        for part in twin.parts:
            if part.parent == parent_id:
                origin = link_origin(part)
                links.append(_link(part, parent_name, origin, origin - parent_origin, visual))
                add(part.id, part.name, origin)

    add(None, root.name, np.zeros(3))
    source = twin.recorded.source if twin.recorded is not None else ""
    return Tree(
        twin.name, tuple(links), source or "twin.json", twin.verdict, verdict_line(twin), layer is not None
    )


def _visuals(owner: StaticPart | Part, T_link_world: Array | None) -> tuple[Visual, ...]:
    """What is drawn of a body: its seen mesh, or what is shown of that and the inferred pieces."""
    layer = owner.completion
    seen = drawn(_carried(owner.mesh if layer is None else layer.shown, T_link_world))
    found = [Visual(f"{owner.name}_visual", seen)] if len(seen.faces) else []
    for p in () if layer is None else layer.pieces:
        r, g, b = (round(float(c) / 255, 4) for c in p.color)
        mesh = _carried(p.mesh, T_link_world)
        found.append(Visual(f"{owner.name}_inferred_{p.name}", mesh, p.basis, p.role, p.reason, (r, g, b)))
    return tuple(found)


def _named_shapes(owner: StaticPart | Part, T_link_world: Array | None) -> dict[str, Collision]:
    """The collision shapes of a body by their names; those of an inferred piece bear its name."""
    layer = owner.completion
    rest = owner.collision if layer is None else layer.collision
    named = {
        f"{owner.name}_{p.name}_collision_{k}": s
        for p in (() if layer is None else layer.pieces)
        for k, s in enumerate(p.shapes)
    }
    named |= {f"{owner.name}_collision_{k}": s for k, s in enumerate(rest)}
    return named if T_link_world is None else {name: _moved(s, T_link_world) for name, s in named.items()}


def _regions(owner: StaticPart | Part, T_link_world: Array | None) -> tuple[Region, ...]:
    found = () if owner.completion is None else owner.completion.interiors
    boxes = {i.name: i.box for i in found}
    if T_link_world is not None:
        boxes = {n: Box(T_link_world @ b.T_world_box, b.size) for n, b in boxes.items()}
    return tuple(Region(f"{owner.name}_{n}", b) for n, b in boxes.items())


def _carried(mesh: Mesh, T_new_old: Array | None) -> Mesh:
    """A mesh in another frame, or, in the same one, to the last bit as it is."""
    return mesh if T_new_old is None else mesh.transformed(T_new_old)


def _room(root: Link, layer: Completion, taken: Sequence[str], visual: bool) -> Link:
    """What stands still and is no furniture of the parts, as a body of its own."""
    name = legal_name("room", taken)
    mesh = drawn(layer.room) if layer.room is not None and visual else _NOTHING
    shapes = {f"{name}_collision_{k}": s for k, s in enumerate(layer.room_collision)}
    return replace(
        root,
        name=name,
        visuals=(Visual(f"{name}_visual", mesh),) if len(mesh.faces) else (),
        shapes=shapes,
        regions=(),
        kind="room",
    )


def require_ranges(twin: Twin) -> None:
    """Raises SceneError for a part that can't move, or whose closed state, in which all files show it, is none of its own."""
    for part in twin.parts:
        if part.joint.upper <= part.joint.lower:
            raise SceneError(
                f"part {part.name!r} has the empty range {part.joint.lower}..{part.joint.upper}",
                "set its limits in twin.json",
            )
        if not part.joint.lower - _ROUNDING <= 0 <= part.joint.upper + _ROUNDING:
            raise SceneError(
                f"part {part.name!r} has the range {part.joint.lower:g}..{part.joint.upper:g}, which does not hold the closed "
                "state 0 that its mesh shows",
                "count its limits from there in twin.json",
            )


def link_origin(part: Part) -> Array:
    """World position (3,) of a part's link frame at state 0."""
    center = part.mesh.area_centroid if len(part.mesh.vertices) else np.zeros(3)
    if isinstance(part.joint, Revolute):
        return geo.nearest_point_on_line(center, part.joint.pivot, part.joint.axis)
    return center


def _static_mass(twin: Twin) -> tuple[float, Array, Array]:
    """Mass (kg), centre (3,) and tensor (3, 3) about it of the static scene.

    It is fixed to the world, so its mass has no effect, but readers want one of every body: it counts as a surface that
    weighs as much per area as the parts do.
    """
    mesh = twin.static.mesh
    weighed = [(p.inertial.mass.value, p.mesh.area) for p in twin.parts if p.inertial is not None]
    area = sum(a for _, a in weighed)
    per_area = sum(m for m, _ in weighed) / area if area > 0 else _BOARD
    corners = mesh.vertices[mesh.faces]
    mass = per_area * geo.triangle_areas(corners)
    total = float(mass.sum())
    if total <= 0:  # nothing was seen: a square metre of board
        return _BOARD, np.zeros(3), np.eye(3) * _BOARD
    com = np.asarray(mass @ corners.mean(axis=1) / total)
    corners = corners - com
    vertices = np.concatenate([corners, corners.sum(axis=1, keepdims=True)], axis=1)
    second = np.einsum("f,fki,fkj->ij", mass / 12, vertices, vertices)  # moments of triangles
    tensor = np.trace(second) * np.eye(3) - second
    # a flat scene's moments meet the triangle inequality as an equation, which rounding can break
    return total, com, tensor + max(_ROUNDING * float(np.trace(tensor)), _LEAST) * np.eye(3)


def joint_name(part: Part) -> str:
    """What a part's joint is called in every format."""
    return f"{part.name}_joint"


def _link(part: Part, parent: str, origin: Array, offset: Array, visual: bool) -> Link:
    joint, inertial, physics = part.joint, inertial_of(part), physics_of(part)
    to_link = geo.make_pose(translation=-origin)
    contact = part.contact
    return Link(
        name=part.name,
        parent=parent,
        offset=offset,
        visuals=_visuals(part, to_link) if visual else (),
        shapes=_named_shapes(part, to_link),
        friction=physics.friction.value,
        joint=TreeJoint(
            name=joint_name(part),
            kind=joint.kind,
            axis=geo.unit(joint.axis),
            lower=float(joint.lower),
            upper=float(joint.upper),
            damping=physics.damping.value,
            frictionloss=physics.frictionloss.value,
            armature=armature(joint, inertial),
            holds=physics.frictionloss.origin == "recording",
        ),
        mass=inertial.mass.value,
        com=inertial.com - origin,
        inertia=inertial.inertia,
        grasp=None if contact is None else geo.make_pose(contact.rotation, contact.point - origin),
        grasp_width=0.0 if contact is None else contact.width,
        regions=_regions(part, to_link),
        kind=part.name.rstrip("0123456789").rstrip("_"),
    )


def spawn(region: Region) -> Array:
    """Where a thing is put down in a region, in its link's frame (3,): the middle of its floor. The axes of a link are the world's."""
    corners = region.box.corners
    return np.array([*corners[:, :2].mean(axis=0), corners[:, 2].min()])


def front(tree: Tree) -> Array:
    """Level unit direction (3,) into which the parts open: where a viewer stands."""
    total = np.zeros(3)
    for link in tree.moving:
        if link.grasp is not None:
            total += link.grasp[:3, 2]  # out of the part
        elif link.joint is not None and link.joint.kind == "prismatic":
            total += link.joint.axis
        elif link.joint is not None and link.visuals:
            total += np.cross(
                link.joint.axis, link.visuals[0].mesh.area_centroid
            )  # the way its middle starts to move
    total[2] = 0.0
    return geo.unit(total) if np.linalg.norm(total) > 1e-6 else np.array([0.0, -1.0, 0.0])


def _moved(piece: Collision, pose: Array) -> Collision:
    return piece.transformed(pose) if isinstance(piece, Mesh) else Box(pose @ piece.T_world_box, piece.size)


def numbers(values: object) -> str:
    """Numbers for a text format, with as many digits as it takes to read back the same double."""
    return " ".join(repr(float(v) + 0.0) for v in np.asarray(values, dtype=np.float64).ravel())
