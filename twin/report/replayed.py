"""A robot's replay as the page shows it: where each link of the robot and each part was, over time."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from twin.errors import InputError
from twin.files.text import read_json, write_text
from twin.geometry import Array
from twin.scene import Revolute, Twin

MOTION, LINKS = "motion.json", "robot.glb"
_DIGITS = 5  # of metres, radians and quaternions: a hundredth of a millimetre
_SAME = 1e-6  # of joints, m and rad: the digits of a twin that was written and read


@dataclass(frozen=True, eq=False)
class Replayed:
    """A robot moves a part; n samples.

    Attributes:
        robot: its name.
        part: its name.
        start: its state at the begin, m or rad, as `states` count them.
        goal: the state that was asked for.
        ok: whether the replay did what it was asked.
        times: (n,) s.
        states: of each part of the twin, (n,) m or rad.
        joints: of each joint of the replay's scene.xml, by its name there, (n,) m or rad.
        links: of each body of the robot that is drawn, by its name in scene.xml: position (n, 3) m and
            quaternion (n, 4), x y z w, in the twin's world. The meshes in robot.glb are in its frame.
        column: radius, length and middle (x, y, z) m of the column below the base, along z of the link
            that stands on it; None without one.
        furniture: the joints of the twin that was played with, see `furniture`.
    """

    robot: str
    part: str
    start: float
    goal: float
    ok: bool
    times: Array
    states: Mapping[str, Array]
    joints: Mapping[str, Array]
    links: Mapping[str, tuple[Array, Array]]
    column: tuple[float, ...] | None
    furniture: Mapping[str, Any]

    @property
    def title(self) -> str:
        """What is seen, in words, such as "Franka opens drawer"."""
        robot = self.robot[:1].upper() + self.robot[1:]
        opens = self.goal >= self.start
        if self.ok:
            return f"{robot} {'opens' if opens else 'closes'} {self.part}"
        return f"{robot} fails to {'open' if opens else 'close'} {self.part}"

    def save(self, folder: Path) -> None:
        """Write motion.json."""
        links = {
            name: {"positions": rounded(at), "quaternions": rounded(turn)}
            for name, (at, turn) in self.links.items()
        }
        told = {
            **{k: getattr(self, k) for k in ("robot", "part", "start", "goal", "ok", "column", "furniture")},
            "times": rounded(self.times),
            "states": {k: rounded(v) for k, v in self.states.items()},
            "joints": {k: rounded(v) for k, v in self.joints.items()},
            "links": links,
        }
        write_text(folder / MOTION, json.dumps(told, allow_nan=False, separators=(",", ":")) + "\n")


def load_replayed(folder: Path) -> Replayed | None:
    """What `Replayed.save` wrote; None where a replay of an earlier version left nothing.

    Raises InputError where the file is not what was written.
    """
    path = folder / MOTION
    if not path.is_file() or not (folder / LINKS).is_file():
        return None
    told = read_json(path)
    try:
        times = _column(told["times"], None)
        n = len(times)
        links = {
            str(k): (_column(v["positions"], n, 3), _column(v["quaternions"], n, 4))
            for k, v in told["links"].items()
        }
        column = told["column"]
        return Replayed(
            robot=str(told["robot"]),
            part=str(told["part"]),
            start=float(told["start"]),
            goal=float(told["goal"]),
            ok=bool(told["ok"]),
            times=times,
            states={str(k): _column(v, n) for k, v in told["states"].items()},
            joints={str(k): _column(v, n) for k, v in told["joints"].items()},
            links=links,
            column=None if column is None else tuple(_column(column, 5).tolist()),
            furniture=dict(told["furniture"]),
        )
    except (KeyError, TypeError, ValueError, AttributeError) as e:
        raise InputError(f"{path} is damaged ({type(e).__name__}: {e})", "run `twin replay` again") from e


def furniture(twin: Twin) -> dict[str, list[Any]]:
    """Of each part what a replay depends on: kind, limits, axis and, of a hinge, a point of it."""
    return {
        p.name: [
            p.joint.kind, p.joint.lower, p.joint.upper, *p.joint.axis.tolist(),
            *(p.joint.pivot.tolist() if isinstance(p.joint, Revolute) else ()),
        ]
        for p in twin.parts
    }  # fmt: skip


def is_of(replayed: Replayed, twin: Twin) -> bool:
    """Whether a replay was played with this twin: the same parts, the same joints."""
    now, then = furniture(twin), replayed.furniture
    return now.keys() == then.keys() and all(
        now[k][0] == then[k][0] and len(now[k]) == len(then[k]) and np.allclose(now[k][1:], then[k][1:], 0, _SAME)
        for k in now
    )  # fmt: skip


def rounded(values: Array) -> Any:
    """JSON numbers, of five digits after the point."""
    return (np.round(np.asarray(values, np.float64), _DIGITS) + 0.0).tolist()


def _column(values: Any, *shape: int | None) -> Array:
    """Finite numbers of a shape. Raises ValueError where they are none."""
    out = np.array(values, dtype=np.float64)
    if out.ndim != len(shape) or any(n not in (None, m) for n, m in zip(shape, out.shape, strict=True)):
        raise ValueError(f"numbers of shape {out.shape}, not {shape}")
    if not len(out) or not np.all(np.isfinite(out)):
        raise ValueError("no finite numbers")
    return out
