"""Pictures at other times than they were rendered at: motion blur, rolling shutter and delayed colour, by the exact motion of the image.

What a pixel shows is a point of a rigid body; where that body and the camera are a frame before and after says how the pixel moves.
Pixels are carried along that motion, the nearest on top; those beside an edge, which hold some of both colours, go with the nearer
surface. Approximated is what the rendered picture does not hold: ground that comes into the open takes the colour beside it, of the
farther side; what enters at the border repeats the border of what it belongs to; light, highlights and shadows are carried with the
surface; fingers that close between two frames move as the hand does.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from recon.simulate.render import Camera
from twin.errors import ConfigError
from twin.geometry import Array, invert_pose, transform

F32 = NDArray[np.float32]
MOST_SAMPLES = 24  # times in an open shutter; chosen by us, at speeds above 24 px in it the blur has steps
EDGE = 0.02  # relative step in depth from one pixel to the next that is an edge; chosen by us
STILL = 1e-6  # pixels: what rounding alone moves


@dataclass(frozen=True)
class Flow:
    """How the pixels of a frame move: `velocity` px/frame and `acceleration` px/frame^2 (H, W, 2); `depth` (H, W) m of what moves so,
    inf for nothing, which decides what covers what; `order` (H * W,) of the pixels, the farthest first.
    """

    velocity: F32
    acceleration: F32
    depth: F32
    order: NDArray[np.int64]

    @staticmethod
    def of(velocity: Array, acceleration: Array, depth: Array) -> Flow:
        """Flow in which pixels beside an edge go with the nearer surface."""
        far = np.where(depth > 0.0, depth, np.inf).astype(np.float32)
        leader = _nearer(far)
        moved = [np.where(np.abs(a) < STILL, 0.0, a).reshape(-1, 2)[leader] for a in (velocity, acceleration)]
        near = far.reshape(-1)[leader]
        order = np.argsort(-near, kind="stable")
        first, second = (m.astype(np.float32).reshape(*depth.shape, 2) for m in moved)
        return Flow(first, second, near.reshape(depth.shape), order)

    def displacement(self, time: Array) -> Array:
        """Way (H, W, 2) in pixels to times (H, W) in frames after this one."""
        t = time[..., None]
        return t * (self.velocity + 0.5 * t * self.acceleration)


def poses_around(poses: Array, index: int, present: Sequence[bool] | None = None) -> Array:
    """Poses (3, 4, 4) in the frames before, at and after `index`, of a body's poses (frames, 4, 4).

    At the ends of the recording, and next to frames in which the body is not there, the motion goes on as on the other side.
    """
    there = [0 <= k < len(poses) and (present is None or present[k]) for k in (index - 1, index + 1)]
    now = poses[index]
    if not any(there):
        return np.stack([now, now, now])
    before = poses[index - 1] if there[0] else now @ invert_pose(poses[index + 1]) @ now
    after = poses[index + 1] if there[1] else now @ invert_pose(poses[index - 1]) @ now
    return np.stack([before, now, after])


def image_motion(
    depth: F32, body: NDArray[np.int32], camera: Camera, cameras: Array, bodies: Sequence[Array]
) -> Flow:
    """Motion of each pixel, through its places in the frames before, at and after this one.

    Args:
        depth: exact depth (H, W) in metres, 0 = nothing.
        body: index (H, W) into `bodies` of what is seen, -1 = nothing.
        cameras: T_world_camera (3, 4, 4) before, now and after.
        bodies: T_world_body (3, 4, 4) of each body, the same way.
    """
    height, width = depth.shape
    cx, cy = camera.centre
    v, u = np.mgrid[0:height, 0:width].astype(np.float64)
    z = depth.astype(np.float64)
    local = np.stack([(u - cx) / camera.focal * z, (v - cy) / camera.focal * z, z], axis=-1)
    here = np.stack([u, v], axis=-1)
    places = np.stack([here, here])
    to_camera = invert_pose(cameras[[0, 2]])
    for k, poses in enumerate(bodies):
        mine = (body == k) & (depth > 0.0)
        fixed = invert_pose(poses[1]) @ cameras[1]
        for side, pose in enumerate(np.asarray(poses)[[0, 2]]):
            moved = camera.project(transform(to_camera[side] @ pose @ fixed, local[mine]))
            places[side][mine] = np.where(np.isfinite(moved), moved, here[mine])
    velocity = 0.5 * (places[1] - places[0])
    acceleration = places[1] + places[0] - 2.0 * here
    return Flow.of(velocity, acceleration, z)


def _nearer(depth: F32) -> NDArray[np.int64]:
    """Index (H * W,) of the pixel whose motion each takes: its own, or at an edge that of the nearest among its neighbours."""
    height, width = depth.shape
    leader = np.arange(height * width)
    nearest = cv2.erode(depth, np.ones((3, 3), np.uint8))
    row, column = np.nonzero(nearest < (1.0 - EDGE) * depth)
    best = np.full(len(row), np.inf, np.float32)
    for dy in (-1, 0, 1):
        for dx in (-1, 0, 1):
            y, x = np.clip(row + dy, 0, height - 1), np.clip(column + dx, 0, width - 1)
            closer = depth[y, x] < best
            best = np.where(closer, depth[y, x], best)
            own = row * width + column
            leader[own[closer]] = (y * width + x)[closer]
    return leader


def shifted(colour: F32, flow: Flow, offsets: Array) -> F32:
    """Colour (H, W, 3) as it is seen at other times.

    Args:
        colour: linear, as rendered.
        flow: motion of its pixels.
        offsets: time (H,) in frames from the rendered one at which each row of the result is seen.
    """
    if not np.any(offsets):
        return colour
    height, width = flow.depth.shape
    v, u = np.mgrid[0:height, 0:width].astype(np.float64)
    time = np.broadcast_to(offsets[:, None], (height, width))
    for _ in range(3):  # a pixel is seen at the time of the row that it has come to
        way = flow.displacement(time)
        time = np.interp(v + way[..., 1], np.arange(height), offsets)
    way = flow.displacement(time)
    carried = _carried(u + way[..., 0], v + way[..., 1], flow.order)
    opened = carried < 0
    source = _filled(carried, way, flow.depth)
    back = way.reshape(-1, 2)[source]
    # where ground has come into the open, going back would lead to what covered it: the neighbour's own pixel instead
    x_from, y_from = (
        np.where(opened, a.reshape(-1)[source], a - back[..., k]).astype(np.float32)
        for k, a in enumerate((u, v))
    )
    return np.asarray(
        cv2.remap(colour, x_from, y_from, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE), dtype=np.float32
    )


def _carried(x: Array, y: Array, order: NDArray[np.int64]) -> NDArray[np.int64]:
    """Which pixel (H, W) each pixel of the result stems from, -1 for none, where pixels come to (x, y) (H, W): each covers the four
    places about its own, so that a surface that comes nearer has no cracks.
    """
    height, width = x.shape
    x, y = x.reshape(-1)[order], y.reshape(-1)[order]
    left, top = np.floor(x).astype(np.int32), np.floor(y).astype(np.int32)
    columns = np.stack([left, np.ceil(x).astype(np.int32)], axis=1)
    rows = np.stack([top, np.ceil(y).astype(np.int32)], axis=1)
    at = rows[:, :, None] * width + columns[:, None, :]
    inside = ((rows >= 0) & (rows < height))[:, :, None] & ((columns >= 0) & (columns < width))[:, None, :]
    source = np.full(height * width, -1, dtype=np.int64)
    source[at[inside]] = np.broadcast_to(order[:, None, None], at.shape)[
        inside
    ]  # the last and so the nearest stays
    return source.reshape(height, width)


def _filled(source: NDArray[np.int64], way: Array, depth: F32) -> NDArray[np.int64]:
    """The same without gaps: where nothing has come to (-1), a neighbour's, grown inwards step by step. Of the neighbours
    the farthest is taken, as what comes into the open lies behind; but what the border covers goes on with what comes in over it.

    Args:
        way: of each pixel (H, W, 2).
        depth: of each pixel (H, W).
    """
    height, width = source.shape
    steps = np.array([-1, 1, -width - 2, width + 2])
    flat = np.pad(source, 1, constant_values=-1).reshape(-1)
    ways = np.append(way.reshape(-1, 2), [[0.0, 0.0]], axis=0)  # the last is for -1: no neighbour
    deep = np.append(depth.reshape(-1), -np.inf)
    row, column = (a.astype(np.int64) for a in np.nonzero(source < 0))
    todo = (row + 1) * (width + 2) + column + 1
    while len(todo):
        around = flat[todo[:, None] + steps]
        x, y = column[:, None] - ways[around, 0], row[:, None] - ways[around, 1]
        comes_in = (around >= 0) & ((x < 0) | (x > width - 1) | (y < 0) | (y > height - 1))
        rank = np.where(comes_in, 1e9 - deep[around], deep[around])
        best = np.take_along_axis(around, rank.argmax(axis=1)[:, None], axis=1)[:, 0]
        found = best >= 0
        if not found.any():
            raise ConfigError(
                "the picture moves by more than its own size while it is taken",
                "lower shutter, rolling_shutter_s or colour_delay_s in simulate.picture",
            )
        flat[todo[found]] = best[found]
        todo, row, column = todo[~found], row[~found], column[~found]
    return flat.reshape(height + 2, width + 2)[1:-1, 1:-1]


def exposed(colour: F32, flow: Flow, rows: Array, opened: float) -> F32:
    """Colour (H, W, 3) as a shutter sees it that is open for `opened` frames about the times `rows` (H,) of its rows, in frames."""
    if opened == 0.0:
        return shifted(colour, flow, rows)
    speed = float(np.quantile(np.linalg.norm(flow.velocity, axis=-1), 0.995))
    samples = int(np.clip(np.ceil(speed * opened), 2, MOST_SAMPLES))
    times = opened * ((np.arange(samples) + 0.5) / samples - 0.5)
    total = np.zeros(colour.shape, np.float64)
    for t in times:
        total += shifted(colour, flow, rows + t)
    return (total / samples).astype(np.float32)
