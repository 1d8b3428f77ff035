"""Whether the cameras' path holds: frames that look at the same places must see the same depth there.

Where the twin has a part nothing is compared, nor what labels call one or a hand, and what was missed is the
smaller part of what is left: a low quantile of the differences in depth is that of the room. What one frame
sees before a place that the other looks at counts only where that one sees through it: else it hides the
place. The quantile grows with the path's error wherever the room is not one plane along which the path slips.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from recon.dense.depth import look_up
from recon.verdict.posed import GATE_M, PosedTwin
from twin import geometry as geo
from twin.geometry import Array
from twin.runs.threads import each
from twin.scene import FIRST_PART_ID

_FRAMES = 40  # looked at, evenly spread
_APART = (0.0, 0.1, 0.25, 0.5, 0.8)  # of the recording, between the frames of a pair; 0: neighbours
_PAIRS = 20  # of each distance
QUANTILE = 0.3  # what was missed may fill two thirds of the picture
_COMMON = 0.1  # of the picture, seen by both frames at least; less may be one thing that moved. Chosen by us


def camera_drift(twin: PosedTwin, labels: Mapping[int, NDArray[np.uint8]]) -> tuple[int, int, float]:
    """The two frames that agree least on where the room is, and by how much, m; 0 if no two overlap.

    labels: label images (H, W) by frame, of which some are looked at.
    """
    known = sorted(labels)
    rows = np.unique(np.linspace(0, len(known) - 1, min(len(known), _FRAMES)).round().astype(int))
    frames = [known[r] for r in rows]
    if not frames:
        return 0, 0, 0.0
    twin.expected(frames[0])  # what it casts rays at is built once, before the threads ask for it
    rooms = list(each(lambda frame: _room(twin, frame, labels[frame]), frames))
    gaps = [max(1, round(share * len(frames))) for share in _APART]
    pairs = [
        (int(a), int(a) + gap)
        for gap in gaps
        for a in np.unique(np.linspace(0, len(frames) - 1 - gap, _PAIRS).round().astype(int))
        if a >= 0
    ]
    off = each(lambda p: _depth_difference(twin, *((frames[k], rooms[k]) for k in p)), pairs)
    worst = (frames[0], frames[0], 0.0)
    for (a, b), metres in zip(pairs, off, strict=True):
        if metres > worst[2]:
            worst = (frames[a], frames[b], metres)
    return worst


def _room(twin: PosedTwin, frame: int, image: NDArray[np.uint8]) -> NDArray[np.float32]:
    """Recorded depth (H, W) m of what never moves by twin and labels, 0 elsewhere."""
    moves = (twin.expected(frame).owner >= FIRST_PART_ID) | (twin.thinned(image) >= FIRST_PART_ID)
    return np.where(moves, np.float32(0.0), twin.seen(frame))


def _depth_difference(
    twin: PosedTwin, one: tuple[int, NDArray[np.float32]], other: tuple[int, NDArray[np.float32]]
) -> float:
    """By how much (m) two frames' depths differ where they look at the same places; 0 if these are few."""
    (a, near), (b, far) = one, other
    y, x = np.nonzero(near)
    points = twin.camera.backproject(np.stack([x, y], axis=-1).astype(float), near[y, x].astype(float))
    T_ba = geo.invert_pose(twin.T_world_cam(b)) @ twin.T_world_cam(a)
    moved = geo.transform(T_ba, points)
    landed = look_up(far, twin.camera, moved)
    seen = landed.z
    both = seen > 0
    nearer = np.flatnonzero(both & (seen < moved[:, 2] - GATE_M))
    hides = _hides(twin, near, landed.x[nearer], landed.y[nearer], seen[nearer], geo.invert_pose(T_ba))
    both[nearer[hides]] = False
    if both.sum() < _COMMON * near.size:
        return 0.0
    return float(np.quantile(np.abs(seen[both] - moved[both, 2]), QUANTILE))


def _hides(
    twin: PosedTwin,
    near: NDArray[np.float32],
    x: NDArray[np.int64],
    y: NDArray[np.int64],
    depth: Array,
    T_ab: Array,
) -> NDArray[np.bool_]:
    """Whether what the other frame sees at pixels (x, y), at these depths (n,), may stand there for the first
    frame, which does not see through it: then it hides what the first frame sees, and is no other copy of it.
    T_ab: from the other camera to the first."""
    points = twin.camera.backproject(np.stack([x, y], axis=-1).astype(float), depth)
    back = geo.transform(T_ab, points)
    again = look_up(near, twin.camera, back).z
    return np.asarray(again < back[:, 2] + GATE_M)
