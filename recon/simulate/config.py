"""What a simulated recording shall look like: one frozen dataclass, every field with a default."""

from __future__ import annotations

import math
from dataclasses import dataclass

from twin.errors import ConfigError

MAX_WIDTH, MAX_HEIGHT = 1920, 1080


@dataclass(frozen=True)
class SimulateConfig:
    """Settings of `simulate`. All defaults are chosen by us; lengths in metres, angles as named.

    Attributes:
        width: of the colour and depth images in pixels, up to 1920.
        height: of the images in pixels, up to 1080.
        fps: frames per second.
        hfov_deg: horizontal field of view; 74.6 degrees is close to head-mounted and Azure Kinect cameras.
        seed: everything random (path, textures, clutter, noise) follows from it.
        opening: how far the part is moved, in radians or metres; None takes 80 % of the joint's range
            (1.2 rad or 0.3 m for an unlimited joint).
        speed: factor on the speed of the opening; 1.0 moves the part in `move_s` seconds.
        frames: number of frames; None follows from the durations below, otherwise they are all scaled to it.
        rest_before_s: time before the hand enters.
        reach_s: from the hand's entry to the closed grasp.
        hold_s: between grasp and motion, and again between motion and release.
        move_s: duration of the minimum-jerk motion at speed 1.
        leave_s: from release until the hand is out of view.
        rest_after_s: time after the hand has left.
        azimuth_deg: bearing of the camera from the part's outward normal, positive towards the right of a person
            facing the part; None searches a free line of sight around a random bearing.
        distance: horizontal distance of the camera from the grip; None takes 0.78 m or, for a wide
            door, enough to stand clear of it, plus a random 0 to 0.16 m.
        height_above_grip: height of the camera above the grip; None follows an eye height of 1.6 m, bent towards the part.
        sway: scale of the head's sway, turn and tremor; 0 holds the camera still after its approach.
        handle: name of a site or geom to grasp; None finds what protrudes from the part.
        wrist_turn: share of a revolute part's angle that the hand turns with it (a wrist turns less than a door).
        textures: contrast of the procedural textures; 0 gives plain colours.
        room: add floor, walls, ceiling and clutter where the scene has none.
        clutter: number of boxes, books and pictures added to the room.
        exclude: bodies whose name contains one of these words are left out, with everything attached to them.
        samples: sub-pixel samples per side for the colour image (2 gives 2 x 2).
        light_samples: shadow rays per pixel and light.
        ambient_samples: ambient occlusion rays per pixel.
        depth_noise: scale of the sensor's depth noise and drop-out; 0 gives exact depth in 1 mm steps.
        colour_noise: scale of the colour noise.
    """

    width: int = 640
    height: int = 480
    fps: float = 15.0
    hfov_deg: float = 74.6
    seed: int = 0
    opening: float | None = None
    speed: float = 1.0
    frames: int | None = None
    rest_before_s: float = 1.4
    reach_s: float = 0.95
    hold_s: float = 0.25
    move_s: float = 2.6
    leave_s: float = 0.8
    rest_after_s: float = 1.05
    azimuth_deg: float | None = None
    distance: float | None = None
    height_above_grip: float | None = None
    sway: float = 1.0
    handle: str | None = None
    wrist_turn: float = 0.5
    textures: float = 1.0
    room: bool = True
    clutter: int = 8
    exclude: tuple[str, ...] = ("panda", "robot")
    samples: int = 2
    light_samples: int = 1
    ambient_samples: int = 3
    depth_noise: float = 1.0
    colour_noise: float = 1.0

    def __post_init__(self) -> None:
        _check(32 <= self.width <= MAX_WIDTH, "width", self.width, f"32 to {MAX_WIDTH} pixels")
        _check(24 <= self.height <= MAX_HEIGHT, "height", self.height, f"24 to {MAX_HEIGHT} pixels")
        _check(1.0 <= self.fps <= 240.0, "fps", self.fps, "1 to 240")
        _check(20.0 <= self.hfov_deg <= 120.0, "hfov_deg", self.hfov_deg, "20 to 120 degrees")
        _check(self.seed >= 0, "seed", self.seed, "0 or more")
        _check(self.opening is None or self.opening > 0.0, "opening", self.opening, "more than 0, or none")
        _check(0.05 <= self.speed <= 20.0, "speed", self.speed, "0.05 to 20")
        _check(self.frames is None or self.frames >= 12, "frames", self.frames, "12 or more, or none")
        for name in ("rest_before_s", "reach_s", "hold_s", "move_s", "leave_s", "rest_after_s"):
            _check(0.05 <= getattr(self, name) <= 60.0, name, getattr(self, name), "0.05 to 60 seconds")
        _check(self.distance is None or 0.4 <= self.distance <= 4.0, "distance", self.distance, "0.4 to 4 m")
        _check(0.0 <= self.wrist_turn <= 1.0, "wrist_turn", self.wrist_turn, "0 to 1")
        for name in ("sway", "textures", "depth_noise", "colour_noise"):
            _check(0.0 <= getattr(self, name) <= 10.0, name, getattr(self, name), "0 to 10")
        _check(0 <= self.clutter <= 40, "clutter", self.clutter, "0 to 40")
        for name in ("samples", "light_samples", "ambient_samples"):
            _check(1 <= getattr(self, name) <= 16, name, getattr(self, name), "1 to 16")


def _check(good: bool, name: str, value: object, allowed: str) -> None:
    if not good or (isinstance(value, float) and not math.isfinite(value)):
        raise ConfigError(f"simulate.{name} = {value} is not allowed", f"use {allowed}")
