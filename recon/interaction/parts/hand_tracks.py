"""Which tracks lie on the hand, by colour learnt from the recording itself.

While the part is at rest, what appears in free space in front of a frame without a hand is the hand. Its
colours tell tracks on the hand from tracks on the part during the motion, when both move together. The colour
of single pixels is no evidence (a skin-coloured door would be lost); of whole tracks it is.

FunREC, supplement 3.2: colour in place of a mask of the hand.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cached_property, partial

import cv2
import numpy as np
from numpy.typing import NDArray

from recon.dense.depth import in_front
from recon.recording import Recording
from recon.tracking.tracks import Tracks
from twin import geometry as geo
from twin.geometry import Array
from twin.runs.threads import each
from twin.scene import Trajectory

# Bins of the colour histogram, per axis. Chosen by us.
_BINS = 24
# px; width to which frames are shrunk. Chosen by us.
_WIDTH = 160
# Frames looked at on each side of the motion. Chosen by us.
_MAX_FRAMES = 12
# Share of the image below which it is noise, not a hand. Chosen by us.
_MIN_SHARE = 0.003
# px; about a track, so far its colour counts. Chosen by us.
_NEIGHBOURS = 2
# Mean log odds above which a track lies on the hand: more likely than not.
_MIN_ODDS = 0.0


class HandTracks:
    """Tells the tracks whose colours are those of the hand; what frames show is read once for all asking.

    Args:
        tracks: of the recording, K of them.
    """

    def __init__(self, recording: Recording, cameras: Trajectory, tracks: Tracks) -> None:
        self._recording, self._cameras, self._tracks = recording, cameras, tracks
        width = min(_WIDTH, recording.intrinsics.width)
        height = max(1, round(recording.intrinsics.height * width / recording.intrinsics.width))
        self._camera = recording.intrinsics.scaled(width, height)
        self._small: dict[int, tuple[NDArray[np.float32], NDArray[np.uint16]]] = {}

    def of(self, rests: Sequence[tuple[int, int]]) -> NDArray[np.bool_]:
        """Mask (K,) of the tracks on the hand.

        Args:
            rests: spans (first, last) of frames in which no part moves, in time order. In each span, the
                frame farthest from the motion serves as the picture without a hand: the first frame of the
                recording's first span, the last frame of the last one, and both ends of the spans in between.
        """
        hand, rest_of = np.ones(_BINS**3), np.ones(_BINS**3)
        found = 0
        for reference, frames in _compared(rests, _MAX_FRAMES):
            for seen in each(partial(self._appeared, reference), frames):
                if seen is not None:
                    mask, index = seen
                    found += 1
                    hand += np.bincount(index[mask], minlength=len(hand))
                    rest_of += np.bincount(index[~mask], minlength=len(hand))
        if found == 0:
            return np.zeros(len(self._tracks), dtype=bool)
        return self._mean_odds(_smooth_log_odds(hand, rest_of, _BINS)) > _MIN_ODDS

    def _appeared(self, reference: int, frame: int) -> tuple[NDArray[np.bool_], NDArray[np.uint16]] | None:
        """What stands in a frame before the surface of a reference frame, and the frame's colours."""
        there, here = self._cameras.pose(reference), self._cameras.pose(frame)
        if there is None or here is None:
            return None
        depth, index = self._look(frame)
        surface = self._look(reference)[0].astype(np.float64)
        mask = in_front(depth.astype(np.float64), surface, self._camera, geo.invert_pose(there) @ here)
        return None if mask.mean() < _MIN_SHARE else (mask, index)

    def _look(self, frame: int) -> tuple[NDArray[np.float32], NDArray[np.uint16]]:
        """Small depth, m, and colours of a frame."""
        if frame not in self._small:
            size, read = (self._camera.width, self._camera.height), self._recording.frame(frame)
            color = cv2.resize(read.color, size, interpolation=cv2.INTER_AREA)
            depth = cv2.resize(read.depth, size, interpolation=cv2.INTER_NEAREST)
            self._small[frame] = np.asarray(depth, np.float32), _bin(np.asarray(color, np.uint8), _BINS)
        return self._small[frame]

    def _mean_odds(self, odds: Array) -> Array:
        """Mean log odds (K,) of the colours about each track; -inf where it is not seen."""
        track, colours = self._about_tracks
        total = np.bincount(track, odds[colours].mean(axis=1), minlength=len(self._tracks))
        count = np.bincount(track, minlength=len(self._tracks))
        return np.where(count > 0, total / np.maximum(count, 1), -np.inf)

    @cached_property
    def _about_tracks(self) -> tuple[NDArray[np.int64], NDArray[np.uint16]]:
        """Tracks (n,) seen in every third frame, one frame after the other, and the colours (n, 25) about
        them."""

        def about(frame: int) -> tuple[NDArray[np.int64], NDArray[np.uint16]]:
            seen = np.flatnonzero(self._tracks.visible[frame])
            index = _bin(self._recording.color(frame), _BINS)
            x, y = np.rint(self._tracks.pixels[frame, seen]).astype(int).T
            x, y = np.clip(x, 0, index.shape[1] - 1), np.clip(y, 0, index.shape[0] - 1)
            padded = np.pad(index, _NEIGHBOURS, mode="reflect")
            shifts = range(2 * _NEIGHBOURS + 1)
            return seen, np.stack([padded[y + dy, x + dx] for dy in shifts for dx in shifts], axis=-1)

        found = list(each(about, range(0, len(self._recording), 3)))
        return np.concatenate([f[0] for f in found]), np.concatenate([f[1] for f in found])


def _compared(rests: Sequence[tuple[int, int]], most: int) -> Iterator[tuple[int, list[int]]]:
    """Frames without a hand, each with those of its rest compared with it, at most `most`."""
    for number, (first, last) in enumerate(rests):
        references = ([first] if number == 0 or len(rests) == 1 else []) + (
            [last] if number == len(rests) - 1 else []
        )
        frames = np.unique(np.linspace(first, last, most).astype(int)).tolist()
        for reference in references or [first, last]:
            yield reference, [f for f in frames if f != reference]


def _smooth_log_odds(hand: Array, rest: Array, bins: int) -> Array:
    """Log odds per colour bin, hand and rest equally likely beforehand, histograms blurred by a bin."""
    out = []
    for histogram in (hand, rest):
        cube = histogram.reshape(bins, bins, bins)
        for axis in range(3):
            cube = (np.roll(cube, 1, axis) + 2.0 * cube + np.roll(cube, -1, axis)) / 4.0
        out.append((cube / cube.sum()).ravel())
    return np.asarray(np.log((out[0] + 1e-5) / (out[1] + 1e-5)))


def _bin(color: NDArray[np.uint8], bins: int) -> NDArray[np.uint16]:
    lab = cv2.cvtColor(color, cv2.COLOR_RGB2LAB)
    value = np.arange(256, dtype=np.int32)
    of_chroma = value * bins // 256
    of_lightness = (value // 2 + 64) * bins // 256  # shading changes lightness more than hue
    index = of_lightness[lab[..., 0]] * (bins * bins) + of_chroma[lab[..., 1]] * bins
    return np.asarray(index + of_chroma[lab[..., 2]], np.uint16)
