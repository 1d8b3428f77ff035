"""What a robot is to the planner and the replay: data read from a small TOML file beside its MJCF model."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, cast

import numpy as np

from twin.errors import InputError
from twin.geometry import Array

_SECTIONS = {"name", "description", "model", "arm", "base", "tool", "gripper"}


@dataclass(frozen=True, eq=False)
class RobotSpec:
    """An arm with a gripper.

    Joint arrays are (n,) in the order of `arm_joints`: velocity rad/s, acceleration rad/s^2, effort N m, home rad.
    The tool frame is the MJCF site `tool`: z out of the hand, y the direction in which the fingers close, origin
    between the finger pads. palm: free depth (m) from the tool point back to the palm, palm_width: its extent along x;
    tip: how far the fingers reach
    beyond the tool point; finger_width: extent of a finger along x. stroke: full opening (m); force: grip force (N).
    footprint: radius (m) of the pedestal under a fixed base.
    """

    name: str
    description: str
    model: Path
    arm_joints: tuple[str, ...]
    arm_actuators: tuple[str, ...]
    velocity: Array
    acceleration: Array
    effort: Array
    home: Array
    base_kind: Literal["fixed"]
    base_body: str
    footprint: float
    tool: str
    palm: float
    palm_width: float
    tip: float
    finger_width: float
    gripper_actuator: str
    gripper_joints: tuple[str, ...]
    finger_bodies: tuple[str, ...]
    stroke: float
    force: float

    def __post_init__(self) -> None:
        n = len(self.arm_joints)
        if n == 0 or len(self.arm_actuators) != n:
            raise InputError(
                f"robot {self.name!r} names {n} arm joints and {len(self.arm_actuators)} actuators",
                "give one actuator for each joint in [arm]",
            )
        for key in ("velocity", "acceleration", "effort", "home"):
            values = np.array(getattr(self, key), dtype=np.float64)
            if values.shape != (n,) or not np.all(np.isfinite(values)):
                raise InputError(f"robot {self.name!r}: arm.{key} must hold {n} finite numbers")
            if key != "home" and np.any(values <= 0):
                raise InputError(f"robot {self.name!r}: arm.{key} must be positive, got {values.tolist()}")
            values.flags.writeable = False
            object.__setattr__(self, key, values)
        for key in ("footprint", "palm", "palm_width", "finger_width", "stroke", "force"):
            if not getattr(self, key) > 0:
                raise InputError(f"robot {self.name!r}: {key} must be positive, got {getattr(self, key)}")
        if self.base_kind != "fixed":
            raise InputError(f"robot {self.name!r} has base kind {self.base_kind!r}", "known kinds: fixed")


def load_spec(path: Path) -> RobotSpec:
    """Read a robot description.

    Args:
        path: the TOML file; `model` in it is relative to its folder.

    Raises:
        InputError: the file is missing, not TOML, lacks a section (such as the gripper) or a key.
    """
    try:
        raw = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as e:
        raise InputError(f"robot file {path} can't be read ({e.strerror})", "give a .toml robot file") from e
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as e:
        raise InputError(f"robot file {path} is not TOML: {e}") from e
    unknown = sorted(set(raw) - _SECTIONS)
    if unknown:
        raise InputError(f"robot file {path} has unknown keys {unknown}", f"known: {sorted(_SECTIONS)}")
    sections = {s: _section(raw, s, path) for s in ("arm", "base", "tool", "gripper")}
    try:
        return _build(raw, sections, path)
    except KeyError as e:
        raise InputError(
            f"robot file {path} lacks the key {e.args[0]!r}", "compare it with franka.toml"
        ) from e
    except (TypeError, ValueError) as e:
        raise InputError(f"robot file {path} has a value of the wrong kind: {e}") from e


def _section(raw: dict[str, Any], name: str, path: Path) -> dict[str, Any]:
    section = raw.get(name)
    if not isinstance(section, dict):
        remedy = (
            "a robot without a gripper can't open anything: add its actuator, joints, bodies, stroke and force"
            if name == "gripper"
            else "compare it with franka.toml"
        )
        raise InputError(f"robot file {path} has no [{name}] section", remedy)
    return section


def _build(raw: dict[str, Any], s: dict[str, dict[str, Any]], path: Path) -> RobotSpec:
    arm, base, tool, gripper = s["arm"], s["base"], s["tool"], s["gripper"]
    model = path.parent / str(raw["model"])
    if not model.is_file():
        raise InputError(f"robot file {path} names the model {model.name}, which is not beside it")
    return RobotSpec(
        name=str(raw["name"]),
        description=str(raw.get("description", "")),
        model=model,
        arm_joints=tuple(arm["joints"]),
        arm_actuators=tuple(arm["actuators"]),
        velocity=np.asarray(arm["velocity"], dtype=np.float64),
        acceleration=np.asarray(arm["acceleration"], dtype=np.float64),
        effort=np.asarray(arm["effort"], dtype=np.float64),
        home=np.asarray(arm["home"], dtype=np.float64),
        base_kind=cast(Literal["fixed"], base["kind"]),
        base_body=str(base["body"]),
        footprint=float(base["footprint"]),
        tool=str(tool["site"]),
        palm=float(tool["palm"]),
        palm_width=float(tool["palm_width"]),
        tip=float(tool["tip"]),
        finger_width=float(tool["finger_width"]),
        gripper_actuator=str(gripper["actuator"]),
        gripper_joints=tuple(gripper["joints"]),
        finger_bodies=tuple(gripper["bodies"]),
        stroke=float(gripper["stroke"]),
        force=float(gripper["force"]),
    )
