"""The simulator: an articulated MJCF scene in, an egocentric RGB-D recording with exact truth out."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from recon.simulate import sensor
from recon.simulate.camera_path import camera_path
from recon.simulate.config import SimulateConfig
from recon.simulate.grip import find_grasp
from recon.simulate.hand import HandShape, arm, hand_shape
from recon.simulate.hand_path import hand_motion
from recon.simulate.joints import scene_path
from recon.simulate.mjcf import OPENING_SHARE, Articulation, load_articulation
from recon.simulate.record import (
    HAND_LABEL,
    PART_ID,
    STATIC_LABEL,
    Truth,
    new_recording,
    write_frame,
    write_truth,
)
from recon.simulate.render import Body, Camera, Lights, Renderer, View
from recon.simulate.room import build_room
from recon.simulate.textures import make_material
from recon.simulate.timeline import Timeline
from twin.errors import ConfigError
from twin.geometry import Array, transform

FIRST_TIME = 1000.0  # seconds; a clock that does not start at zero, as real ones don't
Progress = Callable[[int, int], None]


def simulate(
    scene: Path | str,
    joint: str,
    out: Path | str,
    config: SimulateConfig | None = None,
    progress: Progress | None = None,
) -> Path:
    """Render a person opening one part of an MJCF scene.

    Args:
        scene: MJCF file with hinge or slide joints, or "kitchen" for the Franka Kitchen (extra `simulate`).
        joint: name of the joint to move.
        out: folder of the recording; it must be new or empty.
        config: see `SimulateConfig`.
        progress: called with (frames done, frames) after each frame.

    Returns:
        `out`. The layout is the native one (color/, depth/, intrinsic.json, timestamps.txt) with truth/ beside it.

    Raises:
        InputError: scene, joint, handle or folder can't be used.
        ConfigError: the settings don't fit the joint.
        MissingDependencyError: the Franka Kitchen is asked for but not installed.
    """
    config, folder = config or SimulateConfig(), Path(out)
    stage = Stage(scene_path(scene), joint, config)
    with new_recording(folder) as staged:
        gain = 0.0
        for i in range(stage.timeline.frames):
            view = stage.render(i)
            gain = gain if i > 0 else sensor.exposure(view.colour)
            rng = np.random.default_rng([config.seed, 7, i])
            drift = 1.0 + 0.015 * np.sin(0.11 * i) * config.colour_noise
            colour = sensor.colour_image(view.colour, gain * drift, config.colour_noise, rng)
            depth = sensor.depth_image(view, stage.view_directions(i), config.depth_noise, rng)
            write_frame(staged, i, colour, depth, view.labels)
            if progress is not None:
                progress(i + 1, stage.timeline.frames)
        write_truth(staged, stage.truth(), stage.camera)
    return folder


class Stage:
    """One recording before it is written: geometry, paths and renderer. Equal inputs give equal frames."""

    def __init__(self, scene: Path, joint: str, config: SimulateConfig):
        self.config = config
        rng = {
            name: np.random.default_rng([config.seed, k])
            for k, name in enumerate(("look", "room", "path", "grip"))
        }
        self.scene = load_articulation(scene, joint, config.exclude, config.textures, rng["look"])
        self.timeline = Timeline.of(config)
        self.states = self.timeline.states(_opening(self.scene, config))
        self.grasp = find_grasp(self.scene, config.handle, rng["grip"])
        self.still, bounds = self.scene.static, (self.scene.lower - 3.0, self.scene.upper + 3.0)
        if config.room:
            room, *corners = build_room(
                self.scene, self.grasp.outward, config.clutter, config.textures, rng["room"]
            )
            self.still, bounds = (*self.scene.static, *room), (corners[0], corners[1])
        self.cameras = camera_path(
            self.scene, self.still, bounds, self.grasp, self.timeline, self.states, config, rng["path"]
        )
        self.hand = hand_motion(self.scene, self.grasp, self.timeline, self.states, self.cameras, config)
        self._skin = make_material("skin", config.textures, rng["look"])
        cloth = make_material("fabric", config.textures, rng["look"])
        self._shapes: dict[float, tuple[HandShape, Body]] = {}
        self._static = Body(self.still, STATIC_LABEL)
        self._part = Body(self.scene.part, PART_ID)
        self._arm = Body(arm(self._skin, cloth), HAND_LABEL)
        self.camera = Camera.of(config.width, config.height, config.hfov_deg)
        lights = room_lights(bounds[0], bounds[1], self.scene, self.cameras[:, :3, 3].mean(axis=0))
        self._renderer = Renderer(
            self.camera, lights, config.samples, config.light_samples, config.ambient_samples
        )

    def render(self, index: int) -> View:
        """Exact rendering of frame `index`."""
        bodies = [self._static, self._part]
        poses: list[Array] = [np.eye(4), self.scene.pose(float(self.states[index]))]
        if self.hand.present[index]:
            bodies += [self._hand(index)[1], self._arm]
            poses += [self.hand.T_world_hand[index], self.hand.T_world_arm[index]]
        rng = np.random.default_rng([self.config.seed, 6, index])
        return self._renderer.render(bodies, poses, self.cameras[index], rng)

    def view_directions(self, index: int) -> Array:
        """Unit viewing directions (H, W, 3) in the world."""
        camera = self.camera
        v, u = np.mgrid[0 : camera.height, 0 : camera.width]
        cx, cy = camera.centre
        local = np.stack([(u - cx) / camera.focal, (v - cy) / camera.focal, np.ones(u.shape)], axis=-1)
        local /= np.linalg.norm(local, axis=-1, keepdims=True)
        return local @ self.cameras[index, :3, :3].T

    def truth(self) -> Truth:
        """All that is known about the recording."""
        times = FIRST_TIME + np.arange(self.timeline.frames) / self.config.fps
        keypoints = np.stack(
            [
                transform(self.hand.T_world_hand[i], self._hand(i)[0].keypoints)
                for i in range(self.timeline.frames)
            ]
        )
        return Truth(
            self.scene,
            self.still,
            self.grasp,
            self.timeline,
            self.states,
            times,
            self.cameras,
            self.hand,
            keypoints,
        )

    def _hand(self, index: int) -> tuple[HandShape, Body]:
        closure = float(self.hand.closure[index])
        if closure not in self._shapes:
            shape = hand_shape(closure, self._skin)
            self._shapes[closure] = (shape, Body((shape.surface,), HAND_LABEL))
        return self._shapes[closure]


def _opening(scene: Articulation, config: SimulateConfig) -> float:
    if config.opening is None:
        return OPENING_SHARE * scene.span
    if config.opening > scene.span + 1e-9:
        unit_name = "rad" if scene.kind == "revolute" else "m"
        raise ConfigError(
            f"simulate.opening = {config.opening} {unit_name} is beyond the range of joint {scene.name!r}",
            f"use at most {scene.span:.4g} {unit_name}",
        )
    return config.opening


def room_lights(low: Array, high: Array, scene: Articulation, eye: Array) -> Lights:
    """Two lamps under the ceiling: a warm one beside the person, a cooler one farther off; ambient from everywhere."""
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
