"""A walk in time: the person goes from errand to errand, and each frame says where the eyes are."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from recon.simulate.acts import Act
from recon.simulate.config import Staging
from recon.simulate.grip import Grasp
from recon.simulate.mjcf import Articulation
from recon.simulate.script import among
from recon.simulate.surfaces import Surface
from recon.simulate.timeline import Episode, Timeline
from recon.simulate.walk.floor import BODY, Floor, path_length
from recon.simulate.walk.layout import Layout
from recon.simulate.walk.person import Gait, Person, fixed
from recon.simulate.walk.plan import Plan
from recon.simulate.walk.solids import Solids
from recon.simulate.walk.stations import Station
from twin.geometry import Array

Rng = np.random.Generator
# s of rest after the last interaction at least
REST = 0.8
# s that the way to an interaction takes, and the walk of it, as they are reckoned beforehand
_LEG, _WALK = 4.5, 3.0
# s to spare from which the person lingers, and takes a turn about the room
_SPARE, _STROLL = 2.5, 7.0
# Degrees/s of a fast turn of the head, and degrees that it turns by
_FAST_DEG, _OVER_SHOULDER_DEG = (98.0, 120.0), (95.0, 150.0)
# m over the floor that a walking person looks at, m ahead of the feet
_FLOOR_LOOK = 0.95


class Unfit(Exception):
    """Nobody could walk so; the text says why."""


@dataclass(frozen=True)
class Room:
    """A furnished room with the parts that are handled: their grasps by name, and all that stands still."""

    layout: Layout
    parts: tuple[Articulation, ...]
    grasps: Mapping[str, Grasp]
    still: tuple[Surface, ...]

    @property
    def bounds(self) -> tuple[Array, Array]:
        """The inner corners (3,), m."""
        return self.layout.low, self.layout.high

    def part(self, joint: str) -> Articulation:
        """The part of a joint."""
        return next(p for p in self.parts if p.name == joint)


@dataclass(frozen=True)
class Touch:
    """A hand that comes to a part of `joint` at `state` and takes hold of nothing before it."""

    joint: str
    state: float
    line: Timeline


@dataclass
class Journey:
    """What has been done so far. acts: episodes with their lines; touches: of a hand that takes hold of
    nothing; events: what happened besides."""

    room: Room
    plan: Plan
    config: Staging
    seconds: float
    loops: bool
    rng: Rng
    person: Person
    acts: list[tuple[Episode, Timeline, Station]] = field(default_factory=list)
    touches: list[Touch] = field(default_factory=list)
    events: list[dict[str, Any]] = field(default_factory=list)

    @staticmethod
    def begun(room: Room, plan: Plan, config: Staging, seconds: float, loops: bool, rng: Rng) -> Journey:
        """A person who stands where the floor is free. Raises Unfit where it is nowhere."""
        gait = Gait(
            float(rng.uniform(0.54, 0.7)),
            float(np.radians(rng.uniform(40.0, 48.0))),
            float(rng.uniform(1.5, 1.7)),
        )
        spots = floor_of(room, plan.states(0)).spots(0.4)
        if not len(spots):
            raise Unfit("there is no room to stand")
        far = np.min([np.linalg.norm(spots - s.middle[:2], axis=1) for s in room.layout.stands], axis=0)
        best = spots[far >= np.quantile(far, 0.6)]
        place = best[int(rng.integers(len(best)))]
        person = Person(gait, config.fps, np.append(place, gait.stature), 0.0)
        return Journey(room, plan, config, seconds, loops, rng, person)

    @property
    def frames(self) -> int:
        """Frames of the whole walk."""
        return round(self.seconds * self.config.fps)

    @property
    def left(self) -> float:
        """Seconds that are left."""
        return (self.frames - self.person.frame) / self.config.fps

    def look_round(self) -> None:
        """At the start: over all furniture from one side to the other, if there is time."""
        middles = [s.middle for s in self.room.layout.stands if s.piece.cells]
        angles = np.array([np.arctan2(*(m - self.person.eye)[1::-1]) for m in middles])
        order = np.argsort(angles, kind="stable")
        gaps = np.diff(np.append(angles[order], angles[order][0] + 2.0 * np.pi))
        order = np.roll(order, -int(np.argmax(gaps)) - 1)
        if self.rng.random() < 0.5:
            order = order[::-1]
        ahead = middles[int(order[0])] - self.person.eye
        self.person.yaw = float(np.arctan2(ahead[1], ahead[0]))
        self.person.stand(0.6, fixed(middles[int(order[0])]))
        for k in order[1:]:
            if self.spare(0) < 0.0:
                return
            self.glance(middles[int(k)], np.radians(14.0), 0.1)

    def glance(self, target: Array, within: float, seconds: float, most: float | None = None) -> None:
        """Turn to a point (3,) until it is seen within so many rad, and stay so long. most: rad/s, None: as
        usual."""
        for _ in range(round(5.0 * self.config.fps)):
            if self.person.off(target) < within:
                break
            self.person.stand(1.0 / self.config.fps, fixed(target), most=most)
        self.person.stand(seconds, fixed(target), most=most)

    def go(self, way: Array, target: Array, height: float, pause_s: float = 0.0) -> None:
        """Walk along points (n, 2), looking ahead and in time at what is next (3,).

        Args:
            way: points (n, 2), m.
            target: what is next (3,), m.
            height: of the eyes at the end, m.
            pause_s: for which the person stops half-way.
        """
        if pause_s > 0.0:
            half = len(way) // 2
            self.go(way[: half + 1], target, self.person.gait.stature)
            first = self.person.frame
            self.person.stand(pause_s, fixed(self.person.eye + 2.0 * self.person.ahead))
            self.events.append({"kind": "pause", "frames": [first, self.person.frame - 1]})
            way = way[half:]
        person, turned = self.person, [False]

        def gaze(eye: Array, ahead: Array, left: float) -> Array:
            needed = person.off(target) / person.gait.turning + 0.5
            turned[0] |= left < person.gait.speed * needed
            far = ahead + 0.6 * (ahead - eye[:2])
            return target if turned[0] else np.append(far, _FLOOR_LOOK)

        person.walk(way, gaze, height)

    def turn_fast(self) -> None:
        """Look over one shoulder and back, faster than usual."""
        first = self.person.frame
        most = float(np.radians(self.rng.uniform(*_FAST_DEG)))
        angle = float(np.radians(self.rng.uniform(*_OVER_SHOULDER_DEG)) * self.rng.choice([-1.0, 1.0]))
        yaw = self.person.yaw
        for turned in (yaw + angle, yaw):
            ahead = np.array([np.cos(turned), np.sin(turned), -0.25])
            self.glance(self.person.eye + 2.0 * ahead, np.radians(12.0), 0.25, most)
        self.events.append({"kind": "fast_turn", "frames": [first, self.person.frame - 1]})

    def spare(self, index: int) -> float:
        """Seconds that nothing needs of those that are left before interaction `index`, walks reckoned."""
        todo = self.plan.episodes[index:]
        return self.left - sum(sum(e.lengths) + _LEG for e in todo) - REST

    def linger(self, index: int, metres: float, floor: Floor) -> None:
        """Spend time that is to spare before an interaction so many metres away: look about, walk round."""
        spare = self.spare(index) / len(self.plan.episodes[index:])
        spare = float(self.rng.uniform(0.4, 1.0)) * (
            spare - max(0.0, metres / self.person.gait.speed - _WALK)
        )
        if spare < _SPARE:
            return
        until = self.person.frame + round(spare * self.config.fps)
        if self.loops and spare > _STROLL:
            self.stroll(floor, until)
        while self.person.frame < until - round(1.5 * self.config.fps):
            self.look_about()

    def look_about(self) -> None:
        """A look at one of the pieces, not the one behind."""
        stands = self.room.layout.stands
        seen = [s.middle for s in stands if self.person.off(s.middle) < np.radians(100.0)] or [
            stands[0].middle
        ]
        target = seen[int(self.rng.integers(len(seen)))] + self.rng.uniform(-0.3, 0.3, 3)
        self.glance(target, np.radians(10.0), float(self.rng.uniform(0.5, 1.4)))

    def stroll(self, floor: Floor, until: int) -> None:
        """To some free place that can be reached until about that frame, and a look from there."""
        spots = floor.spots(BODY + 0.05)
        seconds = (until - self.person.frame) / self.config.fps
        if len(spots):
            way = floor.way(self.person.place, spots[int(self.rng.integers(len(spots)))])
            if way is not None and 0.5 < path_length(way) < self.person.gait.speed * seconds:
                stands = self.room.layout.stands
                self.go(way, stands[int(self.rng.integers(len(stands)))].middle, self.person.gait.stature)
        self.look_about()

    def finish(self) -> None:
        """Fill what is left after the last interaction."""
        floor = floor_of(self.room, self.plan.states(len(self.plan.episodes)))
        self.person.stand(0.5, fixed(self.room.layout.stands[0].middle))
        if self.loops and self.person.eyes and self.left > 2.0:
            back = floor.way(self.person.place, self.person.eyes[0][:2])
            if back is not None and len(back) > 3:
                self.go(back, self.room.layout.stands[0].middle, self.person.gait.stature)
        while self.person.frame < self.frames:
            if self.loops:
                self.stroll(floor, self.frames)
            self.look_about()


def floor_of(room: Room, states: Mapping[str, float]) -> Floor:
    """The floor with all parts at their states."""
    solids = [s.still for s in room.layout.stands]
    solids += [stand.part(cell, states.get(n, 0.0)) for n, (stand, cell) in room.layout.cells.items()]
    return Floor.of(*room.bounds, Solids.joined([*solids, *room.layout.others]))


def acts_of(journey: Journey, states: Mapping[str, Array], frames: int) -> tuple[Act, ...]:
    """The interactions that were done, over all frames."""
    out = []
    for k, (episode, line, _) in enumerate(journey.acts):
        scene = among(journey.room.part(episode.joint), journey.room.parts, journey.plan.states(k))
        whole = replace(line, frames=frames)
        out.append(
            Act(scene, journey.room.grasps[episode.joint], whole, states[episode.joint], episode.reaches)
        )
    return tuple(out)
