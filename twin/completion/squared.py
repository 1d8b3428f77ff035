"""Neighbours and worktops that a picture's border cut off, made as wide as what stands beside and below: furniture has straight sides."""

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
_FREE = 0.1  # share of free points from which nothing is there
_NARROW = 0.02  # m, less is raggedness
_WIDEST = 0.6  # m, a cabinet's width
_LOWEST = 0.05  # m
_THIN, _LONG, _BELOW = (
    0.06,
    0.2,
    0.06,
)  # m, of a worktop: how thick at most, how long at least, how far above what it lies on
_OVER = 0.01  # m that fronts may overlap: noise


class Sight:
    """What cameras saw: whether one looked through a point at something behind it."""

    def __init__(self, mesh: Mesh, eyes: Array) -> None:
        """mesh: all that was seen standing still. eyes: (n, 3) m, where cameras were, in the same frame."""
        import open3d as o3d

        self._scene: Any = o3d.t.geometry.RaycastingScene(1)
        self._scene.add_triangles(
            o3d.core.Tensor.from_numpy(np.ascontiguousarray(mesh.vertices, np.float32)),
            o3d.core.Tensor.from_numpy(np.ascontiguousarray(mesh.faces, np.uint32)),
        )
        self._eyes = eyes[np.unique(np.linspace(0, len(eyes) - 1, min(_EYES, len(eyes))).astype(int))]

    def free(self, points: Array) -> float:
        """Share of points (n, 3) through which some camera saw what lies behind."""
        import open3d as o3d

        through = np.zeros(len(points), bool)
        for eye in self._eyes:
            way = points - eye
            far = np.linalg.norm(way, axis=1)
            rays = np.concatenate([np.broadcast_to(eye, way.shape), way / far[:, None]], axis=1)
            hit = self._scene.cast_rays(
                o3d.core.Tensor.from_numpy(np.ascontiguousarray(rays, np.float32)), 1
            )["t_hit"].numpy()
            through |= np.isfinite(hit) & (hit > far + _BEYOND)
        return float(through.mean()) if len(points) else 0.0


def squared(
    boards: Sequence[Board], others: Sequence[Board], sight: Sight, T_world_frame: Array
) -> list[Board]:
    """The boards, of which neighbours reach to the side as far as the farthest in their plane does, and worktops as far as the neighbours
    below, where nothing says that this is free; by themselves or by a board beside them.

    Args:
        boards: of the furniture, in one frame.
        others: what is in the way beside them: the fronts and cabinets of the parts.
        sight: what cameras saw, in the world.
        T_world_frame: pose (4, 4) of the frame.
    """
    out = list(boards)
    for k in range(len(boards)):
        same = _in_line(out[k], out)
        for sign in (-1, 1):
            edge = max((float(sign * (b.high if sign > 0 else b.low)[SIDE]) for b in same), default=-np.inf)
            mine = float(sign * (out[k].high if sign > 0 else out[k].low)[SIDE])
            if not _NARROW < edge - mine < _WIDEST:
                continue
            low, high = out[k].low.copy(), out[k].high.copy()
            low[SIDE], high[SIDE] = sorted((sign * mine, sign * edge))
            added = _beside(replace(out[k], low=low, high=high, basis="assumed"), [*out[:k], *out[k + 1 :]])
            if added is None or any(_overlap(added, b) for b in others):
                continue
            if sight.free(geo.transform(T_world_frame, _grid(added))) > _FREE:
                continue
            beside = "those in its plane" if out[k].role == "neighbour" else "what is below"
            reason = f"{out[k].reason}, and as wide as {beside}"
            if np.allclose(added.size[UP], out[k].size[UP]):
                grown = np.minimum(out[k].low, added.low), np.maximum(out[k].high, added.high)
                out[k] = replace(out[k], low=grown[0], high=grown[1], basis="assumed", reason=reason)
            else:
                out.append(replace(added, name=f"{out[k].name}_wide", reason=reason))
    return out


def _in_line(board: Board, boards: Sequence[Board]) -> list[Board]:
    """The boards whose sides those of one should be in line with: fronts in its plane; of a worktop, the neighbours right below."""
    solid = [b for b in boards if b.role == "neighbour"]
    if board.role == "neighbour":
        return [b for b in solid if abs(b.high[OUT] - board.high[OUT]) < PLANE]
    if board.size[UP] > _THIN or board.size[SIDE] < _LONG or board.size[OUT] < _LONG:
        return []
    return [b for b in solid if -_BELOW < board.low[UP] - b.high[UP] < _BELOW]


def _beside(strip: Board, boards: Sequence[Board]) -> Board | None:
    """The highest piece of a strip that no board takes, None where little is left."""
    taken = [(float(b.low[UP]), float(b.high[UP])) for b in boards if _overlap(strip, b)]
    edges = sorted([(float(strip.low[UP]),) * 2, *taken, (float(strip.high[UP]),) * 2])
    best, reached = (0.0, 0.0), edges[0][1]
    for low, high in edges[1:]:
        best = max(best, (reached, low), key=lambda span: span[1] - span[0])
        reached = max(reached, high)
    if best[1] - best[0] < _LOWEST:
        return None
    low_, high_ = strip.low.copy(), strip.high.copy()
    low_[UP], high_[UP] = best
    return replace(strip, low=low_, high=high_)


def _overlap(a: Board, b: Board) -> bool:
    return bool(np.all(np.minimum(a.high, b.high) - np.maximum(a.low, b.low) > _OVER))


def _grid(board: Board) -> Array:
    """Points (n, 3) on the face of a board that one sees: its front, of a worktop its top."""
    seen = OUT if board.role == "neighbour" else UP
    across = [k for k in (SIDE, UP, OUT) if k != seen]
    axes = [
        np.linspace(board.low[k], board.high[k], max(2, round(float(board.size[k]) / _GRID))) for k in across
    ]
    out = np.full((len(axes[0]) * len(axes[1]), 3), board.high[seen])
    for k, values in zip(across, np.meshgrid(*axes, indexing="ij"), strict=True):
        out[:, k] = values.ravel()
    return out
