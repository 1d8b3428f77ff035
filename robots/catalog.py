"""Finds a robot by name or path."""

from __future__ import annotations

import logging
from pathlib import Path

from robots.spec import RobotSpec, load_spec
from twin.errors import InputError, nearest_name

_LOG = logging.getLogger(__name__)
_ASSETS = Path(__file__).resolve().parent.parent / "assets" / "robots"


def names() -> list[str]:
    """Names of the robots that ship with the project."""
    return sorted(p.stem for p in _ASSETS.glob("*.toml"))


def resolve(robot: str | Path) -> RobotSpec:
    """The robot of this name or file.

    Args:
        robot: a bundled name (`names()`), a `.toml` robot file, or an MJCF file with its `.toml` beside it.

    Raises:
        InputError: nothing of that name; the message lists what exists.
    """
    path = Path(robot)
    if path.suffix.lower() in {".xml", ".urdf", ".toml"} or path.is_file():
        toml = path.with_suffix(".toml")
        if path.suffix.lower() != ".toml" and path.is_file() and not toml.is_file():
            raise InputError(
                f"robot model {path} has no {toml.name} beside it that names its arm, tool and gripper",
                f"write one like {_ASSETS / 'franka.toml'}",
            )
        _LOG.info("robot %s from %s", path.stem, toml)
        return load_spec(toml)
    known = names()
    if str(robot) not in known:
        near = nearest_name(str(robot), known)
        raise InputError(
            f"there is no robot {str(robot)!r}",
            f"known robots: {', '.join(known)}{f'; did you mean {near!r}?' if near else ''}"
            " (or give the path of a .toml robot file)",
        )
    _LOG.info("robot %s is the bundled model", robot)
    return load_spec(_ASSETS / f"{robot}.toml")
