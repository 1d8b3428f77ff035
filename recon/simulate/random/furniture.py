"""Random cabinets with a moving part each: doors, flaps, drawers, sliding doors, lids; bar, knob or edge."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from recon.simulate.random.boards import BOARD, OUT, RIGHT, UP, box, knob, shell
from recon.simulate.random.fronts import GAP, Front, Grip, door, drawer, flap, handle_of, overhang
from twin.geometry import Array
from twin.scene import Box, Prismatic, Revolute

Rng = np.random.Generator


@dataclass(frozen=True)
class Furniture(Front):
    """A moving part with its carcass and what stands around that: both stand still. The part's middle lies
    near x = 0."""

    carcass: list[Box] = field(default_factory=list)
    around: list[Box] = field(default_factory=list)

    @staticmethod
    def of(front: Front, carcass: list[Box], around: list[Box] | None = None) -> Furniture:
        """A front with its carcass and what stands around that."""
        return Furniture(front.panels, front.grip, front.joint, carcass, around or [])

    @property
    def static(self) -> list[Box]:
        """All boxes that stand still."""
        return [*self.carcass, *self.around]


Maker = Callable[[Rng, str], Furniture]


def _neighbours(rng: Rng, low: float, high: float, width: float, free: float) -> list[Box]:
    """Solid neighbours flush with the front, as high as the cabinet; none at `free` (-1, 1; 0: both)."""
    found = []
    for side in (-1, 1):
        if side != free and rng.random() < 0.5:
            w = rng.uniform(0.2, 0.5)
            middle = [side * (width / 2 + 0.02 + w / 2), 0.26, (low + high) / 2]
            found.append(box(middle, [w, 0.5, high - low]))
    return found


def _door(side: float) -> Maker:
    """Hinged on its left (-1) or right (1), seen from the room."""

    def make(rng: Rng, handle: str) -> Furniture:
        width, tall = rng.uniform(0.3, 0.6), rng.uniform(0.35, 1.0)
        z = rng.uniform(max(0.06 + tall / 2, 0.45), 1.45)
        z = min(z, 1.95 - tall / 2)
        over = overhang(handle)
        cabinet = shell(width - over, 0.45, tall, [side * over / 2, 0.25, z])
        front = door(rng, handle, side, (width, tall), z)
        around = _neighbours(rng, z - tall / 2, z + tall / 2, width, -side if handle == "edge" else 0.0)
        return Furniture.of(front, cabinet, around)

    return make


def _flap(up: bool) -> Maker:
    """Hinged above (opens upwards) or below (an oven's door)."""

    def make(rng: Rng, handle: str) -> Furniture:
        width, tall = rng.uniform(0.4, 0.8), rng.uniform(0.3, 0.5)
        z = rng.uniform(1.0, 1.45) if up else rng.uniform(0.45, 0.8)
        over, s = overhang(handle), 1.0 if up else -1.0
        cabinet = shell(width, 0.45, tall - over, [0, 0.25, z + s * over / 2])
        front = flap(rng, handle, up, (width, tall), z)
        return Furniture.of(front, cabinet, _neighbours(rng, z - tall / 2, z + tall / 2, width, 0.0))

    return make


def _drawer(low: float, high: float) -> Maker:
    def make(rng: Rng, handle: str) -> Furniture:
        width, tall, z = rng.uniform(0.3, 0.8), rng.uniform(0.12, 0.28), rng.uniform(low, high)
        z = max(z, tall / 2 + 0.03)
        z = min(z, 1.1 - tall / 2) if handle == "edge" else z  # taken from above
        over = overhang(handle)
        cabinet = shell(width, 0.5, tall - over, [0, 0.275, z - over / 2])
        front = drawer(rng, handle, (width, tall), z)
        return Furniture.of(front, cabinet, _neighbours(rng, z - tall / 2, z + tall / 2, width, 0.0))

    return make


def _sliding(rng: Rng, handle: str) -> Furniture:
    width, tall = rng.uniform(0.4, 0.6), rng.uniform(0.4, 1.1)
    z = rng.uniform(max(0.06 + tall / 2, 0.45), 1.3)
    z = min(z, 1.2 - tall / 2) if handle == "edge" else z  # taken from above
    side = rng.choice([-1.0, 1.0])
    travel = rng.uniform(0.6, 0.85) * width
    over = overhang(handle)
    # the cabinet is two doors wide; a door without handle stands over its top
    cabinet = shell(2 * width, 0.4, tall + 0.04 - 2 * over, [side * width / 2, 0.24, z - over / 2])
    front = box([0, 0.012, z], [width, BOARD, tall])
    at, across = z + rng.uniform(-0.2, 0.2) * tall, rng.uniform(-0.3, 0.3) * width
    face, rim = np.array([-side * (width / 2 - 0.06), 0.003, at]), np.array([across, 0.012, z + tall / 2])
    grip = handle_of(rng, handle, face, (rim, UP), vertical=handle != "edge")
    return Furniture([front], grip, Prismatic(np.array([side, 0.0, 0.0]), 0.0, travel), cabinet)


def _lid(rng: Rng, handle: str) -> Furniture:
    width, depth, tall = rng.uniform(0.4, 0.8), rng.uniform(0.3, 0.45), rng.uniform(0.4, 0.8)
    over = overhang(handle) or 0.01
    # an open box, top at z = tall; the lid's front rim stands over it
    walls = [box([s * (width / 2 - BOARD / 2), depth / 2, tall / 2], [BOARD, depth, tall]) for s in (-1, 1)]
    walls += [box([0, y, tall / 2], [width, BOARD, tall]) for y in (BOARD / 2, depth - BOARD / 2)]
    walls.append(box([0, depth / 2, 0.03], [width, depth, BOARD]))
    top = tall + GAP + BOARD / 2
    board = box([0, (depth - over) / 2, top], [width, depth + over, BOARD])
    at = rng.uniform(-0.15, 0.15) * width
    if handle == "edge":
        rim = np.array([at, -over, top])
        grip = Grip([], rim - 0.012 * OUT, RIGHT, OUT, BOARD)
    else:  # on top of the lid, near its front
        boxes, middle = _upright(rng, handle, np.array([at, 0.05, top + BOARD / 2]))
        grip = Grip(boxes, middle, RIGHT, UP, 0.02)
    turn = np.deg2rad(rng.uniform(50, 80))
    joint = Revolute(np.array([-1.0, 0, 0]), 0.0, turn, pivot=np.array([0, depth, top]))
    return Furniture([board], grip, joint, walls)


def _upright(rng: Rng, handle: str, face: Array) -> tuple[list[Box], Array]:
    """Handle that stands on a horizontal face, and its middle (3,)."""
    if handle == "knob":
        return knob(face, UP)
    long, off = rng.uniform(0.10, 0.20), 0.04
    posts = [box(face + off / 2 * UP + s * (long / 2 - 0.01) * RIGHT, [0.012, 0.012, off]) for s in (-1, 1)]
    middle = face + (off + 0.007) * UP
    return [box(middle, [long, 0.014, 0.014]), *posts], middle


KINDS: dict[str, Maker] = {
    "door_left": _door(-1.0),
    "door_right": _door(1.0),
    "flap_up": _flap(True),
    "flap_down": _flap(False),
    "drawer_low": _drawer(0.15, 0.45),
    "drawer_high": _drawer(0.8, 1.3),
    "sliding_door": _sliding,
    "lid": _lid,
}
