"""DIR/units.jsonl: what became of each unit, a line each, written durably and never changed."""

from __future__ import annotations

import fcntl
import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from twin.errors import InputError

JOURNAL = "units.jsonl"


def append(folder: Path, row: Mapping[str, Any]) -> None:
    """Add a line, whole or not at all as far as a reader sees; other processes may add theirs meanwhile."""
    line = json.dumps(row, ensure_ascii=False, allow_nan=False) + "\n"
    with (folder / JOURNAL).open("ab") as file:
        fcntl.lockf(file, fcntl.LOCK_EX)  # of other hosts too, where the file system tells them
        if file.tell() and not _ends_whole(folder / JOURNAL):
            file.write(b"\n")  # somebody was killed in the middle of a line
        file.write(line.encode())
        file.flush()
        os.fsync(file.fileno())


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
