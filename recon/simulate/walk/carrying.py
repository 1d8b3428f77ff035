"""A thing that is carried by hand from one piece of furniture to another."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from recon.simulate.actors import Actor
from recon.simulate.grip import Grasp
from recon.simulate.hand_path import Arm, HandMotion, grip_pose, hand_motion
from recon.simulate.mjcf import Articulation
from recon.simulate.random.happenings import carried_thing
from recon.simulate.record import OTHER_LABEL
from recon.simulate.render import Body
from recon.simulate.surfaces import Surface
from recon.simulate.timeline import Timeline, minimum_jerk
from recon.simulate.walk.errands import arrive, looked_at, station_for
from recon.simulate.walk.floor import Floor, path_length
from recon.simulate.walk.journey import Journey, floor_of
from recon.simulate.walk.layout import Stand
from recon.simulate.walk.person import fixed
from recon.simulate.walk.stations import Station, Task
from twin.geometry import Array, exp_so3, make_pose, transform

Rng = np.random.Generator
UP = np.array([0.0, 0.0, 1.0])
# m ahead of the eyes, to the hand's side, and below them, where a thing is carried; in view at the lower rim
_AHEAD, _ASIDE, _BELOW = 0.44, 0.08, 0.30
# s of reaching, holding, lifting up, putting down, and leaving
_REACH, _HOLD, _LIFT, _PUT, _LEAVE = 0.9, 0.2, 1.1, 1.2, 0.7
# s that all of it takes at most, without the way
_TAKES = 14.0
# m from a top's rim to the thing, m by which it is lifted where it stands
_RIM, _LIFTED = 0.13, 0.10
# Places that are tried for each end of the way
_TRIES = 6


@dataclass(frozen=True)
class Carried:
    """A thing that is carried.

    Attributes:
        surfaces: about the point that it stands on.
        grasp: where the hand holds it, at the first place.
        places: where it stands before and after (3,), m.
        line: the hand's phases.
        lifted: first and last frame in which it is lifted.
        put: first and last frame in which it is put down.
    """

    surfaces: tuple[Surface, ...]
    grasp: Grasp
    places: tuple[Array, Array]
    line: Timeline
    lifted: tuple[int, int]
    put: tuple[int, int]

    def poses(self, cameras: Array, sign: float) -> Array:
        """T_world_thing (frames, 4, 4) on its way; `sign`: 1 for the right hand, -1 for the left one."""
        ahead = cameras[:, :2, 2]
        yaw = np.unwrap(np.arctan2(ahead[:, 1], ahead[:, 0]))
        level = np.stack([np.cos(yaw), np.sin(yaw), np.zeros(len(yaw))], axis=1)
        right = np.stack([np.sin(yaw), -np.cos(yaw), np.zeros(len(yaw))], axis=1)
        held = cameras[:, :3, 3] + _AHEAD * level + sign * _ASIDE * right - _BELOW * UP
        held = held - (self.grasp.point - self.places[0])
        k = np.arange(len(cameras))
        up = minimum_jerk((k - self.lifted[0]) / (self.lifted[1] - self.lifted[0]))[:, None]
        down = minimum_jerk((k - self.put[0]) / (self.put[1] - self.put[0]))[:, None]
        path = (1.0 - up) * self.places[0] + up * ((1.0 - down) * held + down * self.places[1])
        path = path + 0.06 * (np.sin(np.pi * up) + np.sin(np.pi * down)) * UP
        turned = (yaw - yaw[self.lifted[0]]) * up[:, 0]
        turned[self.put[0] :] = turned[self.put[0]]
        turned[: self.lifted[0]] = 0.0
        return np.stack([make_pose(exp_so3(a * UP), p) for a, p in zip(turned, path, strict=True)])

    def actor(self, cameras: Array, sign: float) -> Actor:
        """The thing, at rest before and after."""
        return Actor.moving(Body(self.surfaces, OTHER_LABEL), self.poses(cameras, sign))

    def hand(self, cameras: Array, arm: Arm) -> tuple[int, HandMotion]:
        """The frame in which the hand comes, and its motion from there on."""
        first, line = self.line.enter, self.line
        window = slice(first, line.gone + 1)
        local = line.begun_at(first)
        poses = self.poses(cameras, arm.sign)
        start = grip_pose(self.grasp, cameras[line.grasp, :3, 3], arm.sign)
        held = poses[window] @ np.linalg.inv(poses[0]) @ start
        return first, hand_motion(held, local, cameras[window], arm)


def carry(journey: Journey, index: int, rng: Rng) -> Carried | None:
    """Before interaction `index`, a thing is taken from one top to another, if there is time."""
    tops = [s for s in journey.room.layout.stands if s.piece.tops]
    floor = floor_of(journey.room, journey.plan.states(index))
    if len(tops) < 2 or journey.spare(index) < _TAKES:
        return None
    one, other = (tops[int(k)] for k in rng.permutation(len(tops))[:2])
    taken = _end(journey, one, floor, rng, (0.0, _LIFTED), None)
    if taken is None:
        return None
    first, start, surfaces = taken
    person = journey.person
    at = person.place
    person.eye[:2] = start.eye[:2]  # the way from there
    given = _end(journey, other, floor, rng, (_LIFTED, 0.0), first)
    person.eye[:2] = at
    if given is None:
        return None
    last, goal, _ = given
    way = floor.way(start.eye[:2], goal.eye[:2])
    if way is None or path_length(way) / person.gait.speed + _TAKES > journey.spare(index) + 3.0:
        return None
    return _carried(journey, (first, start), (last, goal), surfaces)


def _carried(
    journey: Journey, start: tuple[Task, Station], goal: tuple[Task, Station], surfaces: tuple[Surface, ...]
) -> Carried:
    """Do it."""
    person = journey.person
    place, end = (t.scene.pivot for t, _ in (start, goal))
    arrive(journey, *start)
    target = looked_at(start[0].scene, start[0].grasp, [0.0])[0]
    enter = person.frame
    person.stand(_REACH, fixed(target), float(start[1].eye[2]))
    grasp = person.frame
    person.stand(_HOLD, fixed(target), float(start[1].eye[2]))
    lift = person.frame
    person.stand(_LIFT, fixed(target), float(start[1].eye[2]))
    lifted = person.frame
    arrive(journey, *goal)
    target = looked_at(goal[0].scene, goal[0].grasp, [0.0])[0]
    down = person.frame
    person.stand(_PUT, fixed(target), float(goal[1].eye[2]))
    stands = person.frame
    person.stand(_HOLD, fixed(target), float(goal[1].eye[2]))
    release = person.frame
    person.stand(_LEAVE, fixed(target), float(goal[1].eye[2]))
    line = Timeline(enter, grasp, (lift, stands), release, person.frame, person.frame)
    local = tuple(replace(s, vertices=s.vertices - place) for s in surfaces)
    journey.events.append(
        {"kind": "carried", "frames": [lift, stands], "from": place.tolist(), "to": end.tolist()}
    )
    return Carried(local, start[0].grasp, (place, end), line, (lift, lifted), (down, stands))


def _end(
    journey: Journey, stand: Stand, floor: Floor, rng: Rng, levels: tuple[float, float], former: Task | None
) -> tuple[Task, Station, tuple[Surface, ...]] | None:
    """A place on a top near its rim, and where to stand before it; the thing is that of the `former` task."""
    top = stand.piece.tops[0]
    half = 0.5 * top.size
    for _ in range(_TRIES):
        turns = int(rng.integers(4)) if not stand.piece.cells else 0
        local = np.array([rng.uniform(-0.7, 0.7) * half[0], _RIM - half[1], half[2]])
        if turns in (1, 3):
            local[:2] = [half[0] - _RIM, rng.uniform(-0.7, 0.7) * half[1]]
        local[:2] *= -1.0 if turns > 1 else 1.0
        facing_local = [[0.0, -1.0], [1.0, 0.0], [0.0, 1.0], [-1.0, 0.0]][turns]
        place = transform(stand.pose, (top.T_world_box[:3, 3] + local)[None])[0]
        facing = stand.pose[:3, :3] @ np.array([*facing_local, 0.0])
        task, surfaces = _task(journey, place, facing, floor, rng, levels, former)
        corners = np.concatenate([s.vertices for s in surfaces])
        low, high = corners.min(axis=0), corners.max(axis=0)
        if any(_meets(low, high, s) for s in journey.room.still):
            continue
        station = station_for(journey, task)
        if station is not None:
            return task, station, surfaces
    return None


def _task(
    journey: Journey,
    place: Array,
    facing: Array,
    floor: Floor,
    rng: Rng,
    levels: tuple[float, float],
    former: Task | None,
) -> tuple[Task, tuple[Surface, ...]]:
    """The thing at `place` (3,), lifted through `levels` m by who stands on the side `facing` (3,)."""
    if former is None:
        made, handle = carried_thing(rng, facing)
        surfaces = tuple(replace(s, vertices=s.vertices + place) for s in made)
        grasp = Grasp(place + handle, UP, facing, 0.014, "handle")
    else:
        moved = place - former.scene.pivot
        surfaces = tuple(replace(s, vertices=s.vertices + moved) for s in former.scene.part)
        grasp = replace(former.grasp, point=former.grasp.point + moved, outward=facing)
    base = journey.room.parts[0]
    scene = Articulation(
        "carried", "prismatic", UP, place, 0.3, base.static, surfaces, 0.4, place, np.zeros(6), base.lower,
        base.upper, True, {},
    )  # fmt: skip
    return Task(scene, grasp, facing, np.array(levels), (floor, floor)), surfaces


def _meets(low: Array, high: Array, surface: Surface) -> bool:
    """Whether a thing would stand in what stands there already, the board below it not counted."""
    a, b = surface.vertices.min(axis=0), surface.vertices.max(axis=0)
    return bool(np.all(np.minimum(high, b) - np.maximum(low, a) > 2e-3))
