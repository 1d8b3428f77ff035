"""What the person does at a piece of furniture: goes there, looks, takes hold, leads the part, lets go."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from recon.simulate.grip import Grasp
from recon.simulate.hand_path import Arm
from recon.simulate.mjcf import Articulation
from recon.simulate.script import among
from recon.simulate.sight import surroundings
from recon.simulate.surfaces import merged_mesh
from recon.simulate.timeline import Episode, Leg, Timeline
from recon.simulate.walk.floor import Floor, path_length
from recon.simulate.walk.journey import REST, Journey, Touch, Unfit
from recon.simulate.walk.person import fixed
from recon.simulate.walk.plan import others_of
from recon.simulate.walk.solids import Solids
from recon.simulate.walk.stations import Station, Task, find_station, grip_at
from twin.geometry import Array, transform

# rad within which a look has reached what is handled next, and s that it may take
_ARRIVED, _PATIENCE = np.radians(6.0), 5.0
# States between the ends of a leg at which there must be room
_BETWEEN = 4
# s that a hand needs that takes hold of nothing, at most
_TOUCH_S = 8.0


def handle(journey: Journey, index: int, pause_s: float = 0.0) -> None:
    """Interaction `index` of the plan. pause_s: for which the person stops on the way. Raises Unfit."""
    episode = journey.plan.episodes[index]
    task = _task(journey, episode.joint, episode.levels, journey.plan.states(index))
    station = _station(journey, task)
    journey.linger(index, path_length(_way(journey, task, station)), task.floors[0])
    arrive(journey, task, station, pause_s if journey.spare(index) > pause_s else 0.0)
    target = looked_at(task.scene, task.grasp, [episode.start])[0]
    journey.person.stand(episode.wait_s, fixed(target), float(station.eye[2]))
    line = _line(episode, journey.person.frame, journey.config.fps)
    _lead(journey, task, station, line, episode.levels)
    journey.acts.append((episode, line, station))
    if journey.left < REST:
        raise Unfit("there is no time for all that is to be done")


def touch(journey: Journey, index: int) -> None:
    """Before interaction `index`, a hand that takes hold of nothing, where there are time and place."""
    states = journey.plan.states(index)
    joint = str(journey.rng.choice(journey.plan.joints))
    task = _task(journey, joint, [states[joint]], states)
    found = None if journey.spare(index) < _TOUCH_S else station_for(journey, task)
    if found is None:
        return
    arrive(journey, task, found)
    times = journey.rng.uniform([0.7, 0.2, 0.5], [1.0, 0.6, 0.8])
    episode = Episode(
        joint,
        states[joint],
        (Leg(states[joint], float(times[1])),),
        0.0,
        float(times[0]),
        0.15,
        float(times[2]),
    )
    line = _line(episode, journey.person.frame, journey.config.fps)
    _lead(journey, task, found, line, episode.levels)
    journey.touches.append(Touch(joint, states[joint], line))
    journey.events.append({"kind": "empty_hand", "frames": [line.enter, line.gone - 1], "before": joint})


def arrive(journey: Journey, task: Task, station: Station, pause_s: float = 0.0) -> None:
    """Go to a station and come to rest with the eyes on the task. Raises Unfit."""
    person, height = journey.person, float(station.eye[2])
    target = looked_at(task.scene, task.grasp, task.levels[:1])[0]
    journey.go(_way(journey, task, station), target, height, pause_s)
    if not person.settle(fixed(target), height, _ARRIVED, _PATIENCE):
        raise Unfit("the head does not come to rest")


def _task(journey: Journey, joint: str, ends: Sequence[float], states: Mapping[str, float]) -> Task:
    """A part that goes through `ends` while the others are at `states`."""
    room = journey.room
    stand, cell = room.layout.cells[joint]
    between = [np.linspace(a, b, _BETWEEN)[1:] for a, b in pairwise(ends) if a != b]
    levels = np.concatenate([np.array(ends[:1]), *between])
    others = others_of(room.layout, joint, states)
    floors = [Floor.of(*room.bounds, Solids.joined([others, stand.part(cell, float(s))])) for s in levels]
    scene = among(room.part(joint), room.parts, states)
    return Task(scene, room.grasps[joint], stand.outward, levels, floors)


def _station(journey: Journey, task: Task) -> Station:
    """Where to stand for a task. Raises Unfit."""
    found = station_for(journey, task)
    if found is None:
        raise Unfit("there is no place to stand at a part")
    return found


def station_for(journey: Journey, task: Task) -> Station | None:
    """The same; None where there is none, or no way to it."""
    room = journey.room
    around = surroundings(task.scene, task.levels, [*task.scene.static, *room.still], room.bounds)
    arm = Arm.of(replace(journey.config, hand_from_deg=None))  # hangs on its own side, wherever it comes from
    found = find_station(task, around, journey.person.gait.stature, arm, journey.rng)
    there = found is not None and task.floors[0].way(journey.person.place, found.eye[:2]) is not None
    return found if there else None


def _way(journey: Journey, task: Task, station: Station) -> Array:
    way = task.floors[0].way(journey.person.place, station.eye[:2])
    if way is None:
        raise Unfit("there is no way to the furniture")
    return way


def _lead(journey: Journey, task: Task, station: Station, line: Timeline, ends: Sequence[float]) -> None:
    """The eyes from the hand's first frame to its last one."""
    levels = replace(line, frames=line.gone).states(ends)[line.enter :]
    grips = grip_at(task.scene, task.grasp, levels)
    offset = journey.person.eye - station.eye
    journey.person.lead(station.eyes(grips - grips[0]) + offset, looked_at(task.scene, task.grasp, levels))


def _line(episode: Episode, frame: int, fps: float) -> Timeline:
    """The phases of an episode whose hand comes into view in `frame`; its length is that of the episode."""
    seconds = np.cumsum(episode.lengths[1:])
    marks = np.round(seconds * fps).astype(int)
    marks = frame + np.maximum(marks, np.arange(1, len(marks) + 1))
    m = [frame, *(int(v) for v in marks)]
    return Timeline(m[0], m[1], tuple(m[2:-2]), m[-2], m[-1], m[-1])


def looked_at(scene: Articulation, grasp: Grasp, levels: Sequence[float] | Array) -> Array:
    """What is looked at (n, 3) while a part is handled: between the grip and the middle of the part."""
    bounds = merged_mesh(list(scene.part)).bounds
    ends = np.stack([grasp.point, 0.5 * np.asarray(bounds[0] + bounds[1])])
    held = np.stack([transform(scene.pose(float(s)), ends) for s in levels])
    return np.asarray(0.6 * held[:, 0] + 0.4 * held[:, 1])
