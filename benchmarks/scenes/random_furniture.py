"""Random cabinets with one moving part each, exact in everything: all joints and handles that replays are measured on."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from benchmarks.scenes.boards import Board, boards_inertial
from benchmarks.scenes.furniture import bar, box, contact_at, floor, mesh_of, shell
from twin.physics import with_physics
from twin.scene import Box, Joint, Motion, Part, Prismatic, Revolute, StaticPart, Twin

HANDLES = ("bar", "knob", "edge")
_BOARD = 0.018
_OVERHANG = 0.055  # m by which a front without handle stands over the middle of its cabinet's outer board; 46 mm to pinch
_DENSITY = 650.0  # kg/m^3, chipboard
_GAP = 0.003
_OUT = np.array([0.0, -1.0, 0.0])  # fronts look towards -y


def random_furniture(kind: str, handle: str, seed: int) -> Twin:
    """A twin named <kind>_<handle>_<seed>; sizes, heights and ranges are drawn. kind: of KINDS; handle: of HANDLES."""
    rng = np.random.default_rng([sorted(KINDS).index(kind), HANDLES.index(handle), seed])
    boxes, static, joint, grip, along, out, thick = KINDS[kind](rng, handle)
    contact = contact_at(grip, along, out, thick)
    motion = Motion(np.arange(5), np.arange(5) / 10.0, np.linspace(0, joint.upper, 5), ((0, 4),))
    part = Part(
        2, kind, mesh_of(boxes), joint, motion, contact=contact, collision=tuple(boxes),
        inertial=boards_inertial([_board(b) for b in boxes], np.eye(4), _DENSITY),
    )  # fmt: skip
    static = [floor(), box([0, 0.75, 1.0], [4.0, 0.05, 2.0]), *static]
    name = f"{kind}_{handle}_{seed}"
    return with_physics(Twin(name, StaticPart("cabinet", mesh_of(static), tuple(static)), (part,)))


def _board(b: Box) -> Board:
    middle, half = b.T_world_box[:3, 3], b.size / 2
    return Board(tuple(middle - half), tuple(middle + half))


Made = tuple[list[Box], list[Box], Joint, np.ndarray, np.ndarray, np.ndarray, float]
_X, _Z = np.array([1.0, 0, 0]), np.array([0, 0, 1.0])


def _knob(face):
    """Knob on a short neck in front of the face point, and its middle."""
    c = np.asarray(face, float)
    middle = c + 0.030 * _OUT
    return [box(c + 0.012 * _OUT, [0.012, 0.024, 0.012]), box(middle, [0.03, 0.018, 0.03])], middle


def _handle(rng, handle, face, rim, vertical):
    """Boxes, grip point, direction along, direction out, thickness; `rim`: (outermost point, direction) of a bare board."""
    along = _Z if vertical else _X
    if handle == "bar":
        boxes, grip = bar(
            face, rng.uniform(0.10, 0.22), vertical, rng.uniform(0.010, 0.020), rng.uniform(0.03, 0.045)
        )
        return boxes, grip, along, _OUT, 0.016
    if handle == "knob":
        boxes, grip = _knob(face)
        return boxes, grip, along, _OUT, 0.03
    point, out = rim
    return [], point - 0.012 * out, along, out, _BOARD


def _neighbours(rng, low, high, width, free):
    """Solid neighbours flush with the front, as high as the cabinet; on the side `free` (-1, 1, 0: none) there is none."""
    found = []
    for side in (-1, 1):
        if side != free and rng.random() < 0.5:
            w = rng.uniform(0.2, 0.5)
            found.append(
                box([side * (width / 2 + 0.02 + w / 2), 0.26, (low + high) / 2], [w, 0.5, high - low])
            )
    return found


def _door(side: float) -> Callable[..., Made]:
    """Hinged on its left (-1) or right (1), seen from the room."""

    def make(rng, handle):
        width, tall = rng.uniform(0.3, 0.6), rng.uniform(0.35, 1.0)
        z = rng.uniform(max(0.06 + tall / 2, 0.45), 1.45)
        z = min(z, 1.95 - tall / 2)
        over = _OVERHANG if handle == "edge" else 0.0
        cabinet = shell(width - over, 0.45, tall, [side * over / 2, 0.25, z])
        front = box([0, 0.012, z], [width - _GAP, _BOARD, tall - _GAP])
        at = z + rng.uniform(-0.3, 0.3) * (tall - 0.25)
        free = -side * (width / 2 - _GAP / 2)
        boxes, grip, along, out, thick = _handle(
            rng, handle, [free + side * rng.uniform(0.03, 0.06), 0.003, at],
            (np.array([free, 0.012, at]), np.array([-side, 0.0, 0.0])), vertical=True,
        )  # fmt: skip
        joint = Revolute(
            np.array([0, 0, side]), 0.0, np.deg2rad(rng.uniform(60, 110)),
            pivot=np.array([side * width / 2, 0.012, z]),
        )  # fmt: skip
        around = _neighbours(rng, z - tall / 2, z + tall / 2, width, -side if handle == "edge" else 0.0)
        return [front, *boxes], [*cabinet, *around], joint, grip, along, out, thick

    return make


def _flap(up: bool) -> Callable[..., Made]:
    """Hinged above (opens upwards) or below (an oven's door)."""

    def make(rng, handle):
        width, tall = rng.uniform(0.4, 0.8), rng.uniform(0.3, 0.5)
        z = rng.uniform(1.0, 1.45) if up else rng.uniform(0.45, 0.8)
        s = 1.0 if up else -1.0
        over = _OVERHANG if handle == "edge" else 0.0
        cabinet = shell(width, 0.45, tall - over, [0, 0.25, z + s * over / 2])
        front = box([0, 0.012, z], [width - _GAP, _BOARD, tall - _GAP])
        at, free = rng.uniform(-0.15, 0.15) * width, z - s * (tall / 2 - _GAP / 2)
        boxes, grip, along, out, thick = _handle(
            rng, handle, [at, 0.003, free + s * rng.uniform(0.03, 0.06)],
            (np.array([at, 0.012, free]), np.array([0.0, 0.0, -s])), vertical=False,
        )  # fmt: skip
        joint = Revolute(
            np.array([-s, 0, 0]), 0.0, np.deg2rad(rng.uniform(55, 85)),
            pivot=np.array([0, 0.012, z + s * tall / 2]),
        )  # fmt: skip
        around = _neighbours(rng, z - tall / 2, z + tall / 2, width, 0.0)
        return [front, *boxes], [*cabinet, *around], joint, grip, along, out, thick

    return make


def _drawer(low: float, high: float) -> Callable[..., Made]:
    def make(rng, handle):
        width, tall, z = rng.uniform(0.3, 0.8), rng.uniform(0.12, 0.28), rng.uniform(low, high)
        z = max(z, tall / 2 + 0.03)
        z = min(z, 1.1 - tall / 2) if handle == "edge" else z  # taken from above
        over = _OVERHANG if handle == "edge" else 0.0
        cabinet = shell(width, 0.5, tall - over, [0, 0.275, z - over / 2])
        front = box([0, 0.012, z], [width - _GAP, _BOARD, tall - _GAP])
        inner = tall - over - 0.05
        tray = [box([0, 0.25, z - over / 2 - inner / 2 + 0.005], [width - 0.06, 0.44, 0.01])]
        tray += [
            box([s * (width / 2 - 0.035), 0.25, z - over / 2 - 0.01], [0.012, 0.44, inner - 0.02])
            for s in (-1, 1)
        ]
        at, top = rng.uniform(-0.1, 0.1) * width, z + tall / 2 - _GAP / 2
        boxes, grip, along, out, thick = _handle(
            rng,
            handle,
            [at, 0.003, z],
            (np.array([at, 0.012, top]), np.array([0.0, 0.0, 1.0])),
            vertical=False,
        )
        joint = Prismatic(_OUT, 0.0, rng.uniform(0.2, 0.42))
        around = _neighbours(rng, z - tall / 2, z + tall / 2, width, 0.0)
        return [front, *tray, *boxes], [*cabinet, *around], joint, grip, along, out, thick

    return make


def _sliding(rng, handle) -> Made:
    width, tall = rng.uniform(0.4, 0.6), rng.uniform(0.4, 1.1)
    z = rng.uniform(max(0.06 + tall / 2, 0.45), 1.3)
    z = min(z, 1.2 - tall / 2) if handle == "edge" else z  # taken from above
    side = rng.choice([-1.0, 1.0])
    travel = rng.uniform(0.6, 0.85) * width
    over = _OVERHANG if handle == "edge" else 0.0
    # the cabinet is two doors wide; a door without handle stands over its top
    cabinet = shell(2 * width, 0.4, tall + 0.04 - 2 * over, [side * width / 2, 0.24, z - over / 2])
    front = box([0, 0.012, z], [width, _BOARD, tall])
    at, across = z + rng.uniform(-0.2, 0.2) * tall, rng.uniform(-0.3, 0.3) * width
    boxes, grip, along, out, thick = _handle(
        rng, handle, [-side * (width / 2 - 0.06), 0.003, at],
        (np.array([across, 0.012, z + tall / 2]), _Z), vertical=handle != "edge",
    )  # fmt: skip
    joint = Prismatic(np.array([side, 0.0, 0.0]), 0.0, travel)
    return [front, *boxes], cabinet, joint, grip, along, out, thick


def _lid(rng, handle) -> Made:
    width, depth, tall = rng.uniform(0.4, 0.8), rng.uniform(0.3, 0.45), rng.uniform(0.4, 0.8)
    over = _OVERHANG if handle == "edge" else 0.01
    # an open box, top at z = tall; the lid's front rim stands over it
    walls = [box([s * (width / 2 - _BOARD / 2), depth / 2, tall / 2], [_BOARD, depth, tall]) for s in (-1, 1)]
    walls += [box([0, y, tall / 2], [width, _BOARD, tall]) for y in (_BOARD / 2, depth - _BOARD / 2)]
    walls.append(box([0, depth / 2, 0.03], [width, depth, _BOARD]))
    top = tall + _GAP + _BOARD / 2
    board = box([0, (depth - over) / 2, top], [width, depth + over, _BOARD])
    at = rng.uniform(-0.15, 0.15) * width
    if handle == "edge":
        rim, out = np.array([at, -over, top]), _OUT
        boxes, grip, along, thick = [], rim - 0.012 * out, _X, _BOARD
    else:  # on top of the lid, near its front
        face = np.array([at, 0.05, top + _BOARD / 2])
        boxes, grip = _upright(rng, handle, face)
        out, along, thick = _Z, _X, 0.02
    joint = Revolute(
        np.array([-1.0, 0, 0]), 0.0, np.deg2rad(rng.uniform(50, 80)), pivot=np.array([0, depth, top])
    )
    return [board, *boxes], walls, joint, grip, along, out, thick


def _upright(rng, handle, face):
    if handle == "knob":
        return [
            box(face + 0.012 * _Z, [0.012, 0.012, 0.024]),
            box(face + 0.030 * _Z, [0.03, 0.03, 0.018]),
        ], face + 0.030 * _Z
    long, off = rng.uniform(0.10, 0.20), 0.04
    posts = [box(face + off / 2 * _Z + s * (long / 2 - 0.01) * _X, [0.012, 0.012, off]) for s in (-1, 1)]
    middle = face + (off + 0.007) * _Z
    return [box(middle, [long, 0.014, 0.014]), *posts], middle


KINDS: dict[str, Callable[..., Made]] = {
    "door_left": _door(-1.0),
    "door_right": _door(1.0),
    "flap_up": _flap(True),
    "flap_down": _flap(False),
    "drawer_low": _drawer(0.15, 0.45),
    "drawer_high": _drawer(0.8, 1.3),
    "sliding_door": _sliding,
    "lid": _lid,
}
