"""A twin in another world frame, with other zeros of its states, or with another state of one part."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from twin import geometry as geo
from twin.contacts import moved_contact
from twin.geometry import Array
from twin.inferred import Completion, Inferred, Interior
from twin.scene import Collision, HandleSection, Inertial, Joint, Part, Twin


def placed(twin: Twin, T_new_old: Array) -> Twin:
    """Everything of a twin in a new world frame: meshes, joints, masses, contacts, shapes, cameras.

    T_new_old: (4, 4), level: z stays up.
    """
    static = twin.static
    return replace(
        twin,
        static=replace(
            static,
            mesh=static.mesh.transformed(T_new_old),
            collision=_shapes(static.collision, T_new_old),
            completion=None if static.completion is None else _completion(static.completion, T_new_old),
        ),
        parts=tuple(_moved(p, T_new_old, p.joint.transformed(T_new_old)) for p in twin.parts),
        cameras=None if twin.cameras is None else twin.cameras.transformed(T_new_old),
    )


def replaced(twin: Twin, part: Part) -> Twin:
    """The twin with this part in place of its part of the same id."""
    return replace(twin, parts=tuple(part if p.id == part.id else p for p in twin.parts))


def counted_from(twin: Twin, states: Mapping[int, float]) -> Twin:
    """The same twin with its states counted from others: state 0 of each part is where it stands when the
    parts of these ids are at `states`, the rest at 0. What a part carries goes along."""
    if not any(states.values()):
        return twin

    def counted(part: Part) -> Part:
        zero, motion = states.get(part.id, 0.0), part.motion
        joint = part.joint
        if part.parent is not None:
            joint = joint.transformed(twin.part_pose(part.parent, states))
        joint = replace(joint, lower=joint.lower - zero, upper=joint.upper - zero)
        moved = _moved(part, twin.part_pose(part.id, states), joint)
        return replace(moved, motion=replace(motion, state=motion.state - zero))

    return replace(twin, parts=tuple(counted(p) for p in twin.parts))


def _moved(part: Part, T: Array, joint: Joint) -> Part:
    """All shapes and masses of a part moved by T (4, 4), with another joint."""
    return replace(
        part,
        mesh=part.mesh.transformed(T),
        joint=joint,
        inertial=None if part.inertial is None else _inertial(part.inertial, T),
        contact=None if part.contact is None else moved_contact(part.contact, T),
        handle=None if part.handle is None else _handle(part.handle, T),
        collision=_shapes(part.collision, T),
        completion=None if part.completion is None else _completion(part.completion, T),
    )


def _shapes(shapes: tuple[Collision, ...], T: Array) -> tuple[Collision, ...]:
    return tuple(s.transformed(T) for s in shapes)


def _completion(layer: Completion, T: Array) -> Completion:
    def piece(p: Inferred) -> Inferred:
        return replace(p, mesh=p.mesh.transformed(T), shapes=_shapes(p.shapes, T))

    return Completion(
        shown=layer.shown.transformed(T),
        pieces=tuple(piece(p) for p in layer.pieces),
        collision=_shapes(layer.collision, T),
        interiors=tuple(Interior(i.name, i.box.transformed(T)) for i in layer.interiors),
        room=None if layer.room is None else layer.room.transformed(T),
        room_collision=_shapes(layer.room_collision, T),
        version=layer.version,
        kind=layer.kind,
        limits=layer.limits,
    )


def _inertial(inertial: Inertial, T: Array) -> Inertial:
    r = T[:3, :3]
    tensor = r @ inertial.inertia @ r.T
    box = None
    if inertial.com_interval is not None:
        low, high = inertial.com_interval
        corners = np.array(
            [[x, y, z] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])]
        )
        turned = geo.transform(T, corners)
        box = np.stack([turned.min(axis=0), turned.max(axis=0)])
    com = geo.transform(T, inertial.com[None])[0]
    return replace(inertial, com=com, inertia=(tensor + tensor.T) / 2, com_interval=box)


def _handle(handle: HandleSection, T: Array) -> HandleSection:
    return replace(handle, middle=geo.transform(T, handle.middle[None])[0])
