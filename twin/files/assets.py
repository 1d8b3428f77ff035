"""Files that ship with Funtwin: robots, materials, scenes, a recording.

They lie in assets/ of a checkout, and inside the package (twin/_assets) where a wheel was installed;
everything that reads them asks here. assets/MANIFEST.toml lists them with source, licence and checksum.
"""

from __future__ import annotations

import hashlib
import tomllib
from pathlib import Path

from twin.errors import InputError

_PACKAGE = Path(__file__).resolve().parents[1]
REMEDY = "install the package funtwin again, or in a checkout restore the folder assets/"


def places() -> tuple[Path, ...]:
    """Folders that may hold them, the first existing counts: as setup.py installs them, and in a checkout."""
    return _PACKAGE / "_assets", _PACKAGE.parent / "assets"


def asset(name: str) -> Path:
    """Path of the file or folder `name`, relative to assets/. Raises InputError when it is not there."""
    place = next((p for p in places() if p.is_dir()), None)
    if place is None:
        raise InputError(
            f"the files that ship with Funtwin are neither in {' nor in '.join(map(str, places()))}", REMEDY
        )
    if not (place / name).exists():
        raise InputError(f"{place / name}, which ships with Funtwin, is missing", REMEDY)
    return place / name


def faults() -> dict[str, str]:
    """What is "missing" or "altered" of the manifest's files and folders, by name; empty if all is well.

    Raises InputError when the manifest itself is missing or can't be read.
    """
    found = {}
    for name, checksum in _listed().items():
        try:
            told = "" if digest(asset(name)) == checksum else "altered"
        except InputError:
            told = "missing"
        if told:
            found[name] = told
    return found


def digest(path: Path) -> str:
    """SHA-256 of a file; of a folder, of the lines "<sha256>  <relative path>" sorted by path."""
    if path.is_file():
        return hashlib.sha256(path.read_bytes()).hexdigest()
    names = sorted(p.relative_to(path).as_posix() for p in path.rglob("*") if p.is_file())
    lines = "".join(f"{digest(path / name)}  {name}\n" for name in names)
    return hashlib.sha256(lines.encode()).hexdigest()


def _listed() -> dict[str, str]:
    """Name -> checksum of what the manifest lists."""
    path = asset("MANIFEST.toml")
    try:
        rows = tomllib.loads(path.read_text(encoding="utf-8"))["asset"]
        return {row["path"]: row["sha256"] for row in rows}
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError, KeyError, TypeError) as e:
        raise InputError(f"{path} can't be read: {e!r}", REMEDY) from e
