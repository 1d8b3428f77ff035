"""What a simulated recording shall look like: one frozen dataclass, every field with a default."""

from __future__ import annotations

from dataclasses import dataclass

from twin.runs.setting import Settings, setting


@dataclass(frozen=True)
class SimulateConfig(Settings):
    """What a simulated recording shall look like; every default was chosen by us."""

    width: int = setting(640, "width of the colour and depth images", unit="px", at_least=32, at_most=1920)
    height: int = setting(480, "height of the colour and depth images", unit="px", at_least=24, at_most=1080)
    fps: float = setting(15.0, "frames in a second", unit="1/s", at_least=1, at_most=240)
    hfov_deg: float = setting(
        74.6,
        "horizontal field of view; the default is close to head-mounted cameras and Azure Kinect",
        unit="°",
        at_least=20,
        at_most=120,
    )
    seed: int = setting(
        0, "everything random (path, textures, clutter, noise) follows from it", unit="", at_least=0
    )
    opening: float | None = setting(
        None,
        "how far the part is moved; none: 80 % of the joint's range, 1.2 rad or 0.3 m where it has none",
        unit="rad or m",
        above=0,
    )
    speed: float = setting(
        1.0,
        "factor on the speed of the opening; 1 moves the part in move_s",
        unit="",
        at_least=0.05,
        at_most=20,
    )
    frames: int | None = setting(
        None,
        "number of frames, to which the durations are scaled; none: as they are",
        unit="frames",
        at_least=12,
    )
    rest_before_s: float = setting(1.4, "time before the hand enters", unit="s", at_least=0.05, at_most=60)
    reach_s: float = setting(
        0.95, "from the hand's entry to the closed grasp", unit="s", at_least=0.05, at_most=60
    )
    hold_s: float = setting(
        0.25,
        "between grasp and motion, and again between motion and release",
        unit="s",
        at_least=0.05,
        at_most=60,
    )
    move_s: float = setting(
        2.6, "duration of the minimum-jerk motion at speed 1", unit="s", at_least=0.05, at_most=60
    )
    leave_s: float = setting(
        0.8, "from release until the hand is out of view", unit="s", at_least=0.05, at_most=60
    )
    rest_after_s: float = setting(1.05, "time after the hand has left", unit="s", at_least=0.05, at_most=60)
    azimuth_deg: float | None = setting(
        None,
        "bearing of the camera from the part's outward normal, positive to the right of who faces the part; none: a free line of "
        "sight around a random bearing",
        unit="°",
        at_least=-360,
        at_most=360,
    )
    distance: float | None = setting(
        None,
        "horizontal distance of the camera from the grip; none: 0.78 m, or enough to stand clear of a wide door, and a random 0 to "
        "0.16 m more",
        unit="m",
        at_least=0.4,
        at_most=4,
    )
    height_above_grip: float | None = setting(
        None,
        "height of the camera above the grip; none: an eye height of 1.6 m, bent towards the part",
        unit="m",
        at_least=-5,
        at_most=5,
    )
    sway: float = setting(
        1.0,
        "scale of the head's sway, turn and tremor; 0 holds the camera still after its approach",
        unit="",
        at_least=0,
        at_most=10,
    )
    handle: str | None = setting(None, "name of a site or geom to grasp; none: what protrudes from the part")
    wrist_turn: float = setting(
        0.5,
        "share of a hinge's angle that the hand turns with it (a wrist turns less than a door)",
        unit="",
        at_least=0,
        at_most=1,
    )
    textures: float = setting(
        1.0, "contrast of the procedural textures; 0: plain colours", unit="", at_least=0, at_most=10
    )
    room: bool = setting(True, "add floor, walls, ceiling and clutter where the scene has none")
    clutter: int = setting(8, "boxes, books and pictures added to the room", unit="", at_least=0, at_most=40)
    exclude: tuple[str, ...] = setting(
        ("panda", "robot"),
        "bodies with one of these words in their name are left out, with all that hangs on them",
    )
    samples: int = setting(
        2, "sub-pixel samples of the colour image on each side (2: 2 x 2)", unit="", at_least=1, at_most=16
    )
    light_samples: int = setting(1, "shadow rays for each pixel and light", unit="", at_least=1, at_most=16)
    ambient_samples: int = setting(
        3, "rays of ambient occlusion for each pixel", unit="", at_least=1, at_most=16
    )
    depth_noise: float = setting(
        1.0,
        "scale of the sensor's depth noise and drop-out; 0: exact depth in steps of 1 mm",
        unit="",
        at_least=0,
        at_most=10,
    )
    colour_noise: float = setting(1.0, "scale of the colour noise", unit="", at_least=0, at_most=10)
