"""One look at a recording: small pictures of some of its frames, and a few numbers about each.

Every frame is decoded once, at full size; what is kept is small.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray

from recon.cameras.poses import estimate_cameras
from recon.inspection.cuts import Shown
from recon.inspection.pictures import PictureFacts, facts_of
from recon.recording import Recording
from recon.tracking.follow import Seeding, track_points
from recon.tracking.tracks import Tracks
from twin.errors import ReconstructionError
from twin.geometry import Array
from twin.scene import Trajectory

# px, of the pictures that are kept: half the pixels of VGA, and corners are still found to a fraction of one
WIDTH = 480
# Poses tried for a frame: a glance needs no more. Chosen by us.
_TRIES = 100
_FPS = 15.0  # 1/s; what documents ask for. Denser recordings are thinned to it
# frames: up to 12 s all are looked at
_ALL = 180
# frames: of a longer recording beginning, middle and end, 4 s each
_SPAN = 60


@dataclass(frozen=True, eq=False)
class Stretch:
    """Successive frames. frames (n,): their numbers. small: they, `WIDTH` wide, in memory. facts: n."""

    frames: NDArray[np.int64]
    small: Recording
    facts: tuple[PictureFacts, ...]

    @property
    def shown(self) -> Shown:
        """Its frames as thumbnails."""
        return Shown(self.frames, [f.thumbnail for f in self.facts])

    @property
    def seconds(self) -> float:
        """Usual time between two of its frames."""
        return float(np.median(np.diff(self.small.times)))

    @cached_property
    def tracks(self) -> Tracks:
        """Corners followed through the small pictures."""
        return track_points(self.small, seeding=Seeding(cell=16, every=6)).dense()

    @cached_property
    def cameras(self) -> Trajectory | None:
        """Poses from the tracks; None where too few are shared."""
        try:
            return estimate_cameras(self.tracks, self.small.times, self.small.intrinsics.fx, tries=_TRIES)
        except ReconstructionError:
            return None


def thinned(times: Array) -> NDArray[np.int64]:
    """Numbers of the frames that are left of a recording denser than `_FPS`."""
    step = max(1, int(1.0 / (_FPS * float(np.median(np.diff(times)))) + 0.01))
    return np.arange(0, len(times), step)


def chosen_frames(times: Array) -> list[NDArray[np.int64]]:
    """Numbers of the frames that are looked at, in stretches that follow each other."""
    kept = thinned(times)
    if len(kept) <= _ALL:
        return [kept]
    middle = (len(kept) - _SPAN) // 2
    return [kept[:_SPAN], kept[middle : middle + _SPAN], kept[-_SPAN:]]


def glance(recording: Recording) -> list[Stretch]:
    """Read the chosen frames. Raises InputError naming the file when one is unreadable."""
    return [_stretch(recording, frames) for frames in chosen_frames(recording.times)]


def _stretch(recording: Recording, frames: NDArray[np.int64]) -> Stretch:
    k = recording.intrinsics
    scale = min(1.0, WIDTH / k.width)
    size = (round(k.width * scale), round(k.height * scale))

    def read(frame: int) -> tuple[NDArray[np.uint8], NDArray[np.float32], PictureFacts]:
        color, depth = recording.frame(frame)
        facts = facts_of(color, depth)
        grey = cv2.resize(cv2.cvtColor(color, cv2.COLOR_RGB2GRAY), size, interpolation=cv2.INTER_AREA)
        near = cv2.resize(depth, size, interpolation=cv2.INTER_NEAREST_EXACT)
        return np.asarray(grey, dtype=np.uint8), np.asarray(near, dtype=np.float32), facts

    with ThreadPoolExecutor(2) as pool:  # decoding and filters leave Python's lock
        read_all = list(pool.map(read, (int(f) for f in frames)))
    greys, depths, facts = zip(*read_all, strict=True)
    small = replace(
        recording,
        times=recording.times[frames],
        intrinsics=k.scaled(*size),
        read_color=lambda i: np.asarray(cv2.cvtColor(greys[i], cv2.COLOR_GRAY2RGB), dtype=np.uint8),
        read_depth=lambda i: depths[i],
        poses=None,
        gravity_camera0=None,
        path=None,
    )
    return Stretch(frames, small, tuple(facts))
