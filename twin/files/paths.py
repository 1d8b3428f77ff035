"""What public functions take for a path, and whether a folder can be written, before hours of work."""

from __future__ import annotations

import errno
import os
import tempfile
from pathlib import Path

from twin.errors import InputError

AnyPath = str | os.PathLike[str]  # each function makes a Path of it in its first line


def require_writable(folder: Path) -> None:
    """Raises InputError unless files can be written into the folder, which need not exist; nothing is left.

    By trying: permissions say nothing for root or for file systems that can't be written at all.
    """
    try:
        here = folder.absolute()
        while not here.exists():
            here = here.parent
        if not here.is_dir():
            raise NotADirectoryError(errno.ENOTDIR, os.strerror(errno.ENOTDIR))
        Path(tempfile.mkdtemp(prefix=".try-", dir=here)).rmdir()
    except OSError as e:
        raise InputError(
            f"{folder} can't be written: {e.strerror}", "give another folder, one that you may write"
        ) from e
