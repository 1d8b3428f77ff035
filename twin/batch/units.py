"""The units of a batch: one recording each, with an identity that holds on every machine."""

from __future__ import annotations

import hashlib
import os
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from twin.errors import InputError
from twin.names import legal_name

_RANDOM = re.compile(r"(random|walk):(\d{1,9})(?:-(\d{1,9}))?", re.ASCII)
# Files that are recordings, of those in a folder; others, such as README.md, are given by their path.
_FILES = (".r3d", ".mkv", ".bag", ".db3", ".mcap", ".sens")
_MOST = 100_000  # units of one text, more is a slip; chosen by us
# Bytes at either end of each file that tell it from another of the same size. Chosen by us.
_ENDS = 4096
# Files of a folder that are looked into; of the others name and size tell. Chosen by us.
_LOOKED_INTO = 32


@dataclass(frozen=True)
class Unit:
    """One recording. id: a legal name that depends on its name and content alone. source: what was given.

    recording: where it lies; None for one that is rendered from a seed. rendered: options of `twin simulate`.
    """

    id: str
    source: str
    recording: Path | None = None
    rendered: tuple[str, ...] = ()


def units_of(given: Sequence[str]) -> list[Unit]:
    """The units of paths of recordings, folders of some (FOLDER/*), lists (@FILE, a line each) and seeds
    (random:0-99, walk:7), each once, in their order.

    Raises InputError for what is nothing of these.
    """
    found: dict[str, Unit] = {}
    for text in given:
        for unit in _units(text, Path()):
            found.setdefault(unit.id, unit)
    if not found:
        raise InputError("there is no recording", "give paths, FOLDER/*, @FILE, random:0-99 or walk:0-9")
    return list(found.values())


def _units(text: str, place: Path, lists: bool = True) -> Iterator[Unit]:
    match = _RANDOM.fullmatch(text)
    if match is not None:
        yield from _seeds(match[1], int(match[2]), int(match[3] or match[2]))
    elif text.startswith("@") and lists:
        path = place / text[1:]
        try:
            lines = path.read_text(encoding="utf-8").splitlines()
        except (OSError, UnicodeDecodeError) as e:
            raise InputError(
                f"the list {path} can't be read ({e})", "give a text file, a recording a line"
            ) from e
        for line in lines:
            if (told := line.strip()) and not told.startswith("#"):
                yield from _units(told, path.parent, lists=False)
    elif text.endswith("/*"):
        folder = place / text[:-2]
        if not folder.is_dir():
            raise InputError(f"{folder} is no folder", "give one of recordings")
        for path in sorted(p for p in folder.iterdir() if not p.name.startswith(".")):
            if path.is_dir() or path.suffix.lower() in _FILES:
                yield _of_path(path)
    else:
        yield _of_path(place / text)


def _seeds(kind: str, first: int, last: int) -> Iterator[Unit]:
    if last < first or last - first >= _MOST:
        raise InputError(
            f"{kind}:{first}-{last} is no range of seeds", f"give some in order, {_MOST} at most"
        )
    for seed in range(first, last + 1):
        yield Unit(f"{kind}_{seed:06d}", f"{kind}:{seed}", None, (f"--{kind}", str(seed)))


def _of_path(path: Path) -> Unit:
    if not path.exists():
        raise InputError(f"recording {path} does not exist", "check the path, or take it off the list")
    return Unit(f"{legal_name(path.stem)}_{_content(path)[:8]}", str(path), path)


def _content(path: Path) -> str:
    """Digest of names and sizes of all files, and of the ends of some of them: no recording is decoded."""
    told = hashlib.sha256()
    files = sorted(p for p in path.rglob("*") if p.is_file()) if path.is_dir() else [path]
    step = max(1, len(files) // _LOOKED_INTO)
    for k, file in enumerate(files):
        size = file.stat().st_size
        name = file.relative_to(path).as_posix() if path.is_dir() else ""
        told.update(f"{name}\0{size}\0".encode())
        if k % step == 0:
            with file.open("rb") as opened:
                told.update(opened.read(_ENDS))
                if size > _ENDS:
                    opened.seek(-_ENDS, os.SEEK_END)
                    told.update(opened.read(_ENDS))
    return told.hexdigest()


def shard(units: Sequence[Unit], text: str) -> list[Unit]:
    """Every n-th unit, from the i-th on, of i/n (0 to n - 1). Raises InputError for another text."""
    match = re.fullmatch(r"(\d+)/(\d+)", text, re.ASCII)
    if match is None or int(match[1]) >= int(match[2]):
        raise InputError(f"{text!r} is no shard", "give i/n with i from 0 to n - 1, such as 0/8")
    return list(units[int(match[1]) :: int(match[2])])
