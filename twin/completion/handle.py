"""The handle of a front: a bar on posts or a knob on a neck, fitted to what stands off the front.

Where it is, how long it is and how far it stands off are measured; how thick it is, is not: a fused surface
thickens a bar of 12 mm to 15 to 30 mm, the more the noisier the sensor. So a bar is as thick as its outline
in photographs says, and where none tells as bars are, unless what was seen is wider than noise makes one.
What photographs don't tell is assumed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from twin.completion.board import Board
from twin.completion.cloud import OUT, SIDE, UP, Cloud
from twin.completion.leaf import Leaf
from twin.geometry import Array
from twin.handles import STANDS_OFF, TALLEST, is_bar, long_side, split
from twin.scene import HandleSection

BAR = 0.014  # m, thickness of a bar, the middle of 10 to 18 mm as they are sold
POST = 0.011  # m
BLUR = 0.014  # m that a fused surface adds to a bar's width, at most
_LONGEST = 0.8  # m
_SHORTEST = 0.015  # m
_WIDEST = 0.06  # m across
_NARROWEST = 0.005  # m across
_NEAR = 0.06  # m from the contact, half a fist
_MARGIN = 0.02  # m that a handle may reach past its front
_LEAST = 0.0015  # m^2: of a handle that nobody touched
_FLATTEST = 0.014  # m: what stands off less is moulding
_KNOB = 0.030  # m, most of a knob's depth
_KNOB_OFF = 0.02  # m that a knob stands off at least
_NECK = 0.012  # m
_END = 0.010  # m from a bar's end to the middle of its post
_FEW = 20  # points of a piece


@dataclass(frozen=True, eq=False)
class Handle:
    """Boards of one handle, and the box from corner low (3,) to high (3,) that its blurred surface fills."""

    boards: tuple[Board, ...]
    low: Array
    high: Array


def find_handles(
    cloud: Cloud,
    leaf: Leaf,
    noise: float,
    contact: Array | None,
    name: str = "handle",
    section: HandleSection | None = None,
) -> list[Handle]:
    """Handles before a front, that at the contact first; else the largest of a knob's size.

    Args:
        cloud: the surface in the front's frame.
        leaf: the front.
        noise: m, of the front's surface.
        contact: point (3,) in the frame where a hand held the part, None where no hand did.
        name: of the first one's pieces.
        section: how thick one of them is by photographs, its middle in the frame.
    """
    points = cloud.points
    off = (points[:, OUT] > max(STANDS_OFF, 3 * noise)) & (points[:, OUT] < TALLEST)
    off &= np.all(
        (points[:, :2] > leaf.corners[0] - _MARGIN) & (points[:, :2] < leaf.corners[1] + _MARGIN), axis=1
    )
    found: list[tuple[float, Array]] = []
    knobs: list[Array] = []
    for piece in split(points[off]):
        if len(piece) < _FEW or np.quantile(piece[:, OUT], 0.97) < _FLATTEST:
            continue
        far = np.inf if contact is None else float(np.linalg.norm(piece[:, :2] - contact[:2], axis=1).min())
        if far <= _NEAR or _alone(piece, cloud.area):
            found.append((far, piece))
        elif _is_knob(piece, leaf):
            knobs.append(piece)
    found.sort(key=lambda row: (row[0], -len(row[1])))
    made = [
        _fitted(piece, name if k == 0 else f"{name}_{k + 1}", section) for k, (_, piece) in enumerate(found)
    ]
    whole = [h for h in made if h is not None]
    if not whole and contact is not None and knobs:
        knob = _fitted(max(knobs, key=len), name, section)
        whole = [] if knob is None else [knob]
    return whole


def _is_knob(piece: Array, leaf: Leaf) -> bool:
    """Whether a piece (n, 3) that no hand touched is as wide and as far off as knobs, well inside a front."""
    low, high = piece.min(axis=0), piece.max(axis=0)
    inside = np.all((low[:2] > leaf.corners[0] + _MARGIN) & (high[:2] < leaf.corners[1] - _MARGIN))
    return bool(inside and (high - low)[:2].max() < _WIDEST and high[OUT] > _KNOB_OFF)


def _alone(piece: Array, area: float) -> bool:
    """Whether a piece (n, 3) that no hand touched is a handle: long and narrow, and enough of it."""
    _, length, width = long_side(piece, np.array([0.0, 0.0, 1.0]))
    return is_bar(length, width) and length > 0.06 and len(piece) * area > _LEAST


def _fitted(piece: Array, name: str, section: HandleSection | None = None) -> Handle | None:
    """Bar or knob from the points (n, 3) of its blurred surface; section: of one of the handles."""
    along, length, _ = long_side(piece, np.array([0.0, 0.0, 1.0]))
    axis = SIDE if abs(along[SIDE]) >= abs(along[UP]) else UP
    across = UP if axis == SIDE else SIDE
    top = float(np.quantile(piece[:, OUT], 0.97))
    outer = piece[piece[:, OUT] > 0.5 * top]
    ends = np.quantile(piece[:, axis], [0.02, 0.98])
    sides = np.quantile(outer[:, across], [0.02, 0.98])
    length, width = float(np.ptp(ends)), float(np.ptp(sides))
    if not (_SHORTEST < max(length, width) < _LONGEST and _NARROWEST < width < _WIDEST):
        return None
    low, high = piece.min(axis=0), piece.max(axis=0)
    at = float(np.mean(sides))
    if section is not None and np.any((section.middle < low - _NEAR) | (section.middle > high + _NEAR)):
        section = None
    if is_bar(length, width):
        boards = _bar(name, axis, ends, at, top, width, section)
    else:
        boards = _knob(name, axis, float(ends.mean()), at, top, min(length, width), section)
    return Handle(tuple(b for b in boards if b.real), low, high)


def _bar(
    name: str, axis: int, ends: Array, at: float, top: float, width: float, section: HandleSection | None
) -> list[Board]:
    thick = BAR + max(0.0, width - BAR - BLUR) if section is None else section.width
    depth = min(thick, 0.7 * top)
    told = f"handle: bar {1000 * np.ptp(ends):.0f} mm long seen, "
    if section is not None:
        told += _by_outline(section)
    elif thick == BAR:
        told += f"no wider than {1000 * width:.0f} mm; thickness assumed, {1000 * thick:.0f} mm as bars have"
    else:
        told += f"no wider than {1000 * width:.0f} mm; thickness assumed, {1000 * thick:.0f} mm, less what a scan blurs"
    boards = [
        _box(
            name,
            axis,
            (float(ends[0]), float(ends[1])),
            (at - thick / 2, at + thick / 2),
            (top - depth, top),
            "assumed" if section is None else "evidence",
            told,
        )
    ]
    post = min(POST, thick)
    told = "handle: post, where bars have them"
    for k, end in enumerate((ends[0] + _END, ends[1] - _END)):
        span = float(end - post / 2), float(end + post / 2)
        boards.append(
            _box(
                f"{name}_post_{k + 1}",
                axis,
                span,
                (at - post / 2, at + post / 2),
                (0.0, top - depth),
                "assumed",
                told,
            )
        )
    return boards


def _by_outline(section: HandleSection) -> str:
    return f"{1000 * section.width:.0f} mm thick by its outline in {section.photographs} photographs"


def _knob(
    name: str, axis: int, middle: float, at: float, top: float, width: float, section: HandleSection | None
) -> list[Board]:
    depth = min(0.6 * top, _KNOB)
    told = f"handle: knob {1000 * top:.0f} mm off the front seen, {1000 * width:.0f} mm wide with what a scan blurs; depth assumed"
    if section is not None:
        width = section.width
        told = f"handle: knob {1000 * top:.0f} mm off the front seen, {_by_outline(section)}"
    half, neck = width / 2, min(_NECK, width) / 2
    head = _box(
        name,
        axis,
        (middle - half, middle + half),
        (at - half, at + half),
        (top - depth, top),
        "assumed" if section is None else "evidence",
        told,
    )
    stem = (middle - neck, middle + neck), (at - neck, at + neck)
    return [head, _box(f"{name}_neck", axis, *stem, (0.0, top - depth), "assumed", "handle: neck, not seen")]


def _box(
    name: str,
    axis: int,
    along: tuple[float, float],
    across: tuple[float, float],
    out: tuple[float, float],
    basis: str,
    reason: str,
) -> Board:
    low, high = np.empty(3), np.empty(3)
    for k, (a, b) in ((axis, along), (UP if axis == SIDE else SIDE, across), (OUT, out)):
        low[k], high[k] = a, b
    return Board(name, "handle", low, high, basis, reason)  # type: ignore[arg-type]
