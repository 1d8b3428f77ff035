"""Belief spread along surfaces from where part and static scene differ to where they look alike."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from recon.dense.depth import F32
from recon.dense.noise import DepthNoise
from recon.interaction.labels.crf import geodesic
from recon.interaction.labels.enclosed import enclosed_by_parts
from recon.interaction.labels.pooling import SURE, VoxelPool
from recon.interaction.labels.reference_frames import View
from recon.interaction.parts.moving_part import MovingPart
from recon.recording import Intrinsics
from twin.runs.threads import each
from twin.scene import Trajectory

# Log scores and px of the working grid, chosen by us.
_SURFACE_GAIN = 3.0
_FOLLOW_GAIN = 3.0
_REACH_PX = 60.0
# the rim that cameras see no depth in beside a hand, which is nearer than what it hides
_HAND_FARTHER_PX = 8.0


def _filled(depth: F32) -> F32:
    """Depth with unknown pixels filled by the nearest known one, so that a gap bridges no depth edge."""
    if not (depth > 0).any():
        return depth
    _, nearest = cv2.distanceTransformWithLabels(
        (depth <= 0).astype(np.uint8), cv2.DIST_L2, 3, labelType=cv2.DIST_LABEL_PIXEL
    )
    known = depth > 0
    value = np.zeros(int(nearest.max()) + 1, np.float32)
    value[nearest[known]] = depth[known]
    return value[nearest]


def pool_in_space(
    views: list[View],
    scores: list[F32],
    sure: list[NDArray[np.bool_]],
    cameras: Trajectory,
    parts: Sequence[MovingPart],
    camera: Intrinsics,
    scale: float,
    noise: DepthNoise,
) -> None:
    """Let what all views say about a voxel, and what is sure along a surface, count in each view.

    Args:
        sure: masks (1 + P, h, w) of what surely moved and of what surely stays, as `spread_along_surfaces`
            takes them.
        scale: standard deviation of colour within a surface.
        noise: of depth.
    """
    enclosed = enclosed_by_parts(views, scores, sure, cameras, parts, camera, noise)
    pool = VoxelPool(views, cameras, parts, camera, noise)
    pool.add_to(scores)

    def spread(k: int) -> None:
        spread_along_surfaces(scores[k], sure[k], enclosed[k], views[k], scale)

    deque(each(spread, range(len(views))), maxlen=0)
    pool.add_to(scores, settled=True)


def spread_along_surfaces(
    score: F32, sure: NDArray[np.bool_], enclosed: NDArray[np.bool_], seen: View, scale: float
) -> None:
    """If nothing decides part or static, what a part encloses is its own; else the nearer one along it.

    A drawer's bottom slides along itself and looks the same whether it moves or not; but its sides, which it
    adjoins without a depth edge, do move. Static surface is only sure where it stays or where the part can't
    be: support alone proves nothing, for what slides along itself supports both.
    """
    depth = _filled(seen.depth)
    for k in range(1, len(score) - 1):
        lead = score[k] - score[0]
        top = score.max(axis=0)
        possible = (score[0] > -SURE) & (score[k] > -SURE) & (np.maximum(score[0], score[k]) >= top)
        held = enclosed[0, k - 1] & possible & ~sure[0]
        open_question = enclosed[1, k - 1] & ~sure[k] & ~held & possible & (lead < SURE)
        if not (held | open_question).any():
            continue
        moving = held | ((lead > SURE) & (score[k] == top) & sure[0])
        resting = ~held & (lead < -SURE) & (score[0] == top) & (sure[k] | (score[k] < -SURE))
        to_part = geodesic(moving, seen.color, depth, scale, 3)
        to_static = geodesic(resting, seen.color, depth, scale, 3)
        nearer = (to_static - to_part) / (to_static + to_part + 1.0) * np.exp(-to_part / _REACH_PX)
        score[k][open_question] += _SURFACE_GAIN * nearer[open_question]
        score[k][held] += _SURFACE_GAIN


def follow_surroundings(score: F32, seen: View, scale: float) -> None:
    """Pixels without depth take the score of the labels around them, the nearer along like colours.

    No depth, as of stereo on plain surfaces, is no evidence for static. scale: sigma of a surface's colour.
    """
    known = seen.depth > 0
    if known.all() or not known.any():
        return
    label = np.where(known, score.argmax(axis=0), -1)
    ways = np.stack([geodesic(label == k, seen.color, seen.depth, scale, 3) for k in range(len(score))])
    ways[-1] += _HAND_FARTHER_PX
    nearest = ways.min(axis=0)
    score[:, ~known] = (_FOLLOW_GAIN * (nearest - ways) / (nearest + ways + 1.0))[:, ~known]
