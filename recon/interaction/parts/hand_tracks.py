"""Which tracks lie on the hand, by colour learnt from the recording itself.

While the part is at rest, what appears in free space in front of a frame without a hand is the hand. Its
colours tell tracks on the hand from tracks on the part during the motion, when both move together. The colour
of single pixels is no evidence (a skin-coloured door would be lost); of whole tracks it is.

FunREC, supplement 3.2: colour in place of a mask of the hand.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from recon.dense.depth import in_front
from recon.recording import Intrinsics, Recording
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
# Mean log odds above which a track lies on the hand: more likely than not.
_MIN_ODDS = 0.0


def hand_tracks(
    recording: Recording,
    cameras: Trajectory,
    tracks: Tracks,
    rests: Sequence[tuple[int, int]],
) -> NDArray[np.bool_]:
    """Mask (K,) of the tracks whose colours are those of the hand.

    Args:
        rests: spans (first, last) of frames in which no part moves, in time order. In each span, the frame
            farthest from the motion serves as the picture without a hand: the first frame of the recording's
            first span, the last frame of the last one, and both ends of the spans in between.
    """
    width = min(_WIDTH, recording.intrinsics.width)
    size = width, max(1, round(recording.intrinsics.height * width / recording.intrinsics.width))
    camera = recording.intrinsics.scaled(*size)
    hand, rest_of = np.ones(_BINS**3), np.ones(_BINS**3)
    found = 0
    for reference, frames in _compared(rests, _MAX_FRAMES):
        surface = _small_depth(recording, reference, camera)

        def look(
            frame: int, reference: int = reference, surface: Array = surface
        ) -> tuple[NDArray[np.bool_], NDArray[np.int32]] | None:
            there, here = cameras.pose(reference), cameras.pose(frame)
            if there is None or here is None:
                return None
            pose = geo.invert_pose(there) @ here
            mask = in_front(_small_depth(recording, frame, camera), surface, camera, pose)
            if mask.mean() < _MIN_SHARE:
                return None
            return mask, _bin(_small_color(recording, frame, camera), _BINS)

        for seen in each(look, frames):
            if seen is not None:
                mask, index = seen
                found += 1
                hand += np.bincount(index[mask], minlength=len(hand))
                rest_of += np.bincount(index[~mask], minlength=len(hand))
    if found == 0:
        return np.zeros(len(tracks), dtype=bool)
    odds = _smooth_log_odds(hand, rest_of, _BINS)
    return _mean_odds(recording, tracks, odds) > _MIN_ODDS


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


def _bin(color: NDArray[np.uint8], bins: int) -> NDArray[np.int32]:
    lab = cv2.cvtColor(color, cv2.COLOR_RGB2LAB)
    value = np.arange(256, dtype=np.int32)
    of_chroma = value * bins // 256
    of_lightness = (value // 2 + 64) * bins // 256  # shading changes lightness more than hue
    index = of_lightness[lab[..., 0]] * (bins * bins) + of_chroma[lab[..., 1]] * bins
    return np.asarray(index + of_chroma[lab[..., 2]])


def _small_color(recording: Recording, frame: int, camera: Intrinsics) -> NDArray[np.uint8]:
    size = (camera.width, camera.height)
    return np.asarray(cv2.resize(recording.color(frame), size, interpolation=cv2.INTER_AREA), dtype=np.uint8)


def _small_depth(recording: Recording, frame: int, camera: Intrinsics) -> Array:
    size = (camera.width, camera.height)
    return np.asarray(
        cv2.resize(recording.depth(frame), size, interpolation=cv2.INTER_NEAREST), dtype=np.float64
    )


def _mean_odds(recording: Recording, tracks: Tracks, odds: Array) -> Array:
    """Mean log odds (K,) over every third frame's 5x5 neighbourhoods of each track."""

    def odds_at(frame: int) -> tuple[NDArray[np.int64], Array]:
        seen = np.flatnonzero(tracks.visible[frame])
        if not len(seen):
            return seen, np.zeros(0)
        color = recording.color(frame)
        score = cv2.blur(odds[_bin(color, _BINS)], (5, 5))
        x, y = np.rint(tracks.pixels[frame, seen]).astype(int).T
        return seen, score[np.clip(y, 0, color.shape[0] - 1), np.clip(x, 0, color.shape[1] - 1)]

    total, count = np.zeros(len(tracks)), np.zeros(len(tracks))
    for seen, found in each(odds_at, range(0, len(recording), 3)):
        total[seen] += found
        count[seen] += 1
    return np.where(count > 0, total / np.maximum(count, 1), -np.inf)
