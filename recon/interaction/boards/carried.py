"""Surfaces carried by a joint through every picture: the states that explain most of them, and how much."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numba import njit
from numpy.typing import NDArray

from recon.dense.looks import SAME
from recon.interaction.boards.carrier import Carrier, Shared
from recon.interaction.boards.proposals import Proposed, plane_of
from recon.interaction.joints.observations import Kind
from recon.observation.likelihood import explained
from twin import geometry as geo
from twin.geometry import Array
from twin.joint import moved_axis

# All chosen by us.
# Farthest state, rad or m.
_FAR: dict[Kind, float] = {"revolute": np.deg2rad(135.0), "prismatic": 0.7}
# First step between states, rad or m.
_STEP: dict[Kind, float] = {"revolute": np.deg2rad(3.0), "prismatic": 0.02}
# Last step between states, rad or m.
_FINE: dict[Kind, float] = {"revolute": np.deg2rad(0.75), "prismatic": 0.004}
# Fastest motion, rad/s or m/s.
_FASTEST: dict[Kind, float] = {"revolute": np.deg2rad(300.0), "prismatic": 2.5}
# Price of a step of the state, as a share of the surface, so that the state rests where nothing moves it.
_PRICE = 0.01
# Neighbours of a state that are tried after a small change of the joint.
_WINDOW = 3
# Greatest tilts (rad) and shifts (m) of the search for a better joint, by round, and the share of the first
# step by which states then change.
_ROUNDS = (
    (np.deg2rad(6.0), 0.1, 1.0),
    (np.deg2rad(3.0), 0.05, 0.7),
    (np.deg2rad(1.5), 0.025, 0.5),
    (np.deg2rad(0.75), 0.012, 0.35),
    (np.deg2rad(0.4), 0.006, 0.25),
)
_IMPOSSIBLE = -1e9
# Points of each surface of a board.
_OF_BOARD = 500
# Share of a surface that is seen where it comes back to.
_BACK = 0.5


@dataclass(frozen=True, eq=False)
class Explained:
    """A joint with states in the rows (T,), 0 in the first one.

    gains: px that each surface explains beyond leaving, at least 0. worth: those of the leading surface and
    of others at its rest, times the joint's prior; at the other rest it may be the same surface once more.
    """

    joint: Proposed
    rows: NDArray[np.int64]
    state: Array
    gains: Array
    worth: float


@dataclass(frozen=True, eq=False)
class Carried:
    """Surfaces that one joint may carry; the first one leads: it proposes states."""

    carriers: Sequence[Carrier]
    shared: Shared = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "shared", self.carriers[0].shared)

    @property
    def area(self) -> int:
        """Pixels of all surfaces at rest."""
        return sum(c.area for c in self.carriers)

    def only(self, gaining: NDArray[np.bool_]) -> Carried:
        """Those of a mask."""
        return Carried([c for c, g in zip(self.carriers, gaining, strict=True) if g])

    def explained(self, joint: Proposed) -> Explained:
        """The best states of the leading surface on a joint, and what all explain by them."""
        rows, first = self.shared.rows, self.carriers[0]
        step, count = _STEP[joint.kind], round(_FAR[joint.kind] / _STEP[joint.kind])
        states = np.asarray(step * np.arange(-count, count + 1), np.float64)
        poses = np.broadcast_to(joint.poses(states), (len(rows), len(states), 4, 4))
        return self.following(joint, rows, self._best(first.scores(poses, rows), states, rows, joint.kind))

    def improved(self, first: Explained, rounds: int = len(_ROUNDS)) -> Explained:
        """The joint tilted and shifted while that helps: pattern search (Hooke and Jeeves 1961)."""
        best = first
        count = 4 if best.joint.kind == "revolute" else 2
        for tilt, shift, fine in _ROUNDS[-rounds:]:
            for _ in range(2):
                before = best.worth
                for k in range(2 * count):
                    delta = np.zeros(count)
                    delta[k // 2] = (tilt if k // 2 < 2 else shift) * (1.0 if k % 2 else -1.0)
                    trial = self.near(self._moved(best.joint, delta), best, share=fine)
                    if trial.worth > best.worth * (1.0 + 1e-4):
                        best = trial
                if best.worth == before:
                    break
            again = self.explained(best.joint) if fine == 1.0 else self.near(best.joint, best, share=fine)
            best = max(best, again, key=lambda e: e.worth)
        return best

    def followed(self, best: Explained) -> Explained:
        """The states of all rows in fine steps, by all surfaces."""
        rows, step = np.arange(len(self.shared.seconds)), _FINE[best.joint.kind]
        coarse = np.interp(rows, best.rows, best.state)
        low, high = coarse.min() - _STEP[best.joint.kind], coarse.max() + _STEP[best.joint.kind]
        states = np.asarray(step * np.arange(np.floor(low / step), np.ceil(high / step) + 1), np.float64)
        total = np.zeros((len(rows), len(states)))
        for c in self.carriers:
            poses = best.joint.poses(states - coarse[c.seed.rest])
            total += c.scores(np.broadcast_to(poses, (len(rows), *poses.shape)), rows)
        return self.following(best.joint, rows, self._best(total, states, rows, best.joint.kind, coarse))

    def near(self, joint: Proposed, like: Explained, steps: int = _WINDOW, share: float = 1.0) -> Explained:
        """The best states within so many steps of a like joint's, each a share of the first step.

        They are those of the surface that gains most.
        """
        c = self.carriers[int(np.argmax(like.gains))]
        window = share * _STEP[joint.kind] * np.arange(-steps, steps + 1)
        at = int(np.flatnonzero(like.rows == c.seed.rest)[0])
        state = like.state - like.state[at]
        poses = joint.poses((state[:, None] + window).ravel()).reshape(len(state), len(window), 4, 4)
        score = c.scores(poses, like.rows)
        score[at] = _IMPOSSIBLE
        score[at, steps] = 0.0
        # states at a constant distance from the former ones cost nothing
        path, _ = best_path(score, np.full(len(state), 2), _PRICE * c.area)
        return self.following(
            joint, like.rows, np.clip(state + window[path], -_FAR[joint.kind], _FAR[joint.kind])
        )

    def _best(
        self, score: Array, states: Array, rows: NDArray[np.int64], kind: Kind, coarse: Array | None = None
    ) -> Array:
        """The best path of states (rows,) through scores (rows, states): 0 where the leading surface rests,
        or there as `coarse` (rows,) says."""
        rest = self.carriers[0].seed.rest
        at = int(np.flatnonzero(rows == rest)[0])
        zero = 0.0 if coarse is None else coarse[rest]
        score[at] = _IMPOSSIBLE
        score[at, int(np.argmin(np.abs(states - zero)))] = 0.0
        seconds = self.shared.seconds[rows]
        most = np.ceil(_FASTEST[kind] * np.diff(seconds, prepend=seconds[0]) / float(states[1] - states[0]))
        area = self.carriers[0].area if coarse is None else self.area
        path, _ = best_path(score, np.clip(most.astype(np.int64), 2, len(states)), _PRICE * area)
        return np.asarray(states[path])

    def following(self, joint: Proposed, rows: NDArray[np.int64], state: Array) -> Explained:
        """A joint with states (rows,) in some rows, and how much it explains there."""
        state = state - state[0]
        gains = []
        for c in self.carriers:
            at = int(np.flatnonzero(rows == c.seed.rest)[0])
            gains.append(c.gain(joint.poses(state - state[at]), rows))
        worth = sum(
            g for g, c in zip(gains, self.carriers, strict=True) if c.seed.rest == self.carriers[0].seed.rest
        )
        return Explained(
            joint,
            rows,
            state,
            np.array(gains),
            worth * self.shared.prior(joint.axis, self.carriers[0].normal),
        )

    def comes_back(self, fine: Explained) -> bool:
        """Whether the leading surface is seen in the first or the last row, where states of all rows say: a
        hand that came and went is nowhere then."""
        leading = self.carriers[0]
        ends = (0, len(fine.state) - 1)
        poses = fine.joint.poses(fine.state[list(ends)] - fine.state[leading.seed.rest])
        return any((leading.seen(p, r) == SAME).mean() > _BACK for p, r in zip(poses, ends, strict=True))

    def board(self, joint: Proposed, state: Array) -> Array:
        """Points (n, 3) m, in the first row, of the planes of these surfaces. state: of all rows, 0 there."""
        out = []
        for c in self.carriers:
            _, on = plane_of(c.seed.points)
            back = joint.poses(-state[[c.seed.rest]])[0]
            out.append(geo.transform(back, on[:: len(on) // _OF_BOARD + 1]))
        return np.concatenate(out)

    def taken_out(self, fine: Explained) -> Shared:
        """What is left for another part: what these explain by states of all rows is static to others."""
        s = self.shared
        p, left = s.pictures, replace(s, origin=s.origin.copy())
        for c in self.carriers:
            poses = fine.joint.poses(fine.state - fine.state[c.seed.rest])
            explained(c.seed.points, p.T_cam_world, poses, p.near, p.far, left.origin, p.lens, c.gates)
        return left

    def _moved(self, joint: Proposed, delta: Array) -> Proposed:
        """Tilted about the axis point nearest the leading surface, and shifted."""
        foot = geo.nearest_point_on_line(self.carriers[0].points.mean(axis=0), joint.pivot, joint.axis)
        axis, pivot = moved_axis(joint.axis, foot, delta)
        return replace(joint, axis=axis, pivot=pivot)


@njit(cache=True, nogil=True)
def best_path(score, most, price):  # type: ignore[no-untyped-def]
    """The best path of states (T,) through scores (T, Q), and its score (dynamic programming, Viterbi 1967).

    The state changes by at most `most` (T,) per frame, at a `price` per step.
    """
    frames, count = score.shape
    total, new = score[0].astype(np.float64), np.zeros(count)
    back = np.zeros((frames, count), np.int32)
    for t in range(1, frames):
        for q in range(count):
            best, at = -np.inf, q
            for r in range(max(0, q - most[t]), min(count, q + most[t] + 1)):
                c = total[r] - price * abs(q - r)
                if c > best:
                    best, at = c, r
            back[t, q], new[q] = at, best + score[t, q]
        total, new = new, total
    path = np.zeros(frames, np.int64)
    path[frames - 1] = np.argmax(total)
    for t in range(frames - 1, 0, -1):
        path[t - 1] = back[t, path[t]]
    return path, total.max()
