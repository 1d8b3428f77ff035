"""What a simulated recording shall look like: one frozen dataclass, every field with a default."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from twin.runs.setting import Settings, group, setting


@dataclass(frozen=True)
class PictureConfig(Settings):
    """What is wrong with the colour pictures; with the defaults nothing is. A frame's time is the middle of
    its exposure, so no fault but `colour_delay_s` shifts colour against depth on average."""

    jpeg_quality: int = setting(93, "quality of the JPEG files", unit="", at_least=1, at_most=100)
    light: float = setting(
        1.0,
        "share of the full light; the camera amplifies what is left, and its noise with it",
        unit="",
        at_least=0.01,
        at_most=1,
    )
    flicker: float = setting(
        0.0,
        "share by which lamps on the mains (50 Hz) swing, twice in a period; it beats with the frames, and a long exposure "
        "averages it out",
        unit="",
        at_least=0,
        below=1,
    )
    exposure_jumps: float = setting(
        0.0,
        "relative steps of the automatic exposure, at random frames, every 2 s on average",
        unit="",
        at_least=0,
        at_most=3,
    )
    shutter: float = setting(
        0.0,
        "share of a frame's time in which the shutter is open, which blurs what moves",
        unit="",
        at_least=0,
        at_most=1,
    )
    rolling_shutter_s: float = setting(
        0.0, "read-out time from the first to the last row", unit="s", at_least=0, at_most=0.1
    )
    focal_error: float = setting(
        0.0,
        "relative error of the focal length that is written; the true one is then in truth/intrinsic.json",
        unit="",
        at_least=-0.2,
        at_most=0.2,
    )
    centre_error_px: float = setting(
        0.0,
        "how far the principal point that is written lies to the right of the true one",
        unit="px",
        at_least=-100,
        at_most=100,
    )
    colour_delay_s: float = setting(
        0.0, "time by which colour is taken after depth", unit="s", at_least=-0.1, at_most=0.1
    )


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
    sidestep: float = setting(
        0.0, "how far the person steps to one side and back again", unit="m", at_least=-2, at_most=2
    )
    handle: str | None = setting(None, "name of a site or geom to grasp; none: what protrudes from the part")
    hand_side: Literal["right", "left"] = setting("right", "which hand it is")
    hand_cover: Literal["sleeve", "bare", "glove"] = setting(
        "sleeve",
        "what hand and forearm wear: a sleeve to the wrist, none below the elbow, or a glove as well",
    )
    skin_tone: int | None = setting(
        None,
        "which of the simulator's skin tones, from light to dark; none: drawn",
        unit="",
        at_least=0,
        at_most=5,
    )
    hand_from_deg: float | None = setting(
        None,
        "side of the picture from which the hand comes: 0 from the right, 90 from below, 180 from the left, -90 from above; none: from "
        "below, on the hand's side",
        unit="°",
        at_least=-180,
        at_most=180,
    )
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
    light_samples: int = setting(
        1,
        "shadow rays to each light from every second pixel of every second row",
        unit="",
        at_least=1,
        at_most=16,
    )
    ambient_samples: int = setting(
        3, "rays of ambient occlusion from those pixels", unit="", at_least=1, at_most=16
    )
    sensor: Literal["structured_light", "ideal", "time_of_flight", "phone_lidar", "stereo"] = setting(
        "structured_light",
        "the depth camera: as the first Kinect, exact in steps of 1 mm, as Azure Kinect, as a phone, as RealSense D435",
    )
    depth_noise: float = setting(
        1.0,
        "scale of the sensor's depth errors and drop-out; 0: exact depth in steps of 1 mm",
        unit="",
        at_least=0,
        at_most=10,
    )
    colour_noise: float = setting(1.0, "scale of the colour noise", unit="", at_least=0, at_most=10)
    picture: PictureConfig = group(PictureConfig, "faults of the colour pictures and their intrinsics")
