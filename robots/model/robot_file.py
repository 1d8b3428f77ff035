"""What every section of a robot file is held to: known keys, and sections that are there."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from twin.errors import InputError, nearest_name


def check_keys(values: dict[str, Any], known: set[str], where: str, path: Path) -> None:
    """Raise InputError, with the nearest known name, for an unknown key of section `where` ("arm.")."""
    for key in sorted(set(values) - known):
        near = nearest_name(key, sorted(known))
        raise InputError(
            f"robot file {path} has an unknown key '{where}{key}'",
            f"did you mean {where + near!r}?" if near else f"known: {', '.join(sorted(known))}",
        )


def section(raw: dict[str, Any], name: str, path: Path) -> dict[str, Any]:
    """The section of this name. Raises InputError when there is none."""
    found = raw.get(name)
    if not isinstance(found, dict):
        remedy = (
            "a robot without a gripper can't open anything: add its actuator, joints, bodies, stroke and force"
            if name == "gripper"
            else "compare it with franka.toml"
        )
        raise InputError(f"robot file {path} has no [{name}] section", remedy)
    return found
