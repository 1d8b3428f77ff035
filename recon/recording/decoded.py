"""Decoded frames kept in a scratch file beside a run, since most stages read them again."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from recon.recording import Recording

SCRATCH = "decoded.tmp"
# Some 2000 frames of 640x480, two minutes; those that come first. Chosen by us.
MOST_BYTES = 4 * 2**30
# Share of the disk's free room that is taken. Chosen by us.
_SHARE = 0.25
_MILLIMETRE = np.float32(1000.0)
# What a slot holds: nothing, an image as it is, depth in whole millimetres.
_EMPTY, _WHOLE, _PACKED = b"\0", b"\1", b"\2"


@contextmanager
def decoded_once(
    recording: Recording, folder: Path | None, most_bytes: int = MOST_BYTES
) -> Iterator[Recording]:
    """The same recording, whose images are decoded once as long as they fit into so many bytes of disk.

    Stages go through the recording from its start to its end: those frames that come first are kept, for the
    last ones would be gone whenever they are asked for again. Who gets a frame gets a copy. The file lies in
    `folder`, by default in a temporary one, and is deleted at the end. Where it can't be written, all is
    decoded again.
    """
    with tempfile.TemporaryDirectory(prefix="funtwin-") as spare:
        place = Path(spare) if folder is None else folder
        path = place / SCRATCH
        most = min(most_bytes, int(_SHARE * shutil.disk_usage(place).free))
        try:
            # a file of its own: processes of a killed run may still write into the one that it left
            path.unlink(missing_ok=True)
            file = os.open(path, os.O_RDWR | os.O_CREAT | os.O_EXCL, 0o600)
        except OSError:
            yield recording
            return
        try:
            os.truncate(file, 2 * len(recording))
            os.pwrite(file, most.to_bytes(8, "little"), 2 * len(recording))
            yield _kept(recording, file)
        finally:
            os.close(file)
            with suppress(OSError):
                path.unlink()


@contextmanager
def decoded_beside(recording: Recording, folder: Path) -> Iterator[Recording]:
    """The same recording in another process, with the images of a run whose `decoded_once` is open."""
    try:
        file = os.open(folder / SCRATCH, os.O_RDWR)
    except OSError:
        yield recording
        return
    try:
        yield _kept(recording, file)
    finally:
        os.close(file)


def _kept(recording: Recording, file: int) -> Recording:
    """The recording with the images in an open file, which gets those that it lacks."""
    slots = _Slots(file, len(recording), recording.intrinsics.height, recording.intrinsics.width)

    def color(k: int) -> NDArray[np.uint8]:
        known = slots.color(k)
        if known is None:
            known = recording.read_color(k)
            slots.keep_color(k, known)
        return known

    def depth(k: int) -> NDArray[np.float32]:
        known = slots.depth(k)
        if known is None:
            known = recording.read_depth(k)
            slots.keep_depth(k, known)
        return known

    return replace(recording, read_color=color, read_depth=depth)


class _Slots:
    """A file of two bytes a frame, what it holds of colour and depth; eight, how many bytes it may take; and
    a slot a frame, colour before depth. A slot is written before its byte; two who write it write the same.
    """

    def __init__(self, file: int, frames: int, height: int, width: int) -> None:
        self._file, self._shape = file, (height, width)
        self._color, self._depth = 3 * height * width, 4 * height * width
        self._start = 2 * frames + 8
        self._most = int.from_bytes(os.pread(file, 8, 2 * frames), "little")

    def color(self, k: int) -> NDArray[np.uint8] | None:
        """Colour (H, W, 3), where it is kept."""
        if self._holds(2 * k) == _EMPTY:
            return None
        return self._read(self._slot(k), np.empty((*self._shape, 3), np.uint8))

    def depth(self, k: int) -> NDArray[np.float32] | None:
        """Depth (H, W) m, where it is kept."""
        kind, place = self._holds(2 * k + 1), self._slot(k) + self._color
        if kind == _EMPTY:
            return None
        if kind == _WHOLE:
            return self._read(place, np.empty(self._shape, np.float32))
        packed = self._read(place, np.empty(self._shape, np.uint16))
        return None if packed is None else _unpacked(packed)

    def keep_color(self, k: int, image: NDArray[np.uint8]) -> None:
        if image.dtype == np.uint8 and image.shape == (*self._shape, 3):
            self._keep(k, 2 * k, self._slot(k), image, _WHOLE)

    def keep_depth(self, k: int, image: NDArray[np.float32]) -> None:
        if image.dtype == np.float32 and image.shape == self._shape:
            small = _packed(image)
            kind = _WHOLE if small.dtype == np.float32 else _PACKED
            self._keep(k, 2 * k + 1, self._slot(k) + self._color, small, kind)

    def _slot(self, k: int) -> int:
        return self._start + k * (self._color + self._depth)

    def _holds(self, byte: int) -> bytes:
        return os.pread(self._file, 1, byte)

    def _read(self, place: int, into: NDArray[Any]) -> NDArray[Any] | None:
        return into if os.preadv(self._file, [into.data.cast("B")], place) == into.nbytes else None

    def _keep(self, k: int, byte: int, place: int, image: NDArray[Any], kind: bytes) -> None:
        if self._slot(k + 1) > self._most:
            return
        data = np.ascontiguousarray(image).data.cast("B")
        with suppress(OSError):  # a full disk
            if os.pwrite(self._file, data, place) == len(data):
                os.pwrite(self._file, kind, byte)


def _packed(image: NDArray[np.float32]) -> NDArray[np.uint16] | NDArray[np.float32]:
    """Depth (h, w) m in half the bytes if it is whole millimetres, as in most files; else as it is."""
    whole = np.rint(image * _MILLIMETRE)
    if whole.min() >= 0 and whole.max() < 2**16:
        small = whole.astype(np.uint16)
        if np.array_equal(_unpacked(small), image):
            return small
    return image


def _unpacked(stored: NDArray[np.uint16]) -> NDArray[np.float32]:
    return np.asarray(stored.astype(np.float32) / _MILLIMETRE)
