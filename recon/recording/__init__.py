"""Recordings: lazily read RGB-D frames with checked intrinsics and clocks."""

from __future__ import annotations

import operator
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple, SupportsIndex, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from recon.recording.arrays import fields_of_arrays
from recon.recording.delay import without_delay
from recon.recording.intrinsics import Intrinsics as Intrinsics
from recon.recording.part import MIN_FRAMES as MIN_FRAMES
from recon.recording.part import part_of
from twin.errors import InputError
from twin.geometry import Array
from twin.scene import Trajectory

ReadColor = Callable[[int], NDArray[np.uint8]]
ReadDepth = Callable[[int], NDArray[np.float32]]


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
        told = intrinsics, times, fps, depth_scale, poses, gravity_camera0
        return cls(name=name, source=name, **fields_of_arrays(color, depth, *told))

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
