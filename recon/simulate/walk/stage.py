"""One walk before it is written: the room, the parts on their ways, hands, what else moves."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from recon.simulate.actors import Actor
from recon.simulate.acts import Act
from recon.simulate.config import Staging
from recon.simulate.hand_path import Arm, HandMotion, grip_pose, hand_motion, holding
from recon.simulate.record import PART_ID, STATIC_LABEL
from recon.simulate.render import Body
from recon.simulate.staged import Staged, Wardrobe
from recon.simulate.timeline import Timeline
from recon.simulate.truth import TruthPart
from recon.simulate.walk.journey import Journey, Room, acts_of
from recon.simulate.walk.surroundings import room_lamps
from twin.geometry import Array, make_pose

Rng = np.random.Generator
# Frames, evenly over the walk, by which the recording is exposed
_METERED = 5
# m before a grip at which a hand takes hold of nothing
_BEFORE = 0.09


class WalkStage(Staged):
    """A journey through a room as actors, cameras and truth.

    Args of the constructor:
        journey: what was done.
        cameras: T_world_camera (n, 4, 4).
        config: what it is staged by.
        others: what else moves.
        covered: whether something lies on the lens (n,).
        hands: what the hand does besides: frames in which it comes, and its motions.
        frames: recorded from the first on.
        rng: of what the person wears.
    """

    def __init__(
        self,
        journey: Journey,
        cameras: Array,
        config: Staging,
        others: tuple[Actor, ...],
        covered: NDArray[np.bool_],
        hands: Sequence[tuple[int, HandMotion]],
        frames: int,
        rng: Rng,
    ):
        self.room: Room = journey.room
        self.journey = journey
        total = len(cameras)
        self._levels = states_of(journey, total)
        self.acts = acts_of(journey, self._levels, total)
        still = self.room.still
        wardrobe = Wardrobe(config, rng)
        moved = [(act.line.enter, _motion(act, cameras, config)) for act in self.acts]
        hand = reaching(joined([*moved, *hands], total), cameras)
        actors = [Actor.still(Body(still, STATIC_LABEL), total)]
        for k, part in enumerate(self.room.parts):
            poses = np.stack([part.pose(float(s)) for s in self._levels[part.name]])
            actors.append(Actor.moving(Body(part.part, PART_ID + k), poses))
        actors += [*wardrobe.actors(hand), *others]
        lights = room_lamps(self.room.layout)
        super().__init__(config, cameras, hand, tuple(actors), still, lights, (0, frames), covered)

    @property
    def metered(self) -> tuple[int, ...]:
        """Frames over the whole walk: one corner of a room is darker than another."""
        every = np.linspace(0, self.frames - 1, _METERED).round().astype(int)
        return tuple(int(k) for k in every)

    def _truth_parts(self) -> tuple[TruthPart, ...]:
        out, a, b = [], self._first, self._last
        for k, part in enumerate(self.room.parts):
            mine = [(e, line) for e, line, _ in self.journey.acts if e.joint == part.name]
            every = [s for e, line in mine for s in line.segments(e.levels)]
            spans = tuple((first - a, last - a) for first, last in every if a <= first and last < b)
            held = np.zeros(self._last, dtype=bool)
            for _, line in mine:
                held[line.grasp : line.release + 1] = True
            grasp = self.room.grasps[part.name]
            states = self._levels[part.name][a:b]
            out.append(TruthPart(PART_ID + k, part, grasp, states, spans, held[a:]))
        return tuple(out)


def states_of(journey: Journey, frames: int) -> dict[str, Array]:
    """State (frames,) of each part by name."""
    out: dict[str, Array] = {n: np.full(frames, s) for n, s in journey.plan.start.items()}
    for episode, line, _ in journey.acts:
        moved = _over(line, frames).states(episode.levels)
        out[episode.joint] = out[episode.joint] + moved - moved[0]
    return out


def _over(line: Timeline, frames: int) -> Timeline:
    return Timeline(line.enter, line.grasp, line.turns, line.release, line.gone, frames)


def _motion(act: Act, cameras: Array, config: Staging) -> HandMotion:
    """The hand from frame `enter` to `gone`."""
    line, arm_of = act.line, Arm.of(config)
    window = slice(line.enter, line.gone + 1)
    T_start = grip_pose(act.grasp, cameras[line.grasp, :3, 3], arm_of.sign)
    held = holding(act.scene, act.grasp, T_start, act.states[window], config.wrist_turn)
    return hand_motion(held, line.begun_at(line.enter), cameras[window], arm_of, act.reaches)


def touching(journey: Journey, cameras: Array, config: Staging) -> list[tuple[int, HandMotion]]:
    """Hands that take hold of nothing, some cm before a grip: the frames in which they come, their ways."""
    out = []
    for touch in journey.touches:
        line, arm_of = touch.line, Arm.of(config)
        part, grasp = journey.room.part(touch.joint), journey.room.grasps[touch.joint]
        window = slice(line.enter, line.gone + 1)
        T_start = grip_pose(grasp, cameras[line.grasp, :3, 3], arm_of.sign)
        still = np.full(line.gone + 1 - line.enter, touch.state)
        held = holding(part, grasp, T_start, still, config.wrist_turn) @ make_pose(None, [0.0, -_BEFORE, 0.0])
        out.append((line.enter, hand_motion(held, line.begun_at(line.enter), cameras[window], arm_of)))
    return out


def reaching(hand: HandMotion, cameras: Array) -> HandMotion:
    """The hand where its arm comes from behind the lens. On its way from beside the person it may lie behind
    the shoulder, and the arm, as long as ever, would stand before the eyes."""
    along = np.einsum("ni,ni->n", hand.T_world_arm[:, :3, 1], cameras[:, :3, 2])
    present = np.array(hand.present) & (along < 0)
    return replace(hand, present=tuple(bool(p) for p in present))


def joined(motions: list[tuple[int, HandMotion]], frames: int) -> HandMotion:
    """The hand in all frames, from motions and the frames at which they begin; between two of them it is as
    the one before left it."""
    hands = np.broadcast_to(np.eye(4), (frames, 4, 4)).copy()
    arms, closure, present = hands.copy(), np.zeros(frames), np.zeros(frames, dtype=bool)
    for first, motion in sorted(motions, key=lambda m: m[0]):
        count = min(len(motion.closure), frames - first)
        at = slice(first, first + count)
        hands[at], arms[at] = motion.T_world_hand[:count], motion.T_world_arm[:count]
        closure[at] = motion.closure[:count]
        present[at] = motion.present[:count]
        hands[first + count :], arms[first + count :] = hands[first + count - 1], arms[first + count - 1]
        closure[first + count :] = closure[first + count - 1]
    return HandMotion(hands, arms, closure, tuple(bool(p) for p in present))
