"""Parts by depth: boards that left their place, each carried by the joint that explains most through all
frames."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from recon.interaction.boards.board import extents
from recon.interaction.boards.carried import Carried, Explained
from recon.interaction.boards.carrier import POINTS, Carrier, Shared
from recon.interaction.boards.meanwhile import MEANWHILE, together
from recon.interaction.boards.proposals import Proposed, along_room, proposed_joints
from recon.interaction.boards.seeds import Seed, came_and_went, informative_rows, seed_at, seeds
from recon.interaction.joints.observations import Kind, Model
from recon.interaction.joints.sign_and_limits import Oriented, orient, smoothed
from recon.observation.origins import STATIC, UNKNOWN, origins
from recon.observation.pictures import Pictures
from recon.observation.room import room_directions
from recon.recording import Recording
from twin import geometry as geo
from twin.geometry import Array
from twin.runs.threads import each
from twin.scene import Trajectory

# Chosen by us where no other source is named. Rows on which joints are compared.
_ROWS = 40
# Largest seeds whose own shapes propose joints.
_FROM = 2
# Points of a surface while all joints are compared, and each how manieth of those rows.
_FIRST_POINTS, _FIRST_ROWS = 100, 3
# Joints of each part that are searched around.
_IMPROVED = 4
# Two joints that differ by less start no two searches: rad, m.
_ALIKE_AXIS, _ALIKE_M = np.radians(4.0), 0.04
# Rounds of the search after the extent was chosen.
_LAST_ROUNDS = 3
# Fewest frames of a search.
_FEWEST_FRAMES = 8
# Most parts that come back to where they were.
_RETURNS = 3
# Least gain of the leading surface over leaving to somewhere unknown, as a share of its pixels.
LEAST = 0.015
# The same of a further surface of the part.
_SAME = 0.005
# Share of a seed that a found board covers, if it is of it.
_COVERED = 0.5
# A further part explains at least this share of what the first part explains.
_FURTHER = 0.3
# The same of a part that moves while no part that explains more does, as a small drawer after a large door.
_IN_TURN = 0.1
# By how much that share grows with the share of frames in which both move.
_PER_SHARE = 0.2
# Ratio by which a hinge must explain more than a slide, for its two further unknowns.
_SIMPLER = 1.02
# Standard deviation of a state, rad or m: the search's grid.
SIGMA = {"revolute": np.radians(1.5), "prismatic": 0.008}
# The same of the axis, rad, and of the pivot, m.
_SIGMA_AXIS, _SIGMA_PIVOT = np.radians(2.0), 0.02


@dataclass(frozen=True, eq=False)
class DepthPart:
    """A joint with states (T,), 0 at the first of `frames` (T,); what it carries, and px explained a row."""

    joint: Proposed
    frames: NDArray[np.int64]
    state: Array
    score: float
    carried: Carried

    def by(self, joint: Proposed) -> tuple[Array, float]:
        """Another joint's best states (T,), and what it explains by them over what this one does."""
        fine = self.carried.followed(self.carried.explained(joint))
        return smoothed(fine.state), fine.worth / max(self.worth(self.joint, self.state), 1e-12)

    def worth(self, joint: Proposed, state: Array) -> float:
        """Px explained a row by states (T,) on a joint, each within a step of the search."""
        rows = self.carried.shared.rows
        return self.carried.near(joint, self.carried.following(joint, rows, state[rows]), 1).worth

    def oriented(self, quantile: float) -> Oriented:
        """The joint of a twin, positive along the motion, with limits and the search's uncertainty."""
        n = 4 if self.joint.kind == "revolute" else 2
        variance = (
            [_SIGMA_AXIS**2] * 2
            + [_SIGMA_PIVOT**2] * (n - 2)
            + [SIGMA[self.joint.kind] ** 2] * len(self.state)
        )
        model = Model(self.joint.kind, self.joint.axis, self.joint.pivot, self.state)
        return orient(model, np.diag(variance), np.arange(len(self.state)), quantile)


def parts_by_depth(
    recording: Recording, cameras: Trajectory, known: Sequence[Proposed] = ()
) -> list[DepthPart]:
    """The parts that explain what changed, by decreasing evidence.

    known: joints from elsewhere, which compete with those that boards and the room suggest.
    """
    shared = _shared(recording, cameras)
    if shared is None:
        return []
    pictures, static = shared.pictures, shared.origin == STATIC
    left = _changed(pictures)
    grown = {}
    for k, seed in enumerate(left):
        boards = extents(pictures, recording, seed, [o for o in left if o is not seed])
        left[k], grown[id(boards[0])] = boards[0], boards
    found: list[DepthPart] = []
    while left:
        left.sort(key=lambda s: -len(s.points))
        part, fine = _Round(shared, left, grown, known).part()
        if part is None:
            left = left[1:]  # no joint carries the largest one
            continue
        found.append(part)
        shared = part.carried.taken_out(fine)
        left = [s for s in left if not _of(s, part.carried)]
    for _ in range(_RETURNS):
        back = _returning(shared, static, recording, known)
        if back is None:
            break
        part, fine = back
        found.append(part)
        shared = part.carried.taken_out(fine)
    return _worth_telling(sorted(found, key=lambda p: -p.score))


def _returning(
    shared: Shared, static: NDArray[np.bool_], recording: Recording, known: Sequence[Proposed]
) -> tuple[DepthPart, Explained] | None:
    """A part that no part found so far explains and that rests in the first and the last row alike.

    static: pixels (T, h, w) that rest in all rows; where it rests, they are its own.
    """
    left = came_and_went(shared.pictures, shared.origin)
    if not left:
        return None
    origin = np.where(static, UNKNOWN, shared.origin).astype(np.uint8)
    shared = replace(shared, origin=origin, rows=np.union1d(shared.rows, [s.rest for s in left]))
    boards = [extents(shared.pictures, recording, seed) for seed in left]
    grown = {id(b[0]): b for b in boards}
    part, fine = _Round(shared, [b[0] for b in boards], grown, known, len(left)).part()
    return (part, fine) if part is not None and part.carried.comes_back(fine) else None


def part_at(
    recording: Recording,
    cameras: Trajectory,
    point: tuple[int, int, int],
    known: Sequence[Proposed] = (),
    kind: Kind | None = None,
) -> DepthPart | None:
    """The part of whose board a pixel x, y of a frame is; None where no joint carries what is seen there.

    known: as of `parts_by_depth`. kind: of its joint, where that is known.
    """
    shared = _shared(recording, cameras)
    if shared is None:
        return None
    pictures, (x, y, frame) = shared.pictures, point
    row = int(np.argmin(np.abs(pictures.frames - frame)))
    step = recording.intrinsics.width / pictures.camera.width
    seed = seed_at(pictures, row, int(x / step), int(y / step))
    if seed is None:
        return None
    shared = replace(shared, rows=np.union1d(shared.rows, [row]))
    others = _changed(pictures)
    boards = extents(pictures, recording, seed, others)
    return _Round(shared, [boards[0], *others], {id(boards[0]): boards}, known, 1, kind).part()[0]


def _shared(recording: Recording, cameras: Trajectory) -> Shared | None:
    """What all boards of a recording share; None of too few frames."""
    pictures = Pictures.of(recording, cameras)
    if len(pictures.frames) < _FEWEST_FRAMES:
        return None
    origin = origins(pictures)
    seconds = np.asarray(recording.times)[pictures.frames]
    return Shared(pictures, origin, informative_rows(origin, _ROWS), seconds, room_directions(pictures))


def _changed(pictures: Pictures) -> list[Seed]:
    """Surfaces of the first and the last row that were not there at all times."""
    return [s for rest in (0, len(pictures.frames) - 1) for s in seeds(pictures, rest)]


def _of(seed: Seed, carried: Carried) -> bool:
    """Whether a seed is carried, or lies on a board that is."""
    return any(
        c.seed.rest == seed.rest and (c.seed.mask & seed.mask).sum() > _COVERED * seed.mask.sum()
        for c in carried.carriers
    )


@dataclass(frozen=True, eq=False)
class _Round:
    """One part's search: the seeds left, largest first, with what each may be grown to; how many of them
    propose joints, and of which kind."""

    shared: Shared
    left: Sequence[Seed]
    grown: dict[int, list[Seed]]
    known: Sequence[Proposed]
    leading: int = _FROM
    kind: Kind | None = None
    _carriers: dict[tuple[int, int], Carrier] = field(default_factory=dict)

    def part(self) -> tuple[DepthPart | None, Explained]:
        """The part of that joint, None where it explains too little, and its states of all rows in fine
        steps."""
        best, carried = self.best()
        areas = np.array([c.area for c in carried.carriers])
        if best.gains[0] < LEAST * areas[0]:
            return None, best
        its = carried.only(best.gains >= _SAME * areas)
        fine = its.followed(its.following(best.joint, best.rows, best.state))
        state = smoothed(fine.state)
        frames = self.shared.pictures.frames
        return DepthPart(fine.joint, frames, state - state[0], best.worth, its), fine

    def best(self) -> tuple[Explained, Carried]:
        """The joint that explains most, and the board and further seeds that it carries."""
        tried = [(joint, board) for board, joints in self._hypotheses() for joint in joints]
        rough = replace(
            self, shared=self.shared.thinned(_FIRST_ROWS, {s.rest for s in self.left}), _carriers={}
        )
        few = {id(b): rough._with(b, _FIRST_POINTS) for _, b in tried}
        first = list(each(lambda t: few[id(t[1])].explained(t[0]), tried))
        starts: list[int] = []
        for k in sorted(range(len(tried)), key=lambda k: -_worth(first[k])):
            if len(starts) < _IMPROVED and not any(_alike(tried[k][0], tried[s][0]) for s in starts):
                starts.append(k)
        ends = list(each(lambda k: self._competed(first[k], tried[k][1]), starts))
        return max(ends, key=lambda e: _worth(e[0]))

    def _competed(self, start: Explained, board: Seed) -> tuple[Explained, Carried]:
        """A joint searched around, with the extent of its board that explains most."""
        own = self._with(board)
        rows = self.shared.rows
        states = np.interp(rows, start.rows, start.state)
        best = own.improved(own.near(start.joint, own.following(start.joint, rows, states)))
        same = next((es for es in self.grown.values() if any(e is board for e in es)), [])
        for other in same:
            its = self._with(other)
            trial = max(
                its.near(best.joint, its.following(best.joint, best.rows, best.state), 1),
                its.explained(best.joint),
                key=_worth,
            )
            if trial.worth > best.worth:
                best, own = trial, its
        return own.improved(best, _LAST_ROUNDS), own

    def _hypotheses(self) -> Iterator[tuple[Seed, list[Proposed]]]:
        """Boards, and joints for each: the largest seeds in all extents."""
        for seed in self.left[: self.leading]:
            for board in self.grown[id(seed)]:
                joints = proposed_joints(board.points)
                every = [*joints, *along_room(joints, self.shared.room), *self.known]
                yield board, [j for j in every if self.kind in (None, j.kind)]

    def _with(self, board: Seed, most: int = POINTS) -> Carried:
        """A board, and the seeds that do not lie on it."""
        leading = self._carrier(board, most)
        own = Carried([leading])
        return Carried([leading, *(self._carrier(s, most) for s in self.left if not _of(s, own))])

    def _carrier(self, seed: Seed, most: int) -> Carrier:
        key = id(seed), most
        if key not in self._carriers:
            self._carriers[key] = Carrier.of(self.shared, seed, most)
        return self._carriers[key]


def _alike(a: Proposed, b: Proposed) -> bool:
    """Whether two joints are nearly one."""
    if a.kind != b.kind or geo.line_angle(a.axis, b.axis) > _ALIKE_AXIS:
        return False
    return a.kind == "prismatic" or geo.line_distance(a.pivot, a.axis, b.pivot, b.axis) <= _ALIKE_M


def _worth_telling(found: Sequence[DepthPart]) -> list[DepthPart]:
    """The parts (by decreasing score) that explain enough beside the others."""
    out: list[DepthPart] = []
    for part in found:
        share = part.score / max(found[0].score, 1e-12)
        meanwhile = max((together(part.state, p.state) for p in out), default=0.0)
        in_turn = meanwhile < MEANWHILE and share >= _IN_TURN + _PER_SHARE * meanwhile
        if share >= _FURTHER or in_turn:
            out.append(part)
    return out


def _worth(explained: Explained) -> float:
    return explained.worth / (_SIMPLER if explained.joint.kind == "revolute" else 1.0)
