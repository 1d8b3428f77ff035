"""Environments of the independent programs that judge an export and can't share ours.

Each is a virtual environment of its own under `cache_root()`, made once by `twin engines --install` from the
pinned packages in twin/engines/<name>.txt. Nothing is fetched unless the user asks for it.
"""

from __future__ import annotations

import hashlib
import os
import shutil
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from twin.errors import InputError, MissingDependencyError, nearest_name

_DONE = ".complete"  # written last: an installation that was interrupted does not count
_SECONDS = 3600


@dataclass(frozen=True)
class Engine:
    """An environment: its name and what it is for."""

    name: str
    purpose: str

    @property
    def requirements(self) -> Path:
        """File of pinned packages."""
        return Path(__file__).with_name(f"{self.name}.txt")

    @property
    def folder(self) -> Path:
        """Where the environment lies; another set of pinned packages gets another folder."""
        key = hashlib.sha256(self.requirements.read_bytes() + sys.version.encode()).hexdigest()[:8]
        return cache_root() / f"{self.name}-{key}"

    @property
    def installed(self) -> bool:
        return (self.folder / _DONE).is_file()


ENGINES: dict[str, Engine] = {
    e.name: e
    for e in (
        Engine("drake", "Drake reads URDF and MJCF"),
        Engine("newton", "Newton reads URDF, MJCF and USD"),
        Engine("physx", "PhysX, the engine of Isaac Sim, reads USD"),
        Engine("pybullet", "PyBullet reads URDF"),
        Engine("sapien", "SAPIEN reads URDF"),
        Engine("validators", "NVIDIA's USD validator and the SimReady profiles"),
    )
}


def cache_root() -> Path:
    """Folder of all environments: $FUNTWIN_ENGINES, else the user's cache folder."""
    if chosen := os.environ.get("FUNTWIN_ENGINES"):
        return Path(chosen)
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "funtwin" / "engines"


def engine(name: str) -> Engine:
    """The engine of that name. Raises InputError with the nearest name."""
    if name not in ENGINES:
        close = nearest_name(name, list(ENGINES))
        hint = f"did you mean {close!r}? " if close else ""
        raise InputError(f"engine {name!r} is not known", f"{hint}known: {', '.join(ENGINES)}")
    return ENGINES[name]


def interpreter(name: str) -> Path:
    """Python of an installed environment. Raises MissingDependencyError with the command that installs it."""
    e = engine(name)
    if not e.installed:
        raise MissingDependencyError(
            f"the environment of engine {name!r} is not in {e.folder}",
            f"run `twin engines --install {name}`",
        )
    return e.folder / "bin" / "python"


def install(names: Sequence[str]) -> None:
    """Create the environments still missing. Raises InputError if one can't be made; needs the network."""
    for name in names:
        e = engine(name)
        if e.installed:
            continue
        try:
            shutil.rmtree(e.folder, ignore_errors=True)
            e.folder.parent.mkdir(parents=True, exist_ok=True)
            _run([sys.executable, "-m", "venv", str(e.folder)], e)
            python = str(e.folder / "bin" / "python")
            _run([python, "-m", "pip", "install", "-q", "--no-deps", "-r", str(e.requirements)], e)
            (e.folder / _DONE).touch()
        except OSError as error:
            raise InputError(
                f"{e.folder} can't be written: {error}", "set FUNTWIN_ENGINES to a folder that can be"
            ) from error


def _run(command: list[str], e: Engine) -> None:
    done = subprocess.run(command, capture_output=True, text=True, timeout=_SECONDS, check=False)  # noqa: S603
    if done.returncode:
        said = [x for x in done.stderr.splitlines() if x.strip()][-1:] or [f"exit code {done.returncode}"]
        raise InputError(
            f"the environment of engine {e.name!r} can't be made: {said[0]}",
            "check the network and the space on disk, then install again",
        )
