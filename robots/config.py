"""Settings of planning and replay. Every default was chosen by us unless a source is named."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from twin.runs.setting import Settings, group, setting


@dataclass(frozen=True)
class PlanConfig(Settings):
    """How `robots.plan` searches; every default was chosen by us."""

    candidates: int = setting(500, "places of the base that are tried", unit="", at_least=1)
    finalists: int = setting(
        4, "the best places free of collision, which get the precise inverse kinematics", unit="", at_least=1
    )
    rehearse: bool = setting(True, "simulate the finalists, best first, until one succeeds")
    pedestal: tuple[float, float] = setting(
        (0.0, 3.0),
        "lowest and highest base above the floor: a column of its own carries a fixed arm",
        unit="m",
        at_least=0,
    )
    over_insert: float = setting(
        0.005,
        "how much deeper than the middle of the handle the tool point goes, where the handle was found on the mesh",
        unit="m",
        at_least=-0.2,
        at_most=0.2,
    )
    over_insert_blind: float = setting(
        0.020, "the same where only the hand's contact is known", unit="m", at_least=-0.2, at_most=0.2
    )
    approach: float = setting(0.10, "length of the straight way in and out", unit="m", above=0)
    turn: tuple[float, ...] = setting(
        (0.0, 0.25, 0.5, 0.75),
        "shares of a hinge's angle by which the hand may lag behind the handle",
        unit="",
        at_least=-1,
        at_most=1,
        least=1,
    )
    lean: tuple[float, ...] = setting(
        (0.0, 0.45, -0.45),
        "turns of the hand about the direction in which it closes; (0.0,) for none",
        unit="rad",
        at_least=-math.pi,
        at_most=math.pi,
        least=1,
    )
    lean_rim: tuple[float, ...] = setting(
        (0.8, -0.8),
        "more of them where a rim is held, which has nothing beside it",
        unit="rad",
        at_least=-math.pi,
        at_most=math.pi,
    )
    clearance: float = setting(0.02, "wanted between the arm and everything else", unit="m", at_least=0)
    tool_speed: float = setting(
        0.25, "greatest speed of the tool while it moves the part", unit="m/s", above=0
    )
    velocity_share: float = setting(0.5, "share of the robot's velocity limits", unit="", above=0, at_most=1)
    acceleration_share: float = setting(
        0.3, "share of the robot's acceleration limits", unit="", above=0, at_most=1
    )
    torque_share: float = setting(
        0.9,
        "share of the torque limits for the arm's own dynamics and the part's estimated resistance; the rest is for contact",
        unit="",
        above=0,
        at_most=1,
    )
    position_tolerance: float = setting(0.003, "greatest error of the path in position", unit="m", above=0)
    angle_tolerance: float = setting(
        0.05, "greatest error of the path in angle", unit="rad", above=0, at_most=math.pi
    )
    release: bool | None = setting(
        None,
        "let go and retreat at the end; none: unless the part's weight would move it again, were its axis off by two sigma of what "
        "the twin says",
    )
    seed: int = setting(0, "of every random draw", unit="", at_least=0)

    def __post_init__(self) -> None:
        super().__post_init__()
        low, high = map(float, self.pedestal)
        if low > high:
            raise self.refused("pedestal", "name the lower height first")


@dataclass(frozen=True)
class ReplayConfig(Settings):
    """How `robots.replay` plays and records; every default was chosen by us."""

    control: Literal["position", "impedance"] = setting(
        "impedance",
        '"impedance": a compliant hand like Spot\'s (robots/simulation/impedance.py); "position": the robot\'s own joint servos',
    )
    stiffness: float = setting(
        1.0,
        "share of the servos' or the hand's own stiffness; the damping ratio stays",
        unit="",
        above=0,
        at_most=100,
    )
    settle: float = setting(0.6, "simulated after the last command", unit="s", at_least=0)
    video_size: tuple[int, int] = setting((640, 480), "width and height of the video", unit="px", at_least=32)
    video_rate: int = setting(25, "frames in a second of the video", unit="1/s", at_least=1)
    video_frames: int = setting(130, "most frames of the video", unit="frames", at_least=2)


@dataclass(frozen=True)
class RobotsConfig(Settings):
    """How `twin replay` plans and plays."""

    plan: PlanConfig = group(PlanConfig, "where the robot stands, how it takes hold, and its path")
    replay: ReplayConfig = group(ReplayConfig, "how the plan is played in MuJoCo, and its film")
