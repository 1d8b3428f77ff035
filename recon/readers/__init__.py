"""Readers: one file per recording layout, and the table that finds the right one.

To add a layout, write a class with `recognises` and `open` and put an instance of it into `READERS`. Formats that are
recognised but not read stand in `unread.UNREAD` with what to do about them.
"""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path
from typing import Protocol

from recon.readers.files import listing
from recon.readers.native import NativeReader
from recon.readers.record3d import Record3DReader
from recon.readers.tum import TumReader
from recon.readers.unread import UNREAD, refuse_unread, refuse_unread_inside
from recon.recording import Recording
from twin.errors import InputError, nearest_name

__all__ = ["READERS", "UNREAD", "Reader", "open_recording"]


class Reader(Protocol):
    """One recording layout."""

    @property
    def layout(self) -> str:
        """One line that tells what the layout looks like."""
        ...

    def recognises(self, path: Path) -> bool:
        """Whether the path looks like this layout; quick, never raises for an existing path."""
        ...

    def open(self, path: Path) -> Recording:
        """Open the recording. Raises InputError naming the file, the value and the remedy."""
        ...


# The first one that recognises a path opens it: the native layout is the most general and comes last.
READERS: dict[str, Reader] = {
    "record3d": Record3DReader(),
    "tum": TumReader(),
    "native": NativeReader(),
}


def open_recording(path: Path | str, layout: str | None = None) -> Recording:
    """Open a recording with the reader named `layout`, or with the first that recognises it.

    Raises InputError for a path that does not exist, an unknown layout name, a format that is recognised but not read (it
    says what to do), or a layout nobody recognises.
    """
    path = Path(path)
    if layout is not None and layout not in READERS:
        near = nearest_name(layout, list(READERS))
        raise InputError(
            f"there is no recording layout {layout!r}",
            (f"did you mean {near!r}? " if near else "") + f"known: {', '.join(READERS)}",
        )
    if not path.exists():
        raise InputError(f"recording {path} does not exist", "check the path")
    if not os.access(path, os.R_OK | os.X_OK if path.is_dir() else os.R_OK):
        raise InputError(f"recording {path} can't be read", "change its permissions, or copy it")
    return replace(_reader(path, layout).open(path), path=path)


def _reader(path: Path, layout: str | None) -> Reader:
    if layout is not None:
        return READERS[layout]
    refuse_unread(path)
    for reader in READERS.values():
        if reader.recognises(path):
            return reader
    refuse_unread_inside(path)
    there = f"it holds {listing(path)}" if path.is_dir() else f"a file of {path.stat().st_size} bytes"
    known = "; ".join(f"{name}: {reader.layout}" for name, reader in READERS.items())
    raise InputError(f"{path} is no recording known here ({there})", f"use one of these layouts: {known}")
