"""A random walk: room, furniture, what is done, the person's path, camera and faults, all from one seed."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from recon.simulate.actors import Actor
from recon.simulate.config import Staging
from recon.simulate.grip import find_grasp
from recon.simulate.hand_path import Arm
from recon.simulate.random.looks import hand_settings, picture_settings
from recon.simulate.random.scene import merged
from recon.simulate.random.strata import WalkStratum
from recon.simulate.record import require_new
from recon.simulate.render import Camera
from recon.simulate.script import among, posed
from recon.simulate.simulator import DepthLag, record
from recon.simulate.walk.cameras import cameras_of
from recon.simulate.walk.carrying import Carried, carry
from recon.simulate.walk.errands import handle, touch
from recon.simulate.walk.events import Wishes, cover_lens, draw_wishes, move_chair
from recon.simulate.walk.journey import Journey, Room, Unfit
from recon.simulate.walk.layout import Layout, draw_layout
from recon.simulate.walk.model import loose_surfaces, room_parts
from recon.simulate.walk.plan import Plan, draw_plan
from recon.simulate.walk.stage import WalkStage, touching
from recon.simulate.walk.surroundings import room_surfaces
from recon.simulate.walk.witness import unfit_walk
from twin.errors import ConfigError, InputError
from twin.files.text import write_json
from twin.geometry import Array
from twin.runs.settings import as_dict, from_dict

Rng = np.random.Generator
# Rooms of one seed, and walks through each, that are drawn at most
MOST_ROOMS, MOST_WALKS = 8, 6
# s that a walk may take
SHORTEST, LONGEST = 10.0, 600.0
# Seconds from which on a walk returns to earlier places, whatever is drawn: a room has no more new ones
_RETURNS = 180.0
# s that a fast turn of the head takes
_TURN_S = 4.0


@dataclass(frozen=True)
class DrawnWalk:
    """A walk to be rendered, its stratum, and why earlier draws of the seed were repeated."""

    stage: WalkStage
    stratum: WalkStratum
    repeated: tuple[str, ...]

    def to_json(self, seed: int) -> dict[str, Any]:
        """What was drawn, JSON types."""
        stage = self.stage
        fps = stage.config.fps
        return {
            "seed": seed,
            "walk": as_dict(self.stratum),
            "repeated": list(self.repeated),
            "furniture": [
                {"name": s.name, "kind": s.piece.kind, "fronts": [c.name for c in s.piece.cells]}
                for s in stage.room.layout.stands
            ],
            "start": dict(stage.journey.plan.start),
            "episodes": [
                as_dict(e)
                | {"frames": [line.enter, line.gone], "seconds": [line.enter / fps, line.gone / fps]}
                for e, line, _ in stage.journey.acts
            ],
            "events": stage.journey.events,
            "settings": as_dict(stage.config),
        }


def simulate_walk(
    seed: int,
    out: Path | str,
    stratum: WalkStratum | None = None,
    seconds: float | None = None,
    settings: Mapping[str, Any] | None = None,
    progress: Callable[[int, int], None] | None = None,
    depth_lag: DepthLag = 0,
) -> Path:
    """Render a walk through a furnished room with its truth; truth/random.json tells what was drawn.

    Args:
        seed: at least 0; equal seeds give equal recordings.
        out: folder of the recording; it must be new or empty.
        stratum: what is wanted on purpose, None: drawn as well.
        seconds: length of the walk, 10 to 600; None: that of the stratum.
        settings: fields of `Staging` that replace what was drawn, as plain data; `frames` ends the recording
            after so many.
        progress: called with (frames done, frames) after each frame.
        depth_lag: see `simulate`.

    Returns `out`, as `simulate`. Raises InputError, ConfigError.
    """
    folder = Path(out)
    require_new(folder)
    drawn = random_walk(seed, stratum, seconds, settings)
    record(drawn.stage, folder, progress, depth_lag)
    write_json(folder / "truth" / "random.json", drawn.to_json(seed))
    return folder


def random_walk(
    seed: int,
    stratum: WalkStratum | None = None,
    seconds: float | None = None,
    settings: Mapping[str, Any] | None = None,
) -> DrawnWalk:
    """All is drawn from the seed; arguments as `simulate_walk`.

    A draw is repeated only where nobody could walk or see so. Raises InputError after MOST_ROOMS rooms.
    """
    wanted = _wanted(seed, stratum, seconds)
    repeated: list[str] = []
    for attempt in range(MOST_ROOMS):
        rng = np.random.default_rng([seed, 21, attempt])
        layout = draw_layout(rng)
        config = _config(rng, wanted, settings or {})
        for _ in range(MOST_WALKS):
            plan = draw_plan(rng, layout, wanted)
            if plan is None:
                repeated.append("no interactions without a collision")
                break
            room = _room(layout, plan, config)
            try:
                stage = _walked(room, plan, config, wanted, rng)
                fault = unfit_walk(stage)
            except Unfit as found:
                fault = str(found)
            if fault is None:
                return DrawnWalk(stage, wanted, tuple(repeated))
            repeated.append(fault)
    raise InputError(
        f"seed {seed}: none of {len(repeated)} draws can be walked ({repeated[-1]})",
        "take another seed, fewer interactions or more seconds",
    )


def _wanted(seed: int, stratum: WalkStratum | None, seconds: float | None) -> WalkStratum:
    if seconds is not None and not SHORTEST <= seconds <= LONGEST:
        raise InputError(f"a walk of {seconds:g} s can't be drawn", f"ask for {SHORTEST:g} to {LONGEST:g} s")
    rng = np.random.default_rng([seed, 20])
    if stratum is None:
        drawn = WalkStratum.drawn(rng, seconds)
        return replace(drawn, loops=drawn.loops or drawn.seconds > _RETURNS)
    return stratum if seconds is None else replace(stratum, seconds=seconds)


def _config(rng: Rng, wanted: WalkStratum, settings: Mapping[str, Any]) -> Staging:
    config = Staging(
        seed=int(rng.integers(2**31)),
        width=wanted.size[0],
        height=wanted.size[1],
        fps=wanted.fps,
        sensor=wanted.sensor,
        clutter=int(rng.integers(4, 15)),
        textures=float(rng.choice([1.0, rng.uniform(0.5, 0.9)])),
        samples=2,
        hfov_deg=float(rng.uniform(64.0, 88.0)),
        sway=float(rng.uniform(0.4, 1.2)),
        **hand_settings(rng),
    )
    config = picture_settings(rng, wanted, config)
    return from_dict(Staging, merged(as_dict(config), settings), "settings")


def _room(layout: Layout, plan: Plan, config: Staging) -> Room:
    """The furnished room, with the parts in the order in which they are first handled."""
    look, around, grip = (np.random.default_rng([config.seed, k]) for k in (0, 1, 3))
    joints = list(dict.fromkeys(e.joint for e in plan.episodes))
    parts = room_parts(layout, joints, config.textures, look)
    surfaces = room_surfaces(layout, config.clutter, config.textures, around)
    shut = dict.fromkeys(joints, 0.0)
    grasps = {}
    for part in parts:
        door = layout.cells[part.name][1].behind
        seen = [p for p in parts if p.name != door]  # what is behind a door is taken when that is open
        grasps[part.name] = find_grasp(among(part, seen, shut), None, grip)
    return Room(layout, parts, grasps, (*parts[0].static, *surfaces))


def _walked(room: Room, plan: Plan, config: Staging, wanted: WalkStratum, rng: Rng) -> WalkStage:
    """The walk through a room. Raises Unfit where nobody could walk so."""
    journey = Journey.begun(room, plan, config, wanted.seconds, wanted.loops, rng)
    wishes = draw_wishes(rng, len(plan.episodes))
    carried = _done(journey, wishes, rng)
    frames, person = journey.frames, journey.person
    recorded = frames if config.frames is None else config.frames
    if recorded > frames:
        raise ConfigError(
            f"simulate.frames = {recorded} is more than the walk's {frames}", "ask for more --seconds"
        )
    eyes, looks = np.stack(person.eyes)[:frames], np.array(person.looks)[:frames]
    cameras = cameras_of(eyes, looks, config, np.random.default_rng([config.seed, 2]))
    hands = touching(journey, cameras, config)
    others = []
    if carried is not None:
        hands.append(carried.hand(cameras, Arm.of(config)))
        others.append(carried.actor(cameras, Arm.of(config).sign))
    covered = cover_lens(journey, hands, frames, rng) if wishes.cover else np.zeros(frames, dtype=bool)
    others += _chair(journey, wishes, cameras, config, rng)
    journey.events.sort(key=lambda e: e["frames"])
    look = np.random.default_rng([config.seed, 4])
    return WalkStage(journey, cameras, config, tuple(others), covered, hands, recorded, look)


def _done(journey: Journey, wishes: Wishes, rng: Rng) -> Carried | None:
    """The person does what was planned, and what happens on the way. Raises Unfit."""
    carried = None
    journey.look_round()
    for k in range(len(journey.plan.episodes)):
        if k in wishes.turns and journey.spare(k) > _TURN_S:
            journey.turn_fast()
        if k in wishes.touches:
            touch(journey, k)
        if k == wishes.carry:
            carried = carry(journey, k, rng)
        handle(journey, k, wishes.pauses.get(k, 0.0))
    journey.finish()
    return carried


def _chair(journey: Journey, wishes: Wishes, cameras: Array, config: Staging, rng: Rng) -> list[Actor]:
    """The chair that may be moved; where nobody moves it, it stands still for good."""
    loose = journey.room.layout.loose
    if loose is None:
        return []
    surfaces = loose_surfaces(loose, config.textures, np.random.default_rng([config.seed, 5]))
    camera = Camera.of(config.width, config.height, config.hfov_deg)
    moved = move_chair(journey, surfaces, cameras, camera, rng) if wishes.chair else None
    if moved is None:
        standing = tuple(posed(s, loose.pose) for s in surfaces)
        journey.room = replace(journey.room, still=(*journey.room.still, *standing))
    return [moved] if moved else []
