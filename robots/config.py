"""Settings of planning and replay. Every default was chosen by us unless a source is named."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from twin.errors import ConfigError

CONTROLS = ("position", "impedance")


@dataclass(frozen=True)
class PlanConfig:
    """How `robots.plan` searches. Lengths m, angles rad, times s.

    candidates: base poses tried. finalists: how many of the best that are free of collision get the precise inverse
    kinematics; rehearse: simulate these, best first, until one succeeds. pedestal: lowest and highest base above the floor (a free-standing column carries a fixed arm).
    over_insert: how much deeper than the middle of the handle the tool point goes when the handle was found on the
    mesh; over_insert_blind: when only the hand's contact is known. approach: length of the straight way in and out.
    turn: shares of a revolute joint's angle by which the hand may lag behind the handle. lean: turns of the hand about
    the closing direction; lean_rim: more of them where a rim is held, which has nothing beside it. clearance: wanted between arm and everything else. tool_speed: peak speed of the tool while
    it moves the part. velocity_share, acceleration_share: of the robot's limits. torque_share: of the torque
    limits, for the arm's own dynamics and the part's estimated resistance; the rest is for contact. position_tolerance,
    angle_tolerance: largest error of the path. release: let go and retreat at the end; None: unless the part's weight
    would move it again, were its axis off by two sigma of what the twin says. seed: of every random draw.
    """

    candidates: int = 500
    finalists: int = 4
    rehearse: bool = True
    pedestal: tuple[float, float] = (0.0, 3.0)
    over_insert: float = 0.005
    over_insert_blind: float = 0.020
    approach: float = 0.10
    turn: tuple[float, ...] = (0.0, 0.25, 0.5, 0.75)
    lean: tuple[float, ...] = (0.0, 0.45, -0.45)
    lean_rim: tuple[float, ...] = (0.8, -0.8)
    clearance: float = 0.02
    tool_speed: float = 0.25
    velocity_share: float = 0.5
    acceleration_share: float = 0.3
    torque_share: float = 0.9
    position_tolerance: float = 0.003
    angle_tolerance: float = 0.05
    release: bool | None = None
    seed: int = 0

    def __post_init__(self) -> None:
        low, high = self.pedestal
        if not 0 <= low <= high:
            raise ConfigError(f"pedestal must be 0 <= low <= high, got {self.pedestal}")
        for key in (
            "candidates",
            "finalists",
            "approach",
            "tool_speed",
            "position_tolerance",
            "angle_tolerance",
        ):
            if getattr(self, key) <= 0:
                raise ConfigError(f"{key} must be positive, got {getattr(self, key)}")
        for key in ("velocity_share", "acceleration_share", "torque_share"):
            if not 0 < getattr(self, key) <= 1:
                raise ConfigError(f"{key} must be in (0, 1], got {getattr(self, key)}")
        if not self.turn or not self.lean:
            raise ConfigError("turn and lean need at least one value each", "use (0.0,)")


@dataclass(frozen=True)
class ReplayConfig:
    """How `robots.replay` plays and records. control: "position", the robot's own joint servos, or "impedance", a compliant
    hand like Spot's (robots/simulation/impedance.py). stiffness: share of the servos' or the hand's own; the damping ratio stays.
    settle: s of simulation after the last command. video_size: width, height in pixels.
    video_rate: frames per second of the file; video_frames: at most so many frames."""

    control: Literal["position", "impedance"] = "position"
    stiffness: float = 1.0
    settle: float = 0.6
    video_size: tuple[int, int] = (640, 480)
    video_rate: int = 25
    video_frames: int = 130

    def __post_init__(self) -> None:
        if self.settle < 0 or self.video_rate <= 0 or self.video_frames < 2 or min(self.video_size) < 32:
            raise ConfigError(f"replay settings out of range: {self}")
        if self.control not in CONTROLS:
            raise ConfigError(f"control must be one of {', '.join(CONTROLS)}, got {self.control!r}")
        if not 0 < self.stiffness <= 100:
            raise ConfigError(f"stiffness must be in (0, 100], got {self.stiffness}", "1 is the robot's own")
