"""Where moving parts go: the inferred furniture must leave that free, as the recording shows the motion."""

from __future__ import annotations

import numpy as np

from twin import geometry as geo
from twin.collision.clearance import sweep_states
from twin.completion.board import Board
from twin.geometry import Array
from twin.inferred import Completion
from twin.scene import Part

_SPACING = 0.012  # m between points on a part's boards
_STEP = 0.015  # m that no point moves farther between two states
_INTO = 0.004  # m into a board that a part may come: noise of both
_SPARE = 0.004  # m from where the part passes that a shortened board ends
_FINGER = 0.02  # m, thickness and width of a finger (chosen by us)
_BEHIND = 0.03  # m that fingers reach behind and before the middle of what they hold
_WORTH = 0.5  # share of a board that must be left of it


def swept_points(part: Part, layer: Completion) -> Array:
    """Points (n, 3) m of a part's pieces and seen surface shown, over its whole range, in the world."""
    from twin.collision.solid import spread

    clouds = [layer.shown.vertices]
    for piece in layer.pieces:
        corners = piece.mesh.vertices[piece.mesh.faces]
        clouds.append(spread(corners, piece.mesh.area / _SPACING**2)[0])
    points = np.concatenate(clouds)
    return np.concatenate([geo.transform(part.joint.pose(s), points) for s in sweep_states(part, _STEP)])


def held_points(part: Part) -> Array:
    """Points (n, 3) m that two fingers filled at the closed part's grip, in the world; none without hand."""
    contact = part.contact
    if contact is None:
        return np.zeros((0, 3))
    beside = contact.width / 2 + np.arange(0.0, _FINGER + 1e-9, _FINGER / 2)
    grid = np.meshgrid(
        np.concatenate([-beside, beside]),
        np.linspace(-_FINGER / 2, _FINGER / 2, 3),
        np.linspace(-_BEHIND, _BEHIND, 7),
        indexing="ij",
    )
    points = np.stack([g.ravel() for g in grid], axis=1)
    return geo.transform(geo.make_pose(contact.rotation, contact.point), points)


def out_of_the_way(board: Board, swept: Array, into: float = _INTO) -> Board | None:
    """The board or its largest part free of points (n, 3) in its frame; None where too little is left.

    into: m that points may come into it; below zero they keep that far away.
    """
    hit = swept
    for axis in range(3):  # the first leaves few of millions
        along = hit[:, axis]
        hit = hit[(along > board.low[axis] + into) & (along < board.high[axis] - into)]
    if not len(hit):
        return board
    best: tuple[float, Array, Array] | None = None
    for axis in range(3):
        for high in (False, True):
            low_, high_ = board.low.copy(), board.high.copy()
            if high:
                high_[axis] = hit[:, axis].min() + min(into, 0.0) - _SPARE
            else:
                low_[axis] = hit[:, axis].max() - min(into, 0.0) + _SPARE
            share = float((high_[axis] - low_[axis]) / board.size[axis])
            if share > _WORTH and (best is None or share > best[0]):
                best = share, low_, high_
    if best is None:
        return None
    return Board(
        board.name,
        board.role,
        best[1],
        best[2],
        board.basis,
        f"{board.reason}, up to where the part or the hand moves",
    )
