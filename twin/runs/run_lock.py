"""One process at a time works on a run folder."""

from __future__ import annotations

import errno
import fcntl
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO

from twin.errors import InputError

# Record locks belong to the process and end with it, however it ends: forked workers that outlive it don't
# keep the folder. Closing any handle drops the lock: a process opens it once and counts claims here.
_HELD: dict[Path, tuple[IO[str], int]] = {}


@contextmanager
def claimed(run: Path) -> Iterator[None]:
    """Hold an existing run folder for this process, which may claim it again while it does.

    Raises InputError when another process holds it or it can't be written.
    """
    claim(run)
    try:
        yield
    finally:
        release(run)


def claim(run: Path) -> None:
    """Hold `run` until `release` was called as often."""
    path = run.resolve() / ".lock"
    if path in _HELD:
        handle, count = _HELD[path]
        _HELD[path] = handle, count + 1
        return
    try:
        handle = _locked(path)
    except BlockingIOError as e:
        owner = f" ({e.strerror})" if e.strerror else ""
        raise InputError(
            f"run folder {run} is in use by another process{owner}", "wait for it or give another folder"
        ) from e
    except OSError as e:
        raise InputError(
            f"run folder {run} can't be written ({e.strerror})", "give a folder that you may write"
        ) from e
    _HELD[path] = handle, 1


def release(run: Path) -> None:
    """Give up one claim; with the last one, other processes may have the folder."""
    path = run.resolve() / ".lock"
    handle, count = _HELD.pop(path)
    if count > 1:
        _HELD[path] = handle, count - 1
    else:
        path.unlink(missing_ok=True)
        handle.close()


def _locked(path: Path) -> IO[str]:
    """The lock's file, opened and locked. Raises BlockingIOError that tells the owner's process number."""
    while True:
        handle = path.open("a+", encoding="ascii")
        try:
            fcntl.lockf(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as e:
            handle.seek(0)
            owner = handle.read(20).strip()
            handle.close()
            if e.errno in (errno.EACCES, errno.EAGAIN):
                raise BlockingIOError(e.errno, f"process {owner}" if owner else "") from e
            raise
        # Its owner may have removed the file between the two calls: then this lock is on nothing.
        if path.exists() and os.path.samestat(path.stat(), os.fstat(handle.fileno())):
            handle.truncate(0)
            handle.write(str(os.getpid()))
            handle.flush()
            return handle
        handle.close()
