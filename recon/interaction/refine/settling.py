"""Rounds of association and least squares until the joint settles.

Each round builds the surface anew from where the joint puts the frames, so the joint creeps along what the
surface tells least: of a plain flap, the plane that halves its turn. By the plain rounds a pivot that is 6 cm
off has 4 left after nine; so they are accelerated.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from recon.interaction.refine.terms import Terms
from twin.geometry import Array
from twin.joint import Joint

# All chosen by us.
MOST_ROUNDS = 24
# rad, tilt of a settled joint
_TILT = np.radians(0.01)
# m, shift of a settled joint
_SHIFT = 1e-4
_LEVER = 0.3
# changes between steps that are combined: with more, association's noise is taken for slope
_MEMORY = 2
_LONGEST = 10.0  # times the plain step, that a combined one is at most
_LEFT = 10.0  # rounds: as far as the last step goes on in these is how wrong the joint may still be


@dataclass(frozen=True, eq=False)
class Settled:
    """Joint and states (n,), last terms, and the joint's next step (2,) or (4,), rad and m; 0 if settled."""

    joint: Joint
    state: Array
    terms: Terms
    left: Array


def settle(
    one_round: Callable[[Joint, Array], tuple[Joint, Array, Terms]], joint: Joint, state: Array
) -> Settled:
    """Rounds from a joint and its states (n,) until one of them moves the joint no more; two at least."""
    origin, mixing = joint, Mixing()
    scale = _scale(origin, len(state))
    for number in range(MOST_ROUNDS):
        after, moved, terms = one_round(joint, state)
        step = after.minus(joint)
        still = np.abs(step[:2]).max() < _TILT and np.abs(step[2:]).max(initial=0.0) < _SHIFT
        if (still and number) or number == MOST_ROUNDS - 1:
            left = np.zeros_like(step) if still else _LEFT * step
            break
        here, there = (np.concatenate([j.minus(origin), s]) for j, s in ((joint, state), (after, moved)))
        mixed = mixing.next(here * scale, (there - here) * scale) / scale
        joint, state = origin.plus(mixed[: len(step)]), mixed[len(step) :]
    return Settled(after, moved, terms, left)


def _scale(joint: Joint, frames: int) -> Array:
    """What makes joint and states comparable: all states count as much as one unknown of the joint."""
    hinge = joint.kind == "revolute"
    of_joint = [1.0, 1.0, 1.0 / _LEVER, 1.0 / _LEVER] if hinge else [1.0, 1.0]
    return np.append(of_joint, np.full(frames, (1.0 if hinge else 1.0 / _LEVER) / np.sqrt(frames)))


class Mixing:
    """Next points of an iteration x -> x + step(x) that creeps, from its last few steps (Anderson 1965,
    "Iterative procedures for nonlinear integral equations")."""

    def __init__(self) -> None:
        self._points: list[Array] = []
        self._steps: list[Array] = []

    def next(self, point: Array, step: Array) -> Array:
        """Where to go on from a point (n,) that the iteration would move by `step` (n,)."""
        self._points = [*self._points[-_MEMORY:], point]
        self._steps = [*self._steps[-_MEMORY:], step]
        if len(self._points) < 2:
            return point + step
        ways, changes = np.diff(self._points, axis=0).T, np.diff(self._steps, axis=0).T
        share = np.linalg.lstsq(changes, step, rcond=1e-3)[0]
        way = step - (ways + changes) @ share
        longest = _LONGEST * float(np.linalg.norm(step))
        return np.asarray(point + way * min(1.0, longest / max(float(np.linalg.norm(way)), 1e-12)))
