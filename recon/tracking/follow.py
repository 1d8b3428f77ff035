"""Corners followed through a recording, in stretches that go on from each other.

FunREC, supplement 1.2: tracks and visibilities without a learned tracker.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from recon.recording import Recording
from recon.tracking.tracks import FEWEST, SparseTracks
from twin.runs.keys import Stage
from twin.runs.loop import Loop, untold
from twin.runs.setting import Settings, setting
from twin.runs.threads import each

TRACKS = Stage("tracks", 3, ("tracks",))
CORNERS = Stage("corners", 2, ("tracks",))


@dataclass(frozen=True)
class TrackConfig(Settings):
    """Corner tracking; pixels are those of the tracking image."""

    max_width: int = setting(
        640,
        "greatest width of the tracking image; measured: more pixels cost time and gain no accuracy",
        unit="px",
        at_least=64,
    )
    max_depth: float = setting(
        6.0,
        "points farther away are left out: noise of structured light and time of flight grows with depth squared",
        unit="m",
        above=0,
        infinite=True,
    )


@dataclass(frozen=True)
class Seeding:
    """Where and when corners are taken. cell: side (px) of a cell, which gets one corner. every: frames after
    which empty cells get one. Measured: other ways of seeding left 3 % of the corners on the moving part."""

    cell: int = 12
    every: int = 10


# px; side of the window that is compared. Chosen by us.
_WINDOW = 21
# Halvings of the image, for corners that move far. Chosen by us.
_LEVELS = 3
# px; a corner followed there and back ends no farther from its start. Chosen by us.
_MAX_FORWARD_BACKWARD = 0.7
# Share of the corners that are found again below which a step of exposure is assumed. Chosen by us: of an
# automatic one's step of 12 %, 5 % are, else 30 to 90.
_LOST = 0.5
# Least eigenvalue of a corner's gradient matrix, grey levels 0 to 1. Chosen by us.
_MIN_CORNER_QUALITY = 2e-5
# Relative step in 3 x 3 pixels that makes an edge of depth. Chosen by us.
_DEPTH_EDGE = 0.03
_USUAL, _SEEDING = TrackConfig(), Seeding()


@dataclass(frozen=True, eq=False, repr=False)
class Live:
    """Corners that are being followed: the grey picture (h, w) in which they stand, their numbers (n,), their
    places xy (n, 2) px, and the next one's number."""

    grey: NDArray[np.uint8]
    number: NDArray[np.int64]
    xy: NDArray[np.float32]
    following: int


@dataclass(frozen=True, eq=False, repr=False)
class Stretch:
    """Corners through successive frames: seen (T,) of them in each frame, then track (n,), xy (n, 2) px and
    depth (n,) m of one after the other; `live`: how they go on."""

    seen: NDArray[np.int64]
    track: NDArray[np.int64]
    xy: NDArray[np.float32]
    depth: NDArray[np.float32]
    live: Live


def track_points(
    recording: Recording, config: TrackConfig = _USUAL, progress: Loop = untold, seeding: Seeding = _SEEDING
) -> SparseTracks:
    """Track corners through every frame and lift them by depth.

    Corners are seeded one per grid cell, followed by pyramidal Lucas-Kanade with a forward-backward test
    (Kalal 2010), and reseeded in empty cells. A track without valid depth in a frame is not visible there.
    """
    return tracks_of(
        recording, [follow(recording, config=config, progress=progress, seeding=seeding)], config
    )


def follow(
    recording: Recording,
    first: int = 0,
    last: int | None = None,
    before: Live | None = None,
    *,
    config: TrackConfig = _USUAL,
    progress: Loop = untold,
    seeding: Seeding = _SEEDING,
) -> Stretch:
    """Corners through the frames first..last, which go on with those `before`. Default: all frames."""
    size = _image_of(recording, config)
    cv2.setRNGSeed(0)
    tracker = _Tracker(config, seeding, size, before)

    def prepared(i: int) -> tuple[NDArray[np.uint8], NDArray[np.float32], NDArray[np.bool_]]:
        frame = recording.frame(i)
        grey = cv2.resize(cv2.cvtColor(frame.color, cv2.COLOR_RGB2GRAY), size, interpolation=cv2.INTER_AREA)
        depth = cv2.resize(frame.depth, size, interpolation=cv2.INTER_NEAREST)
        smooth, edge = _smooth_depth(np.asarray(depth, dtype=np.float32), _DEPTH_EDGE)
        return np.asarray(grey, dtype=np.uint8), smooth, edge

    chosen = range(first, len(recording) if last is None else last + 1)
    frames = each(prepared, chosen)
    for i in progress(chosen, "tracks"):
        tracker.step(i, *next(frames))
    return tracker.stretch()


def tracks_of(
    recording: Recording, stretches: Sequence[Stretch], config: TrackConfig = _USUAL
) -> SparseTracks:
    """The tracks of successive stretches of a recording."""
    size = _image_of(recording, config)
    lengths = np.concatenate([s.seen for s in stretches])
    track = np.concatenate([s.track for s in stretches])
    frame = np.repeat(np.arange(len(lengths)), lengths)
    count = np.bincount(track, minlength=stretches[-1].live.following)
    kept = count[track] >= FEWEST
    number = np.cumsum(count >= FEWEST) - 1
    starts = np.searchsorted(frame[kept], np.arange(len(lengths) + 1))
    return SparseTracks(
        starts.astype(np.int64),
        number[track[kept]].astype(np.int32),
        np.concatenate([s.xy for s in stretches])[kept],
        np.concatenate([s.depth for s in stretches])[kept],
        int((count >= FEWEST).sum()),
        recording.intrinsics.scaled(*size),
        1.0 / _scale(recording, config),
    )


def _scale(recording: Recording, config: TrackConfig) -> float:
    return min(1.0, config.max_width / recording.intrinsics.width)


def _image_of(recording: Recording, config: TrackConfig) -> tuple[int, int]:
    """Width and height, px, of the tracking image."""
    scale = _scale(recording, config)
    return round(recording.intrinsics.width * scale), round(recording.intrinsics.height * scale)


def followed(
    before: NDArray[np.uint8], after: NDArray[np.uint8], start: NDArray[np.float32]
) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """Where corners (n, 2) px of a grey picture are in another, and which (n,) of them come back."""
    lk = {
        "winSize": (_WINDOW, _WINDOW),
        "maxLevel": _LEVELS,
        "criteria": (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 20, 0.01),
    }
    corners = start[:, None]
    there, ok1, _ = cv2.calcOpticalFlowPyrLK(before, after, corners, None, **lk)  # type: ignore[call-overload]
    back, ok2, _ = cv2.calcOpticalFlowPyrLK(after, before, there, None, **lk)  # type: ignore[call-overload]
    error = np.linalg.norm((back - corners)[:, 0], axis=1)
    return there[:, 0], (ok1[:, 0] == 1) & (ok2[:, 0] == 1) & (error < _MAX_FORWARD_BACKWARD)


def equally_bright(
    before: NDArray[np.uint8], after: NDArray[np.uint8]
) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
    """Two grey pictures, of which the brighter one is darkened until their means are the same."""
    gain = max(float(before.mean()), 1.0) / max(float(after.mean()), 1.0)
    if gain < 1.0:
        return before, np.rint(after * gain).astype(np.uint8)
    return np.rint(before / gain).astype(np.uint8), after


class _Tracker:
    """State of the tracker between frames: the previous image and the live corners."""

    def __init__(
        self, config: TrackConfig, seeding: Seeding, size: tuple[int, int], before: Live | None
    ) -> None:
        self._config, self._seeding = config, seeding
        self._size = size
        self._previous = None if before is None else before.grey
        self._live_id = np.zeros(0, dtype=np.int64) if before is None else before.number
        self._live_xy = np.zeros((0, 2), dtype=np.float32) if before is None else before.xy
        self._next_id = 0 if before is None else before.following
        # of each frame: observations, their tracks, pixels and depth
        self._log: list[tuple[int, NDArray[np.int64], NDArray[np.float32], NDArray[np.float32]]] = []

    def step(
        self, index: int, grey: NDArray[np.uint8], smooth: NDArray[np.float32], edge: NDArray[np.bool_]
    ) -> None:
        """smooth, edge: depth m of the same size and its edges and holes."""
        if self._previous is not None and len(self._live_id):
            self._follow(grey)
        if index % self._seeding.every == 0:
            self._seed(grey, smooth, edge)
        xy = np.rint(self._live_xy).astype(int)
        z = smooth[xy[:, 1], xy[:, 0]]
        z = np.where(edge[xy[:, 1], xy[:, 0]] | (z > self._config.max_depth), 0.0, z).astype(np.float32)
        seen = z > 0
        self._log.append((int(seen.sum()), self._live_id[seen], self._live_xy[seen], z[seen]))
        self._previous = grey

    def _follow(self, grey: NDArray[np.uint8]) -> None:
        assert self._previous is not None
        xy, found = followed(self._previous, grey, self._live_xy)
        if found.sum() < _LOST * len(found):  # all at once: the camera has changed its exposure, perhaps
            again, more = followed(*equally_bright(self._previous, grey), self._live_xy)
            if more.sum() > found.sum():
                xy, found = again, more
        w, h = self._size
        inside = (xy[:, 0] >= 1) & (xy[:, 0] <= w - 2) & (xy[:, 1] >= 1) & (xy[:, 1] <= h - 2)
        keep = inside & found
        # Two tracks that have run into each other follow the same point: the older one stays.
        cells = np.rint(xy / 2.0).astype(np.int64)
        _, first = np.unique(
            np.where(keep, cells[:, 1] * w + cells[:, 0], -1 - np.arange(len(xy))), return_index=True
        )
        unique = np.zeros(len(xy), dtype=bool)
        unique[first] = True
        keep &= unique
        self._live_id, self._live_xy = self._live_id[keep], np.ascontiguousarray(xy[keep])

    def _seed(self, grey: NDArray[np.uint8], depth: NDArray[np.float32], edge: NDArray[np.bool_]) -> None:
        side = self._seeding.cell
        w, h = self._size
        score = cv2.cornerMinEigenVal(grey.astype(np.float32) / 255.0, 5)
        score[edge | (depth <= 0) | (depth > self._config.max_depth)] = 0.0
        border = _WINDOW // 2
        score[:border], score[-border:], score[:, :border], score[:, -border:] = 0.0, 0.0, 0.0, 0.0
        ny, nx = h // side, w // side
        blocks = score[: ny * side, : nx * side].reshape(ny, side, nx, side).swapaxes(1, 2)
        flat = blocks.reshape(ny, nx, -1)
        best = flat.argmax(axis=-1)
        good = np.take_along_axis(flat, best[..., None], -1)[..., 0] > _MIN_CORNER_QUALITY
        cell = np.floor(self._live_xy / side).astype(int)
        inside = (cell[:, 0] < nx) & (cell[:, 1] < ny)
        good[cell[inside, 1], cell[inside, 0]] = False
        cy, cx = np.nonzero(good)
        b = best[cy, cx]
        xy = np.stack([cx * side + b % side, cy * side + b // side], axis=-1).astype(np.float32)
        self._live_id = np.concatenate([self._live_id, np.arange(self._next_id, self._next_id + len(xy))])
        self._live_xy = np.concatenate([self._live_xy, xy])
        self._next_id += len(xy)

    def stretch(self) -> Stretch:
        """Gather the log."""
        assert self._previous is not None
        seen, track, xy, depth = zip(*self._log, strict=True)
        live = Live(self._previous, self._live_id, self._live_xy, self._next_id)
        return Stretch(np.array(seen), np.concatenate(track), np.concatenate(xy), np.concatenate(depth), live)


def _smooth_depth(
    depth: NDArray[np.float32], edge_step: float
) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """3x3 median depth (0 where unknown) and a mask of depth edges and holes."""
    median = cv2.medianBlur(depth, 3)
    kernel = np.ones((3, 3), np.uint8)
    far = cv2.dilate(depth, kernel)
    near = cv2.erode(np.where(depth > 0, depth, np.float32(0.0)), kernel)
    edge = (near <= 0) | (far - near > edge_step * np.maximum(median, 0.1))
    return np.asarray(median), np.asarray(edge)
