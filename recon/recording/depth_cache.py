"""Decoded depth kept in memory, since most stages read it again."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from recon.recording import ReadDepth, Recording

# some 200 frames of 640x480 in whole millimetres; chosen by us: a tenth of what a reconstruction takes
MOST_BYTES = 128 * 2**20
_MILLIMETRE = np.float32(1000.0)


def with_cached_depth(recording: Recording, most_bytes: int = MOST_BYTES) -> Recording:
    """The same recording, whose depth is decoded once as long as it fits into so many bytes.

    Depth alone, since it is asked for more often than colour and takes longer to decode. Stages go through
    the recording from its start to its end: those frames that come first are kept, for the last ones would be
    gone whenever they are asked for again. Who gets a frame gets a copy.
    """
    return replace(recording, read_depth=_remembering(recording.read_depth, most_bytes))


def _remembering(read: ReadDepth, most_bytes: int) -> ReadDepth:
    """`read`, each of whose images is decoded once if there is room for it."""
    known: dict[int, NDArray[np.uint16] | NDArray[np.float32]] = {}

    def get(index: int) -> NDArray[np.float32]:
        if index in known:
            return _unpacked(known[index])
        image = read(index)
        small = _packed(image)
        if sum(k.nbytes for k in list(known.values())) + small.nbytes <= most_bytes:
            known[index] = small
        return image

    return get


def _packed(image: NDArray[np.float32]) -> NDArray[np.uint16] | NDArray[np.float32]:
    """A copy in half the bytes if depth (h, w) m is whole millimetres, as in most files; else as is."""
    whole = np.rint(image * _MILLIMETRE)
    if whole.min() >= 0 and whole.max() < 2**16:
        small = whole.astype(np.uint16)
        if np.array_equal(_unpacked(small), image):
            return small
    return image.copy()


def _unpacked(stored: NDArray[np.uint16] | NDArray[np.float32]) -> NDArray[np.float32]:
    if stored.dtype == np.uint16:
        return np.asarray(stored.astype(np.float32) / _MILLIMETRE)
    return np.array(stored, dtype=np.float32)
