"""The tray behind a drawer's front: floor, sides and back, as seen when the drawer was open."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from twin import geometry as geo
from twin.completion.board import Board
from twin.completion.cloud import OUT, SIDE, UP, Cloud, Layer, Mask, layers, outline
from twin.completion.leaf import BENT, Leaf
from twin.geometry import Array
from twin.inferred import Basis

WALL = 0.012  # m, side of a drawer; FLOOR as well: both as usual, used where no camera saw the other face
FLOOR = 0.010
DEPTH = 0.45  # m, usual depth of a drawer, where neither its rear nor the furniture's was seen
_ASIDE = 0.03  # m from the front's edge to a drawer's side, with its runner, where no side was seen
_RAISED = 0.025  # m from the front's lower edge to the floor, where no floor was seen
_HEIGHT = 0.6  # share of the front's height that sides have, where none was seen
_LEAST = 0.0015  # m^2 of a layer
_REAL = 0.25  # share of the largest layer that a lower one needs to be the floor: contents lie above it
_REAR = 0.10  # m: a wall that faces the viewer nearer to the front is none of the back
_PAST = 0.05  # m that sides may go on behind a back
_THICKEST = 0.03  # m of a side
_BELOW_RIM = 0.04  # m
_MIDDLE = 0.25  # share of a floor that lies in the middle half of the width
_MUCH = 2.0  # times the surface of its inner face from which a side's outer one tells more
_BORDER = 0.008  # m inside a front's edges that its skirt takes
_HANGS = 0.12  # m behind a front that its skirt takes
_WIDE = 0.3  # share of the front's width that a floor has at least
_SHORTEST = 0.03  # m of a drawer's side
# m that a drawer keeps from the back of its cabinet: boxes come in steps of 5 cm and need 1 cm behind them
_APART = 0.035


@dataclass(frozen=True, eq=False)
class Tray:
    """Boards behind a drawer's front, inside from corner low (3,) to high (3,) in the part's frame."""

    boards: tuple[Board, ...]
    low: Array
    high: Array


@dataclass(frozen=True, eq=False)
class _Wall:
    """One side: inner face (m along side), thickness m, whether seen, rear (m along out), top and bottom (m
    along up)."""

    inner: float
    thickness: float
    seen: bool
    rear: float
    top: float | None
    told: str
    low: float | None = None


def find_tray(cloud: Cloud, leaf: Leaf, rear_limit: float | None) -> Tray:
    """The tray of a drawer.

    Args:
        cloud: the part's surface in its frame.
        leaf: its front.
        rear_limit: where (m along out, negative) the furniture ends behind; None if unseen.
    """
    front = -leaf.thickness
    margin = np.array([0.02, 0.02])
    low = np.array([*(leaf.corners[0] - margin), -1.2])
    high = np.array([*(leaf.corners[1] + margin), front - 0.006])
    behind = cloud.where(cloud.within(low, high) & ~_skirt(cloud, leaf))
    floor = _floor(behind, leaf)
    left, right = _sides(behind, leaf, floor)
    rears = [w.rear for w in (left, right) if w.seen]
    if rears:  # surface behind both sides is the cabinet's
        floor = _floor(behind, leaf, min(rears))
    tops = [w.top for w in (left, right) if w.top is not None]
    backs = _backs(behind, max(tops, default=float(leaf.corners[1, 1])), rears)
    seen = rears + ([_end(floor, OUT)] if floor is not None else [])
    rear_seen = min(seen, default=front)
    if backs:
        rear, rear_basis, told = backs[0].offset, "evidence", "inner face seen"
    else:
        limit = -DEPTH if rear_limit is None else min(rear_limit + _APART, front - 0.1)
        rear, rear_basis = min(rear_seen, limit), "assumed"
        told = "nothing bounds it" if rear_limit is None else "no farther than its cabinet is deep"
    lows = [w.low for w in (left, right) if w.low is not None]
    bottom = leaf.corners[0, 1] + _RAISED if floor is None else floor.offset
    if floor is None and lows:  # sides end at the floor
        bottom = max(bottom, min(lows) + FLOOR)
    top = float(np.median(tops)) if tops else bottom + _HEIGHT * float(leaf.size[1])
    top = float(np.clip(top, bottom + _SHORTEST, max(leaf.corners[1, 1], bottom + _SHORTEST)))
    inside = np.array([left.inner, bottom, rear]), np.array([right.inner, top, front])
    boards = _boards(inside, (left, right), floor, rear_seen, rear_basis, told)  # type: ignore[arg-type]
    return Tray(tuple(b for b in boards if b.real), *inside)


def _skirt(cloud: Cloud, leaf: Leaf) -> Mask:
    """Which points lie right behind the front's border, where fusion bridges to what was farther."""
    p = cloud.points
    inside = geo.every((p[:, :2] > leaf.corners[0] + _BORDER) & (p[:, :2] < leaf.corners[1] - _BORDER))
    return np.asarray(~inside & (p[:, OUT] > -_HANGS))


def _backs(behind: Cloud, top: float, rears: list[float]) -> list[Layer]:
    """Layers that face the viewer and may be the back, largest first.

    The back lies mostly below the sides' upper edges and not before their rear (m along out): labels may take
    the front edge of an open drawer's cabinet for a back.
    """
    found = layers(behind, OUT, 1, _LEAST) if len(behind) else []
    found = [k for k in found if k.offset < -_REAR and np.median(k.cloud.points[:, UP]) < top]
    return [k for k in found if k.offset < max(rears, default=0.0) + _PAST]


def _floor(behind: Cloud, leaf: Leaf, rear: float = -np.inf) -> Layer | None:
    """The lowest large layer that faces up, below the skirt of the front's rim, wider than a side's rim and
    not behind the sides' rear (m along out)."""
    below, wide = float(leaf.corners[1, 1]) - _BELOW_RIM, _WIDE * float(leaf.size[0])
    found = layers(behind, UP, 1, _LEAST) if len(behind) else []
    found = [k for k in found if k.offset < below and _spans(k.cloud.points[:, SIDE], leaf, wide)]
    found = [k for k in found if np.quantile(k.cloud.points[:, OUT], 0.97) > rear]
    large = [k for k in found if k.cloud.size > _REAL * found[0].cloud.size]
    return min(large, key=lambda k: k.offset) if large else None


def _spans(along: Array, leaf: Leaf, wide: float) -> bool:
    """Whether a layer at places (n,) m along the side is a floor: wide, not two sides' rims and a gap."""
    middle = np.abs(along - leaf.corners[:, 0].mean()) < leaf.size[0] / 4
    return bool(np.ptp(np.quantile(along, [0.05, 0.95])) > wide and middle.mean() > _MIDDLE)


def _sides(behind: Cloud, leaf: Leaf, floor: Layer | None) -> tuple[_Wall, _Wall]:
    middle = float(leaf.corners[:, 0].mean())
    walls = [_side(behind, s, middle) for s in (-1, 1)]
    found = [w for w in walls if w is not None]
    out = []
    for s, wall in zip((-1, 1), walls, strict=True):
        if wall is not None:
            out.append(wall)
            continue
        if found:
            place, told = 2 * middle - found[0].inner, "not seen, as far out as the other"
        elif floor is not None:
            corners = outline(floor.cloud.points[:, [SIDE, OUT]])
            ends = floor.cloud.points[:, SIDE]
            place = float(
                (corners[0, 0], corners[1, 0])[s > 0]
                if corners is not None
                else np.quantile(ends, 0.5 + 0.48 * s)
            )
            place += s * BENT
            told = "not seen, at the floor's end"
        else:
            place, told = (
                float(leaf.corners[(s + 1) // 2, 0]) - s * _ASIDE,
                "not seen, inside the front's edge",
            )
        out.append(_Wall(place, WALL, False, 0.0, None, told))
    left, right = out
    return left, right


def _side(behind: Cloud, s: int, middle: float) -> _Wall | None:
    """The side left (-1) or right (1): inner face to the middle, outer one away; the larger one decides."""
    beyond = [k for k in layers(behind, SIDE, -s, _LEAST) if s * (k.offset - middle) > 0.04]
    away = [k for k in layers(behind, SIDE, s, _LEAST / 3) if s * (k.offset - middle) > 0.04]
    if not beyond and not (away and away[0].cloud.size > _LEAST):
        return None
    if not beyond or (away and away[0].cloud.size > _MUCH * beyond[0].cloud.size):
        inner, points = away[0].offset - s * WALL, away[0].cloud.points
        thickness, told = WALL, f"outer face seen; thickness assumed, {1000 * WALL:.0f} mm as usual"
    else:
        inner, points = beyond[0].offset, beyond[0].cloud.points
        thickness, told = _thickness(behind, s, inner, points, away)
    low, top = (float(q) for q in np.quantile(points[:, UP], [0.05, 0.95]))
    rear = float(np.quantile(points[:, OUT], 0.03)) - BENT
    return _Wall(inner, thickness, True, rear, top + BENT, told, low - BENT)


def _thickness(behind: Cloud, s: int, inner: float, points: Array, away: list[Layer]) -> tuple[float, str]:
    """Thickness of a side with a seen inner face: by its outer face, by its rim, or the usual one."""
    outer = [k.offset for k in away if 0.003 < s * (k.offset - inner) < _THICKEST]
    if outer:
        thickness = abs(outer[0] - inner)
        return thickness, f"both faces seen, {1000 * thickness:.0f} mm thick"
    top = float(np.quantile(points[:, UP], 0.95)) + BENT
    rim = behind.facing(UP, 1) & (np.abs(behind.points[:, UP] - top) < 0.02)
    wide = s * (behind.points[rim, SIDE] - inner)
    wide = wide[(wide > -0.003) & (wide < _THICKEST)]
    if len(wide) * behind.area > _LEAST / 3:
        thickness = float(np.clip(2 * np.median(wide), 0.006, _THICKEST))
        return thickness, f"inner face and top seen, {1000 * thickness:.0f} mm thick"
    return WALL, f"inner face seen; thickness assumed, {1000 * WALL:.0f} mm as usual"


def _end(layer: Layer, axis: int) -> float:
    return float(np.quantile(layer.cloud.points[:, axis], 0.02)) - BENT


def _boards(
    inside: tuple[Array, Array],
    walls: tuple[_Wall, _Wall],
    floor: Layer | None,
    rear_seen: float,
    rear_basis: Basis,
    rear_told: str,
) -> list[Board]:
    low, high = inside
    (left, right), rear, front = walls, float(low[2]), float(high[2])
    outer = np.array([left.inner - left.thickness, right.inner + right.thickness])
    known = rear if rear_basis == "evidence" else max(rear, rear_seen)
    spans: list[tuple[str, float, float, bool]] = [("", known, front, True)]
    if rear < known - 0.005:
        spans.append(("_rear", rear, known, False))
    boards = []
    depth = f"seen {100 * (front - rear_seen):.0f} cm behind the front" if rear_seen < front else "not seen"
    for suffix, a, b, bounded in spans:
        if b - a < 0.005:
            continue
        told = depth if bounded else f"continued to the rear, {rear_told}"
        thick = f"thickness assumed, {1000 * FLOOR:.0f} mm as usual"
        basis: Basis = "evidence" if bounded and floor is not None else "assumed"
        floor_low, floor_high = [outer[0], low[1] - FLOOR, a], [outer[1], low[1], b]
        boards.append(
            Board(
                f"floor{suffix}",
                "floor",
                np.array(floor_low),
                np.array(floor_high),
                basis,
                f"floor: {told}; {thick}",
            )
        )
        for wall, name, x in (
            (left, "left_side", (outer[0], left.inner)),
            (right, "right_side", (right.inner, outer[1])),
        ):
            basis = "evidence" if bounded and wall.seen else "assumed"
            reason = f"side: {wall.told}" if bounded else f"side: {told}"
            boards.append(
                Board(
                    f"{name}{suffix}",
                    "side",
                    np.array([x[0], low[1], a]),
                    np.array([x[1], high[1], b]),
                    basis,
                    reason,
                )
            )
    back_low, back_high = [outer[0], low[1] - FLOOR, rear - WALL], [outer[1], high[1], rear]
    told = f"back: {rear_told}; thickness assumed, {1000 * WALL:.0f} mm as usual"
    boards.append(Board("back", "back", np.array(back_low), np.array(back_high), rear_basis, told))
    return boards
