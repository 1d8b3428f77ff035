"""Which files of a folder we wrote: a list with hashes, so that nobody else's work is replaced or lost."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Collection, Mapping
from pathlib import Path

from twin.errors import InputError
from twin.files.atomic import contents, put
from twin.files.text import read_json, write_json

LIST = "files.json"
_FORMAT = "funtwin-files/1"


def replace_own(staged: Path, folder: Path, overwrite: bool = False) -> None:
    """Put files written into `staged` (`twin.files.atomic.staging`) in the place of those we wrote before.

    What we no longer write goes; everything else stays. LIST in the folder says what is ours.

    Raises InputError like `refuse_edited`; OSError if it can't be written. Nothing has changed then.
    """
    folder = folder.resolve()
    fresh = hashes(staged)
    if not overwrite:
        refuse_edited(folder, fresh)
    write_json(staged / LIST, {"format": _FORMAT, "files": fresh})
    ours = {*_listed(folder), *fresh, LIST} if folder.is_dir() else set()
    put(staged, folder, ours)


def place_own(staged: Path, folder: Path, scope: Collection[str], overwrite: bool = False) -> None:
    """Like `replace_own`, for a folder that is not ours: it stays, and each file in it changes at once.

    scope: every path that such a call may write. Files of other scopes stay, also on the list.
    """
    folder.mkdir(parents=True, exist_ok=True)
    fresh = hashes(staged)
    if not overwrite:
        refuse_edited(folder, fresh, scope)
    listed = _listed(folder)
    for path in fresh:
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
    for path in fresh:
        (staged / path).replace(folder / path)
    for path in set(listed) & set(scope) - set(fresh):
        (folder / path).unlink(missing_ok=True)
    kept = {path: value for path, value in listed.items() if path not in scope}
    # Last: a call that dies before leaves files that the same call, made again, finds to be what it writes.
    write_json(folder / LIST, {"format": _FORMAT, "files": dict(sorted((kept | fresh).items()))})


def refuse_edited(folder: Path, fresh: Mapping[str, str], scope: Collection[str] | None = None) -> None:
    """Raise InputError when writing the files `fresh` (path -> SHA-256) into `folder` would lose what
    somebody else wrote: a file of ours that was changed since, or another one of the same name. Files that
    say what would be written are no loss.

    scope: the paths that are looked at, beside `fresh`; None: all that the folder holds.
    """
    listed = _listed(folder)
    if (folder / LIST).exists() and not listed:
        lost = [(LIST, False)]
    else:
        lost = []
    if scope is not None:
        looked = sorted(path for path in {*scope, *fresh} if os.path.lexists(folder / path))
    else:
        looked = contents(folder) if folder.is_dir() else []
    for path in looked:
        blocked = any(other.startswith(f"{path}/") or path.startswith(f"{other}/") for other in fresh)
        if blocked or path in fresh or (path in listed):
            stands = _hash(folder / path)
            if blocked or stands not in (listed.get(path), fresh.get(path)):
                lost.append((path, path in listed))
    if lost:
        path, ours = lost[0]
        what = "was changed since it was exported" if ours else "is not a file that was exported"
        more = f" (so are {len(lost) - 1} more)" if len(lost) > 1 else ""
        raise InputError(
            f"{folder / path} {what}{more}",
            "keep a copy under another name or elsewhere, or give --overwrite to lose it",
        )


def hashes(folder: Path) -> dict[str, str]:
    """SHA-256 of every file in a folder by its relative path with /."""
    return {path: _hash(folder / path) for path in contents(folder)}


def _listed(folder: Path) -> dict[str, str]:
    """What the folder's list says is ours; nothing without a list."""
    data = read_json(folder / LIST)
    files = data.get("files") if data.get("format") == _FORMAT else None
    return {str(k): str(v) for k, v in files.items()} if isinstance(files, dict) else {}


def _hash(path: Path) -> str:
    """SHA-256 of a file; empty for what is none."""
    return hashlib.sha256(path.read_bytes()).hexdigest() if path.is_file() else ""
