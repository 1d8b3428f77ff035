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
from twin.physics import KEPT
from twin.placed import replaced
from twin.scene import FIRST_PART_ID, HAND_LABEL, STATIC_LABEL, Mesh, Part, StaticPart, Twin

# Share of a part's surface below which a piece of it is too small to be a part; chosen by us.
_LEAST = 0.01


def with_name(twin: Twin, part: Part, to: str) -> Twin:
    """The part by another name, in pairs that don't collide as well."""
    pairs = tuple((to if a == part.name else a, to if b == part.name else b) for a, b in twin.filtered_pairs)
    unpaired = replace(twin, filtered_pairs=())  # a pair names parts that there are
    return rejudged(replace(replaced(unpaired, replace(part, name=to)), filtered_pairs=pairs))


def removed(twin: Twin, part: Part) -> Twin:
    """The part is none: its surface stands still, closed, with what carried it. What it carried stays."""
    if part.parent is not None:
        return _taken_in(twin, part, twin.part(part.parent))
    static = twin.static
    whole = replace(static, mesh=_joined(static, part), collision=(*static.collision, *part.collision))
    return _without(replace(twin, static=whole), part, None)


def merged(twin: Twin, part: Part, other: Part) -> Twin:
    """The part is a piece of another one, and moves with it."""
    if part.id == other.id:
        raise Unfit("it is that part")
    if other.parent == part.id:
        raise Unfit(f"{other.name} is mounted on it")
    return _taken_in(twin, part, other)


def split(twin: Twin, part: Part, point: Array) -> Twin:
    """The connected piece of the part that is nearest to a point (3,) m becomes a part of its own, with the
    same joint and motion. Labels tell it not apart: they stay the first one's. Neither keeps a mass."""
    mesh = part.mesh
    if not len(mesh.faces):
        raise Unfit("it has no surface")
    piece = vertex_pieces(mesh.faces, len(mesh.vertices))[mesh.faces[:, 0]]
    middles = mesh.vertices[mesh.faces].mean(axis=1)
    mine = np.asarray(piece == piece[int(np.argmin(np.linalg.norm(middles - point, axis=1)))], np.bool_)
    share = mesh.of(mine).area / max(mesh.area, 1e-12)
    if not _LEAST < share < 1 - _LEAST:
        raise Unfit(f"the piece nearest to that point has {100 * share:.1f} % of its surface")
    name = legal_name(part.name, [o.name for o in twin.owners])
    number = next(k for k in range(FIRST_PART_ID, HAND_LABEL) if all(p.id != k for p in twin.parts))
    bodiless = replace(part, inertial=None, physics=None, collision=(), completion=None)
    apart = replace(bodiless, id=number, name=name, mesh=mesh.of(mine), contact=None, handle=None)
    left = replaced(twin, replace(bodiless, mesh=mesh.of(~mine)))
    return rejudged(bare(replace(left, parts=(*left.parts, apart))))


def _taken_in(twin: Twin, part: Part, by: Part) -> Twin:
    """The part as a piece of another one, whose mass and resistance are computed anew unless it was weighed
    or a number of it stated."""
    told = by.physics is not None and (
        by.physics.catch is not None or any(q.origin in KEPT for q in by.physics.numbers.values())
    )
    weighed = by.inertial is not None and by.inertial.mass.origin in KEPT
    whole = replace(
        by,
        mesh=_joined(by, part),
        collision=(*by.collision, *part.collision),
        inertial=by.inertial if weighed else None,
        physics=by.physics if told or weighed else None,
    )
    return _without(replaced(twin, whole), part, by.id)


def _joined(a: StaticPart | Part, b: Part) -> Mesh:
    return joined_textures([a.mesh, b.mesh])[0]


def _without(twin: Twin, gone: Part, by: int | None) -> Twin:
    """Without a part: what it carried, its pixels and its pairs are another's, or the static scene's."""
    parts = tuple(replace(p, parent=by) if p.parent == gone.id else p for p in twin.parts if p.id != gone.id)
    into = np.uint8(STATIC_LABEL if by is None else by)
    labels: Mapping[int, NDArray[np.uint8]] = {
        frame: np.where(image == gone.id, into, image) for frame, image in twin.labels.items()
    }
    pairs = tuple(pair for pair in twin.filtered_pairs if gone.name not in pair)
    return rejudged(bare(replace(twin, parts=parts, labels=labels, filtered_pairs=pairs)))
