"""Settings of planning and replay. Every default was chosen by us unless a source is named."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from twin.runs.setting import Settings, group, setting

# s simulated after a plan's last command; chosen by us
SETTLE = 0.6


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
    clearance: float = setting(0.02, "wanted between the arm and everything else", unit="m", at_least=0)
    tool_speed: float = setting(
        0.25, "greatest speed of the tool while it moves the part", unit="m/s", above=0
    )
    torque_share: float = setting(
        0.9,
        "share of the torque limits for the arm's own dynamics and the part's estimated resistance; the rest is for contact",
        unit="",
        above=0,
        at_most=1,
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
    video_size: tuple[int, int] = setting((640, 480), "width and height of the video", unit="px", at_least=32)
    video_frames: int = setting(130, "most frames of the video", unit="frames", at_least=2)


@dataclass(frozen=True)
class RobotsConfig(Settings):
    """How `twin replay` plans and plays."""

    plan: PlanConfig = group(PlanConfig, "where the robot stands, how it takes hold, and its path")
    replay: ReplayConfig = group(ReplayConfig, "how the plan is played in MuJoCo, and its film")
