"""What frames hold, as digests: what is computed of some frames depends on these alone, whatever follows."""

from __future__ import annotations

import hashlib

import numpy as np
from numpy.typing import NDArray

from recon.recording import Recording
from twin.runs.keys import Stage, digest
from twin.runs.loop import Loop, untold
from twin.runs.threads import each

FRAMES = Stage("frames", 1, ())
# Bytes of a frame's digest: 2**64 frames before two are expected to share one.
_BYTES = 16


def frame_digests(recording: Recording, progress: Loop = untold) -> NDArray[np.uint8]:
    """Digests (T, 16) of the frames' colour and depth."""

    def of(k: int) -> NDArray[np.uint8]:
        out = hashlib.blake2b(digest_size=_BYTES)
        for image in recording.frame(k):
            out.update(np.ascontiguousarray(image).data)
        return np.frombuffer(out.digest(), np.uint8)

    frames = range(len(recording))
    found = each(of, frames)
    return np.stack([next(found) for _ in progress(frames, "frames")])


def content_of(recording: Recording, digests: NDArray[np.uint8], first: int, last: int) -> str:
    """Digest of the frames first..last: pictures, times, and the camera's intrinsics."""
    inside = slice(first, last + 1)
    return digest(recording.intrinsics, np.asarray(recording.times)[inside], digests[inside])
