"""One recording before it is written: who is where in every frame, and what the camera sees."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cached_property

import numpy as np

from recon.simulate.actors import Actor
from recon.simulate.camera_path import camera_path
from recon.simulate.config import Staging
from recon.simulate.hand import arm, hand_shape, skeleton
from recon.simulate.hand_path import (
    Arm,
    HandMotion,
    grip_pose,
    hand_motion,
    holding,
    one_after_the_other,
    shoulder_place,
)
from recon.simulate.mjcf import Articulation
from recon.simulate.record import HAND_LABEL, OTHER_LABEL, PART_ID, STATIC_LABEL
from recon.simulate.render import Body, Camera, Lights, Renderer, View
from recon.simulate.room import build_room
from recon.simulate.script import Script, acts_of, load_parts
from recon.simulate.shutter import Flow, image_motion, poses_around
from recon.simulate.surfaces import Surface
from recon.simulate.textures import make_material, skin_material
from recon.simulate.truth import FIRST_TIME, Truth, TruthPart
from twin.geometry import Array, transform

# Shadow rays to each light from every second pixel of every second row; chosen by us
_LIGHT_SAMPLES = 1


class Stage:
    """One recording before it is written: geometry, paths and renderer. Equal inputs give equal frames."""

    def __init__(self, script: Script, config: Staging):
        self.config, self.script = config, script
        rng = {
            name: np.random.default_rng([config.seed, k])
            for k, name in enumerate(("look", "room", "path", "grip"))
        }
        self.parts = load_parts(script, config, rng["look"])
        self.acts = acts_of(script, self.parts, config, rng["grip"])
        self._states = {a.scene.name: a.states for a in self.acts}
        self.acts = tuple(script.happening.act(a) for a in self.acts)
        self.still, bounds = self._surroundings(rng["room"])
        self.cameras = camera_path(self.acts, self.still, bounds, config, rng["path"])
        self._skin = skin_material(config.skin_tone, config.textures, rng["look"])
        cloth = make_material("fabric", config.textures, rng["look"])
        self._glove = cloth if config.hand_cover == "glove" else self._skin
        self._shapes: dict[float, Body] = {}
        self.hand = self._hand_motion()
        arm_body = Body(arm(self._glove, cloth, config.hand_cover == "bare"), HAND_LABEL)
        self.actors = self._actors(arm_body, bounds)
        self.camera = Camera.of(config.width, config.height, config.hfov_deg)
        lights = room_lights(bounds[0], bounds[1], self.acts[0].scene, self.cameras[:, :3, 3].mean(axis=0))
        self._renderer = Renderer(self.camera, lights, config.samples, _LIGHT_SAMPLES, config.ambient_samples)
        self._first, self._last = self._window()

    @property
    def frames(self) -> int:
        """Number of frames that are recorded."""
        return self._last - self._first

    @property
    def shows_others(self) -> bool:
        """Whether something moves that is no part."""
        return any(a.body(0).label == OTHER_LABEL for a in self.actors)

    def shoulder_distance(self, k: int) -> float:
        """Distance in metres of the hand from the shoulder of its side in frame `k` of the whole script."""
        shoulder = shoulder_place(self.cameras[k], self._hanging)
        return float(np.linalg.norm(self.hand.T_world_hand[k, :3, 3] - shoulder))

    @cached_property
    def _hanging(self) -> Arm:
        """The arm on its own side, wherever the hand comes from."""
        return Arm.of(replace(self.config, hand_from_deg=None))

    def render(self, index: int) -> View:
        """Exact rendering of frame `index`."""
        return self.prepared(index)()

    def prepared(self, index: int) -> Callable[[], View]:
        """The same for later: the result renders in any thread, beside other frames; this, one thread."""
        k = index + self._first
        there = [a for a in self.actors if a.present[k]]
        rng = np.random.default_rng([self.config.seed, 6, index])
        bodies, poses = [a.body(k) for a in there], [a.T_world_body[k] for a in there]
        return self._renderer.prepared(bodies, poses, self.cameras[k], rng)

    def flow(self, index: int, view: View) -> Flow:
        """How the pixels of the rendering of frame `index` move."""
        k = index + self._first
        there = [a for a in self.actors if a.present[k]]
        bodies = [poses_around(a.T_world_body, k, a.present.tolist()) for a in there]
        return image_motion(view.depth, view.body, self.camera, poses_around(self.cameras, k), bodies)

    def view_directions(self, index: int) -> Array:
        """Unit viewing directions (H, W, 3) in the world."""
        return self._directions @ self.cameras[index + self._first, :3, :3].T

    @cached_property
    def _directions(self) -> Array:
        """The same in the camera."""
        camera = self.camera
        v, u = np.mgrid[0 : camera.height, 0 : camera.width]
        cx, cy = camera.centre
        local = np.stack([(u - cx) / camera.focal, (v - cy) / camera.focal, np.ones(u.shape)], axis=-1)
        return local / np.linalg.norm(local, axis=-1, keepdims=True)

    def truth(self) -> Truth:
        """All that is known about the recording."""
        a, b = self._first, self._last
        left = self.config.hand_side == "left"
        local = [skeleton(float(c), left) for c in self.hand.closure[a:b]]
        keypoints = [transform(T, p) for T, p in zip(self.hand.T_world_hand[a:b], local, strict=True)]
        hand = self.hand.during(a, b)
        times = FIRST_TIME + np.arange(b - a) / self.config.fps
        side = self.config.hand_side
        return Truth(
            self._truth_parts(), self.still, times, self.cameras[a:b], hand, np.stack(keypoints), side
        )

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

    def _window(self) -> tuple[int, int]:
        """First frame that is recorded, and the one after the last."""
        before, after = (round(s * self.config.fps) for s in self.script.cut_s)
        return before, len(self.cameras) - after

    def _surroundings(self, rng: np.random.Generator) -> tuple[tuple[Surface, ...], tuple[Array, Array]]:
        """All that stands still, and the room's inner corners."""
        first, config = self.acts[0], self.config
        static = self.parts[0].static
        if not config.room:
            return static, (first.scene.lower - 3.0, first.scene.upper + 3.0)
        room, *corners = build_room(
            first.scene, first.grasp.outward, config.clutter, config.textures, rng, self.parts[1:]
        )
        return (*static, *room), (corners[0], corners[1])

    def _hand_motion(self) -> HandMotion:
        config, arm_of = self.config, Arm.of(self.config)
        motions = []
        for act in self.acts:
            held = self.script.happening.leads(act, self.cameras)
            if held is None:
                T_start = grip_pose(act.grasp, self.cameras[act.line.grasp, :3, 3], arm_of.sign)
                held = holding(act.scene, act.grasp, T_start, act.states, config.wrist_turn)
            motions.append(hand_motion(held, act.line, self.cameras, arm_of, act.reaches))
        return one_after_the_other(motions)

    def _actors(self, arm_body: Body, bounds: tuple[Array, Array]) -> tuple[Actor, ...]:
        frames, present = len(self.cameras), np.array(self.hand.present)
        out = [Actor.still(Body(self.still, STATIC_LABEL), frames)]
        for k, part in enumerate(self.parts):
            label = PART_ID + k if self.script.moves_parts else STATIC_LABEL
            poses = np.stack([part.pose(float(s)) for s in self._states[part.name]])
            out.append(Actor.moving(Body(part.part, label), poses))
        out.append(Actor(lambda i: self._hand(i), self.hand.T_world_hand, present))
        out.append(Actor(lambda _: arm_body, self.hand.T_world_arm, present))
        out += self.script.happening.actors(self.acts[0], self.cameras, bounds)
        return tuple(out)

    def _hand(self, index: int) -> Body:
        closure = float(self.hand.closure[index])
        if closure not in self._shapes:
            shape = hand_shape(closure, self._glove, left=self.config.hand_side == "left")
            self._shapes[closure] = Body((shape.surface,), HAND_LABEL)
        return self._shapes[closure]


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
