"""What a robot is to the planner and the replay: data read from a small TOML file beside its MJCF model."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from robots.model.looks import Looks, read_looks
from robots.model.model_files import locate
from robots.model.robot_file import check_keys, section
from twin.errors import InputError
from twin.geometry import Array

BASE_KINDS = ("fixed", "planar")
GRIPPER_KINDS = ("parallel", "claw")
_SQUEEZE = 0.02  # m beyond closed; a command that saturates the gripper's force whatever it holds
# m, at most, between a handle and the jaw that does not move, before the hand closes (chosen by us)
_JAW_ROOM = 0.020

_ARM = {"joints", "actuators", "velocity", "acceleration", "effort", "home", "stiffness", "damping"}
_BASE = {"kind", "body", "footprint", "distance"}
_PLANAR = {"joints", "actuators", "velocity", "acceleration", "effort"}
_TOOL = {"site", "body", "position", "quat_wxyz", "palm", "palm_width", "tip"}
_GRIPPER = {"kind", "actuator", "joints", "bodies", "stroke", "force"}
_CLAW = {"open", "closed", "lever", "fixed_jaw"}
_TOP = {"name", "description", "model", "arm", "base", "tool", "gripper", "looks"}


@dataclass(frozen=True, eq=False)
class RobotSpec:
    """An arm with a gripper, on a fixed or a planar base.

    Joint arrays are (n,) in the order of `arm_joints`: velocity rad/s, acceleration rad/s^2, effort N m, home
    rad. A planar base is two slides and a hinge; they are the first three of `arm_joints` (m, N for the
    slides; home 0) and repeated in `base_joints`, which is empty for a fixed base. The tool frame is the MJCF
    site `tool`: z out of the hand, y the direction in which the fingers close, origin between the finger
    pads. palm: free depth (m) from the tool point back to the palm, palm_width: its extent along x; tip: how
    far the fingers reach beyond the tool point. stroke: full
    opening (m); force: grip force (N). footprint: radius (m) of the pedestal under a fixed base, or of what
    must be free around a planar one. distance: nearest and farthest (m, horizontally) of the base from a
    handle that is worth trying.

    A parallel gripper's actuator takes the opening in metres, shared evenly by its joints. A claw has one
    hinge whose angle (rad) is `jaw_open` at full opening and `jaw_closed` when shut; its actuator takes the
    angle. lever: m from that hinge to the tool point (1 for a parallel gripper); fixed_jaw: m from the tool
    point to the face of the jaw that does not move, on the side of -y (0 for a parallel gripper).

    A model without a tool site gets one: on `tool_body` (empty: it has one), at tool_position (3,) m, turned
    by tool_quat_wxyz (4,). stiffness, damping: (n,) of servos that replace the model's actuators (N m/rad, N
    m s/rad), or empty: it has its own. See robots/model/mjcf.py. looks: whose visuals it wears in a film,
    None for its own shapes.
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
    base_kind: str
    base_body: str
    footprint: float
    distance: tuple[float, float]
    tool: str
    palm: float
    palm_width: float
    tip: float
    gripper_kind: str
    gripper_actuator: str
    gripper_joints: tuple[str, ...]
    finger_bodies: tuple[str, ...]
    stroke: float
    force: float
    base_joints: tuple[str, ...] = ()
    jaw_open: float = 0.0
    jaw_closed: float = 0.0
    lever: float = 1.0
    fixed_jaw: float = 0.0
    tool_body: str = ""
    tool_position: tuple[float, ...] = (0.0, 0.0, 0.0)
    tool_quat_wxyz: tuple[float, ...] = (1.0, 0.0, 0.0, 0.0)
    stiffness: tuple[float, ...] = ()
    damping: tuple[float, ...] = ()
    looks: Looks | None = None

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
        for key in ("footprint", "palm", "palm_width", "stroke", "force", "lever"):
            if not 0 < getattr(self, key) < np.inf:
                raise InputError(f"robot {self.name!r}: {key} must be positive, got {getattr(self, key)}")
        self._check_kinds()
        self._check_additions()

    def _check_additions(self) -> None:
        n = len(self.arm_joints)
        if len(self.tool_position) != 3 or len(self.tool_quat_wxyz) != 4 or not any(self.tool_quat_wxyz):
            raise InputError(
                f"robot {self.name!r}: tool.position takes 3 numbers and tool.quat_wxyz 4, not all zero"
            )
        if not (self.stiffness or self.damping):
            return
        if self.planar or self.gripper_kind != "parallel":
            raise InputError(
                f"robot {self.name!r}: arm.stiffness makes servos for a fixed arm with a parallel gripper only",
                "write the actuators into the MJCF file",
            )
        for key, values in (("stiffness", self.stiffness), ("damping", self.damping)):
            if len(values) != n or min(values) <= 0 or not np.all(np.isfinite(values)):
                raise InputError(f"robot {self.name!r}: arm.{key} must hold {n} positive numbers")

    def _check_kinds(self) -> None:
        for key, kind, known in (
            ("base", self.base_kind, BASE_KINDS),
            ("gripper", self.gripper_kind, GRIPPER_KINDS),
        ):
            if kind not in known:
                raise InputError(
                    f"robot {self.name!r} has {key} kind {kind!r}", f"known kinds: {', '.join(known)}"
                )
        if not 0 <= self.distance[0] < self.distance[1]:
            raise InputError(
                f"robot {self.name!r}: base.distance must be nearest < farthest, got {self.distance}"
            )
        if self.planar != (len(self.base_joints) == 3) or self.arm_joints[: len(self.base_joints)] != (
            self.base_joints
        ):
            raise InputError(
                f"robot {self.name!r}: a planar base has three joints, two slides and a hinge, "
                f"got {list(self.base_joints)}"
            )
        if not self.gripper_joints or not self.finger_bodies:
            raise InputError(f"robot {self.name!r}: gripper.joints and gripper.bodies must not be empty")
        if self.gripper_kind == "claw" and (
            len(self.gripper_joints) != 1 or self.jaw_open == self.jaw_closed
        ):
            raise InputError(
                f"robot {self.name!r}: a claw has one joint, whose angle differs between gripper.open and "
                f"gripper.closed"
            )

    @property
    def planar(self) -> bool:
        """True when the base moves on the floor."""
        return self.base_kind == "planar"

    def jaws(self, opening: float) -> Array:
        """Gripper joint positions (k,) at an opening in m."""
        if self.gripper_kind == "claw":
            share = opening / self.stroke
            return np.array([self.jaw_closed + share * (self.jaw_open - self.jaw_closed)])
        return np.full(len(self.gripper_joints), opening / len(self.gripper_joints))

    def gripper_command(self, opening: Array) -> Array:
        """Actuator command (n,) for openings (n,) in m; for 0, one that presses with full force."""
        if self.gripper_kind == "claw":
            span = self.jaw_open - self.jaw_closed
            squeeze = self.jaw_closed - np.sign(span) * 0.5  # rad
            return np.where(opening > 1e-6, self.jaw_closed + opening / self.stroke * span, squeeze)
        return np.where(opening > 1e-6, opening, -_SQUEEZE)

    def beside(self, thickness: float) -> float:
        """How far (m, along y) the tool point stands off the middle of a held handle of this thickness.

        0 for fingers that close evenly; the jaw of a claw that does not move lies on the handle.
        """
        return 0.0 if self.gripper_kind == "parallel" else self.fixed_jaw - thickness / 2

    def room(self, thickness: float) -> float:
        """How far (m, along -y) the hand stays off its hold until it closes, for jaws to clear the handle."""
        return (
            0.0 if self.gripper_kind == "parallel" else min(_JAW_ROOM, max(self.stroke - thickness, 0.0) / 2)
        )


def load_spec(path: Path) -> RobotSpec:
    """Read a robot description.

    Args:
        path: the TOML file; `model` in it is relative to its folder.

    Raises:
        InputError: the file is missing, not TOML, lacks a section (such as the gripper) or a key, or has one
            that is not known.
    """
    try:
        raw = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as e:
        raise InputError(f"robot file {path} can't be read ({e.strerror})", "give a .toml robot file") from e
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as e:
        raise InputError(f"robot file {path} is not TOML: {e}") from e
    check_keys(raw, _TOP, "", path)
    sections = {s: section(raw, s, path) for s in ("arm", "base", "tool", "gripper")}
    check_keys(sections["arm"], _ARM, "arm.", path)
    check_keys(
        sections["base"],
        _BASE | (_PLANAR if sections["base"].get("kind") == "planar" else set()),
        "base.",
        path,
    )
    check_keys(sections["tool"], _TOOL, "tool.", path)
    claw = _CLAW if sections["gripper"].get("kind") == "claw" else set()
    check_keys(sections["gripper"], _GRIPPER | claw, "gripper.", path)
    try:
        return _build(raw, sections, path)
    except KeyError as e:
        raise InputError(
            f"robot file {path} lacks the key {e.args[0]!r}", "compare it with franka.toml"
        ) from e
    except (TypeError, ValueError) as e:
        raise InputError(f"robot file {path} has a value of the wrong kind: {e}") from e


def _build(raw: dict[str, Any], s: dict[str, dict[str, Any]], path: Path) -> RobotSpec:
    arm, base, tool, gripper = s["arm"], s["base"], s["tool"], s["gripper"]
    model = locate(str(raw["model"]), path.parent)
    planar, claw = base["kind"] == "planar", gripper.get("kind") == "claw"
    nearest, farthest = base["distance"]

    def joined(key: str) -> list[Any]:
        return [*(base[key] if planar else []), *arm[key]]

    return RobotSpec(
        name=str(raw["name"]),
        description=str(raw.get("description", "")),
        model=model,
        arm_joints=tuple(joined("joints")),
        arm_actuators=tuple(joined("actuators")),
        velocity=np.asarray(joined("velocity"), dtype=np.float64),
        acceleration=np.asarray(joined("acceleration"), dtype=np.float64),
        effort=np.asarray(joined("effort"), dtype=np.float64),
        home=np.asarray([0.0] * (3 if planar else 0) + list(arm["home"]), dtype=np.float64),
        base_kind=str(base["kind"]),
        base_body=str(base["body"]),
        footprint=float(base["footprint"]),
        distance=(float(nearest), float(farthest)),
        tool=str(tool["site"]),
        palm=float(tool["palm"]),
        palm_width=float(tool["palm_width"]),
        tip=float(tool["tip"]),
        gripper_kind=str(gripper["kind"]),
        gripper_actuator=str(gripper["actuator"]),
        gripper_joints=tuple(gripper["joints"]),
        finger_bodies=tuple(gripper["bodies"]),
        stroke=float(gripper["stroke"]),
        force=float(gripper["force"]),
        base_joints=tuple(base["joints"]) if planar else (),
        jaw_open=float(gripper["open"]) if claw else 0.0,
        jaw_closed=float(gripper["closed"]) if claw else 0.0,
        lever=float(gripper["lever"]) if claw else 1.0,
        fixed_jaw=float(gripper["fixed_jaw"]) if claw else 0.0,
        tool_body=str(tool.get("body", "")),
        tool_position=tuple(float(v) for v in tool.get("position", (0, 0, 0))),
        tool_quat_wxyz=tuple(float(v) for v in tool.get("quat_wxyz", (1, 0, 0, 0))),
        stiffness=tuple(float(v) for v in arm.get("stiffness", ())),
        damping=tuple(float(v) for v in arm.get("damping", ())),
        looks=read_looks(raw["looks"], path) if "looks" in raw else None,
    )
