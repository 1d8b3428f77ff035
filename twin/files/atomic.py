"""Files and folders that change at once: the new content is written beside the old, then takes its place.

Whenever the process dies, the old or the new content stands under the name, whole. What is not ours in a
folder goes along into the new one: it is linked, not copied, so its bytes, names and times stay.
"""

from __future__ import annotations

import ctypes
import errno
import fcntl
import glob
import os
import shutil
import tempfile
from collections.abc import Collection, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

_EXCHANGE = 2  # RENAME_EXCHANGE of renameat2(2)
_AT_CWD = -100  # AT_FDCWD


def write_file(path: Path, data: bytes) -> None:
    """Write a file, in a folder made if need be; an existing file is replaced at once and gives its mode.

    Raises OSError that names the file.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    tidy(path)
    handle, name = tempfile.mkstemp(prefix=f".{path.name}-", suffix=".tmp", dir=path.parent)
    try:
        with os.fdopen(handle, "wb") as out:
            fcntl.flock(out, fcntl.LOCK_EX)
            out.write(data)
            out.flush()
            os.fsync(out.fileno())
            Path(name).chmod(path.stat().st_mode & 0o777 if path.exists() else 0o644)
            Path(name).replace(path)
    except OSError as e:  # a full disk is told without a name, and the temporary one tells nobody anything
        raise OSError(e.errno, e.strerror, str(path)) from e
    finally:
        Path(name).unlink(missing_ok=True)


@contextmanager
def staging(folder: Path) -> Iterator[Path]:
    """An empty folder beside `folder` to write its next content into; gone at the end, whatever happened."""
    folder.parent.mkdir(parents=True, exist_ok=True)
    tidy(folder)
    temporary = Path(tempfile.mkdtemp(prefix=f".{folder.name}-", suffix=".tmp", dir=folder.parent))
    handle = os.open(temporary, os.O_RDONLY)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX)
        staged = temporary / "new"
        staged.mkdir()
        yield staged
    finally:
        _remove(temporary)
        os.close(handle)


def put(staged: Path, folder: Path, ours: Collection[str]) -> None:
    """Put what was written into `staged` in the place of `folder`.

    Args:
        staged: from `staging(folder)`.
        ours: paths in `folder` (relative, with /) that the new content replaces or drops; everything else in
            it stays.

    Raises OSError, FileExistsError if a path not ours is also in `staged`; the folder then is as it was.
    """
    if not folder.exists():
        staged.rename(folder)
        return
    _carry(folder, staged, [path for path in contents(folder) if path not in ours])
    shutil.copymode(folder, staged)
    if not _exchanged(staged, folder):
        aside = staged.parent / "old"
        folder.rename(aside)
        staged.rename(folder)


def contents(folder: Path) -> list[str]:
    """Everything in a folder but filled folders: relative paths with /, sorted. Links are not followed.

    Raises OSError for a folder that can't be listed.
    """
    found = []
    for place, folders, files in os.walk(folder, onerror=_raise):
        here = Path(place)
        links = [name for name in folders if (here / name).is_symlink()]
        inner = [name for name in folders if name not in links]
        found += [(here / name).relative_to(folder).as_posix() for name in (*files, *links)]
        if here != folder and not (files or links or inner):
            found.append(here.relative_to(folder).as_posix())
    return sorted(found)


def _raise(error: OSError) -> None:
    raise error


def _carry(old: Path, new: Path, paths: Collection[str]) -> None:
    """Bring entries of `old` into `new`, folders with their mode and times."""
    made: list[str] = []
    for path in paths:
        for parent in [p.as_posix() for p in reversed(Path(path).parents) if p != Path()]:
            if not (new / parent).is_dir():
                (new / parent).mkdir()
                made.append(parent)
        source, target = old / path, new / path
        if source.is_dir() and not source.is_symlink():
            if not target.is_dir():
                target.mkdir()
                made.append(path)
        else:
            _link(source, target)
    for path in reversed(made):
        shutil.copystat(old / path, new / path)


def _link(source: Path, target: Path) -> None:
    if target.exists() or target.is_symlink():
        raise FileExistsError(errno.EEXIST, "is not ours and in the way", str(source))
    try:
        os.link(source, target, follow_symlinks=False)
    except OSError as e:
        if e.errno not in (errno.EPERM, errno.EXDEV, errno.EMLINK, errno.ENOTSUP, errno.ENOSYS, errno.EACCES):
            raise
        shutil.copy2(source, target, follow_symlinks=False)  # a file system without hard links


def _exchanged(one: Path, other: Path) -> bool:
    """Swap two folders at once; False where kernel or file system can't."""
    rename = getattr(ctypes.CDLL(None, use_errno=True), "renameat2", None)
    if rename is None:
        return False
    if rename(_AT_CWD, os.fsencode(one), _AT_CWD, os.fsencode(other), _EXCHANGE) == 0:
        return True
    code = ctypes.get_errno()
    if code in (errno.ENOSYS, errno.EINVAL, errno.ENOTSUP):
        return False
    raise OSError(code, os.strerror(code), str(other))


def _remove(folder: Path) -> None:
    """Remove a folder with all in it, also folders in it that their owner made unwritable."""
    for place, inner, _ in os.walk(folder):
        for name in inner:
            if not Path(place, name).is_symlink():
                with suppress(OSError):
                    Path(place, name).chmod(0o700)
    shutil.rmtree(folder, ignore_errors=True)


def tidy(path: Path) -> None:
    """Remove what killed processes left beside a path; a lock on each tells whether its process lives.

    If a process died between setting a folder aside and putting the new one there, the old one comes back.
    """
    for left in path.parent.glob(f".{glob.escape(path.name)}-*.tmp"):
        with suppress(OSError):
            handle = os.open(left, os.O_RDONLY)
            try:
                fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
                if (left / "old").is_dir() and not path.exists():
                    (left / "old").rename(path)
                if left.is_dir():
                    _remove(left)
                else:
                    left.unlink()
            finally:
                os.close(handle)
