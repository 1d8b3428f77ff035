"""Log scores of a frame's pixels from reference frames alone: static scene, parts, hand."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from recon.dense.depth import F32
from recon.dense.noise import DepthNoise
from recon.interaction.labels.evidence import ENOUGH
from recon.interaction.labels.pooling import SURE, world_points
from recon.interaction.labels.reference_frames import (
    References,
    View,
    gather,
    normals_of,
    relative_moves,
    says_nothing,
)
from recon.interaction.parts.moving_part import MovingPart
from recon.recording import Intrinsics
from twin import geometry as geo
from twin.geometry import Array
from twin.scene import Revolute, Trajectory

# Log scores, chosen by us and the same for every recording.
_SUPPORT = 1.5  # two references' agreement
_VIOLATION = 4.0  # one and a half references that see through
_HAND = -0.7  # of a hand: a moving pixel without more evidence is part or hand alike
# Share of the range by which a state is clearly another. Chosen by us.
_MOVED_SHARE = 0.15
# px of the working grid at the picture's border, whose normals are unknown: what comes into view lies there.
_RIM = 2
# Cosine between a surface's normal and its way below which it slides in itself; normals are known to .1.
_ALONG = 0.15


def first_scores(
    seen: View,
    refs: References,
    cameras: Trajectory,
    parts: Sequence[MovingPart],
    boxes: Sequence[tuple[Array, Array] | None],
    camera: Intrinsics,
    slack: float,
    noise: DepthNoise,
) -> tuple[F32, NDArray[np.bool_]]:
    """Log scores (1 + P + 1, h, w) of static, parts, hand from the reference frames alone; the masks
    (1 + P, h, w) of what surely moved and, for each part, of what surely stays (see `_stays`)."""
    moves = relative_moves(cameras, parts, seen.frame, refs.frames)
    moves[:, [f == seen.frame for f in refs.frames]] = np.nan
    known = seen.depth > 0
    world = world_points(seen, camera, cameras.pose(seen.frame))
    within = [_within(p.pose(seen.frame), box, known, world) for p, box in zip(parts, boxes, strict=True)]
    nowhere = known & ~np.logical_or.reduce(within)
    planes = [_score(gather(seen, refs, moves[0], camera, slack, noise, nowhere))]
    stays = []
    for part, inside, move in zip(parts, within, moves[1:], strict=True):
        side = _side(part, seen.frame, refs)
        still = gather(seen, refs, moves[0], camera, slack, noise, inside, side)
        planes[0][inside] = _score(still)[inside]
        stays.append(_stays(still, side))
        score = _score(gather(seen, refs, move, camera, slack, noise, inside, side))
        score[known & ~inside] = -_VIOLATION
        alike = slides_in_itself(seen, part, cameras.pose(seen.frame), camera) & (planes[0] > -SURE)
        planes.append(np.where(alike, np.minimum(score, planes[0]), score))
    untold = says_nothing(seen, noise) & (np.max(planes, axis=0) < _HAND)
    planes = [np.where(untold, np.float32(0), p) for p in planes]
    planes.append(np.full(known.shape, _HAND, np.float32))
    return np.stack(planes).astype(np.float32), np.array([planes[0] < -SURE, *stays])


def slides_in_itself(
    seen: View, part: MovingPart, T_world_cam: Array | None, camera: Intrinsics
) -> NDArray[np.bool_]:
    """Pixels (h, w) whose surface the part's motion carries along itself: a wall beside a drawer.

    Where the part was, the same surface goes on: that it is seen there tells nothing of where this piece was.
    """
    pose, joint = np.eye(4) if T_world_cam is None else T_world_cam, part.joint
    inner = normals_of(seen, camera)[_RIM:-_RIM, _RIM:-_RIM]
    normals = np.pad(inner, ((_RIM, _RIM), (_RIM, _RIM), (0, 0)), mode="edge")
    way = np.broadcast_to(joint.axis @ pose[:3, :3], normals.shape)
    if isinstance(joint, Revolute):
        v, u = np.mgrid[: seen.depth.shape[0], : seen.depth.shape[1]]
        points = camera.backproject(np.stack([u, v], axis=-1).astype(float), seen.depth.astype(float))
        way = np.cross(way, points - geo.transform(geo.invert_pose(pose), joint.pivot[None])[0])
    across = np.abs(np.sum(normals * way, axis=-1))
    told = np.any(normals != 0, axis=-1)
    return np.asarray(told & (across < _ALONG * np.linalg.norm(way, axis=-1)))


def _within(
    pose: Array | None, box: tuple[Array, Array] | None, known: NDArray[np.bool_], world: F32
) -> NDArray[np.bool_]:
    """Pixels (h, w) of known depth in a part's box; all of them when its pose or its box is not known."""
    inside = known.copy()
    if box is not None and pose is not None:
        at_rest = geo.transform(geo.invert_pose(pose), world)
        inside[known] = ((at_rest > box[0]) & (at_rest < box[1])).all(axis=1)
    return inside


def _side(part: MovingPart, frame: int, refs: References) -> NDArray[np.int8]:
    """-1 for references at rest with the part at a clearly lower state than in this frame, 1 at a higher."""
    span = float(np.ptp(part.motion.state)) if len(part.motion.state) else 0.0
    now, then = part.state(frame), [part.state(f) for f in refs.frames]
    if now is None or span == 0:
        return np.zeros(len(then), np.int8)
    share = np.array([0.0 if s is None else (s - now) / span for s in then])
    return np.asarray(np.sign(share) * (np.abs(share) > _MOVED_SHARE) * refs.trusted, dtype=np.int8)


def _stays(evidence: F32, side: NDArray[np.int8]) -> NDArray[np.bool_]:
    """Pixels that are seen at their place both while the part is at lower and while it is at higher states.

    They are static even if so flat that they could have moved along themselves: a table below a door.
    """
    counts = [int((side == sign).sum()) for sign in (-1, 1)]
    sides = [evidence[2 + k] > 0.4 * n for k, n in enumerate(counts) if n]
    return np.logical_and.reduce(sides) if sides else np.ones(evidence.shape[1:], bool)


def _score(evidence: F32) -> F32:
    support, violation, lower, higher = evidence
    seen_through = np.clip((0.85 * violation - 0.3 * (lower + higher)) / 1.5, 0.0, 1.0)
    score: F32 = (_SUPPORT * np.minimum(support, ENOUGH) / ENOUGH - _VIOLATION * seen_through).astype(
        np.float32
    )
    return score
