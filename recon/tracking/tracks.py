"""Point tracks of a recording: of some frames as arrays, of minutes as observations."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recon.recording import Intrinsics
from twin.errors import SceneError
from twin.geometry import Array
from twin.runs.keys import digest

# Observations of a track, at least: fewer constrain nothing.
FEWEST = 3
# px of the recording; lateral noise of a track: about what the forward-backward test leaves. Measured.
PIXEL_SIGMA = 0.6


@dataclass(frozen=True, eq=False, repr=False)
class Tracks:
    """T frames, K tracks: points_cam (T, K, 3) m in each frame's camera, pixels (T, K, 2), visible (T, K)
    bool. Points and pixels are NaN exactly where a track is not visible."""

    points_cam: Array
    pixels: Array
    visible: NDArray[np.bool_]

    def __post_init__(self) -> None:
        t, k = self.visible.shape
        for name, shape in (("points_cam", (t, k, 3)), ("pixels", (t, k, 2))):
            if getattr(self, name).shape != shape:
                raise SceneError(f"tracks: {name} must have shape {shape}, got {getattr(self, name).shape}")
        for name in ("points_cam", "pixels"):
            finite = np.isfinite(getattr(self, name)).all(axis=-1)
            if not np.array_equal(finite, self.visible):
                raise SceneError(f"tracks: {name} must be NaN exactly where a track is not visible")

    def __repr__(self) -> str:
        share = self.visible.mean() if self.visible.size else 0.0
        return f"<Tracks: {len(self)} in {len(self.visible)} frames, visible in {share:.0%}>"

    def __len__(self) -> int:
        return self.visible.shape[1]

    def without(self, some: NDArray[np.bool_]) -> Tracks:
        """The same tracks, of which some (K,) are never visible."""
        seen = self.visible & ~some
        points, pixels = (np.where(seen[..., None], a, np.nan) for a in (self.points_cam, self.pixels))
        return Tracks(points, pixels, seen)


@dataclass(frozen=True, eq=False, repr=False)
class SparseTracks:
    """Tracks of a whole recording, one row an observation, in the order of the frames.

    Frame f has the rows starts[f]:starts[f + 1]. starts: (T + 1,). track (n,): 0 to count - 1. xy (n, 2) px
    of the tracking image, whose intrinsics are `camera`; to_full: pixels of the recording in one of its.
    depth: (n,) m. A track has three rows or more: fewer constrain nothing.
    """

    starts: NDArray[np.int64]
    track: NDArray[np.int32]
    xy: NDArray[np.float32]
    depth: NDArray[np.float32]
    count: int
    camera: Intrinsics
    to_full: float

    def __post_init__(self) -> None:
        rows = len(self.track)
        if self.starts[0] != 0 or self.starts[-1] != rows or np.any(np.diff(self.starts) < 0):
            raise SceneError(f"tracks: starts must rise from 0 to the number of rows, {rows}")
        if self.xy.shape != (rows, 2) or self.depth.shape != (rows,):
            raise SceneError(f"tracks: {rows} rows need xy ({rows}, 2) and depth ({rows},)")

    def __repr__(self) -> str:
        return f"<SparseTracks: {self.count} in {self.frames} frames, {len(self.track)} observations>"

    def __len__(self) -> int:
        return self.count

    @property
    def frames(self) -> int:
        """Number of frames, T."""
        return len(self.starts) - 1

    def dense(self, first: int = 0, last: int | None = None) -> Tracks:
        """The tracks of the frames first..last, counted from 0, as arrays; those with three observations or
        more there. Default: the whole recording."""
        last = self.frames - 1 if last is None else last
        frame, column, chosen = self._between(first, last)
        shape = (last - first + 1, int(column.max(initial=-1)) + 1)
        pixels, depth = np.full((*shape, 2), np.nan), np.zeros(shape)
        pixels[frame, column], depth[frame, column] = self.xy[chosen], self.depth[chosen]
        visible = depth > 0
        points = self.camera.backproject(pixels, depth)
        points[~visible] = np.nan
        return Tracks(points, (pixels + 0.5) * self.to_full - 0.5, visible)

    def content(self, first: int, last: int) -> str:
        """Digest of what `dense` gives of these frames."""
        frame, column, chosen = self._between(first, last)
        return digest(self.camera, self.to_full, frame, column, self.xy[chosen], self.depth[chosen])

    def _between(self, first: int, last: int) -> tuple[NDArray[np.int64], ...]:
        """Of tracks with enough observations in the frames first..last: frame, column and row here (n,)."""
        rows = slice(self.starts[first], self.starts[last + 1])
        kept = np.bincount(self.track[rows], minlength=self.count) >= FEWEST
        column = np.cumsum(kept) - 1
        chosen = np.flatnonzero(kept[self.track[rows]]) + rows.start
        frame = np.searchsorted(self.starts, chosen, side="right") - 1 - first
        return frame, column[self.track[chosen]], chosen
