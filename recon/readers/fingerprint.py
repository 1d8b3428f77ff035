"""What identifies a recording: a hash over names, sizes and bytes, or, where many, over samples of them."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from recon.readers.files import check_complete, read_bytes, shown
from twin.errors import InputError

WHOLE_BYTES = 256 * 2**20  # chosen by us: read in a fifth of a second from a disk's cache
BLOCKS = 64  # of a larger recording, evenly from its first to its last byte
BLOCK_BYTES = 64 * 2**10


def fingerprint(root: Path, files: Iterable[Path]) -> str:
    """SHA-256 over the sorted names (relative to `root`), sizes and bytes of the input files.

    It depends on neither the machine nor on times or the place of the folder. Images of a small recording are
    checked to be complete; of more than `WHOLE_BYTES`, `BLOCKS` blocks over all files stand for the bytes.
    Raises InputError for a file that is missing, empty, or truncated.
    """
    found = sorted(files, key=lambda p: p.relative_to(root).as_posix())
    sizes = [_size(p) for p in found]
    if sum(sizes) > WHOLE_BYTES:
        return _of_samples(found, [p.relative_to(root).as_posix() for p in found], sizes)
    digest = hashlib.sha256()
    for path in found:
        data = read_bytes(path)
        check_complete(shown(path), data)
        digest.update(f"{path.relative_to(root).as_posix()}\0{len(data)}\0".encode())
        digest.update(data)
    return digest.hexdigest()


def fingerprint_of(path: Path) -> str:
    """SHA-256 of a file's bytes, or size and `BLOCKS` blocks if over `WHOLE_BYTES`; no name."""
    size = _size(path)
    if size > WHOLE_BYTES:
        return _of_samples([path], [""], [size])
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def _size(path: Path) -> int:
    try:
        size = path.stat().st_size
    except OSError as error:
        raise InputError(
            f"{shown(path)} can't be read ({error.strerror})", "copy the recording again"
        ) from None
    if size == 0:
        raise InputError(f"{shown(path)} is empty (0 bytes)", "copy the recording again")
    return size


def _of_samples(files: Sequence[Path], names: Sequence[str], sizes: Sequence[int]) -> str:
    digest = hashlib.sha256()
    for name, size in zip(names, sizes, strict=True):
        digest.update(f"{name}\0{size}\0".encode())
    ends = np.cumsum(sizes)
    for start in np.linspace(0, ends[-1] - 1, BLOCKS).astype(np.int64):
        k = int(np.searchsorted(ends, start, side="right"))
        with files[k].open("rb") as stream:
            # the last block ends where the file does
            at = min(int(start) - (int(ends[k]) - sizes[k]), max(0, sizes[k] - BLOCK_BYTES))
            stream.seek(at)
            digest.update(stream.read(BLOCK_BYTES))
    return digest.hexdigest()
