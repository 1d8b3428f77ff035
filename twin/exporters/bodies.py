"""What is drawn of a body and what of it collides: the seen layer alone, or both layers side by side."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from twin.exporters.links import Link, Region, Visual
from twin.exporters.visual import drawn
from twin.geometry import Array
from twin.inferred import Completion
from twin.names import legal_name
from twin.scene import Box, Collision, Mesh, Part, StaticPart

_NOTHING = Mesh(np.zeros((0, 3)), np.zeros((0, 3), np.int32))


def visuals_of(owner: StaticPart | Part, T_link_world: Array | None) -> tuple[Visual, ...]:
    """What is drawn of a body: its seen mesh, or what is shown of that and the inferred pieces."""
    layer = owner.completion
    seen = drawn(_carried(owner.mesh if layer is None else layer.shown, T_link_world))
    found = [Visual(f"{owner.name}_visual", seen)] if len(seen.faces) else []
    for p in () if layer is None else layer.pieces:
        r, g, b = (round(float(c) / 255, 4) for c in p.color)
        mesh, plain = _carried(p.mesh, T_link_world), None if p.mesh.texture is not None else (r, g, b)
        found.append(Visual(f"{owner.name}_inferred_{p.name}", mesh, p.basis, p.role, p.reason, plain))
    return tuple(found)


def named_shapes(owner: StaticPart | Part, T_link_world: Array | None) -> dict[str, Collision]:
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


def regions_of(owner: StaticPart | Part, T_link_world: Array | None) -> tuple[Region, ...]:
    found = () if owner.completion is None else owner.completion.interiors
    boxes = {i.name: i.box for i in found}
    if T_link_world is not None:
        boxes = {n: Box(T_link_world @ b.T_world_box, b.size) for n, b in boxes.items()}
    return tuple(Region(f"{owner.name}_{n}", b) for n, b in boxes.items())


def _carried(mesh: Mesh, T_new_old: Array | None) -> Mesh:
    """A mesh in another frame, or, in the same one, to the last bit as it is."""
    return mesh if T_new_old is None else mesh.transformed(T_new_old)


def room_of(root: Link, layer: Completion, taken: Sequence[str], visual: bool) -> Link:
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


def _moved(piece: Collision, pose: Array) -> Collision:
    return piece.transformed(pose) if isinstance(piece, Mesh) else Box(pose @ piece.T_world_box, piece.size)
