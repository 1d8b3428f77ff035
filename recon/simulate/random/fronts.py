"""Fronts that open: doors, flaps and drawers of boards, each with its handle, or none, and its joint."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from recon.simulate.random.boards import BOARD, OUT, RIGHT, UP, bar, box, knob
from twin.geometry import Array
from twin.scene import Box, Joint, Prismatic, Revolute

HANDLES = ("bar", "knob", "edge")
# m by which a front without handle stands over the middle of its cabinet's outer board; 46 mm to pinch
OVERHANG = 0.055
# m between a front and the next one
GAP = 0.003
# m, with its floor, that a drawer's sides are high at least
TRAY = 0.03
# m that a drawer's tray is deep
TRAY_DEPTH = 0.44
# Degrees that a door's hinge turns at most
DOOR_TURN = (60.0, 110.0)
# Where a door's handle is, see `door`
HANDLE_AT = (-0.3, 0.3)
Rng = np.random.Generator


@dataclass(frozen=True)
class Grip:
    """The handle's boxes, none for a bare edge, and how it is held: point (3,), direction along (3,), out of
    the part (3,), and the thickness of what is held, metres.
    """

    boxes: list[Box]
    point: Array
    along: Array
    out: Array
    thickness: float


@dataclass(frozen=True)
class Front:
    """A moving part of boards with its handle and joint. It looks towards -y, the floor is z = 0."""

    panels: list[Box]
    grip: Grip
    joint: Joint

    @property
    def part(self) -> list[Box]:
        """All boxes that move."""
        return [*self.panels, *self.grip.boxes]


def overhang(handle: str) -> float:
    """Metres by which a front with this handle stands over its cabinet."""
    return OVERHANG if handle == "edge" else 0.0


def handle_of(rng: Rng, handle: str, face: Array, rim: tuple[Array, Array], vertical: bool) -> Grip:
    """A handle at `face` (3,). rim: outermost point and direction of a bare board."""
    along = UP if vertical else RIGHT
    if handle == "bar":
        boxes, grip = bar(
            face, rng.uniform(0.10, 0.22), vertical, rng.uniform(0.010, 0.020), rng.uniform(0.03, 0.045)
        )
        return Grip(boxes, grip, along, OUT, 0.016)
    if handle == "knob":
        boxes, grip = knob(face)
        return Grip(boxes, grip, along, OUT, 0.03)
    point, out = rim
    return Grip([], point - 0.012 * out, along, out, BOARD)


def door(
    rng: Rng,
    handle: str,
    side: float,
    size: tuple[float, float],
    z: float,
    turn: tuple[float, float] = DOOR_TURN,
    at: tuple[float, float] = HANDLE_AT,
) -> Front:
    """Hinged on its left (-1) or right (1), seen from the room. size: width and height, m; z: of its middle;
    turn: between which angles its largest one lies, degrees; at: between which heights its handle is, over
    the middle, as shares of the height that a handle leaves free."""
    width, tall = size
    front = box([0, 0.012, z], [width - GAP, BOARD, tall - GAP])
    high = z + rng.uniform(*at) * (tall - 0.25)
    free = -side * (width / 2 - GAP / 2)
    face = np.array([free + side * rng.uniform(0.03, 0.06), 0.003, high])
    rim = np.array([free, 0.012, high]), np.array([-side, 0.0, 0.0])
    grip = handle_of(rng, handle, face, rim, vertical=True)
    most = np.deg2rad(rng.uniform(*turn))
    joint = Revolute(np.array([0, 0, side]), 0.0, most, pivot=np.array([side * width / 2, 0.012, z]))
    return Front([front], grip, joint)


def flap(rng: Rng, handle: str, up: bool, size: tuple[float, float], z: float) -> Front:
    """Hinged above (`up`: opens upwards) or below (an oven's door). size: width and height, m; z: of its
    middle."""
    width, tall = size
    s = 1.0 if up else -1.0
    front = box([0, 0.012, z], [width - GAP, BOARD, tall - GAP])
    at, free = rng.uniform(-0.15, 0.15) * width, z - s * (tall / 2 - GAP / 2)
    face = np.array([at, 0.003, free + s * rng.uniform(0.03, 0.06)])
    rim = np.array([at, 0.012, free]), np.array([0.0, 0.0, -s])
    grip = handle_of(rng, handle, face, rim, vertical=False)
    turn = np.deg2rad(rng.uniform(55, 85))
    joint = Revolute(np.array([-s, 0, 0]), 0.0, turn, pivot=np.array([0, 0.012, z + s * tall / 2]))
    return Front([front], grip, joint)


def drawer(rng: Rng, handle: str, size: tuple[float, float], z: float, deep: float = TRAY_DEPTH) -> Front:
    """A front with a tray behind it. size: width and height of the front, m; z: of its middle; deep: of the
    tray, m."""
    width, tall = size
    over = overhang(handle)
    front = box([0, 0.012, z], [width - GAP, BOARD, tall - GAP])
    inner = max(tall - over - 0.05, TRAY)
    middle = 0.03 + deep / 2
    tray = [box([0, middle, z - over / 2 - inner / 2 + 0.005], [width - 0.06, deep, 0.01])]
    sides = [s * (width / 2 - 0.035) for s in (-1, 1)]
    tray += [box([x, middle, z - over / 2 - 0.01], [0.012, deep, inner - 0.02]) for x in sides]
    at, top = rng.uniform(-0.1, 0.1) * width, z + tall / 2 - GAP / 2
    rim = np.array([at, 0.012, top]), UP
    grip = handle_of(rng, handle, np.array([at, 0.003, z]), rim, vertical=False)
    return Front([front, *tray], grip, Prismatic(OUT, 0.0, rng.uniform(0.2, 0.42)))
