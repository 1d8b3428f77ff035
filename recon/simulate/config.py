"""What a simulated recording shall look like: what a user chooses, and what only the random draw sets."""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from typing import Literal

from twin.runs.setting import Settings, group, setting


@dataclass(frozen=True)
class PictureConfig(Settings):
    """What is wrong with the colour pictures; with the defaults nothing is. A frame's time is the middle of
    its exposure, so no fault but `colour_delay_s` shifts colour against depth on average."""

    light: float = setting(
        1.0,
        "share of the full light; the camera amplifies what is left, and its noise with it",
        unit="",
        at_least=0.01,
        at_most=1,
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
        "factor on the speed of the opening; 1 moves the part in 2.6 s",
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
    handle: str | None = setting(None, "name of a site or geom to grasp; none: what protrudes from the part")
    room: bool = setting(True, "add floor, walls, ceiling and clutter where the scene has none")
    exclude: tuple[str, ...] = setting(
        ("panda", "robot"),
        "bodies with one of these words in their name are left out, with all that hangs on them",
    )
    samples: int = setting(
        2, "sub-pixel samples of the colour image on each side (2: 2 x 2)", unit="", at_least=1, at_most=16
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
    picture: PictureConfig = group(PictureConfig, "faults of the colour pictures and their intrinsics")


@dataclass(frozen=True)
class Faults(PictureConfig):
    """All that is wrong with the colour pictures: the settings, and what only the random draw sets.

    Attributes:
        jpeg_quality: of the JPEG files.
        flicker: share by which lamps on the mains (50 Hz) swing, twice in a period; it beats with the frames,
            and a long exposure averages it out.
        exposure_jumps: relative steps of the automatic exposure, at random frames, every 2 s on average.
        focal_error: relative error of the focal length that is written; the true one is then in
            truth/intrinsic.json.
        centre_error_px: how far the principal point that is written lies to the right of the true one.
    """

    jpeg_quality: int = 93
    flicker: float = 0.0
    exposure_jumps: float = 0.0
    focal_error: float = 0.0
    centre_error_px: float = 0.0


@dataclass(frozen=True)
class Staging(SimulateConfig):
    """All that a recording is staged by: the settings, and what only the random draw sets. Every default was
    chosen by us.

    Attributes:
        sway: scale of the head's sway, turn and tremor; 0 holds the camera still after its approach.
        sidestep: m; how far the person steps to one side and back again.
        hand_side: which hand it is.
        hand_cover: what hand and forearm wear: a sleeve to the wrist, none below the elbow, or a glove too.
        skin_tone: which of the simulator's skin tones, from light to dark; None: drawn.
        hand_from_deg: side of the picture from which the hand comes: 0 from the right, 90 from below, 180
            from the left, -90 from above; None: from below, on the hand's side.
        wrist_turn: share of a hinge's angle that the hand turns with it (a wrist turns less than a door).
        textures: contrast of the procedural textures; 0: plain colours.
        clutter: boxes, books and pictures added to the room.
        ambient_samples: rays of ambient occlusion from every second pixel of every second row.
        colour_noise: scale of the colour noise.
    """

    picture: Faults = field(default_factory=Faults)
    sway: float = 1.0
    sidestep: float = 0.0
    hand_side: Literal["right", "left"] = "right"
    hand_cover: Literal["sleeve", "bare", "glove"] = "sleeve"
    skin_tone: int | None = None
    hand_from_deg: float | None = None
    wrist_turn: float = 0.5
    textures: float = 1.0
    clutter: int = 8
    ambient_samples: int = 3
    colour_noise: float = 1.0

    @staticmethod
    def of(config: SimulateConfig) -> Staging:
        """A configuration with the defaults of what it doesn't hold."""
        if isinstance(config, Staging):
            return config
        chosen = {f.name: getattr(config, f.name) for f in fields(config)}
        return Staging(**chosen | {"picture": Faults(**vars(config.picture))})
