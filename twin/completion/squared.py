"""Neighbours, plinths and worktops cut by a picture's border, made as wide as what is beside them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from twin import geometry as geo
from twin.completion.board import Board
from twin.completion.cloud import OUT, SIDE, UP
from twin.geometry import Array
from twin.scene import Mesh

PLANE = 0.012  # m within which fronts are in one plane
_EYES = 12  # cameras that are asked
_GRID = 0.03  # m between the points that are asked for
_BEYOND = 0.05  # m behind a point at which something was seen, so that the point is free
FREE = 0.1  # share of free points from which nothing is there
_NARROW = 0.02  # m, less is raggedness
_WIDEST = 0.6  # m, a cabinet's width
_LOWEST = 0.05  # m of a strip that must be left beside other boards
_MOSTLY = 0.8  # share of a lower strip that must be left
_THIN = 0.06  # m, thickest worktop
_LONG = 0.2  # m, shortest worktop
BELOW = 0.06  # m, farthest that a worktop is above what it lies on
_OVERHANG = 0.05  # m, the widest overhang of a worktop
PLINTH = 0.15  # m, the highest plinth, and how far behind the fronts it stands at most
OVER = 0.01  # m that fronts may overlap: noise


class Sight:
    """What cameras saw: whether some camera saw surface behind a point."""

    def __init__(self, mesh: Mesh, eyes: Array) -> None:
        """mesh: the seen static surface. eyes: (n, 3) m, the cameras, in the same frame."""
        import open3d as o3d

        self._scene: Any = o3d.t.geometry.RaycastingScene(1)
        self._scene.add_triangles(
            o3d.core.Tensor.from_numpy(np.ascontiguousarray(mesh.vertices, np.float32)),
            o3d.core.Tensor.from_numpy(np.ascontiguousarray(mesh.faces, np.uint32)),
        )
        self.eyes = eyes
        self._asked = eyes[np.unique(np.linspace(0, len(eyes) - 1, min(_EYES, len(eyes))).astype(int))]

    def free(self, points: Array) -> float:
        """Share of points (n, 3) that some camera saw through."""
        import open3d as o3d

        through = np.zeros(len(points), bool)
        for eye in self._asked:
            way = points - eye
            far = np.linalg.norm(way, axis=1)
            rays = np.concatenate([np.broadcast_to(eye, way.shape), way / far[:, None]], axis=1)
            hit = self._scene.cast_rays(
                o3d.core.Tensor.from_numpy(np.ascontiguousarray(rays, np.float32)), 1
            )["t_hit"].numpy()
            through |= np.isfinite(hit) & (hit > far + _BEYOND)
        return float(through.mean()) if len(points) else 0.0


def squared(
    boards: Sequence[Board], cabinets: Sequence[Board], sight: Sight, T_world_frame: Array
) -> list[Board]:
    """The boards; neighbours, plinths and worktops extended sideways to the boards in line with them.

    The extension must not be seen to be free. It is part of the board or a board of its own beside.

    Args:
        boards: of the furniture, in one frame.
        cabinets: insides of the parts' cabinets, which stay free.
        sight: what cameras saw, in the world.
        T_world_frame: pose (4, 4) of the frame.
    """
    out = list(boards)
    for last in (False, True):  # worktops follow the boards below, which follow a plinth
        for k in [k for k, b in enumerate(boards) if _is_worktop(b) is last]:
            for sign in (-1, 1):
                added = _added(out[k], [*out[:k], *out[k + 1 :]], cabinets, sign)
                if added is None or sight.free(geo.transform(T_world_frame, _face(added))) > FREE:
                    continue
                if out[k].basis == "assumed" and np.allclose(added.size[UP], out[k].size[UP]):
                    low, high = np.minimum(out[k].low, added.low), np.maximum(out[k].high, added.high)
                    out[k] = replace(added, name=out[k].name, low=low, high=high)
                else:
                    out.append(added)
    return out


def _added(board: Board, others: Sequence[Board], cabinets: Sequence[Board], sign: int) -> Board | None:
    """The missing piece of a board to one side, up to the farthest board in line; None if none or taken."""
    edge, beside = max(_ends(board, others, cabinets, sign), default=(-np.inf, ""))
    mine = _end(board, sign)
    if not _NARROW < edge - mine < _WIDEST:
        return None
    low, high = board.low.copy(), board.high.copy()
    low[SIDE], high[SIDE] = sorted((sign * mine, sign * edge))
    side = "right" if sign > 0 else "left"
    strip = replace(
        board,
        name=f"{board.name}_{side}",
        low=low,
        high=high,
        basis="assumed",
        reason=f"{board.reason}, and as wide as {beside}",
    )
    added = _beside(strip, others)
    return None if added is None or any(overlap(added, b) for b in cabinets) else added


def _face(board: Board) -> Array:
    """Points (n, 3) on a board's visible face: the front, of a worktop the top."""
    return sheet(board, UP if int(np.argmin(board.size)) == UP else OUT)


def _end(board: Board, sign: int) -> float:
    """How far a board reaches to one side."""
    return float(sign * (board.high if sign > 0 else board.low)[SIDE])


def _ends(
    board: Board, boards: Sequence[Board], cabinets: Sequence[Board], sign: int
) -> list[tuple[float, str]]:
    """How far the boards in line with a board reach to one side, and which: fronts in its plane; of a
    neighbour its plinth and worktop; of a plinth or worktop the neighbours."""
    found = []
    fronts = [b for b in boards if b.role == "neighbour"]
    if board.role == "neighbour":
        level = [b for b in (*fronts, *cabinets) if abs(b.high[OUT] - board.high[OUT]) < PLANE]
        found += [(_end(b, sign), "those in its plane") for b in level]
        found += [(_end(b, sign), "its plinth") for b in boards if b.role == "plinth" and stands_on(board, b)]
        found += [
            (_end(b, sign) - _overhang(b, board), "its worktop")
            for b in boards
            if _is_worktop(b) and _lies_on(b, board)
        ]
    elif board.role == "plinth":
        found += [(_end(b, sign), "what it carries") for b in fronts if stands_on(b, board)]
    elif _is_worktop(board):
        below = [b for b in (*fronts, *cabinets) if _lies_on(board, b)]
        found += [(_end(b, sign) + _overhang(board, b), "what is below") for b in below]
    return found


def _is_worktop(board: Board) -> bool:
    return bool(
        board.role == "panel" and board.size[UP] < _THIN and min(board.size[SIDE], board.size[OUT]) > _LONG
    )


def _lies_on(top: Board, solid: Board) -> bool:
    shared = min(top.high[SIDE], solid.high[SIDE]) - max(top.low[SIDE], solid.low[SIDE])
    return bool(-BELOW < top.low[UP] - solid.high[UP] < BELOW and shared > 0.0)


def _overhang(top: Board, solid: Board) -> float:
    """How far (m) a worktop hangs over its cabinets to the front, and likewise to the side."""
    return float(np.clip(top.high[OUT] - solid.high[OUT], 0.0, _OVERHANG))


def stands_on(front: Board, plinth: Board) -> bool:
    """Whether a neighbour stands right above a board that is set back."""
    shared = min(front.high[SIDE], plinth.high[SIDE]) - max(front.low[SIDE], plinth.low[SIDE])
    return bool(
        -OVER < front.low[UP] - plinth.high[UP] < PLINTH
        and 0.0 < front.high[OUT] - plinth.high[OUT] < PLINTH
        and shared > _LONG
    )


def _beside(strip: Board, boards: Sequence[Board]) -> Board | None:
    """The highest piece of a strip that no board takes. None if the piece is small or at neither end of the
    strip: a piece that hangs between boards belongs to no cabinet."""
    taken = [(float(b.low[UP]), float(b.high[UP])) for b in boards if overlap(strip, b)]
    edges = sorted([(float(strip.low[UP]),) * 2, *taken, (float(strip.high[UP]),) * 2])
    best, reached = (0.0, 0.0), edges[0][1]
    for low, high in edges[1:]:
        best = max(best, (reached, low), key=lambda span: span[1] - span[0])
        reached = max(reached, high)
    if best[1] - best[0] < min(_LOWEST, _MOSTLY * float(strip.size[UP])):
        return None
    low_, high_ = strip.low.copy(), strip.high.copy()
    if best[0] > low_[UP] and best[1] < high_[UP]:
        return None
    low_[UP], high_[UP] = best
    return replace(strip, low=low_, high=high_)


def overlap(a: Board, b: Board) -> bool:
    """Whether two boards share more than noise."""
    return bool(np.all(np.minimum(a.high, b.high) - np.maximum(a.low, b.low) > OVER))


def sheet(board: Board, axis: int) -> Array:
    """Points (n, 3) inside the borders of a board's face along an axis of the frame."""
    across = [k for k in (SIDE, UP, OUT) if k != axis]
    counts = [max(2, round(float(board.size[k]) / _GRID)) for k in across]
    axes = [
        board.low[k] + board.size[k] * (np.arange(n) + 0.5) / n for k, n in zip(across, counts, strict=True)
    ]
    out = np.full((len(axes[0]) * len(axes[1]), 3), board.high[axis])
    for k, values in zip(across, np.meshgrid(*axes, indexing="ij"), strict=True):
        out[:, k] = values.ravel()
    return out
