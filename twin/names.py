"""Names that are legal, and mean the same, in URDF, MJCF and USD."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterable

from twin.errors import SceneError

_LEGAL = re.compile(r"[A-Za-z][A-Za-z0-9_]*\Z")
# "world" is the root frame of URDF and MJCF: a part of that name would collide with it.
_RESERVED = frozenset({"world"})


def is_legal_name(name: str) -> bool:
    """True when `name` is `[A-Za-z][A-Za-z0-9_]*` and not reserved."""
    return bool(_LEGAL.match(name)) and name.lower() not in _RESERVED


def require_legal(name: str) -> None:
    """Raises SceneError for a name that is not legal, with one that is."""
    if not is_legal_name(name):
        raise SceneError(f"name {name!r} is not legal in URDF, MJCF and USD", f"use {legal_name(name)!r}")


def legal_name(text: str, taken: Iterable[str] = ()) -> str:
    """Make a legal name from any text, unlike all in `taken` whatever the case (by a number)."""
    plain = unicodedata.normalize("NFKD", text).encode("ascii", "ignore").decode()
    base = re.sub(r"[^A-Za-z0-9]+", "_", plain).strip("_") or "part"
    if not base[0].isalpha() or base.lower() in _RESERVED:
        base = f"part_{base}"
    used = {t.lower() for t in taken}
    name, k = base, 2
    while name.lower() in used:
        name, k = f"{base}_{k}", k + 1
    return name


def several(names: str | Iterable[str]) -> list[str]:
    """The names; a text is one of them, so that `formats="mjcf"` is what it seems to be."""
    return [names] if isinstance(names, str) else list(names)


def unused(name: str, taken: Iterable[str]) -> str:
    """The name, with underscores behind it until it is none of those taken, whatever their case."""
    others = {t.lower() for t in taken}
    while name.lower() in others:
        name += "_"
    return name


def scene_file(twin: str) -> str:
    """Name of the file with floor and light beside a twin's MJCF: scene.xml, unless the twin has it."""
    return f"{unused('scene', [twin])}.xml"
