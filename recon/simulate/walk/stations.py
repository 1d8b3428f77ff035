"""Where a person stands to handle a part: within an arm's reach, in sight of it, clear of its way."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from recon.simulate.camera_path import FOLLOW
from recon.simulate.grip import Grasp
from recon.simulate.hand_path import Arm, shoulder_place
from recon.simulate.mjcf import Articulation
from recon.simulate.sight import Surroundings, sight
from recon.simulate.walk.floor import Floor
from twin.geometry import Array, make_pose, transform, unit

Rng = np.random.Generator
# m from the shoulder to the grip, with the upper body bent forward; less than what a draw is refused for
ARM = 0.92
# m that the person's middle keeps from everything while handling a part
STANDING = 0.20
# Degrees from the way the furniture looks, and m from the grip, at which places are tried
_BEARINGS = np.radians(np.arange(-66.0, 67.0, 11.0))
_DISTANCES = np.array([0.44, 0.52, 0.6, 0.68, 0.76, 0.84])
# m over the grip at which the eyes are, where the person bends down to it; m over the floor at least
_RISE, _LOWEST = (0.42, 0.66), 0.72
# What a place is worth at least: about half of the part and the grip are in sight
_WORTH = 0.5
# Places that are looked from, the best ones first; m from the grip to the wrist
_SEEN, _HAND = 40, 0.09
# m from the grip at which a person likes to stand
_LIKED = 0.64


@dataclass(frozen=True)
class Station:
    """Eyes `eye` (3,) m where the hand takes hold, and the horizontal direction `away` (3,) from the grip to
    the person, who gives way along it."""

    eye: Array
    away: Array

    def eyes(self, led: Array) -> Array:
        """Eyes (n, 3) where the grip has come `led` (n, 3) m from where it was taken."""
        return self.eye + FOLLOW * (led @ self.away)[:, None] * self.away


@dataclass(frozen=True)
class Task:
    """A part among all that stands around it, its grasp, where it faces (3,), the states (n,) that it goes
    through, and the floor at each of them."""

    scene: Articulation
    grasp: Grasp
    facing: Array
    levels: Array
    floors: Sequence[Floor]

    @cached_property
    def grips(self) -> Array:
        """Where the grip is (n, 3) at each state."""
        return grip_at(self.scene, self.grasp, self.levels)


def grip_at(scene: Articulation, grasp: Grasp, levels: Array) -> Array:
    """Grip (n, 3) at states (n,)."""
    return np.stack([transform(scene.pose(float(s)), grasp.point[None])[0] for s in levels])


def find_station(task: Task, around: Surroundings, stature: float, arm: Arm, rng: Rng) -> Station | None:
    """The best place for a task; None where there is none. stature: height of the eyes, m."""
    grips = task.grips
    led = grips - grips[0]
    facing = unit(task.facing * [1.0, 1.0, 0.0])
    right = np.cross([0.0, 0.0, 1.0], facing)
    high = float(grips[:, 2].max()) + float(rng.uniform(*_RISE))
    rises = [high, high - 0.14, high - 0.28]
    turned = float(rng.uniform(-0.08, 0.08))
    found: list[tuple[float, Station]] = []
    for bearing in _BEARINGS + turned:
        away = np.cos(bearing) * facing + np.sin(bearing) * right
        for distance in _DISTANCES:
            for lower, rise in enumerate(rises):
                eye = grips[0] + distance * away
                eye[2] = np.clip(rise, _LOWEST, stature)
                station = Station(eye, away)
                if not _fits(task, station, led, arm):
                    continue
                worth = 0.12 * abs(bearing) + 0.5 * abs(distance - _LIKED) + 0.05 * lower
                found.append((-worth, station))
    found.sort(key=lambda f: -f[0])
    best: tuple[float, Station] | None = None
    for liking, station in found[:_SEEN]:
        if _arm_meets(task, station, led, arm, around):
            continue
        worth = sight(task.scene, around, task.grasp, station.eyes(0.5 * (led[-1:] + led[:1]))[0])
        if worth > _WORTH and (best is None or worth + liking > best[0]):
            best = worth + liking, station
    return None if best is None else best[1]


def _fits(task: Task, station: Station, led: Array, arm: Arm) -> bool:
    """Whether the person has room at each state, and the arm reaches the grip."""
    eyes = station.eyes(led)
    for eye, grip, floor in zip(eyes, task.grips, task.floors, strict=True):
        if floor.clearance(eye[None, :2])[0] < STANDING:
            return False
        if float(np.linalg.norm(shoulder_of(eye, grip, arm) - grip)) > ARM:
            return False
    return True


def _arm_meets(task: Task, station: Station, led: Array, arm: Arm, around: Surroundings) -> bool:
    """Whether the straight line from the shoulder to the hand passes through something."""
    rays = []
    for eye, grip, state in zip(station.eyes(led), task.grips, task.levels, strict=True):
        hand = grip + _HAND * (task.scene.pose(float(state))[:3, :3] @ task.grasp.outward)
        shoulder = shoulder_of(eye, grip, arm)
        rays.append(np.concatenate([shoulder, hand - shoulder]))
    return bool(around.static.blocked(np.array(rays, dtype=np.float32)).any())


def shoulder_of(eye: Array, target: Array, arm: Arm) -> Array:
    """The shoulder (3,) of a person who looks from `eye` at `target` (3,)."""
    ahead = target - eye
    forward = unit(ahead * [1.0, 1.0, 0.0])
    right = np.cross(forward, [0.0, 0.0, 1.0])
    return shoulder_place(make_pose(np.stack([right, [0.0, 0.0, -1.0], forward], axis=1), eye), arm)
