"""Changed surfaces carried by a joint through every frame: the states of best agreement, and their score."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from recon.interaction.joints.observations import Kind
from recon.interaction.motion.change.depths import Depths
from recon.interaction.motion.change.kernels import agreements, best_path
from recon.interaction.motion.change.surfaces import Changed
from recon.interaction.parts.changed.proposals import Proposed
from twin import geometry as geo
from twin.geometry import Array
from twin.joint import moved_axis

# All chosen by us.
# Points of a surface that are carried; more cost time and rank no joint otherwise.
POINTS = 200
# Rows on which joints are compared.
ROWS = 40
# Share of a surface in view in a row that looks at the surface.
_IN_VIEW = 0.2
# Fewest such rows for a mean over them.
_FEWEST_ROWS = 5
# Standard deviations of noise within which depths agree.
_SIGMAS = 4.0
# m within which depths agree at least.
_LEAST_M = 0.018
# Farthest state, rad or m.
_FAR: dict[Kind, float] = {"revolute": np.deg2rad(135.0), "prismatic": 0.7}
# First step between states, rad or m.
_STEP: dict[Kind, float] = {"revolute": np.deg2rad(3.0), "prismatic": 0.02}
# Last step between states, rad or m.
_FINE: dict[Kind, float] = {"revolute": np.deg2rad(0.75), "prismatic": 0.004}
# Fastest motion, rad/s or m/s.
_FASTEST: dict[Kind, float] = {"revolute": np.deg2rad(300.0), "prismatic": 2.5}
# Weight of a point seen through against a point that agrees: nothing excuses free space.
_THROUGH = 2.0
# Price of a step of the state, so that the state rests where nothing moves it.
_PRICE = 0.01
# Neighbours of a state that are tried after a small change of the joint.
_WINDOW = 3
# Surfaces whose own best states are tried for all.
_LEADING = 4
# Greatest tilts (rad) and shifts (m) of the search for a better joint, by round.
_ROUNDS = (
    (np.deg2rad(6.0), 0.1),
    (np.deg2rad(3.0), 0.05),
    (np.deg2rad(1.5), 0.025),
    (np.deg2rad(0.75), 0.012),
    (np.deg2rad(0.4), 0.006),
)


@dataclass(frozen=True, eq=False)
class CarriedSurface:
    """A changed surface: world points (n, 3) m and Lab colours (n, 3) at its rest in row `rest`.

    new: (T, h, w), `motion.change.surfaces.novelty` to that row. rows: those that compare joints.
    panel: whether the surface slides in its own plane, over its own place.
    """

    depths: Depths
    rest: int
    points: Array
    tint: Array
    area: int  # px of the depths
    new: NDArray[np.uint8]
    rows: NDArray[np.int64]
    panel: bool = False

    @staticmethod
    def of(
        depths: Depths, changed: Changed, new: NDArray[np.uint8], rows: NDArray[np.int64], panel: bool = False
    ) -> CarriedSurface:
        """A few of its points, evenly chosen."""
        count = len(changed.points)
        chosen = np.sort(np.random.default_rng(0).choice(count, min(POINTS, count), replace=False))
        return CarriedSurface(
            depths, changed.rest, changed.points[chosen], changed.tint[chosen], count, new, rows, panel
        )

    @property
    def _gate(self) -> tuple[float, float]:
        noise = self.depths.noise
        return max(_LEAST_M, _SIGMAS * noise.base), _SIGMAS * noise.slope

    def scores(self, poses: Array, rows: NDArray[np.int64]) -> Array:
        """Agreement less twice what is seen through (rows, n), as shares, at poses (rows, n, 4, 4)."""
        T_cam_world, depth, colour, new = self._compared if rows is self.rows else self._pictures(rows)
        good, through = agreements(
            self.points, self.tint, T_cam_world, np.ascontiguousarray(poses), depth, colour, new, self.panel, self.depths.lens, self._gate
        )  # fmt: skip
        return np.asarray(good - _THROUGH * through)

    def _pictures(
        self, rows: NDArray[np.int64]
    ) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any], NDArray[Any]]:
        """Cameras, depths, colours and what is new, in some rows."""
        d = self.depths
        return d.T_cam_world[rows], d.depth[rows], d.colour[rows], self.new[rows]

    @cached_property
    def _compared(self) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any], NDArray[Any]]:
        return self._pictures(self.rows)

    def along(self, poses: Array, rows: NDArray[np.int64]) -> Array:
        """The same (rows,) at one pose (rows, 4, 4) each."""
        return self.scores(poses[:, None], rows)[:, 0]

    def mean(self, scores: Array, rows: NDArray[np.int64]) -> float:
        """Mean of scores (rows,) over the rows that look at the surface: others say nothing of it."""
        looks = self._looks if rows is self.rows else self._looked_at(rows)
        return float(scores[looks].mean())

    @cached_property
    def unknown(self) -> float:
        """A surface's mean score if it stays, then leaves to somewhere unknown: what a joint must exceed."""
        rows = self.rows
        stays = self.along(np.tile(np.eye(4), (len(rows), 1, 1)), rows)
        return self.mean(np.maximum(stays, 0.0), rows)

    @cached_property
    def _looks(self) -> NDArray[np.bool_]:
        return self._looked_at(self.rows)

    def _looked_at(self, rows: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Rows (rows,) in whose picture part of it rests; all if these are few."""
        d = self.depths
        ahead = geo.transform(d.T_cam_world[rows], self.points)
        pixels = d.camera.project(np.where(ahead[..., 2:] > 0.1, ahead, [0.0, 0.0, 1.0]))
        inside = (ahead[..., 2] > 0.1) & np.all(
            (pixels >= 0) & (pixels < [d.camera.width, d.camera.height]), axis=-1
        )
        looks = inside.mean(axis=1) >= _IN_VIEW
        return looks if looks.sum() >= _FEWEST_ROWS else np.ones(len(rows), bool)


@dataclass(frozen=True, eq=False)
class Explained:
    """A joint with states in the rows (T,), 0 in the first one.

    gains: each surface's mean score over that of leaving, at least 0. worth: the gains summed over pixels.
    """

    joint: Proposed
    rows: NDArray[np.int64]
    state: Array
    gains: Array
    worth: float


@dataclass(frozen=True, eq=False)
class CarriedSurfaces:
    """All surfaces that changed, largest first, and the seconds (T,) of the rows."""

    depths: Depths
    surfaces: Sequence[CarriedSurface]
    seconds: Array

    def explained(self, joint: Proposed) -> Explained:
        """The best states for all surfaces on a joint: the worthiest of each leading surface's."""
        rows = self.surfaces[0].rows
        tried = [self.following(joint, rows, self._path(joint, s, rows)) for s in self.surfaces[:_LEADING]]
        return max(tried, key=lambda e: e.worth)

    def improved(self, first: Explained) -> Explained:
        """The joint tilted and shifted while that helps: pattern search (Hooke and Jeeves 1961)."""
        best = first
        count = 4 if best.joint.kind == "revolute" else 2
        for tilt, shift in _ROUNDS:
            for _ in range(2):
                before = best.worth
                for k in range(2 * count):
                    delta = np.zeros(count)
                    delta[k // 2] = (tilt if k // 2 < 2 else shift) * (1.0 if k % 2 else -1.0)
                    trial = self.near(self._moved(best.joint, delta), best)
                    if trial.worth > best.worth * (1.0 + 1e-4):
                        best = trial
                if best.worth == before:
                    break
            best = max(best, self.explained(best.joint), key=lambda e: e.worth)
        return best

    def followed(self, best: Explained) -> Explained:
        """The states of all rows in fine steps, by all surfaces that gain."""
        rows, step = np.arange(len(self.depths.frames)), _FINE[best.joint.kind]
        coarse = np.interp(rows, best.rows, best.state)
        low, high = coarse.min() - _STEP[best.joint.kind], coarse.max() + _STEP[best.joint.kind]
        states = np.asarray(step * np.arange(np.floor(low / step), np.ceil(high / step) + 1), np.float64)
        total = np.zeros((len(rows), len(states)))
        for surface, gain in zip(self.surfaces, best.gains, strict=True):
            if gain > 0:
                total += surface.area * surface.scores(
                    _for_all(best.joint.poses(states - coarse[surface.rest]), rows), rows
                )
        total /= max(sum(s.area for s, g in zip(self.surfaces, best.gains, strict=True) if g > 0), 1)
        return self.following(best.joint, rows, self._best(total, states, rows, best.joint.kind, 0))

    def near(self, joint: Proposed, like: Explained, steps: int = _WINDOW) -> Explained:
        """The best states within so many coarse steps of a like joint's, by the surface that gains most."""
        surface = self.surfaces[int(np.argmax(like.gains * [s.area for s in self.surfaces]))]
        step = _STEP[joint.kind]
        window = step * np.arange(-steps, steps + 1)
        at = int(np.flatnonzero(like.rows == surface.rest)[0])
        state = like.state - like.state[at]
        poses = joint.poses((state[:, None] + window).ravel()).reshape(len(state), len(window), 4, 4)
        score = surface.scores(poses, like.rows)
        score[at] = -1e6
        score[at, steps] = 0.0
        # states at a constant distance from the former ones cost nothing
        path, _ = best_path(score, np.full(len(state), 2), _PRICE)
        return self.following(
            joint, like.rows, np.clip(state + window[path], -_FAR[joint.kind], _FAR[joint.kind])
        )

    def _path(self, joint: Proposed, surface: CarriedSurface, rows: NDArray[np.int64]) -> Array:
        """The states (rows,) that one surface asks for."""
        step, count = _STEP[joint.kind], round(_FAR[joint.kind] / _STEP[joint.kind])
        states = np.asarray(step * np.arange(-count, count + 1), np.float64)
        return self._best(
            surface.scores(_for_all(joint.poses(states), rows), rows), states, rows, joint.kind, surface.rest
        )

    def _best(self, score: Array, states: Array, rows: NDArray[np.int64], kind: Kind, rest: int) -> Array:
        """The best path of states (rows,) through scores (rows, states), 0 in row `rest` of the depths."""
        at = int(np.flatnonzero(rows == rest)[0])
        score[at] = -1e6
        score[at, int(np.argmin(np.abs(states)))] = 0.0
        gaps = np.diff(self.seconds[rows], prepend=self.seconds[rows[0]])
        most = np.ceil(_FASTEST[kind] * gaps / float(states[1] - states[0])).astype(np.int64)
        path, _ = best_path(score, np.clip(most, 2, len(states)), _PRICE)
        return np.asarray(states[path])

    def following(self, joint: Proposed, rows: NDArray[np.int64], state: Array) -> Explained:
        """A joint with states (rows,) in some rows, and how well depth agrees with it there."""
        state = state - state[0]
        gains = []
        for s in self.surfaces:
            at = int(np.flatnonzero(rows == s.rest)[0])
            gains.append(max(s.mean(s.along(joint.poses(state - state[at]), rows), rows) - s.unknown, 0.0))
        areas = [s.area for s in self.surfaces]
        return Explained(joint, rows, state, np.array(gains), float(np.dot(gains, areas)))

    def _moved(self, joint: Proposed, delta: Array) -> Proposed:
        """Tilted about the axis point nearest the largest surface, and shifted."""
        foot = geo.nearest_point_on_line(self.surfaces[0].points.mean(axis=0), joint.pivot, joint.axis)
        axis, pivot = moved_axis(joint.axis, foot, delta)
        return replace(joint, axis=axis, pivot=pivot)


def _for_all(poses: Array, rows: NDArray[np.int64]) -> Array:
    """The same poses (n, 4, 4) for each of the rows: (rows, n, 4, 4)."""
    return np.broadcast_to(poses, (len(rows), *poses.shape))
