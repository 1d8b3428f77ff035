"""Pictures at other times than rendered: motion blur, rolling shutter, delayed colour, by exact image motion.

What a pixel shows is a point of a rigid body; where that body and the camera are a frame before and after
says how the pixel moves. Pixels are carried along that motion, the nearest on top; those beside an edge,
which hold some of both colours, go with the nearer surface. Approximated is what the rendered picture does
not hold: ground that comes into the open takes the colour beside it, of the farther side; what enters at the
border repeats the border of what it belongs to; light, highlights and shadows are carried with the surface;
fingers that close between two frames move as the hand does.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from recon.simulate import pixel_motion
from recon.simulate.render import Camera
from twin.errors import ConfigError
from twin.geometry import Array, invert_pose

F32 = NDArray[np.float32]
MOST_SAMPLES = 24  # times in an open shutter; chosen by us, at speeds above 24 px in it the blur has steps
EDGE = 0.02  # relative step in depth from one pixel to the next that is an edge; chosen by us
STILL = 1e-6  # pixels: what rounding alone moves
# a pixel is seen at the time of the row that it has come to; each shrinks the error
ROUNDS = 3


@dataclass(frozen=True)
class Flow:
    """How the pixels of a frame move: `velocity` px/frame and `acceleration` px/frame^2 (H, W, 2); `depth`
    (H, W) m of what moves so, inf for nothing, which decides what covers what.
    """

    velocity: F32
    acceleration: F32
    depth: F32

    @staticmethod
    def of(velocity: Array, acceleration: Array, depth: Array | F32) -> Flow:
        """Flow in which pixels beside an edge go with the nearer surface."""
        far = np.where(depth > 0.0, depth, np.inf).astype(np.float32)
        nearest = cv2.erode(far, np.ones((3, 3), np.uint8))
        first, second = (np.ascontiguousarray(m, dtype=np.float64) for m in (velocity, acceleration))
        return Flow(*pixel_motion.led(first, second, far, nearest, EDGE, STILL))


def poses_around(poses: Array, index: int, present: NDArray[np.bool_] | None = None) -> Array:
    """Poses (3, 4, 4) in the frames before, at and after `index`, of a body's poses (frames, 4, 4).

    At the ends, and next to frames without the body, the motion goes on as on the other side.
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
    to_camera = invert_pose(cameras[[0, 2]])
    moves = np.empty((len(bodies), 2, 3, 4))
    for k, poses in enumerate(bodies):
        fixed = invert_pose(poses[1]) @ cameras[1]
        moves[k] = (to_camera @ np.asarray(poses)[[0, 2]] @ fixed)[:, :3]
    return Flow.of(*pixel_motion.motion(depth, body, camera.focal, *camera.centre, moves), depth)


def shifted(colour: F32, flow: Flow, offsets: Array) -> F32:
    """Colour (H, W, 3) as it is seen at other times.

    Args:
        colour: linear, as rendered.
        flow: motion of its pixels.
        offsets: time (H,) in frames from the rendered one at which each row of the result is seen.
    """
    if not np.any(offsets):
        return colour
    rows = np.ascontiguousarray(offsets, dtype=np.float64)
    way = pixel_motion.ways(flow.velocity, flow.acceleration, rows, ROUNDS)
    carried = pixel_motion.carried(way, flow.depth)
    source = _filled(carried, way, flow.depth)
    x_from, y_from = pixel_motion.origins(source, carried < 0, way)
    return np.asarray(
        cv2.remap(colour, x_from, y_from, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE), dtype=np.float32
    )


def _filled(source: NDArray[np.int64], way: Array, depth: F32) -> NDArray[np.int64]:
    """The same without gaps: where nothing has come to (-1), a neighbour's, grown inwards step by step. Of
    the neighbours the farthest is taken, as what comes into the open lies behind; but what the border covers
    goes on with what comes in over it.

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
    """Colour (H, W, 3) of a shutter open for `opened` frames about its rows' times `rows` (H,), in frames."""
    if opened == 0.0:
        return shifted(colour, flow, rows)
    speed = float(np.quantile(np.linalg.norm(flow.velocity, axis=-1), 0.995))
    samples = int(np.clip(np.ceil(speed * opened), 2, MOST_SAMPLES))
    times = opened * ((np.arange(samples) + 0.5) / samples - 0.5)
    total = np.zeros(colour.shape, np.float64)
    for t in times:
        total += shifted(colour, flow, rows + t)
    return (total / samples).astype(np.float32)
