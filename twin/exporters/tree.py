"""The one intermediate model that all writers read: links, joint frames, inertials, shapes.

Every link frame has the axes of the twin's world at state 0, so axes, tensors and meshes need no rotation:
the frame of a revolute part sits on its hinge, at the foot of its mesh's centroid; that of a prismatic part
at the centroid. The root link is the static scene and its frame is the world.
"""

from __future__ import annotations

import numpy as np

from twin import geometry as geo
from twin.errors import SceneError
from twin.exporters.bodies import named_shapes, regions_of, room_of, visuals_of
from twin.exporters.links import Link as Link
from twin.exporters.links import Region as Region
from twin.exporters.links import Tree as Tree
from twin.exporters.links import TreeCatch as TreeCatch
from twin.exporters.links import TreeJoint as TreeJoint
from twin.exporters.links import Visual as Visual
from twin.exporters.links import catches_lost as catches_lost
from twin.exporters.links import clear_of_each_other as clear_of_each_other
from twin.exporters.links import numbers as numbers
from twin.exporters.links import spawn as spawn
from twin.geometry import Array
from twin.limits import cut_off
from twin.physics import armature, inertial_of, physics_of, static_friction
from twin.physics.catches import lever_of, require_catch
from twin.scene import Part, Revolute, Twin
from twin.verdict import verdict_line

# URDF demands effort and velocity limits; nothing was measured. Chosen by us, far above a hand's.
EFFORT_LIMIT = {"revolute": 100.0, "prismatic": 200.0}  # N m, N
VELOCITY_LIMIT = {"revolute": 6.0, "prismatic": 3.0}  # rad/s, m/s
# m or rad of limits, share of a trace. Far above double precision, far below any scene. Chosen by us.
_ROUNDING = 1e-9
# kg m^2, least inertia. Chosen by us.
_LEAST = 1e-9
_BOARD = 12.6  # kg/m^2: 18 mm of furniture board, as in assets/materials.toml


def build_tree(twin: Twin, visual: bool = True) -> Tree:
    """Turn a twin into links. Raises SceneError when a part lacks what simulation needs.

    visual: with what is drawn, a third of the time; else links show nothing.
    """
    require_ranges(twin)
    mass, com, inertia = _static_mass(twin)
    static = twin.static
    root = Link(
        name=static.name,
        parent=None,
        offset=np.zeros(3),
        visuals=visuals_of(static, None) if visual else (),
        shapes=named_shapes(static, None),
        friction=static_friction(twin),
        mass=mass,
        com=com,
        inertia=inertia,
        regions=regions_of(static, None),
        kind="furniture",
    )
    links = [root]
    layer = static.completion
    if layer is not None and layer.room is not None:
        links.append(room_of(root, layer, [static.name, *(p.name for p in twin.parts)], visual))

    def add(parent_id: int | None, parent_name: str, parent_origin: Array) -> None:
        for part in twin.parts:
            if part.parent == parent_id:
                origin = link_origin(part)
                links.append(_link(twin, part, parent_name, origin, origin - parent_origin, visual))
                add(part.id, part.name, origin)

    add(None, root.name, np.zeros(3))
    source = twin.recorded.source if twin.recorded is not None else ""
    return Tree(
        twin.name,
        tuple(links),
        source or "twin.json",
        twin.verdict,
        verdict_line(twin),
        layer is not None,
        _filtered(twin, links),
    )


def _filtered(twin: Twin, links: list[Link]) -> tuple[tuple[str, str], ...]:
    """Pairs of links that don't collide: a part and what it is mounted on, since hinges and runners are not
    modelled as contact, and the twin's filtered pairs; what is filtered against the static scene is so
    against all that stands still."""
    mounted = [(str(k.parent), k.name) for k in links if k.joint is not None]
    standing = [k.name for k in links if k.parent is None]
    stated = [
        (first, b) for a, b in twin.filtered_pairs for first in (standing if a == twin.static.name else [a])
    ]
    return tuple(dict.fromkeys([*mounted, *(p for p in stated if p[::-1] not in mounted)]))


def require_ranges(twin: Twin) -> None:
    """Raises SceneError for a part that can't move or whose closed state (in all files) is out of range."""
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
        if cut := cut_off(part):
            raise SceneError(cut, "set limits in twin.json that hold it, or leave the motion out there")
        require_catch(part)


def link_origin(part: Part) -> Array:
    """World position (3,) of a part's link frame at state 0."""
    center = part.mesh.area_centroid if len(part.mesh.vertices) else np.zeros(3)
    if isinstance(part.joint, Revolute):
        return geo.nearest_point_on_line(center, part.joint.pivot, part.joint.axis)
    return center


def _static_mass(twin: Twin) -> tuple[float, Array, Array]:
    """Mass (kg), centre (3,) and tensor (3, 3) about it of the static scene.

    It is fixed to the world, so its mass has no effect, but readers want one of every body: it counts as a
    surface that weighs as much per area as the parts do.
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


def _link(twin: Twin, part: Part, parent: str, origin: Array, offset: Array, visual: bool) -> Link:
    joint, inertial, physics = part.joint, inertial_of(part), physics_of(part)
    to_link = geo.make_pose(translation=-origin)
    contact = part.contact
    return Link(
        name=part.name,
        parent=parent,
        offset=offset,
        visuals=visuals_of(part, to_link) if visual else (),
        shapes=named_shapes(part, to_link),
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
            catch=_catch(part, origin),
            times=part.motion.times - started(twin),
            states=part.motion.state,
        ),
        mass=inertial.mass.value,
        com=inertial.com - origin,
        inertia=inertial.inertia,
        grasp=None if contact is None else geo.make_pose(contact.rotation, contact.point - origin),
        grasp_width=0.0 if contact is None else contact.width,
        regions=regions_of(part, to_link),
        kind=_kind(part),
    )


def started(twin: Twin) -> float:
    """When the recording starts, in s of its own clock: at its first camera, else at the first state."""
    if twin.cameras is not None:
        return float(twin.cameras.times[0])
    return min((float(p.motion.times[0]) for p in twin.parts if len(p.motion.times)), default=0.0)


def _kind(part: Part) -> str:
    """What a part is: as its inferred layer says, else as its name begins."""
    told = "" if part.completion is None else part.completion.kind
    return told or part.name.rstrip("0123456789").rstrip("_")


def _catch(part: Part, origin: Array) -> TreeCatch | None:
    """A part's catch, where the hand held it, or where it is farthest from its hinge."""
    catch = physics_of(part).catch
    if catch is None:
        return None
    place = np.zeros(3)
    if isinstance(part.joint, Revolute):
        points = part.mesh.vertices
        if lever_of(part) is not None and part.contact is not None:
            points = part.contact.point[None]
        arms = np.linalg.norm(np.cross(points - part.joint.pivot, part.joint.axis), axis=1)
        place = points[int(np.argmax(arms))] - origin
    sources = (catch.force.source, catch.width.source)
    return TreeCatch(catch.force.value, catch.width.value, place, sources)


def front(tree: Tree) -> Array:
    """Level unit direction (3,) into which the parts open: where a viewer stands."""
    total = np.zeros(3)
    for link in tree.moving:
        if link.grasp is not None:
            total += link.grasp[:3, 2]  # out of the part
        elif link.joint is not None and link.joint.kind == "prismatic":
            total += link.joint.axis
        elif link.joint is not None and link.visuals:
            # the way its middle starts to move
            total += np.cross(link.joint.axis, link.visuals[0].mesh.area_centroid)
    total[2] = 0.0
    return geo.unit(total) if np.linalg.norm(total) > 1e-6 else np.array([0.0, -1.0, 0.0])
