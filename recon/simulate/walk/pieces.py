"""Pieces of furniture with rows of identical fronts: kitchen lines, chests of drawers, wardrobes, fridges."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from recon.simulate.random.boards import BOARD, box
from recon.simulate.random.fronts import HANDLE_AT, Front, door, drawer, flap
from recon.simulate.random.furniture import KINDS
from twin.geometry import Array, make_pose
from twin.scene import Box

Rng = np.random.Generator
# m between the front boards' middle and the carcass, as in the cabinets of clips
_FRONT = 0.025
# Degrees to which doors beside each other turn, so that they keep clear of the next one's handle
_DOOR_TURN = (75.0, 100.0)
# Degrees to which the door before a drawer turns, so that the drawer comes out
_DOOR_BEFORE = (93.0, 100.0)
# Where handles of doors are: near the upper edge of low doors, the lower one of high doors, else between
_AT_LOW, _AT_HIGH = (0.3, 0.5), (-0.5, -0.4)
# m over the floor below which the middle of a door is low, above which it is high
_LOW, _HIGH = 0.6, 1.5
# m from a door to the drawer behind it, more than a handle stands off
_BEHIND = 0.09
# Share of the cabinets with a drawer behind a door
_HIDDEN = 0.35


@dataclass(frozen=True)
class Cell:
    """A front of a piece and where it stands, `shift` (3,) m. row: fronts of one row look the same; behind:
    the door that must be open first."""

    name: str
    front: Front
    shift: Array
    row: str
    behind: str | None = None


@dataclass(frozen=True)
class Piece:
    """Furniture that looks towards -y, the floor is z = 0. still: roles and boxes of what never moves; tops:
    boxes on which things can stand."""

    kind: str
    cells: tuple[Cell, ...]
    still: tuple[tuple[str, Box], ...]
    tops: tuple[Box, ...] = ()


# Fronts of a column from the floor up: their kinds and heights
Column = tuple[float, Sequence[tuple[str, float]]]


def _cabinet(
    rng: Rng, prefix: str, columns: Sequence[Column], base: float, depth: float, hidden: bool = False
) -> tuple[list[Cell], list[tuple[str, Box]]]:
    """Columns of fronts side by side on one carcass that stands `base` m over the floor; fronts of one kind
    and size are one row. hidden: one door has a drawer behind it."""
    handle = str(rng.choice(["bar", "knob"], p=[0.7, 0.3]))
    widths = np.array([w for w, _ in columns])
    edges = np.concatenate([[0.0], np.cumsum(widths)]) - widths.sum() / 2
    doors = [k for k, (_, fronts) in enumerate(columns) if any(f.startswith("door") for f, _ in fronts)]
    before = int(rng.choice(doors)) if hidden and doors else None
    seeds: dict[str, int] = {}
    count: Counter[str] = Counter()
    cells, still = [], []
    for k, (width, fronts) in enumerate(columns):
        x, z = float(edges[k] + edges[k + 1]) / 2, base
        for kind, tall in fronts:
            word = kind.split("_")[0]
            row = f"{prefix}_{word}_{width:.3f}_{tall:.3f}"
            seed = seeds.setdefault(row, int(rng.integers(2**31)))
            count[word] += 1
            name = f"{prefix}_{word}_{count[word]}"
            opens = k == before and word == "door"
            made = _front(np.random.default_rng(seed), kind, handle, (width, tall), z + tall / 2, opens)
            cells.append(Cell(name, made, np.array([x, 0.0, 0.0]), row))
            if opens:
                cells.append(_hidden(rng, name, x, (width, tall), z))
            still.append(("carcass", _board_at(x, width, z, depth)))
            z += tall
        still.append(("carcass", _board_at(x, width, z, depth)))
    tallest = max(sum(t for _, t in fronts) for _, fronts in columns)
    for x in edges:
        middle = [float(x), _FRONT + depth / 2, base + tallest / 2]
        still.append(("carcass", box(middle, [BOARD, depth, tallest])))
    wide = float(edges[-1] - edges[0])
    still.append(("carcass", box([0, _FRONT + depth, base + tallest / 2], [wide, BOARD, tallest])))
    return cells, still


def _board_at(x: float, width: float, z: float, depth: float) -> Box:
    return box([x, _FRONT + depth / 2, z], [width, depth, BOARD])


def _front(rng: Rng, kind: str, handle: str, size: tuple[float, float], z: float, opens: bool) -> Front:
    if kind == "drawer":
        return drawer(rng, handle, size, z)
    if kind.startswith("flap"):
        return flap(rng, handle, kind == "flap_up", size, z)
    turn = _DOOR_BEFORE if opens else _DOOR_TURN
    at = _AT_LOW if z < _LOW else _AT_HIGH if z > _HIGH else HANDLE_AT
    return door(rng, handle, -1.0 if kind == "door_left" else 1.0, size, z, turn, at)


def _hidden(rng: Rng, before: str, x: float, size: tuple[float, float], z: float) -> Cell:
    """A drawer behind the door `before` of that size, whose lower edge is at `z` m."""
    tall = float(rng.uniform(0.14, 0.2))
    middle = z + tall / 2 + float(rng.uniform(0.05, max(0.06, size[1] - tall - 0.05)))
    made = drawer(rng, "knob", (size[0] - 0.1, tall), middle, deep=0.3)
    return Cell(f"{before}_inner_drawer", made, np.array([x, _BEHIND, 0.0]), f"{before}_inner", before)


def _plinth(width: float, depth: float, base: float) -> list[tuple[str, Box]]:
    return [
        ("carcass", box([0, 0.06 + (depth - 0.03) / 2, base / 2], [width - 0.02, depth - 0.03, base - 0.01]))
    ]


def _doors(rng: Rng, count: int) -> list[str]:
    """Hinges of doors side by side: in pairs that open from the middle, or all on one side."""
    if rng.random() < 0.5:
        return ["door_left" if k % 2 == 0 else "door_right" for k in range(count)]
    return [str(rng.choice(["door_left", "door_right"]))] * count


def kitchen(rng: Rng, name: str) -> Piece:
    """Base cabinets in a row with a worktop, wall cabinets above."""
    count = int(rng.integers(2, 5))
    width = float(rng.uniform(0.42, 0.6 if count < 4 else 0.52))
    base, depth, tall = float(rng.uniform(0.08, 0.12)), 0.5, 0.72
    sides = _doors(rng, count)
    style = str(rng.choice(["doors", "drawer_row", "column", "oven"], p=[0.35, 0.3, 0.2, 0.15]))
    fronts: list[list[tuple[str, float]]] = [[(s, tall)] for s in sides]
    if style == "drawer_row":
        fronts = [[(s, tall - 0.17), ("drawer", 0.17)] for s in sides]
    at = int(rng.integers(count))
    if style == "column":
        number = int(rng.integers(3, 5))
        fronts[at] = [("drawer", tall / number)] * number
    if style == "oven":
        fronts[at] = [("drawer", 0.22), ("flap_down", tall - 0.22)]
    columns = [(width, f) for f in fronts]
    cells, still = _cabinet(rng, name, columns, base, depth, bool(rng.random() < _HIDDEN))
    wide = count * width
    still += _plinth(wide, depth, base)
    top = box([0, 0.26, base + tall + 0.025], [wide + 0.02, 0.56, 0.032])
    still.append(("top", top))
    if rng.random() < 0.85:
        upper, low = float(rng.uniform(0.5, 0.62)), float(rng.uniform(1.38, 1.46))
        kinds = ["flap_up"] * count if rng.random() < 0.2 else sides
        above, boards = _cabinet(rng, f"{name}_wall", [(width, [(k, upper)]) for k in kinds], low, 0.3)
        back = np.array([0.0, depth - 0.3, 0.0])
        cells += [Cell(c.name, c.front, c.shift + back, c.row) for c in above]
        still += [(role, _shifted(b, back)) for role, b in boards]
    return Piece("kitchen", tuple(cells), tuple(still), (top,))


def chest(rng: Rng, name: str) -> Piece:
    """A chest of three or four equal drawers, now and then two of them side by side."""
    number, tall = int(rng.integers(3, 5)), float(rng.uniform(0.17, 0.24))
    double = rng.random() < 0.25
    width = float(rng.uniform(0.42, 0.55) if double else rng.uniform(0.5, 0.95))
    columns = [(width, [("drawer", tall)] * number)] * (2 if double else 1)
    return _low(rng, "chest", name, columns, 0.46)


def sideboard(rng: Rng, name: str) -> Piece:
    """Two to four equal doors side by side, with or without a row of drawers above them."""
    count, width = int(rng.integers(2, 4)), float(rng.uniform(0.38, 0.5))
    tall = float(rng.uniform(0.5, 0.68))
    upper = [("drawer", 0.15)] if rng.random() < 0.4 else []
    columns = [(width, [(side, tall), *upper]) for side in _doors(rng, count)]
    return _low(rng, "sideboard", name, columns, 0.42, bool(rng.random() < _HIDDEN))


def _low(
    rng: Rng, kind: str, name: str, columns: Sequence[Column], depth: float, hidden: bool = False
) -> Piece:
    """Furniture of at most breast height: a plinth below, a board on top."""
    base = float(rng.uniform(0.05, 0.1))
    cells, still = _cabinet(rng, name, columns, base, depth, hidden)
    wide, high = sum(w for w, _ in columns), base + max(sum(t for _, t in f) for _, f in columns)
    top = box([0, _FRONT + depth / 2 - 0.01, high + 0.02], [wide + 0.02, depth + 0.04, 0.022])
    return Piece(kind, tuple(cells), (*still, *_plinth(wide, depth, base), ("top", top)), (top,))


def wardrobe(rng: Rng, name: str) -> Piece:
    """Two or three tall doors side by side."""
    width, tall, depth = float(rng.uniform(0.42, 0.5)), float(rng.uniform(1.7, 1.85)), 0.5
    columns = [(width, [(side, tall)]) for side in _doors(rng, int(rng.integers(2, 4)))]
    cells, still = _cabinet(rng, name, columns, 0.09, depth)
    return Piece("wardrobe", tuple(cells), (*still, *_plinth(sum(w for w, _ in columns), depth, 0.09)))


def fridge(rng: Rng, name: str) -> Piece:
    """A freezer's door and a fridge's above it, hinged on one side."""
    width, side = float(rng.uniform(0.55, 0.62)), str(rng.choice(["door_left", "door_right"]))
    lower, upper = float(rng.uniform(0.5, 0.7)), float(rng.uniform(0.95, 1.15))
    cells, still = _cabinet(rng, name, [(width, [(side, lower), (side, upper)])], 0.05, 0.52)
    shelves = [("carcass", _board_at(0.0, width, 0.05 + lower + f * upper, 0.4)) for f in (0.3, 0.6)]
    return Piece("fridge", tuple(cells), (*still, *shelves, *_plinth(width, 0.52, 0.05)))


def single(kind: str) -> Callable[[Rng, str], Piece]:
    """A cabinet as clips have them, with one part."""

    def make(rng: Rng, name: str) -> Piece:
        made = KINDS[kind](rng, str(rng.choice(["bar", "knob"])))
        every = np.concatenate([b.corners for b in (*made.carcass, *made.part)])
        x = 0.5 * float(every[:, 0].min() + every[:, 0].max())
        shift = np.array([-x, 0.0, 0.0])
        still = [("carcass", _shifted(b, shift)) for b in made.carcass]
        return Piece(kind, (Cell(f"{name}_{kind}", made, shift, f"{name}_{kind}"),), tuple(still))

    return make


def table(rng: Rng) -> Piece:
    """A table on four legs, about the origin."""
    size = np.array([rng.uniform(0.9, 1.3), rng.uniform(0.6, 0.8)])
    high = float(rng.uniform(0.72, 0.77))
    top = box([0, 0, high - 0.015], [*size, 0.03])
    return Piece("table", (), (("top", top), *_legs(size - 0.1, high - 0.03, 0.05)), (top,))


def chair(rng: Rng) -> Piece:
    """A chair whose back stands at its rear (+y), about the origin."""
    seat, wide, back = (
        float(rng.uniform(0.43, 0.47)),
        float(rng.uniform(0.38, 0.44)),
        float(rng.uniform(0.82, 0.95)),
    )
    half = wide / 2
    boards = [
        ("carcass", box([0, 0, seat - 0.015], [wide, wide, 0.03])),
        ("carcass", box([0, half - 0.015, back - 0.09], [wide, 0.022, 0.18])),
        *(
            ("carcass", box([s * (half - 0.02), half - 0.02, (seat + back) / 2], [0.03, 0.03, back - seat]))
            for s in (-1, 1)
        ),
    ]
    return Piece("chair", (), (*boards, *_legs(np.array([wide - 0.04, wide - 0.04]), seat - 0.03, 0.034)))


def _legs(spread: Array, high: float, thick: float) -> list[tuple[str, Box]]:
    at = [(x, y) for x in (-0.5, 0.5) for y in (-0.5, 0.5)]
    return [("carcass", box([x * spread[0], y * spread[1], high / 2], [thick, thick, high])) for x, y in at]


def _shifted(b: Box, shift: Array) -> Box:
    return Box(make_pose(None, shift) @ b.T_world_box, b.size)


# Pieces that stand against walls, and how often each is drawn relative to the others; chosen by us
PIECES: dict[str, tuple[Callable[[Rng, str], Piece], float]] = {
    "kitchen": (kitchen, 1.0),
    "chest": (chest, 1.0),
    "sideboard": (sideboard, 0.6),
    "wardrobe": (wardrobe, 0.6),
    "fridge": (fridge, 0.6),
    "sliding_door": (single("sliding_door"), 0.25),
    "lid": (single("lid"), 0.2),
}
