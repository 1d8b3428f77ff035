"""What of a completed surface hangs on its boards; what reaches none of them is no part of the furniture."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from twin import geometry as geo
from twin.completion.board import Board
from twin.completion.cloud import UP
from twin.completion.squared import BELOW, PLINTH
from twin.geometry import Array
from twin.mesh import vertex_pieces
from twin.scene import Mesh

# m from a part's boards within which a piece of it touches them. Chosen by us: a scan's noise.
_TOUCHES = 0.015
# m around a board within which something belongs to the same furniture: as far as a worktop is above what it
# lies on (twin.completion.squared).
_AROUND = BELOW
# m below it: the height of a plinth, of which the upper half may be hidden.
_UNDER = PLINTH
# m around a loose board within which the seen surface is its own (as twin.completion.shown has it).
_OWN = 0.020
# m within which two triangles' middles are one: what arithmetic leaves of a pose and its inverse.
_SAME = 1e-6

Mask = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Hanging:
    """Boards and drawn surface that hang on the parts' cabinets, and the seen triangles (F,) that don't."""

    boards: list[Board]
    shown: Mesh
    loose: Mask


def without_floaters(mesh: Mesh, boards: Sequence[Board], T_world_frame: Array) -> Mesh:
    """The mesh of a part without loose pieces that touch no board: the part is made of boards."""
    if not len(mesh.faces):
        return mesh
    low, high = _corners(boards)
    piece, found = _reached(mesh, low - _TOUCHES, high + _TOUCHES, T_world_frame)
    near: Mask = np.any(found, axis=1)
    return mesh.of(near[piece[mesh.faces[:, 0]]])


def hanging(
    shown: Mesh, boards: Sequence[Board], anchors: Sequence[Board], seen: Mesh, T_world_frame: Array
) -> Hanging:
    """What of boards and drawn surface hangs on the anchors, directly or by one another.

    Args:
        shown: the drawn surface, in the world.
        boards: beside the anchors; both lie in the frame.
        anchors: the parts' cabinets.
        seen: the surface, in the world, of which some is drawn.
        T_world_frame: pose (4, 4) of the frame.
    """
    low, high = _corners([*anchors, *boards])
    from_, to = low - _AROUND, high + _AROUND
    from_[:, UP] = low[:, UP] - _UNDER
    piece, found = _reached(shown, from_, to, T_world_frame)
    meets = np.all((to[:, None] > low) & (from_[:, None] < high), axis=2)
    joints = np.block([[meets, found.T], [found, np.zeros((len(found), len(found)), bool)]])
    group = connected_components(csr_array(joints), directed=False)[1]
    held = np.isin(group, group[: len(anchors)])
    ours, drawn = held[len(anchors) : len(low)], held[len(low) :][piece[shown.faces[:, 0]]]
    kept = [b for b, h in zip(boards, ours, strict=True) if h]
    loose = [b for b, h in zip(boards, ours, strict=True) if not h]
    if not loose and drawn.all():
        return Hanging(kept, shown, np.zeros(len(seen.faces), bool))
    ours_seen = _beside(seen, [*anchors, *kept], T_world_frame) | _among(seen, shown.of(drawn))
    loose_seen = (_beside(seen, loose, T_world_frame) & ~ours_seen) | _among(seen, shown.of(~drawn))
    return Hanging(kept, shown.of(drawn), _nearer(seen, loose_seen, ours_seen))


def _corners(boards: Sequence[Board]) -> tuple[Array, Array]:
    """Low and high corners (n, 3) of boards."""
    both = np.array([[b.low, b.high] for b in boards]).reshape(-1, 2, 3)
    return both[:, 0], both[:, 1]


def _reached(mesh: Mesh, low: Array, high: Array, T_world_frame: Array) -> tuple[NDArray[np.int64], Mask]:
    """The connected piece of each vertex (V,), and which pieces reach into which boxes (pieces, boxes)."""
    local = geo.transform(geo.invert_pose(T_world_frame), mesh.vertices)
    piece = vertex_pieces(mesh.faces, len(mesh.vertices)).astype(np.int64)
    found = np.zeros((int(piece.max(initial=-1)) + 1, len(low)), bool)
    for k in range(len(low)):
        found[np.unique(piece[geo.every((local > low[k]) & (local < high[k]))]), k] = True
    return piece, found


def _nearer(mesh: Mesh, one: Mask, other: Mask) -> Mask:
    """Which triangles (F,) of a mesh are of one kind, or of neither and nearer to one than to the other."""
    if not one.any() or not other.any():
        return one
    middles = mesh.vertices[mesh.faces].mean(axis=1)
    open_ = ~one & ~other
    out = one.copy()
    distances = [cKDTree(middles[kind]).query(middles[open_])[0] for kind in (one, other)]
    out[open_] = distances[0] < distances[1]
    return out


def _among(mesh: Mesh, other: Mesh) -> Mask:
    """Which triangles (F,) of a mesh are among those of another."""
    middles = mesh.vertices[mesh.faces].mean(axis=1)
    if not len(other.faces):
        return np.zeros(len(middles), bool)
    tree = cKDTree(other.vertices[other.faces].mean(axis=1))
    return np.asarray(tree.query(middles, distance_upper_bound=_SAME)[0] < _SAME)


def _beside(mesh: Mesh, boards: Sequence[Board], T_world_frame: Array) -> Mask:
    """Which triangles (F,) of a mesh have their middle in or beside one of the boards."""
    local = geo.transform(geo.invert_pose(T_world_frame), mesh.vertices[mesh.faces].mean(axis=1))
    out = np.zeros(len(local), bool)
    for b in boards:
        out |= geo.every((local > b.low - _OWN) & (local < b.high + _OWN))
    return out
