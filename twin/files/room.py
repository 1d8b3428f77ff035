"""Room on a disk: kept ahead for what must be written, and whether none is left."""

from __future__ import annotations

import ctypes
import errno
import os
import tempfile
from pathlib import Path

# What a system says of a disk, or of a user's share of it, that is full.
FULL = (errno.ENOSPC, errno.EDQUOT)
_KEEP_SIZE = 1  # FALLOC_FL_KEEP_SIZE of fallocate(2)
_LIBC = ctypes.CDLL(None, use_errno=True)
_PAGE = os.sysconf("SC_PAGE_SIZE")


def kept(path: Path, size: int) -> bool:
    """Keep room for `size` bytes more at the end of a file, which is made if need be and grows by nothing.

    False where the disk is full. Where the file system keeps none ahead, its free room tells. Raises OSError
    that names the file.
    """
    try:
        with path.open("ab") as file:
            end = file.seek(0, os.SEEK_END)
            told = _LIBC.fallocate(
                file.fileno(), _KEEP_SIZE, ctypes.c_int64(end), ctypes.c_int64(max(size, 1))
            )
            code = ctypes.get_errno() if told else 0
        if code in (errno.EOPNOTSUPP, errno.ENOSYS):
            code = 0 if 1e6 * free_mb(path) >= size else errno.ENOSPC
        if code:
            raise OSError(code, os.strerror(code), str(path))
    except OSError as e:
        if e.errno in FULL:
            return False
        raise
    return True


def free_mb(path: Path) -> float:
    """MB that the disk of a path has left for this user."""
    disk = os.statvfs(path)
    return disk.f_bavail * disk.f_frsize / 1e6


def full(folder: Path) -> bool:
    """Whether the disk of a folder has less than 1 MB left, or does not take another page."""
    if free_mb(folder) < 1.0:
        return True
    try:
        with tempfile.TemporaryFile(dir=folder, buffering=0) as file:
            file.write(bytes(_PAGE))
            os.fsync(file.fileno())
    except OSError as e:
        return e.errno in FULL
    return False
