"""What of a seen surface is drawn beside the boards: flat on a board's face, no shreds, no double."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from twin import geometry as geo
from twin.completion.board import Board
from twin.geometry import Array
from twin.mesh import vertex_pieces
from twin.scene import Mesh

ON_FACE = 0.008  # m: seen surface this near a board's face is that face
_BESIDE = 0.020  # m around a board within which a fused surface's ragged skirt lies
_SKIRT = 0.030  # m that it hangs behind
_BESIDE_SHARE = 0.2  # of a piece behind a drawer's front that may lie beside the opening
_HANGS = 0.12  # m that it hangs behind a front that moves
LOOKS = float(np.cos(np.radians(40.0)))  # of a noisy face, from its board's
_SHRED = 0.002  # share of the surface, and m^2, below which a loose piece is a shred
_SHRED_AREA = 0.0015


def shown_surface(
    mesh: Mesh,
    boards: Sequence[Board],
    T_world_frame: Array,
    fitted: Sequence[tuple[Array, Array]] = (),
    front: Board | None = None,
) -> Mesh:
    """Seen triangles that are drawn beside the boards.

    A triangle on a board's face is put into its plane and ends where the board ends. One that merely
    surrounds a board, as a fused surface's skirt does, and one in a box (low, high) of `fitted`, for which
    other pieces stand, is left out; so are shreds. front: a part's front, whose skirt hangs far behind:
    before it lies what the part moves away from.
    """
    if not len(mesh.faces):
        return mesh
    local = geo.transform(geo.invert_pose(T_world_frame), mesh.vertices)
    normals, _ = geo.triangle_normals(local[mesh.faces])
    keep = np.ones(len(mesh.faces), bool)
    moved = local.copy()
    settled = np.zeros(len(mesh.faces), bool)
    for board in boards:
        on_board = np.zeros(len(mesh.faces), bool)
        for axis in range(3):
            for sign, plane in ((-1, board.low[axis]), (1, board.high[axis])):
                on_face = _on_face(local, mesh.faces, normals, board, axis, sign, plane) & ~settled
                _flatten(moved, np.unique(mesh.faces[on_face]), board, axis, plane)
                on_board |= on_face
        settled |= on_board
    for board in boards:
        low, high = board.low - _BESIDE, board.high + _BESIDE
        low[2] -= _SKIRT - _BESIDE
        around = geo.every((local > low) & (local < high))
        keep &= settled | ~geo.every(around[mesh.faces])
    if front is not None:
        keep &= settled | ~geo.every(_skirt(local, front)[mesh.faces])
    for low, high in fitted:
        inside = geo.every((local > low - ON_FACE) & (local < high + ON_FACE))
        keep &= settled | ~np.asarray(inside)[mesh.faces].any(axis=1)
    return without_shreds(mesh.of(keep, geo.transform(T_world_frame, moved)))


def _skirt(local: Array, front: Board) -> NDArray[np.bool_]:
    """Which points (n, 3) lie beside and behind a front's border: noise of fusion towards what is farther."""
    beside = _BESIDE + ON_FACE
    around = np.all(
        (local[:, :2] > front.low[:2] - beside) & (local[:, :2] < front.high[:2] + beside), axis=1
    )
    inside = np.all(
        (local[:, :2] > front.low[:2] + ON_FACE) & (local[:, :2] < front.high[:2] - ON_FACE), axis=1
    )
    return np.asarray(around & ~inside & (local[:, 2] < ON_FACE) & (local[:, 2] > -_HANGS))


def _on_face(
    local: Array, faces: NDArray[Any], normals: Array, board: Board, axis: int, sign: int, plane: float
) -> NDArray[np.bool_]:
    """Which triangles (F,) lie on one face of a board and look its way."""
    near = np.abs(local[:, axis] - plane) < min(ON_FACE, 0.6 * float(board.size[axis]))
    for k in range(3):
        if k != axis:
            near &= (local[:, k] > board.low[k] - ON_FACE) & (local[:, k] < board.high[k] + ON_FACE)
    return np.asarray(geo.every(near[faces]) & (sign * normals[:, axis] > LOOKS))


def _flatten(moved: Array, vertices: NDArray[Any], board: Board, axis: int, plane: float) -> None:
    moved[vertices, axis] = plane
    for k in range(3):
        if k != axis:
            moved[vertices, k] = np.clip(moved[vertices, k], board.low[k], board.high[k])


def passing(mesh: Mesh, front: Board, T_world_frame: Array) -> Mesh:
    """The surface of a drawer without pieces much of which lies beside the opening that its front covers."""
    if not len(mesh.faces):
        return mesh
    local = geo.transform(geo.invert_pose(T_world_frame), mesh.vertices)
    out = np.any((local[:, :2] < front.low[:2] - ON_FACE) | (local[:, :2] > front.high[:2] + ON_FACE), axis=1)
    piece = vertex_pieces(mesh.faces, len(mesh.vertices))
    share = np.bincount(piece, out & (local[:, 2] < front.low[2])) / np.maximum(np.bincount(piece), 1)
    return mesh.of((share < _BESIDE_SHARE)[piece[mesh.faces[:, 0]]])


def without_surroundings(mesh: Mesh, panel: Board, T_world_frame: Array) -> Mesh:
    """The surface of a door without what lies beside its panel and behind the panel's middle: a board ends
    there, and what goes on is the furniture around it, which labels took for the door."""
    if not len(mesh.faces):
        return mesh
    local = geo.transform(geo.invert_pose(T_world_frame), mesh.vertices)
    out = np.any((local[:, :2] < panel.low[:2] - ON_FACE) | (local[:, :2] > panel.high[:2] + ON_FACE), axis=1)
    behind = local[:, 2] < (panel.low[2] + panel.high[2]) / 2
    return mesh.of(~(out & behind)[mesh.faces].any(axis=1))


def up_to(mesh: Mesh, rear: float, T_world_frame: Array) -> Mesh:
    """The drawer's surface up to its back's rear (m along out); what is behind is mislabelled furniture."""
    if not len(mesh.faces):
        return mesh
    local = geo.transform(geo.invert_pose(T_world_frame), mesh.vertices)
    keep = geo.every(local[mesh.faces, 2] > rear - ON_FACE)
    return mesh.of(keep)


def without_shreds(mesh: Mesh) -> Mesh:
    """The mesh without loose pieces too small to be anything, and without faces that have no area."""
    if not len(mesh.faces):
        return mesh
    area = geo.triangle_areas(mesh.vertices[mesh.faces])
    piece = vertex_pieces(mesh.faces, len(mesh.vertices))[mesh.faces[:, 0]]
    sizes = np.bincount(piece, weights=area)
    least = min(_SHRED_AREA, _SHRED * float(area.sum()))
    return mesh.of((sizes[piece] >= least) & (area > 1e-10))
