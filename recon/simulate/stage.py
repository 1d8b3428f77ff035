"""One recording before it is written: who is where in every frame, and what the camera sees."""

from __future__ import annotations

import numpy as np

from recon.simulate.actors import Actor
from recon.simulate.camera_path import camera_path
from recon.simulate.config import Staging
from recon.simulate.hand_path import (
    Arm,
    HandMotion,
    grip_pose,
    hand_motion,
    holding,
    one_after_the_other,
)
from recon.simulate.mjcf import Articulation
from recon.simulate.record import PART_ID, STATIC_LABEL
from recon.simulate.render import Body, Lights
from recon.simulate.room import build_room
from recon.simulate.script import Script, acts_of, load_parts
from recon.simulate.staged import Staged, Wardrobe
from recon.simulate.surfaces import Surface
from recon.simulate.truth import TruthPart
from twin.geometry import Array

# Shadow rays to each light from every second pixel of every second row; chosen by us
_LIGHT_SAMPLES = 1


class Stage(Staged):
    """A script's recording: furniture in its room, the person's camera and hand, and what else goes on."""

    def __init__(self, script: Script, config: Staging):
        self.script = script
        rng = {
            name: np.random.default_rng([config.seed, k])
            for k, name in enumerate(("look", "room", "path", "grip"))
        }
        self.parts = load_parts(script, config, rng["look"])
        self.acts = acts_of(script, self.parts, config, rng["grip"])
        self._states = {a.scene.name: a.states for a in self.acts}
        self.acts = tuple(script.happening.act(a) for a in self.acts)
        still, bounds = self._surroundings(config, rng["room"])
        cameras = camera_path(self.acts, still, bounds, config, rng["path"])
        wardrobe = Wardrobe(config, rng["look"])
        hand = self._hand_motion(config, cameras)
        actors = [Actor.still(Body(still, STATIC_LABEL), len(cameras)), *self._parts_moving()]
        actors += [*wardrobe.actors(hand), *script.happening.actors(self.acts[0], cameras, bounds)]
        lights = room_lights(bounds[0], bounds[1], self.acts[0].scene, cameras[:, :3, 3].mean(axis=0))
        before, after = (round(s * config.fps) for s in script.cut_s)
        window = before, len(cameras) - after
        super().__init__(config, cameras, hand, tuple(actors), still, lights, window)

    def _truth_parts(self) -> tuple[TruthPart, ...]:
        if not self.script.moves_parts:
            return ()
        a, b = self._first, self._last
        out = []
        for k, joint in enumerate(self.script.joints):
            mine = [
                (e, act) for e, act in zip(self.script.episodes, self.acts, strict=True) if e.joint == joint
            ]
            spans = [span for e, act in mine for span in act.line.segments(e.levels)]
            seen = [(max(0, first - a), min(b - a - 1, last - a)) for first, last in spans]
            held = np.any([act.line.in_contact() for e, act in mine if e.reaches], axis=0)
            held = np.broadcast_to(held, len(self.cameras))[a:b]
            moved = tuple(s for s in seen if s[0] < s[1])
            grasp, states = mine[0][1].grasp, self._states[joint][a:b]
            out.append(TruthPart(PART_ID + k, self.parts[k], grasp, states, moved, held))
        return tuple(out)

    def _surroundings(
        self, config: Staging, rng: np.random.Generator
    ) -> tuple[tuple[Surface, ...], tuple[Array, Array]]:
        """All that stands still, and the room's inner corners."""
        first = self.acts[0]
        static = self.parts[0].static
        if not config.room:
            return static, (first.scene.lower - 3.0, first.scene.upper + 3.0)
        room, *corners = build_room(
            first.scene, first.grasp.outward, config.clutter, config.textures, rng, self.parts[1:]
        )
        return (*static, *room), (corners[0], corners[1])

    def _hand_motion(self, config: Staging, cameras: Array) -> HandMotion:
        arm_of = Arm.of(config)
        motions = []
        for act in self.acts:
            held = self.script.happening.leads(act, cameras)
            if held is None:
                T_start = grip_pose(act.grasp, cameras[act.line.grasp, :3, 3], arm_of.sign)
                held = holding(act.scene, act.grasp, T_start, act.states, config.wrist_turn)
            motions.append(hand_motion(held, act.line, cameras, arm_of, act.reaches))
        return one_after_the_other(motions)

    def _parts_moving(self) -> list[Actor]:
        out = []
        for k, part in enumerate(self.parts):
            label = PART_ID + k if self.script.moves_parts else STATIC_LABEL
            poses = np.stack([part.pose(float(s)) for s in self._states[part.name]])
            out.append(Actor.moving(Body(part.part, label), poses))
        return out


def room_lights(low: Array, high: Array, scene: Articulation, eye: Array) -> Lights:
    """Two lamps under the ceiling: a warm one beside the person, a cooler one farther; ambient all over."""
    middle = 0.5 * (scene.lower + scene.upper)
    height = min(float(high[2]) - 0.08, max(float(eye[2]), float(middle[2])) + 1.6)
    away = (eye - middle) * [1.0, 1.0, 0.0]
    side = np.cross([0.0, 0.0, 1.0], away)
    inside_low, inside_high = low + 0.35, high - 0.35
    shapes = []
    for place, size in ((middle + 0.75 * away + 0.6 * side, 0.30), (middle + 0.9 * away - 1.1 * side, 0.22)):
        centre = np.clip(place, inside_low, inside_high)
        centre[2] = height
        shapes.append(np.stack([centre, [size, 0.0, 0.0], [0.0, size, 0.0]]))
    powers = np.array([[3.3, 3.1, 2.7], [1.5, 1.6, 1.8]])
    sky = np.array([0.55, 0.56, 0.58])
    return Lights(np.stack(shapes).astype(np.float32), powers.astype(np.float32), sky.astype(np.float32))
