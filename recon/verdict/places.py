"""Whether each place of a part's surface was seen to move with it: depth alone, no tracks.

A place that moves is seen where the part brings it, at two places that are apart, and one frame sees through
what another one shows it at, in as many frames as contradict it: a place that was labelled wrong (a wall, a
table, a neighbour) is seen through where the part would bring it, or is still seen where it was when the part
has left. A hand hides and never shows what is behind it.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from recon.dense.depth import F32, look_up
from recon.interaction.parts.moving_part import MovingPart
from recon.verdict.in_motion import frames_by_travel
from recon.verdict.posed import PosedTwin, gate
from twin import geometry as geo
from twin.geometry import Array
from twin.mesh import sample_surface
from twin.scene import Mesh

# Places, evenly by area. Chosen by us
PLACES = 600
# Frames of the motion, by travel. Chosen by us
MOVING = 10
# Frames of each rest beside. Chosen by us
RESTING = 4
# Limits of depth that a place must move by. Chosen by us
APART = 2.0
_BESIDE = 5  # px of the thinned picture: what is that near a place's ray may be it
_UNKNOWN, _HIDDEN, _THERE, _EMPTY = 0, 1, 2, 3  # what a frame says of a point of the room

Bits = NDArray[np.bool_]


@dataclass(frozen=True)
class Places:
    """Shares of a part's area. witnessed: seen to move with it. far: goes far enough for that."""

    witnessed: float
    far: float


def places(twin: PosedTwin, part: MovingPart, mesh: Mesh) -> Places | None:
    """What was seen of each place of a part's surface at state 0; None without area or motion."""
    points = sample_surface(mesh, PLACES, np.random.default_rng(0))[0]
    frames = looked_at(twin, part)
    if not len(points) or len(frames) < 2:
        return None
    views = _views(twin, frames)
    state = np.interp(frames, part.motion.frames, part.motion.state)
    posed = np.array([geo.transform(part.joint.pose(float(s)), points) for s in state])
    limit = APART * views[0].off
    far = np.linalg.norm(posed[np.argmax(state)] - posed[np.argmin(state)], axis=-1) > limit
    moved, against = _counted(twin, views, posed, limit)
    witnessed = (moved > 0) & (moved >= against)
    return Places(float(witnessed.mean()), float(far.mean()))


def looked_at(twin: PosedTwin, part: MovingPart) -> list[int]:
    """Frames of the part's motion and of the rests around it, until another part moves; None if at rest."""
    moving = frames_by_travel(part, MOVING)
    if not moving:
        return []
    known = twin.cameras.frames
    first, last = part.motion.intervals[0][0], part.motion.intervals[-1][1]
    others = [i for p, _ in twin.parts if p.id != part.id for i in p.motion.intervals]
    since = max((b for _, b in others if b < first), default=int(known[0]) - 1)
    until = min((a for a, _ in others if a > last), default=int(known[-1]) + 1)
    rests = [known[(known > since) & (known < first)], known[(known > last) & (known < until)]]
    chosen = [r[np.linspace(0, len(r) - 1, min(len(r), RESTING)).round().astype(int)] for r in rests]
    return sorted({*moving, *(int(f) for rest in chosen for f in rest)})


@dataclass(frozen=True, eq=False)
class _Depth:
    """Depth (H, W) m, 0 = unknown; least and greatest beside each pixel, inf and 0 if all are unknown."""

    here: F32
    nearest: F32
    farthest: F32

    @classmethod
    def of(cls, depth: F32) -> _Depth:
        kernel = np.ones((_BESIDE, _BESIDE), np.uint8)
        nearest = cv2.erode(np.where(depth > 0, depth, np.float32(np.inf)), kernel)
        return cls(depth, np.asarray(nearest), np.asarray(cv2.dilate(depth, kernel)))


@dataclass(frozen=True, eq=False)
class _View:
    """A frame: what was seen, what the twin shows in its state, and how far (m) other depths differ."""

    T_cam_world: Array
    seen: _Depth
    twin: _Depth
    off: float


def _views(twin: PosedTwin, frames: list[int]) -> list[_View]:
    """The frames with one limit for all, the middle of theirs: a hand may fill one of them."""
    pairs = [(twin.seen(f), twin.expected(f).depth) for f in frames]
    off = float(np.median([gate(seen, expected)[1] for seen, expected in pairs]))
    return [
        _View(geo.invert_pose(twin.T_world_cam(f)), _Depth.of(seen), _Depth.of(expected), off)
        for f, (seen, expected) in zip(frames, pairs, strict=True)
    ]


def _counted(
    twin: PosedTwin, views: list[_View], posed: Array, limit: float
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """How many frames show each place (n,) moved to where it is seen, farther than `limit` m from another
    position at which it is, and how many contradict it. posed (F, n, 3): where the part brings them."""
    frames = np.arange(len(views))
    # said[r, f]: what frame r says of the points as in frame f; left[r, f]: the twin is empty there in r.
    pairs = [_says(twin, view, posed.reshape(-1, 3)) for view in views]
    said = np.array([s for s, _ in pairs]).reshape(len(frames), *posed.shape[:2])
    left = np.array([e for _, e in pairs]).reshape(said.shape)
    own = said[frames, frames]
    there = own == _THERE
    apart = np.linalg.norm(posed[:, None] - posed, axis=-1) > limit
    followed = there & (apart & there).any(axis=1)
    moved = followed & (said == _EMPTY).any(axis=0)
    stayed = (left & (said == _THERE) & there).any(axis=1)
    return moved.sum(axis=0), ((own == _EMPTY) | stayed).sum(axis=0)


def _says(twin: PosedTwin, view: _View, points: Array) -> tuple[NDArray[np.int8], Bits]:
    """What a frame says of points (n, 3) of the room, and where (n,) the twin has nothing in its state."""
    at = geo.transform(view.T_cam_world, points)
    inside, x, y, seen = look_up(view.seen.here, twin.camera, at)
    known, z, off = inside & (seen > 0), at[:, 2], view.off
    nearest = view.seen.nearest[y, x]
    out = np.full(len(points), _UNKNOWN, np.int8)
    out[known & (nearest < z - off)] = _HIDDEN
    out[known & (np.abs(seen - z) <= off)] = _THERE
    out[known & (nearest > z + off)] = _EMPTY
    left = (view.twin.nearest[y, x] > z + 2 * off) | (view.twin.farthest[y, x] < z - 2 * off)
    return out, left
