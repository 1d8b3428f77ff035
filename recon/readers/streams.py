"""What a reader returns: two streams of pictures, each with camera and clock, to become a recording."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from recon.readers import files
from recon.recording import MIN_FRAMES, Intrinsics, ReadColor, ReadDepth, Recording
from recon.recording.rig import Lens, Rig
from twin.errors import InputError
from twin.geometry import Array, unit

MAX_SIDE = 640  # px, chosen by us: VGA holds what a 256x192 depth image can support, a ninth of 1920x1440


@dataclass(frozen=True, eq=False)
class Streams:
    """A recording as its files hold it.

    Attributes:
        name: of the recording.
        source: where it is from, for messages.
        color_times: (n,) s, increasing.
        depth_times: (m,) s on the same clock, increasing.
        read_color: index into `color_times` -> (H, W, 3) uint8 RGB as stored, of the size of `rig.color`.
        read_depth: index into `depth_times` -> (h, w) float32 m as stored, 0 = unknown, of the size of
            `rig.depth`.
        rig: both cameras.
        fingerprint: of all that the recording depends on.
        poses: times (k,) s and T_world_cam (k, 4, 4) of the colour camera with OpenCV's axes, in any order.
        upright: whether the poses' world is z-up, so that they tell gravity.
        gravity: unit vector (3,) that points down in the first colour picture's axes.
        tolerance: s between a colour and a depth picture of one frame; None: half a frame.
        longest: px, the longer side that pictures are scaled down to; None: as they are.
        own_cameras: fx, fy, cx, cy (n, 4) of each colour picture, where a lens that moves makes them others
            than those of `rig`; depth is then seen through the same lens.
    """

    name: str
    source: str
    color_times: Array
    depth_times: Array
    read_color: ReadColor
    read_depth: ReadDepth
    rig: Rig
    fingerprint: str
    poses: tuple[Array, Array] | None = None
    upright: bool = False
    gravity: Array | None = None
    tolerance: float | None = None
    longest: int | None = MAX_SIDE
    own_cameras: Array | None = None
    warnings: tuple[str, ...] = ()
    metadata: Mapping[str, str] = field(default_factory=dict)


def recording_of(streams: Streams) -> Recording:
    """Bring two streams onto one pixel grid and one clock, that of colour.

    Colour is undistorted and scaled down to `longest`; depth is brought into that camera behind a z-buffer. A
    frame is a colour picture and the nearest depth within tolerance. InputError: the clocks don't meet.
    """
    color, depth, lost = _frames(streams)
    times = streams.color_times[color]
    tolerance = _half_frame(times) if streams.tolerance is None else streams.tolerance
    poses = None if streams.poses is None else files.trajectory_at(*streams.poses, times, tolerance)
    warnings = streams.warnings
    if streams.poses is not None and poses is None:
        warnings += (_other_time(streams, times),)
    gravity = streams.gravity
    if gravity is not None and color[0] != 0:
        gravity = None  # it is told in the axes of a picture that is left out
    if streams.upright and poses is not None and poses.frames[0] == 0:
        gravity = unit(poses.T_world_cam[0, :3, :3].T @ np.array([0.0, 0.0, -1.0]))
    read_color, read_depth, grid = _on_one_grid(streams)
    return Recording(
        name=streams.name,
        source=streams.source,
        times=times,
        intrinsics=grid,
        read_color=lambda k: read_color(int(color[k])),
        read_depth=lambda k: read_depth(int(depth[k])),
        fingerprint=streams.fingerprint,
        poses=poses,
        gravity_camera0=gravity,
        warnings=warnings + ((lost,) if lost else ()),
        metadata=streams.metadata,
    )


def associate(first: Array, second: Array, tolerance: float) -> NDArray[np.int64]:
    """Pairs (n, 2) of indices into two sorted lists of times (s), nearest first, each time used at most once.

    Pairs are further apart than `tolerance` nowhere, and come in the order of `first`.
    """
    low = np.searchsorted(second, first - tolerance, side="left")
    high = np.searchsorted(second, first + tolerance, side="right")
    candidates = [
        (abs(first[i] - second[j]), i, j) for i in range(len(first)) for j in range(int(low[i]), int(high[i]))
    ]
    used_first: set[int] = set()
    used_second: set[int] = set()
    pairs = []
    for _, i, j in sorted(candidates):
        if i not in used_first and j not in used_second:
            used_first.add(i)
            used_second.add(j)
            pairs.append((i, j))
    return np.array(sorted(pairs), dtype=np.int64).reshape(-1, 2)


def _other_time(streams: Streams, times: Array) -> str:
    assert streams.poses is not None
    stamps = streams.poses[0]
    return (
        f"{streams.name}: its poses (from {stamps.min():.3f} to {stamps.max():.3f} s) are of another time than its frames "
        f"(from {times[0]:.3f} to {times[-1]:.3f} s), and left out"
    )


def _half_frame(times: Array) -> float:
    return 0.5 * float(np.median(np.diff(times))) if len(times) >= MIN_FRAMES else 0.0


def _frames(streams: Streams) -> tuple[NDArray[np.int64], NDArray[np.int64], str]:
    """Indices of colour and of depth, one a frame, and what is to be said of those left out."""
    first, second = streams.color_times, streams.depth_times
    for name, times in (("colour", first), ("depth", second)):
        if len(times) == 0:
            raise InputError(f"{streams.source} holds no {name} picture", "record colour and depth")
    if np.array_equal(first, second):
        _require_increasing(streams.source, "frame", first)
        both = np.arange(len(first), dtype=np.int64)
        return both, both, ""
    _require_increasing(streams.source, "colour", first)
    _require_increasing(streams.source, "depth", second)
    slower = max(_half_frame(first), _half_frame(second))
    tolerance = slower if streams.tolerance is None else streams.tolerance
    pairs = associate(first, second, tolerance)
    if len(pairs) < min(MIN_FRAMES, len(first)):
        raise InputError(
            f"{streams.source}: {len(pairs)} of {len(first)} colour pictures (from {first[0]:.3f} to {first[-1]:.3f} s) have "
            f"a depth picture (from {second[0]:.3f} to {second[-1]:.3f} s) within {tolerance:.3f} s",
            "give both streams one clock",
        )
    lost = len(first) - len(pairs)
    return (
        pairs[:, 0],
        pairs[:, 1],
        (f"{streams.name}: {lost} of {len(first)} colour images have no depth image in time" if lost else ""),
    )


def _require_increasing(source: str, name: str, times: Array) -> None:
    bad = np.flatnonzero(~(np.diff(times) > 0))
    if not np.all(np.isfinite(times)) or len(bad):
        k = int(bad[0]) + 1 if len(bad) else int(np.flatnonzero(~np.isfinite(times))[0])
        raise InputError(
            f"{source}: time stamps must strictly increase, {name} {k} has {float(times[k])!r} s",
            "sort the frames or repair timestamps.txt",
        )


def _on_one_grid(streams: Streams) -> tuple[ReadColor, ReadDepth, Intrinsics]:
    """Readers of both pictures on the recording's pixel grid, by own indices, and that grid's camera."""
    rig = streams.rig
    native, seen = rig.color.camera, rig.depth.camera
    scale = 1.0 if streams.longest is None else min(1.0, streams.longest / max(native.width, native.height))
    grid = (
        native if scale == 1.0 else native.scaled(round(native.width * scale), round(native.height * scale))
    )

    def color(index: int) -> NDArray[np.uint8]:
        image = streams.read_color(index)
        _require_size(streams, "colour", index, image.shape, native)
        return image

    def depth(index: int) -> NDArray[np.float32]:
        metres = streams.read_depth(index)
        _require_size(streams, "depth", index, metres.shape, seen)
        return metres

    if rig.is_registered and grid == native and streams.own_cameras is None:
        return color, depth, grid
    from recon.dense.registration import ColorGrid, DepthGrid, moved_lens  # here: OpenCV and compiled kernels

    to_color, to_depth = ColorGrid(rig.color, grid), DepthGrid(rig, grid)
    if streams.own_cameras is None:
        return lambda k: to_color(color(k)), lambda k: to_color.where_seen(to_depth(depth(k))), grid
    own = [replace(native, fx=k[0], fy=k[1], cx=k[2], cy=k[3]) for k in streams.own_cameras.tolist()]
    of_depth = files.nearest_frames(streams.depth_times, streams.color_times, np.inf)

    def own_depth(index: int) -> NDArray[np.float32]:
        lens = Lens(own[of_depth[index]].scaled(seen.width, seen.height))
        return DepthGrid(Rig(rig.color, lens), grid)(depth(index))

    return lambda k: to_color(moved_lens(color(k), own[k], native)), own_depth, grid


def _require_size(
    streams: Streams, name: str, index: int, shape: tuple[int, ...], camera: Intrinsics
) -> None:
    if shape[:2] != (camera.height, camera.width):
        raise InputError(
            f"{streams.source}: {name} {index} is {shape[1]}x{shape[0]}, its camera's numbers are of "
            f"{camera.width}x{camera.height}",
            "give the intrinsics of the images as they are stored, neither turned nor cropped",
        )
