"""Finds robot model files on this machine. Nothing is imported from other packages, nothing is downloaded.

The search goes from what the user said to what happens to be installed: beside the robot file, the folder
named by FUNTWIN_MENAGERIE (a checkout of MuJoCo Menagerie), robot_descriptions' cache, packages.
"""

from __future__ import annotations

import logging
import os
from collections.abc import Iterator
from importlib.metadata import distributions
from pathlib import Path, PurePosixPath

from twin.errors import InputError

MENAGERIE = "FUNTWIN_MENAGERIE"
_LOG = logging.getLogger(__name__)


def locate(model: str, beside: Path) -> Path:
    """The file of a `model`, a relative path such as "panda.xml" or "franka_emika_panda/panda.xml".

    Raises InputError when the path leaves the folders it is looked for in, or no folder has it.
    """
    relative = below(model)
    found = find(model, beside) or (_installed(relative) if len(relative.parts) > 1 else None)
    if found is None:
        raise InputError(
            f"robot file names the model {model}, which is not beside it",
            f"put it there, or set {MENAGERIE} to a checkout that has it",
        )
    if found.parent != (beside / model).parent:
        _LOG.info("robot model %s from %s", model, found)
    return found


def find(model: str, beside: Path) -> Path | None:
    """The same file beside the robot file or in a checkout, or None. Installed packages take a second.

    Raises InputError when the path leaves the folders it is looked for in, or FUNTWIN_MENAGERIE names none.
    """
    relative = below(model)
    for root in _folders(beside):
        if (root / relative).is_file():
            return root / relative
    return None


def below(model: str) -> PurePosixPath:
    """The path of a model file as one that stays below a folder. Raises InputError for one that does not."""
    relative = PurePosixPath(model)
    if relative.is_absolute() or ".." in relative.parts or not relative.parts:
        raise InputError(
            f"robot model {model!r} must be a path below the robot file's folder or below a Menagerie checkout",
            "give it without a leading / and without ..",
        )
    return relative


def _folders(beside: Path) -> Iterator[Path]:
    """Where to look, in order; what lies beside the robot file needs no look at the user's home."""
    yield beside
    yield from checkouts()


def checkouts() -> list[Path]:
    """Folders of MuJoCo Menagerie on this machine, the user's own first."""
    cache = Path(os.environ.get("ROBOT_DESCRIPTIONS_CACHE", "~/.cache/robot_descriptions")).expanduser()
    named = os.environ.get(MENAGERIE)
    if named and not Path(named).expanduser().is_dir():
        raise InputError(f"{MENAGERIE} names {named}, which is no folder", "unset it or correct it")
    folders = [Path(named).expanduser()] if named else []
    return [*folders, *(f for f in (cache / "mujoco_menagerie",) if f.is_dir())]


def _installed(relative: PurePosixPath) -> Path | None:
    """The first file, by package name, of an installed package whose path ends with `relative`."""
    tail = relative.parts
    for package in sorted(distributions(), key=lambda d: str(d.name)):
        for file in package.files or ():
            if file.parts[-len(tail) :] == tail:
                path = Path(str(package.locate_file(file)))
                if path.is_file():
                    return path
    return None
