"""Where the furniture of a room stands: against two to four walls, turned to the room, none on another."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from recon.simulate.random.fronts import Front
from recon.simulate.walk.pieces import PIECES, Cell, Piece, chair, table
from recon.simulate.walk.solids import Solids
from twin.geometry import Array, make_pose
from twin.scene import Joint

Rng = np.random.Generator
# m of free floor before a front, for the part and the person; chosen by us
FRONT_ROOM = 0.95
# m between two pieces
_APART = 0.03
# Tries of a piece at places drawn anew, before it is left out
_TRIES = 40
_CEILING = 2.55
# Quarter turns of a piece at each wall, and which wall that is: axis, and whether it is the upper one
_WALLS = ((0, 1, True), (1, 0, False), (2, 1, False), (3, 0, True))
_COS, _SIN = (1.0, 0.0, -1.0, 0.0), (0.0, 1.0, 0.0, -1.0)
# Pieces of a room at most, and m by which a chair is moved at most along each wall
_MOST, _PUT = 8, 1.1
# Wall pieces of a room, and how likely each number is
_COUNTS, _SHARES = (3, 4, 5), (0.3, 0.4, 0.3)


@dataclass(frozen=True)
class Stand:
    """A piece of furniture with its name and T_world_piece (4, 4)."""

    name: str
    piece: Piece
    pose: Array

    @cached_property
    def still(self) -> Solids:
        """What never moves of it, in the world."""
        return Solids.of([b for _, b in self.piece.still], self.pose)

    def cell_pose(self, cell: Cell) -> Array:
        """T_world_front (4, 4) of the frame in which the cell's front is made."""
        return np.asarray(self.pose @ make_pose(None, cell.shift))

    def part(self, cell: Cell, state: float) -> Solids:
        """The boxes of a front at `state`, in the world."""
        return Solids.of(cell.front.part).moved(self.cell_pose(cell) @ joint_pose(cell.front, state))

    @cached_property
    def closed(self) -> Solids:
        """All of it with all fronts shut."""
        return Solids.joined([self.still, *(self.part(c, 0.0) for c in self.piece.cells)])

    @property
    def middle(self) -> Array:
        """Centre (3,) of its bounds, metres."""
        low, high = self.closed.bounds
        return 0.5 * (low + high)

    @property
    def outward(self) -> Array:
        """Unit direction (3,) to which its fronts look."""
        return np.asarray(-self.pose[:3, 1])


@dataclass(frozen=True)
class Layout:
    """The room's inner corners `low` and `high` (3,) and what stands in it. loose: the chair that somebody
    may move, where it stands first; put: T_world_chair (4, 4) of where it is moved to."""

    low: Array
    high: Array
    stands: tuple[Stand, ...]
    loose: Stand | None
    put: Array | None

    @cached_property
    def cells(self) -> dict[str, tuple[Stand, Cell]]:
        """All fronts by name."""
        return {c.name: (s, c) for s in self.stands for c in s.piece.cells}

    @property
    def others(self) -> list[Solids]:
        """The chair that may be moved, at both places."""
        if self.loose is None or self.put is None:
            return []
        return [self.loose.still, Stand("", self.loose.piece, self.put).still]


def joint_pose(front: Front, state: float) -> Array:
    """T (4, 4) by which a front moves, in the frame that it is made in."""
    joint: Joint = front.joint
    return np.asarray(joint.pose(state))


def draw_layout(rng: Rng) -> Layout:
    """A room and its furniture, drawn: three to eight pieces, along two walls or more."""
    while True:
        size = np.array([rng.uniform(3.7, 5.2), rng.uniform(3.3, 4.4)])
        low, high = np.array([*(-size / 2), 0.0]), np.array([*(size / 2), _CEILING])
        fronts = _fronts(rng, low, high)
        if len({tuple(s.outward.round().tolist()) for s in fronts}) > 1:
            break
    stands = list(fronts)
    if rng.random() < 0.8:
        desk = _anywhere(rng, "table", table(rng), (low + 0.75, high - 0.75), fronts, stands)
        stands += [desk] if desk else []
        chairs = min(int(rng.integers(1, 4)), _MOST - 1 - len(stands))
        for k in range(chairs):
            around = (low + 0.3, high - 0.3) if desk is None else _about(desk)
            seat = _anywhere(rng, f"chair_{k + 1}", chair(rng), around, fronts, stands)
            stands += [seat] if seat else []
    made = chair(rng)
    loose = _anywhere(rng, "loose_chair", made, (low + 0.3, high - 0.3), fronts, stands)
    if loose is not None:
        away = (loose.pose[:3, 3] - _PUT, loose.pose[:3, 3] + _PUT)
        put = _anywhere(rng, "", made, away, fronts, [*stands, loose])
        if put is not None and _inside(put, low, high):
            return Layout(low, high, tuple(stands), loose, put.pose)
    return Layout(low, high, tuple(stands), None, None)


def _fronts(rng: Rng, low: Array, high: Array) -> list[Stand]:
    """The pieces that stand against the walls of a room between two corners (3,)."""
    walls = [_WALLS[k] for k in rng.permutation(4)[: int(rng.integers(2, 5))]]
    stands: list[Stand] = []
    for k, kind in enumerate(_kinds(rng)):
        name = f"{kind}_{k + 1}"
        made = Stand(name, PIECES[kind][0](rng, name), np.eye(4))
        found = _against_wall(rng, made, walls, (low, high), stands)
        stands += [found] if found else []
    return stands


def _kinds(rng: Rng) -> list[str]:
    """Kinds of the wall pieces; one with a row of fronts is always among them."""
    names = list(PIECES)
    shares = np.array([share for _, share in PIECES.values()])
    count = int(rng.choice(_COUNTS, p=_SHARES))
    drawn = [str(k) for k in rng.choice(names, size=count, replace=False, p=shares / shares.sum())]
    if not {"kitchen", "chest"} & set(drawn):
        drawn[0] = str(rng.choice(["kitchen", "chest"]))
    if count > 3 and rng.random() < 0.3:
        drawn[-1] = "chest"
    return sorted(drawn, key=lambda k: k != "kitchen")  # the widest first


def _against_wall(
    rng: Rng,
    stand: Stand,
    walls: Sequence[tuple[int, int, bool]],
    corners: tuple[Array, Array],
    stands: Sequence[Stand],
) -> Stand | None:
    low, high = corners
    small, large = stand.closed.bounds
    back = float(large[1])
    for _ in range(_TRIES):
        turns, axis, upper = walls[int(rng.integers(len(walls)))]
        turn = _quarter(turns)
        along = 1 - axis
        room = (low[along] - float(small[0]) + 0.02, high[along] - float(large[0]) - 0.02)
        if room[0] > room[1]:
            continue
        place = np.zeros(3)
        place[along] = float(rng.uniform(*room))
        if rng.random() < 0.4:  # in a corner
            place[along] = room[int(rng.integers(2))]
        place[axis] = high[axis] - back - 0.002 if upper else low[axis] + back + 0.002
        found = Stand(stand.name, stand.piece, make_pose(turn, place))
        if not any(_disturbs(found, s) or _disturbs(s, found) for s in stands):
            return found
    return None


def _quarter(turns: int) -> Array:
    c, s = _COS[turns], _SIN[turns]
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def _disturbs(one: Stand, other: Stand, room: float = FRONT_ROOM) -> bool:
    """Whether one stands in the other, or on the floor before its fronts."""
    low, high = (b[:2] for b in one.closed.bounds)
    taken_low, taken_high = (b[:2].copy() for b in other.closed.bounds)
    if other.piece.cells:
        ahead = other.outward[:2] * room
        taken_low += np.minimum(ahead, 0.0)
        taken_high += np.maximum(ahead, 0.0)
    return bool(np.all(np.minimum(high, taken_high) - np.maximum(low, taken_low) > -_APART))


def _anywhere(
    rng: Rng,
    name: str,
    piece: Piece,
    where: tuple[Array, Array],
    fronts: Sequence[Stand],
    stands: Sequence[Stand],
) -> Stand | None:
    """A piece with its middle between two corners, any way round, clear of all others and their fronts."""
    for _ in range(_TRIES):
        angle = float(rng.choice([0.0, 0.5, 1.0, 1.5])) * np.pi + float(rng.uniform(-0.15, 0.15))
        place = np.append(rng.uniform(where[0][:2], where[1][:2]), 0.0)
        turn = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1.0]])
        found = Stand(name, piece, make_pose(turn, place))
        others = [s for s in stands if s not in fronts]
        if not any(_disturbs(found, s) for s in fronts) and not any(_disturbs(found, s) for s in others):
            return found
    return None


def _about(desk: Stand) -> tuple[Array, Array]:
    low, high = desk.closed.bounds
    return low - 0.35, high + 0.35


def _inside(stand: Stand, low: Array, high: Array) -> bool:
    a, b = stand.closed.bounds
    return bool(np.all(a[:2] > low[:2] + 0.03) and np.all(b[:2] < high[:2] - 0.03))
