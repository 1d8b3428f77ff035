"""DIR/units.jsonl: what became of each unit, a line each, written durably and never changed."""

from __future__ import annotations

import fcntl
import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from twin.errors import InputError
from twin.files.room import kept

JOURNAL = "units.jsonl"
# Bytes that a line takes at most; most take one or two thousand. Chosen by us.
_LINE = 16_384


def append(folder: Path, row: Mapping[str, Any]) -> None:
    """Add a line, whole or not at all as far as a reader sees; other processes may add theirs meanwhile.

    Raises OSError that names the file, as of a full disk; the file then is as it was.
    """
    path = folder / JOURNAL
    line = json.dumps(row, ensure_ascii=False, allow_nan=False) + "\n"
    with path.open("ab", buffering=0) as file:
        fcntl.lockf(file, fcntl.LOCK_EX)  # of other hosts too, where the file system tells them
        end = file.seek(0, os.SEEK_END)
        if end and not _ends_whole(path):
            line = "\n" + line  # somebody was killed in the middle of a line
        left = line.encode()
        try:
            while left:  # a disk that fills takes a part of it
                left = left[file.write(left) :]
            os.fsync(file.fileno())
        except OSError as e:
            file.truncate(end)
            raise OSError(e.errno, e.strerror, str(path)) from e


def has_room(folder: Path, lines: int) -> bool:
    """Keep room on the disk for so many lines more; False where it is full."""
    return kept(folder / JOURNAL, lines * _LINE)


def _ends_whole(path: Path) -> bool:
    with path.open("rb") as file:
        file.seek(-1, os.SEEK_END)
        return file.read(1) == b"\n"


def latest(folder: Path) -> dict[str, dict[str, Any]]:
    """The last row of each unit by its id. A line that was cut off in the middle says nothing.

    Raises InputError for a file that can't be read.
    """
    path = folder / JOURNAL
    if not path.is_file():
        return {}
    try:
        lines = path.read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError as e:
        raise InputError(f"{path} can't be read ({e.strerror})", "give the folder of a batch") from e
    rows: dict[str, dict[str, Any]] = {}
    for line in lines:
        try:
            row = json.loads(line)
        except ValueError:
            continue
        if isinstance(row, dict) and isinstance(row.get("id"), str):
            rows[row["id"]] = row
    return rows
