"""A walk in time: the person goes from errand to errand, and each frame says where the eyes are."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from recon.simulate.acts import Act
from recon.simulate.config import Staging
from recon.simulate.grip import Grasp
from recon.simulate.hand_path import Arm
from recon.simulate.mjcf import Articulation
from recon.simulate.script import among
from recon.simulate.sight import surroundings
from recon.simulate.surfaces import Surface, merged_mesh
from recon.simulate.timeline import Episode, Timeline
from recon.simulate.walk.floor import BODY, Floor, path_length
from recon.simulate.walk.layout import Layout
from recon.simulate.walk.plan import Plan, others_of
from recon.simulate.walk.solids import Solids
from recon.simulate.walk.stations import Station, Task, find_station, grip_at
from recon.simulate.walk.walker import Gait, Walker, fixed
from twin.geometry import Array, transform

Rng = np.random.Generator
# rad within which a look has reached what is handled next, and s that it may take
_ARRIVED, _PATIENCE = np.radians(6.0), 5.0
# s of rest after the last interaction at least, and s over what is needed from which the person lingers
_REST, _SPARE = 0.8, 2.5
# m over the floor that a walking person looks at, m ahead of the feet
_FLOOR_LOOK = 0.95
# States between the ends of a leg at which there must be room
_BETWEEN = 4


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


@dataclass
class Journey:
    """What has been done so far. acts: episodes with their lines; events: what happened besides."""

    room: Room
    plan: Plan
    config: Staging
    seconds: float
    loops: bool
    rng: Rng
    walker: Walker
    acts: list[tuple[Episode, Timeline, Station]] = field(default_factory=list)
    events: list[dict[str, object]] = field(default_factory=list)

    @staticmethod
    def begun(room: Room, plan: Plan, config: Staging, seconds: float, loops: bool, rng: Rng) -> Journey:
        """A person who stands where the floor is free. Raises Unfit where it is nowhere."""
        gait = Gait(
            float(rng.uniform(0.54, 0.7)),
            float(np.radians(rng.uniform(40.0, 48.0))),
            float(rng.uniform(1.5, 1.7)),
        )
        spots = _floor(room, plan.states(0)).spots(0.4)
        if not len(spots):
            raise Unfit("there is no room to stand")
        far = np.min([np.linalg.norm(spots - s.middle[:2], axis=1) for s in room.layout.stands], axis=0)
        best = spots[far >= np.quantile(far, 0.6)]
        place = best[int(rng.integers(len(best)))]
        walker = Walker(gait, config.fps, np.append(place, gait.stature), 0.0)
        return Journey(room, plan, config, seconds, loops, rng, walker)

    @property
    def frames(self) -> int:
        """Frames of the whole walk."""
        return round(self.seconds * self.config.fps)

    @property
    def left(self) -> float:
        """Seconds that are left."""
        return (self.frames - self.walker.frame) / self.config.fps

    def look_round(self) -> None:
        """At the start: over all furniture from one side to the other."""
        middles = [s.middle for s in self.room.layout.stands if s.piece.cells]
        angles = np.array([np.arctan2(*(m - self.walker.eye)[1::-1]) for m in middles])
        order = np.argsort(angles, kind="stable")
        gaps = np.diff(np.append(angles[order], angles[order][0] + 2.0 * np.pi))
        order = np.roll(order, -int(np.argmax(gaps)) - 1)
        if self.rng.random() < 0.5:
            order = order[::-1]
        ahead = middles[int(order[0])] - self.walker.eye
        self.walker.yaw = float(np.arctan2(ahead[1], ahead[0]))
        self.walker.stand(0.6, fixed(middles[int(order[0])]))
        for k in order[1:]:
            self.glance(middles[int(k)], np.radians(14.0), 0.1)

    def glance(self, target: Array, within: float, seconds: float) -> None:
        """Turn to a point (3,) until it is seen within so many rad, and stay so long."""
        for _ in range(round(5.0 * self.config.fps)):
            if self.walker.off(target) < within:
                break
            self.walker.stand(1.0 / self.config.fps, fixed(target))
        self.walker.stand(seconds, fixed(target))

    def handle(self, index: int) -> None:
        """Interaction `index` of the plan: go there, look, take hold, lead, let go."""
        episode = self.plan.episodes[index]
        states = self.plan.states(index)
        scene = among(self.room.part(episode.joint), self.room.parts, states)
        grasp = self.room.grasps[episode.joint]
        station, floor = self._station(episode, scene, grasp, states)
        way = floor.way(self.walker.place, station.eye[:2])
        if way is None:
            raise Unfit("there is no way to the furniture")
        self._linger(index, path_length(way), floor, station)
        way = floor.way(self.walker.place, station.eye[:2])
        if way is None:
            raise Unfit("there is no way to the furniture")
        middle = _middle(scene)
        target = _looked_at(scene, grasp, middle, np.array([episode.start]))[0]
        self.go(way, target, station.eye[2])
        if not self.walker.settle(fixed(target), float(station.eye[2]), _ARRIVED, _PATIENCE):
            raise Unfit("the head does not come to rest")
        self.walker.stand(episode.wait_s, fixed(target), float(station.eye[2]))
        line = _line(episode, self.walker.frame, self.config.fps)
        levels = replace(line, frames=line.gone).states(episode.levels)[line.enter :]
        grips = grip_at(scene, grasp, levels)
        offset = self.walker.eye - station.eye
        self.walker.lead(station.eyes(grips - grips[0]) + offset, _looked_at(scene, grasp, middle, levels))
        self.acts.append((episode, line, station))
        if self.left < _REST:
            raise Unfit("there is no time for all that is to be done")

    def go(self, way: Array, target: Array, height: float) -> None:
        """Walk along points (n, 2), looking ahead and in time at what is next (3,); height: of the eyes there."""
        walker, turned = self.walker, [False]

        def gaze(eye: Array, ahead: Array, left: float) -> Array:
            needed = walker.off(target) / walker.gait.turning + 0.5
            turned[0] |= left < walker.gait.speed * needed
            far = ahead + 0.6 * (ahead - eye[:2])
            return target if turned[0] else np.append(far, _FLOOR_LOOK)

        walker.walk(way, gaze, height)

    def _station(
        self, episode: Episode, scene: Articulation, grasp: Grasp, states: Mapping[str, float]
    ) -> tuple[Station, Floor]:
        """Where to stand for an episode, and the floor before it."""
        room = self.room
        stand, cell = room.layout.cells[episode.joint]
        ends = list(episode.levels)
        levels = np.concatenate(
            [
                ends[:1],
                *(np.linspace(a, b, _BETWEEN)[1:] for a, b in zip(ends, ends[1:], strict=False) if a != b),
            ]
        )
        others = others_of(room.layout, episode.joint, states)
        floors = [Floor.of(*room.bounds, Solids.joined([others, stand.part(cell, float(s))])) for s in levels]
        task = Task(scene, grasp, stand.outward, levels, floors)
        around = surroundings(scene, levels, [*scene.static, *self.room.still], room.bounds)
        found = find_station(task, around, self.walker.gait.stature, Arm.of(self._hanging), self.rng)
        if found is None:
            raise Unfit("there is no place to stand at a part")
        return found, floors[0]

    @property
    def _hanging(self) -> Staging:
        """The arm on its own side, wherever the hand comes from."""
        return replace(self.config, hand_from_deg=None)

    def _linger(self, index: int, metres: float, floor: Floor, station: Station) -> None:
        """Spend what time there is to spare before an interaction: look at things, walk round."""
        todo = self.plan.episodes[index:]
        busy = sum(sum(e.lengths) for e in todo) + 4.5 * len(todo) + _REST
        spare = (self.left - busy) / len(todo)
        need = metres / self.walker.gait.speed - 3.0
        spare = float(self.rng.uniform(0.4, 1.0)) * (spare - max(0.0, need))
        if spare < _SPARE:
            return
        until = self.walker.frame + round(spare * self.config.fps)
        if self.loops and spare > 7.0:
            self.stroll(floor, until, np.asarray(station.eye[:2]))
        while self.walker.frame < until - round(1.5 * self.config.fps):
            self.look_about()

    def look_about(self) -> None:
        """A look at one of the pieces, not the one behind."""
        stands = self.room.layout.stands
        seen = [s.middle for s in stands if self.walker.off(s.middle) < np.radians(100.0)] or [
            stands[0].middle
        ]
        target = seen[int(self.rng.integers(len(seen)))] + self.rng.uniform(-0.3, 0.3, 3)
        self.glance(target, np.radians(10.0), float(self.rng.uniform(0.5, 1.4)))

    def stroll(self, floor: Floor, until: int, goal: Array | None = None) -> None:
        """To some free place and a look from there, again until about that frame. goal: (2,) to which there must
        be a way afterwards in time."""
        spots = floor.spots(BODY + 0.05)
        while len(spots) and self.walker.frame < until:
            place = spots[int(self.rng.integers(len(spots)))]
            way = floor.way(self.walker.place, place)
            seconds = (until - self.walker.frame) / self.config.fps
            if way is not None and 0.5 < path_length(way) < self.walker.gait.speed * seconds:
                stands = self.room.layout.stands
                self.go(way, stands[int(self.rng.integers(len(stands)))].middle, self.walker.gait.stature)
            self.look_about()
            if goal is not None:
                return

    def finish(self) -> None:
        """Fill what is left after the last interaction."""
        floor = _floor(self.room, self.plan.states(len(self.plan.episodes)))
        self.walker.stand(0.5, fixed(self.room.layout.stands[0].middle))
        if self.loops and self.walker.eyes and self.left > 2.0:
            back = floor.way(self.walker.place, self.walker.eyes[0][:2])
            if back is not None and len(back) > 3:
                self.go(back, self.room.layout.stands[0].middle, self.walker.gait.stature)
        while self.walker.frame < self.frames:
            if self.loops:
                self.stroll(floor, self.frames)
            self.look_about()


def _floor(room: Room, states: Mapping[str, float]) -> Floor:
    """The floor with all parts at their states."""
    solids = [s.still for s in room.layout.stands]
    solids += [stand.part(cell, states.get(n, 0.0)) for n, (stand, cell) in room.layout.cells.items()]
    return Floor.of(*room.bounds, Solids.joined([*solids, *room.layout.others]))


def _line(episode: Episode, frame: int, fps: float) -> Timeline:
    """The phases of an episode whose hand comes into view in `frame`; its length is that of the episode."""
    seconds = np.cumsum(episode.lengths[1:])
    marks = np.round(seconds * fps).astype(int)
    marks = frame + np.maximum(marks, np.arange(1, len(marks) + 1))
    m = [frame, *(int(v) for v in marks)]
    return Timeline(m[0], m[1], tuple(m[2:-2]), m[-2], m[-1], m[-1])


def _middle(scene: Articulation) -> Array:
    bounds = merged_mesh(list(scene.part)).bounds
    return 0.5 * np.asarray(bounds[0] + bounds[1])


def _looked_at(scene: Articulation, grasp: Grasp, middle: Array, levels: Sequence[float] | Array) -> Array:
    """What is looked at (n, 3) while a part is handled: between the grip and the middle of the part."""
    ends = np.stack([grasp.point, middle])
    held = np.stack([transform(scene.pose(float(s)), ends) for s in levels])
    return np.asarray(0.6 * held[:, 0] + 0.4 * held[:, 1])


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
