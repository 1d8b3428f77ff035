"""How a robot looks, as data: the section [looks] of a robot file."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from robots.model.model_files import below
from robots.model.robot_file import check_keys
from twin.errors import InputError

_KEYS = {"model", "bodies", "joints", "hold", "left_out"}


@dataclass(frozen=True)
class Looks:
    """Another model's visuals that a robot wears in films, where that model is on the machine.

    Attributes:
        model: its file, a path below a checkout of MuJoCo Menagerie such as "franka_emika_panda/panda.xml".
        bodies: of each body of ours that is dressed, the bodies of that model whose visuals it wears; none
            where another body's visuals show it already.
        joints: our joint -> theirs, of those whose names differ.
        hold: joint of theirs that we don't have -> where it stands, rad or m.
        left_out: bodies of theirs whose visuals nobody wears.
        folder: that of the robot file, where the model is looked for first.
    """

    model: str
    bodies: dict[str, tuple[str, ...]]
    joints: dict[str, str] = field(default_factory=dict)
    hold: dict[str, float] = field(default_factory=dict)
    left_out: tuple[str, ...] = ()
    folder: Path = field(default=Path(), compare=False)

    def __post_init__(self) -> None:
        below(self.model)
        worn = Counter(b for names in self.bodies.values() for b in names)
        if not worn:
            raise InputError(
                "looks.bodies names no body of the model that is worn",
                'say which body wears what, such as bodies = { link0 = "link0" }',
            )
        twice = [b for b, count in worn.items() if count > 1] + sorted(set(worn) & set(self.left_out))
        if twice:
            raise InputError(
                f"looks names {twice[0]!r} twice", "each body is worn by one body of ours, or left out"
            )
        for name, state in self.hold.items():
            if not np.isfinite(state):
                raise InputError(f"looks.hold.{name} must be a finite number, got {state}")


def read_looks(raw: object, path: Path) -> Looks:
    """The section [looks] of the robot file `path`.

    Raises:
        InputError: a key is missing, not known, or has a value of the wrong kind; a body is named twice; a
            state is not finite; the model's path leaves the folders it is looked for in.
    """
    if not isinstance(raw, dict):
        raise _wrong(path, "must be a section, [looks]")
    check_keys(raw, _KEYS, "looks.", path)
    for key in ("model", "bodies"):
        if key not in raw:
            raise _wrong(path, f"lacks the key {key!r}")
    if not isinstance(raw["model"], str):
        raise _wrong(path, f"model must be a path, got {raw['model']!r}")
    hold = {}
    for name, state in _table(raw, "hold", path).items():
        if isinstance(state, bool) or not isinstance(state, int | float):
            raise _wrong(path, f"hold.{name} must be a number (rad or m), got {state!r}")
        hold[name] = float(state)
    joints = _table(raw, "joints", path)
    for name, theirs in joints.items():
        if not isinstance(theirs, str):
            raise _wrong(path, f"joints.{name} must be the name of a joint, got {theirs!r}")
    return Looks(
        model=raw["model"],
        bodies={b: _names(v, f"bodies.{b}", path) for b, v in _table(raw, "bodies", path).items()},
        joints=joints,
        hold=hold,
        left_out=_names(raw.get("left_out", []), "left_out", path),
        folder=path.parent,
    )


def _table(raw: dict[str, Any], key: str, path: Path) -> dict[str, Any]:
    table = raw.get(key, {})
    if not isinstance(table, dict):
        raise _wrong(path, f"{key} must be a table of names, got {table!r}")
    return table


def _names(value: object, key: str, path: Path) -> tuple[str, ...]:
    names = [value] if isinstance(value, str) else value
    if not isinstance(names, list) or not all(isinstance(n, str) for n in names):
        raise _wrong(path, f"{key} must be the name of a body or a list of names, got {value!r}")
    return tuple(names)


def _wrong(path: Path, what: str) -> InputError:
    return InputError(f"robot file {path}: looks {what}", "compare it with franka.toml, or leave [looks] out")
