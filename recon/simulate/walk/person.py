"""The person, frame by frame: feet on a way, eyes at a height, a head that turns as fast as heads do."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from twin.geometry import Array

# 1/s by which the head catches up with what is looked at
_CATCH = 3.2
# Degrees/s^2 by which the head's turning changes
_TURN_CHANGE = np.radians(170.0)
# m/s^2 by which walking speeds up and slows down
_START_STOP = 0.8
# m/s and 1/s of standing up and bending down
_BEND, _BEND_CATCH = 0.5, 2.6
# Degrees of pitch that a look takes at most
_PITCH = np.radians(68.0)

# What is looked at (3,), of the eyes (3,)
Gaze = Callable[[Array], Array]


@dataclass(frozen=True)
class Gait:
    """How a person moves: walking speed m/s, turning rad/s at most, height of the eyes m."""

    speed: float
    turning: float
    stature: float


def fixed(target: Array) -> Gaze:
    """A look at one point (3,)."""
    return lambda _: target


@dataclass
class Person:
    """A person at `eye` (3,) who looks along `yaw` and `pitch` (rad, up is positive) and logs each frame."""

    gait: Gait
    fps: float
    eye: Array
    yaw: float
    pitch: float = -0.2
    turning: float = 0.0
    nodding: float = 0.0
    eyes: list[Array] = field(default_factory=list)
    looks: list[tuple[float, float]] = field(default_factory=list)

    @property
    def frame(self) -> int:
        """The next frame."""
        return len(self.eyes)

    @property
    def place(self) -> Array:
        """Where the person stands (2,)."""
        return self.eye[:2].copy()

    @property
    def ahead(self) -> Array:
        """Unit direction (3,) of the look."""
        level = np.cos(self.pitch)
        return np.array([level * np.cos(self.yaw), level * np.sin(self.yaw), np.sin(self.pitch)])

    def off(self, target: Array) -> float:
        """Angle (rad) by which a look misses a point (3,)."""
        yaw, pitch = self._towards(target)
        return float(np.hypot(_wrapped(yaw - self.yaw), pitch - self.pitch))

    def stand(
        self, seconds: float, gaze: Gaze, height: float | None = None, most: float | None = None
    ) -> None:
        """Stay; height: of the eyes, most: rad/s that the head turns, None: as usual."""
        for _ in range(max(0, round(seconds * self.fps))):
            self._step(self.place, gaze, height, most)

    def settle(self, gaze: Gaze, height: float, within: float, patience: float) -> bool:
        """Stay until the look has come to rest within so many rad; whether it did in `patience` s."""
        for _ in range(round(patience * self.fps)):
            still = np.hypot(self.turning, self.nodding) < np.radians(12.0)
            if self.off(gaze(self.eye)) < within and abs(self.eye[2] - height) < 0.04 and still:
                return True
            self._step(self.place, gaze, height, None)
        return False

    def lead(self, eyes: Array, targets: Array) -> None:
        """The eyes are led (n, 3) while looking at targets (n, 3)."""
        for eye, target in zip(eyes, targets, strict=True):
            self._look(target, None)
            self.eye = np.asarray(eye, dtype=np.float64).copy()
            self._log()

    def walk(self, way: Array, gaze: Callable[[Array, Array, float], Array], height: float) -> None:
        """Along points (n, 2). gaze: of the eyes, the point some way ahead (2,) and the metres left; height:
        of the eyes at the end."""
        steps = np.linalg.norm(np.diff(way, axis=0), axis=1)
        along = np.concatenate([[0.0], np.cumsum(steps)])
        done, speed, total = 0.0, 0.0, float(along[-1])
        while done < total - 1e-3:
            left = total - done
            at = _point(way, along, done)
            ahead = _point(way, along, min(done + 1.1, total))
            soon = _point(way, along, min(done + 0.25, total))
            heading = np.arctan2(*(soon - at)[::-1]) if left > 0.02 else self.yaw
            facing = max(0.3, float(np.cos(_wrapped(heading - self.yaw))))
            most = min(self.gait.speed * facing, float(np.sqrt(2.0 * _START_STOP * left)) + 0.02)
            change = _START_STOP / self.fps
            speed = float(np.clip(most, speed - 2.0 * change, speed + change))
            done = min(total, done + max(speed, 0.03) / self.fps)
            target = gaze(self.eye, ahead, left)
            self._step(_point(way, along, done), fixed(target), height if left < 0.9 else None, None)

    def _step(self, place: Array, gaze: Gaze, height: float | None, most: float | None) -> None:
        goal = self.gait.stature if height is None else height
        bend = float(np.clip(_BEND_CATCH * (goal - self.eye[2]), -_BEND, _BEND))
        self._look(gaze(self.eye), most)
        self.eye = np.array([place[0], place[1], self.eye[2] + bend / self.fps])
        self._log()

    def _look(self, target: Array, most: float | None) -> None:
        yaw, pitch = self._towards(target)
        wish = min(_CATCH, 0.6 * self.fps) * np.array([_wrapped(yaw - self.yaw), pitch - self.pitch])
        limit = self.gait.turning if most is None else most
        wish *= min(1.0, limit / max(float(np.hypot(*wish)), 1e-9))
        now = np.array([self.turning, self.nodding])
        change, least = wish - now, _TURN_CHANGE * (1.0 if most is None else 3.0) / self.fps
        now = now + change * min(1.0, least / max(float(np.hypot(*change)), 1e-9))
        self.turning, self.nodding = float(now[0]), float(now[1])
        self.yaw += self.turning / self.fps
        self.pitch += self.nodding / self.fps

    def _towards(self, target: Array) -> tuple[float, float]:
        ahead = target - self.eye
        level = float(np.hypot(ahead[0], ahead[1]))
        yaw = float(np.arctan2(ahead[1], ahead[0])) if level > 0.05 else self.yaw
        return yaw, float(np.clip(np.arctan2(ahead[2], level), -_PITCH, _PITCH))

    def _log(self) -> None:
        self.eyes.append(self.eye.copy())
        self.looks.append((self.yaw, self.pitch))


def _point(way: Array, along: Array, at: float) -> Array:
    return np.array([np.interp(at, along, way[:, k]) for k in (0, 1)])


def _wrapped(angle: float) -> float:
    return float((angle + np.pi) % (2.0 * np.pi) - np.pi)
