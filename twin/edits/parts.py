"""Edits of which parts there are: their names, parts that are one, two in one, and what is no part."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from twin.atlas import joined_textures
from twin.edits.joints import bare
from twin.edits.unfit import Unfit
from twin.edits.worth import rejudged
from twin.geometry import Array
from twin.mesh import vertex_pieces
from twin.names import legal_name
from twin.scene import FIRST_PART_ID, HAND_LABEL, STATIC_LABEL, Mesh, Part, Twin

# Share of a part's surface below which a piece of it is too small to be a part; chosen by us.
_LEAST = 0.01


def with_name(twin: Twin, part: Part, to: str) -> Twin:
    """The part by another name, in pairs that don't collide as well."""
    pairs = tuple((to if a == part.name else a, to if b == part.name else b) for a, b in twin.filtered_pairs)
    parts = tuple(replace(p, name=to) if p.id == part.id else p for p in twin.parts)
    return rejudged(replace(twin, parts=parts, filtered_pairs=pairs))


def removed(twin: Twin, part: Part) -> Twin:
    """The part is none: its surface stands still, closed, with what carried it. What it carried stays."""
    held = replace(twin, parts=tuple(_on(p, part, part.parent) for p in twin.parts if p.id != part.id))
    if part.parent is None:
        whole = _joined(twin.static.mesh, part.mesh)
        held = replace(held, static=replace(twin.static, mesh=whole))
    else:
        held = _with_mesh(held, part.parent, part.mesh)
    into = STATIC_LABEL if part.parent is None else part.parent
    return _settled(twin, held, part, into)


def merged(twin: Twin, part: Part, other: Part) -> Twin:
    """The part is a piece of another one, and moves with it."""
    if part.id == other.id:
        raise Unfit("it is that part")
    if other.parent == part.id:
        raise Unfit(f"{other.name} is mounted on it")
    held = replace(twin, parts=tuple(_on(p, part, other.id) for p in twin.parts if p.id != part.id))
    return _settled(twin, _with_mesh(held, other.id, part.mesh), part, other.id)


def split(twin: Twin, part: Part, point: Array) -> Twin:
    """The connected piece of the part that is nearest to a point (3,) m becomes a part of its own, with the
    same joint and motion. Labels tell it not apart: they stay the first one's."""
    mesh = part.mesh
    if not len(mesh.faces):
        raise Unfit("it has no surface")
    piece = vertex_pieces(mesh.faces, len(mesh.vertices))[mesh.faces[:, 0]]
    middles = mesh.vertices[mesh.faces].mean(axis=1)
    mine = np.asarray(piece == piece[int(np.argmin(np.linalg.norm(middles - point, axis=1)))], np.bool_)
    area = mesh.of(mine).area
    if not _LEAST * mesh.area < area < (1 - _LEAST) * mesh.area:
        raise Unfit(
            f"the piece nearest to that point has {100 * area / max(mesh.area, 1e-12):.1f} % of its surface"
        )
    name = legal_name(part.name, [o.name for o in twin.owners])
    number = next(k for k in range(FIRST_PART_ID, HAND_LABEL) if all(p.id != k for p in twin.parts))
    apart = replace(part, id=number, name=name, mesh=mesh.of(mine), contact=None, handle=None, inertial=None)
    left = replace(part, mesh=mesh.of(~mine), inertial=None)
    parts = [left if p.id == part.id else p for p in twin.parts]
    return rejudged(bare(replace(twin, parts=(*parts, apart))))


def _on(part: Part, gone: Part, carrier: int | None) -> Part:
    return replace(part, parent=carrier) if part.parent == gone.id else part


def _joined(a: Mesh, b: Mesh) -> Mesh:
    return joined_textures([a, b])[0]


def _with_mesh(twin: Twin, number: int, more: Mesh) -> Twin:
    parts = tuple(replace(p, mesh=_joined(p.mesh, more)) if p.id == number else p for p in twin.parts)
    return replace(twin, parts=parts)


def _settled(before: Twin, twin: Twin, gone: Part, into: int) -> Twin:
    """With the labels of what is gone as another's, and without its pairs."""
    pairs = tuple(pair for pair in twin.filtered_pairs if gone.name not in pair)
    labels: Mapping[int, NDArray[np.uint8]] = {
        frame: np.where(image == gone.id, np.uint8(into), image) for frame, image in before.labels.items()
    }
    return rejudged(bare(replace(twin, labels=labels, filtered_pairs=pairs)))
