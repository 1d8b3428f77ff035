"""Openings by the piece of furniture that they sit in, and which surface belongs to which piece."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from twin import geometry as geo
from twin.completion.opening import Opening
from twin.geometry import Array
from twin.inferred import Completion, Inferred, Interior
from twin.mesh import joined
from twin.names import legal_name

# All chosen by us. m between the cabinets of one piece of furniture: less than a cabinet's width, so that one
# that nobody opened may stand between them.
_BESIDE = 0.5
# Least cosine between the axes of fronts of one piece.
_ALIGNED = float(np.cos(np.radians(8.0)))


def by_furniture(opened: Sequence[Opening]) -> list[list[Opening]]:
    """Openings of one piece of furniture together, in the given order.

    Their frames lie along the same axes, and the cabinets hang together with gaps of `_BESIDE` at most.
    """
    out: list[list[Opening]] = []
    for o in opened:
        mine = [group for group in out if any(_side_by_side(o, other) for other in group)]
        together = [other for group in mine for other in group]
        where = out.index(mine[0]) if mine else len(out)
        rest = [group for group in out if group not in mine]
        out = [*rest[:where], [*together, o], *rest[where:]]
    return out


def nearest_piece(groups: Sequence[Sequence[Opening]], points: Array) -> NDArray[np.intp]:
    """The group (n,) to whose cabinets each world point (n, 3) is nearest."""
    away = [np.min([_distance(o, points) for o in group], axis=0) for group in groups]
    return np.asarray(np.argmin(away, axis=0))


def together(layers: Sequence[Completion]) -> Completion:
    """Layers of several pieces of furniture as one, without what is room; names stay apart by a number."""
    names: list[str] = []
    pieces: list[Inferred] = []
    for piece in (p for layer in layers for p in layer.pieces):
        names.append(legal_name(piece.name, names))
        pieces.append(replace(piece, name=names[-1]))
    insides: list[Interior] = [i for layer in layers for i in layer.interiors]
    return Completion(joined([layer.shown for layer in layers]), tuple(pieces), (), tuple(insides))


def _side_by_side(a: Opening, b: Opening) -> bool:
    turn = a.front.frame.T_world_frame[:3, :3].T @ b.front.frame.T_world_frame[:3, :3]
    if np.abs(turn).max(axis=0).min() < _ALIGNED:
        return False
    low, high = a.inside
    there = a.front.local(geo.transform(b.front.frame.T_world_frame, _corners(b)))
    gap = np.maximum(low - there.max(axis=0), there.min(axis=0) - high)
    return bool(np.linalg.norm(np.maximum(gap, 0.0)) < _BESIDE)


def _corners(o: Opening) -> Array:
    """The eight corners (8, 3) of a cabinet in its front's frame."""
    return np.stack(np.meshgrid(*np.transpose(o.inside)), axis=-1).reshape(-1, 3)


def _distance(o: Opening, points: Array) -> Array:
    """m (n,) from world points (n, 3) to a cabinet."""
    (low, high), p = o.inside, o.front.local(points)
    return np.asarray(np.linalg.norm(np.maximum(np.maximum(low - p, p - high), 0.0), axis=1))
