"""Recordings: lazily read RGB-D frames with checked intrinsics and clocks."""

from __future__ import annotations

import operator
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple, SupportsIndex, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from twin.errors import InputError
from twin.geometry import Array
from twin.scene import Trajectory

ReadColor = Callable[[int], NDArray[np.uint8]]
ReadDepth = Callable[[int], NDArray[np.float32]]

MIN_FRAMES = 10  # chosen by us: rest, motion and rest again need a few frames each


@dataclass(frozen=True)
class Intrinsics:
    """Pinhole camera without distortion, pixel centres at integers; focal lengths and centre in pixels."""

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float

    def __post_init__(self) -> None:
        values = (self.width, self.height, self.fx, self.fy, self.cx, self.cy)
        if not np.all(np.isfinite(values)) or min(self.width, self.height, self.fx, self.fy) <= 0:
            raise InputError(
                f"intrinsics must be finite with positive size and focal lengths, got {values}",
                "give width, height, fx, fy, cx, cy in pixels",
            )
        if not (0 <= self.cx < self.width and 0 <= self.cy < self.height):
            raise InputError(
                f"principal point ({self.cx}, {self.cy}) lies outside the {self.width}x{self.height} image",
                "give the intrinsics of this resolution",
            )

    @property
    def matrix(self) -> Array:
        """K (3, 3)."""
        return np.array([[self.fx, 0, self.cx], [0, self.fy, self.cy], [0, 0, 1.0]])

    def scaled(self, width: int, height: int) -> Intrinsics:
        """The same camera at another resolution; pixel centres stay at integers."""
        sx, sy = width / self.width, height / self.height
        cx, cy = (self.cx + 0.5) * sx - 0.5, (self.cy + 0.5) * sy - 0.5
        return Intrinsics(width, height, self.fx * sx, self.fy * sy, cx, cy)

    @property
    def vector(self) -> Array:
        """(fx, fy, cx, cy), for compiled kernels."""
        return np.array([self.fx, self.fy, self.cx, self.cy])

    def binned(self, factor: int) -> Intrinsics:
        """The camera whose pixels are blocks of `factor` x `factor`; partial blocks right, below are cut."""
        cx, cy = ((c + 0.5) / factor - 0.5 for c in (self.cx, self.cy))
        return Intrinsics(
            self.width // factor, self.height // factor, self.fx / factor, self.fy / factor, cx, cy
        )

    def strided(self, step: int) -> Intrinsics:
        """The camera of every `step`-th pixel from the first on, as image[::step, ::step]."""
        width, height = -(-self.width // step), -(-self.height // step)
        return Intrinsics(width, height, *(self.vector / step).tolist())

    def backproject(self, pixels: Array, depth: Array) -> Array:
        """Camera points (..., 3) in metres of pixels (..., 2) = (x, y) at depth (...) metres."""
        x = (pixels[..., 0] - self.cx) / self.fx * depth
        y = (pixels[..., 1] - self.cy) / self.fy * depth
        return np.stack([x, y, np.asarray(depth, dtype=np.float64)], axis=-1)

    def project(self, points_cam: Array) -> Array:
        """Pixels (..., 2) of camera points (..., 3); depth must be positive."""
        z = points_cam[..., 2]
        return np.stack(
            [points_cam[..., 0] / z * self.fx + self.cx, points_cam[..., 1] / z * self.fy + self.cy], axis=-1
        )


class Frame(NamedTuple):
    """One frame: colour (H, W, 3) uint8 RGB and depth (H, W) float32 m, 0 = unknown, on one pixel grid."""

    color: NDArray[np.uint8]
    depth: NDArray[np.float32]


@dataclass(frozen=True, eq=False, repr=False)
class Recording:
    """An RGB-D recording whose frames are read when asked for.

    `recording[i]` is a frame (negative from the end), `recording[a:b:c]` a recording of these frames, and a
    loop goes over all frames. `color(i)` and `depth(i)` decode one of a frame's two images, `frame(i)` both;
    nothing is kept. Readers hand in `read_color` and `read_depth`, whose images are aligned on the grid of
    `intrinsics`. times (N,) s strictly increase. poses: known camera poses, used only when asked.
    gravity_camera0: unit vector (3,) that points down, in the first camera's axes, when the device knew it.
    path: where the recording lies, None for one in memory; opened_with: further options of it.
    """

    name: str
    source: str
    times: Array
    intrinsics: Intrinsics
    read_color: ReadColor
    read_depth: ReadDepth
    fingerprint: str
    poses: Trajectory | None = None
    gravity_camera0: Array | None = None
    warnings: tuple[str, ...] = ()
    metadata: Mapping[str, str] = field(default_factory=dict)
    path: Path | str | None = None
    opened_with: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        t = np.array(self.times, dtype=np.float64)
        if t.ndim != 1 or len(t) < MIN_FRAMES:
            raise InputError(
                f"{self.source}: a recording needs at least {MIN_FRAMES} frames, got {t.size}",
                "record the part at rest, the motion, and rest again",
            )
        bad = np.flatnonzero(~(np.diff(t) > 0))
        if not np.all(np.isfinite(t)) or len(bad):
            k = int(bad[0]) + 1 if len(bad) else int(np.flatnonzero(~np.isfinite(t))[0])
            raise InputError(
                f"{self.source}: time stamps must strictly increase, frame {k} has {t[k]!r} s",
                "sort the frames or repair timestamps.txt",
            )
        t.flags.writeable = False
        object.__setattr__(self, "times", t)

    @classmethod
    def from_arrays(
        cls,
        color: Any,
        depth: Any,
        intrinsics: Intrinsics | ArrayLike,
        *,
        times: ArrayLike | None = None,
        fps: float | None = None,
        depth_scale: float | None = None,
        poses: Trajectory | ArrayLike | None = None,
        gravity_camera0: ArrayLike | None = None,
        name: str = "arrays",
    ) -> Recording:
        """A recording from arrays in memory, which are neither copied nor changed.

        Args:
            color: (T, H, W, 3) uint8 RGB, or anything with a length whose items are such images (a list, a
                memory map).
            depth: (T, H, W), on the same pixel grid. Floats are metres, whole numbers need `depth_scale`. 0,
                NaN and infinity mean unknown.
            intrinsics: `Intrinsics` of these images, or K (3, 3) in pixels.
            times: (T,) s, strictly increasing; or fps: frames a second.
            depth_scale: depth values in a metre, as Open3D counts: 1000 for millimetres, 5000 for TUM RGB-D.
            poses: T_world_cam (T, 4, 4) with OpenCV's camera axes, or a `Trajectory`; used only when asked.
            gravity_camera0: vector (3,) that points down in the first camera's axes.

        Raises:
            InputError: shapes, types or ranges that are not these; it says which and how to bring them there.
        """
        from recon.recording.arrays import recording_from_arrays

        return recording_from_arrays(
            color, depth, intrinsics, times, fps, depth_scale, poses, gravity_camera0, name
        )

    def __len__(self) -> int:
        return len(self.times)

    def __iter__(self) -> Iterator[Frame]:
        return (self.frame(k) for k in range(len(self)))

    @overload
    def __getitem__(self, index: SupportsIndex) -> Frame: ...
    @overload
    def __getitem__(self, index: slice) -> Recording: ...
    def __getitem__(self, index: SupportsIndex | slice) -> Frame | Recording:
        """A frame, or a recording of the frames of a slice, which reads from this one.

        Raises InputError for a missing frame, and for a slice that goes backwards or holds too few frames.
        """
        if isinstance(index, slice):
            from recon.recording.part import part_of

            return part_of(self, index)
        k = operator.index(index)
        return self.frame(k + len(self) if -len(self) <= k < 0 else k)

    def without_depth_delay(self, delay: int | str) -> Recording:
        """The same recording, for depth that lags `delay` behind colour (is ahead of it: negative).

        Args:
            delay: whole frames, or a time such as "66ms"; `recon.inspect` tells it. Each frame gets the depth
                of the frame that is so much later, and frames without one are left out.

        Raises InputError for another delay, and where too few frames are left.
        """
        from recon.recording.delay import without_delay

        return without_delay(self, delay)

    def __repr__(self) -> str:
        from recon.recording.view import facts

        return f"<Recording {self.name!r}: {', '.join(facts(self).values())}>"

    def _repr_html_(self) -> str:
        """For notebooks: what `repr` says, and the first, middle and last frame."""
        from recon.recording.view import html

        return html(self)

    def frame(self, index: int) -> Frame:
        """Read both images of frame `index`. Raises InputError naming the file when one is unreadable."""
        return Frame(self.color(index), self.depth(index))

    def color(self, index: int) -> NDArray[np.uint8]:
        """Read the colour (H, W, 3) uint8 RGB of frame `index` alone. Raises InputError as `frame` does."""
        return self.read_color(self._checked(index))

    def depth(self, index: int) -> NDArray[np.float32]:
        """Read the depth (H, W) m, 0 = unknown, of frame `index` alone. Raises InputError as `frame` does."""
        return self.read_depth(self._checked(index))

    def _checked(self, index: int) -> int:
        if not 0 <= index < len(self):
            raise InputError(f"{self.source} has frames 0..{len(self) - 1}, not {index}")
        return index
