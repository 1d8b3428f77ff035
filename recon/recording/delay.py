"""Depth that lags behind colour, brought back to it: each colour picture gets the depth of its time."""

from __future__ import annotations

import hashlib
import re
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from recon.recording.part import MIN_FRAMES, of_frames
from twin.errors import InputError

if TYPE_CHECKING:
    from recon.recording import Recording

_MS = re.compile(r"([+-]?\d+(?:\.\d+)?) ?ms", re.ASCII)
_REMEDY = 'give whole frames, such as 2, or a time such as "66ms"; negative where depth is ahead of colour'


def without_delay(recording: Recording, delay: int | str) -> Recording:
    """The same colour, with the depth of frames that are `delay` later: frames, or a text such as "66ms".

    Frames whose depth is not recorded are left out. Raises InputError for another delay, or too few frames.
    """
    frames, partners = _pairs(recording, delay)
    if np.array_equal(frames, partners) and len(frames) == len(recording):
        return recording
    if len(frames) < MIN_FRAMES:
        raise InputError(
            f"{recording.source}: a depth delay of {delay} leaves {len(frames)} of {len(recording)} frames",
            _REMEDY,
        )
    kept = of_frames(recording, frames, f"{recording.source}[depth {delay} later]")
    digest = hashlib.sha256(kept.fingerprint.encode() + partners.astype("<i8").tobytes())
    return replace(
        kept, read_depth=lambda k: recording.depth(int(partners[k])), fingerprint=digest.hexdigest()
    )


def _pairs(recording: Recording, delay: int | str) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Frames whose colour is kept, and those whose depth goes with them."""
    frames = np.arange(len(recording))
    if isinstance(delay, int) and not isinstance(delay, bool):
        partners = frames + delay
        kept = (partners >= 0) & (partners < len(frames))
        return frames[kept], partners[kept]
    found = _MS.fullmatch(delay.strip()) if isinstance(delay, str) else None
    if found is None:
        raise InputError(f"{delay!r} is no depth delay", _REMEDY)
    times = recording.times
    wanted = times + float(found[1]) / 1000.0
    after = np.clip(np.searchsorted(times, wanted), 1, len(times) - 1)
    partners = np.where(wanted - times[after - 1] <= times[after] - wanted, after - 1, after)
    kept = np.abs(times[partners] - wanted) <= 0.5 * float(np.median(np.diff(times)))
    return frames[kept], partners[kept]
