"""What is rendered and written: actors, camera poses and a renderer, whoever staged them."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from copy import copy
from dataclasses import replace
from functools import cached_property
from typing import Self

import numpy as np
from numpy.typing import NDArray

from recon.simulate.actors import Actor
from recon.simulate.config import Staging
from recon.simulate.hand import arm, hand_shape, skeleton
from recon.simulate.hand_path import Arm, HandMotion, shoulder_place
from recon.simulate.record import HAND_LABEL, OTHER_LABEL
from recon.simulate.render import Body, Camera, Lights, Renderer, View
from recon.simulate.shutter import Flow, image_motion, poses_around
from recon.simulate.surfaces import Surface
from recon.simulate.textures import make_material, skin_material
from recon.simulate.truth import FIRST_TIME, Truth, TruthPart
from twin.geometry import Array, transform

# Shadow rays to each light from every second pixel of every second row; chosen by us
_LIGHT_SAMPLES = 1


class Wardrobe:
    """The person's hand in its shapes, and the arm, in what they wear; drawn from `rng`."""

    def __init__(self, config: Staging, rng: np.random.Generator):
        self._left = config.hand_side == "left"
        self._skin = skin_material(config.skin_tone, config.textures, rng)
        cloth = make_material("fabric", config.textures, rng)
        self._glove = cloth if config.hand_cover == "glove" else self._skin
        self._shapes: dict[float, Body] = {}
        self._arm = Body(arm(self._glove, cloth, config.hand_cover == "bare"), HAND_LABEL)

    def actors(self, hand: HandMotion) -> list[Actor]:
        """Hand and arm on their ways."""
        present = np.array(hand.present)
        return [
            Actor(lambda i: self.hand(float(hand.closure[i])), hand.T_world_hand, present),
            Actor(lambda _: self._arm, hand.T_world_arm, present),
        ]

    def hand(self, closure: float) -> Body:
        """The hand's body, the same object for the same closure."""
        if closure not in self._shapes:
            shape = hand_shape(closure, self._glove, left=self._left)
            self._shapes[closure] = Body((shape.surface,), HAND_LABEL)
        return self._shapes[closure]


class Staged(ABC):
    """One recording before it is written: geometry, paths and renderer. Equal inputs give equal frames.

    Args of the constructor:
        config: what it is staged by.
        cameras: T_world_camera (n, 4, 4) of the whole script.
        hand: the hand's way through it.
        actors: all that is rendered.
        still: surfaces of what never moves.
        lights: lamps of the room.
        window: the first frame of the script that is recorded, and the one after the last.
        covered: whether something lies on the lens (n,); None: never.
    """

    def __init__(
        self,
        config: Staging,
        cameras: Array,
        hand: HandMotion,
        actors: tuple[Actor, ...],
        still: tuple[Surface, ...],
        lights: Lights,
        window: tuple[int, int],
        covered: NDArray[np.bool_] | None = None,
    ):
        self.config, self.cameras, self.hand = config, cameras, hand
        self.actors, self.still = actors, still
        self.camera = Camera.of(config.width, config.height, config.hfov_deg)
        self._renderer = Renderer(self.camera, lights, config.samples, _LIGHT_SAMPLES, config.ambient_samples)
        self._first, self._last = window
        self._covered = np.zeros(len(cameras), dtype=bool) if covered is None else covered

    def during(self, first: int, last: int) -> Self:
        """The same of which only frames `first` to `last` of this recording are recorded.

        Raises ValueError where it has no such frames.
        """
        if not 0 <= first < last < self.frames:
            raise ValueError(f"frames {first} to {last} are none of {self.frames}")
        out = copy(self)
        out._first, out._last = self._first + first, self._first + last + 1
        return out

    def covered(self, index: int) -> bool:
        """Whether something lies on the lens in frame `index`: no colour, no depth, no label."""
        return bool(self._covered[index + self._first])

    @property
    def metered(self) -> tuple[int, ...]:
        """Frames by whose brightness the recording is exposed, the first among them."""
        return (0,)

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
        bodies = [poses_around(a.T_world_body, k, a.present) for a in there]
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
        return Truth(
            self._truth_parts(),
            self.still,
            times,
            self.cameras[a:b],
            hand,
            np.stack(keypoints),
            self.config.hand_side,
            self.shows_others,
        )

    @abstractmethod
    def _truth_parts(self) -> tuple[TruthPart, ...]:
        """The parts that are moved, over the frames that are recorded."""
