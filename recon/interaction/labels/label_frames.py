"""Labels: which pixels are static scene, which part, which hand, from geometry alone.

Every pixel's point is carried into reference frames as if it belonged to the static scene and as if to each
part. A surface that is seen through in another frame can't have been there. What neither hypothesis explains
is the hand with its sleeve. Evidence is then pooled over voxels of the world and of each part, and over
neighbouring pixels. FunREC, supplement 1.3: geometry in place of votes on regions.
"""

from __future__ import annotations

import warnings
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from recon.dense.depth import F32
from recon.dense.noise import GOOD_SENSOR, DepthNoise
from recon.interaction.labels.crf import agree, upsample_labels
from recon.interaction.labels.enclosed import DEEP
from recon.interaction.labels.first_scores import first_scores
from recon.interaction.labels.hand_pieces import Rests, drop_crumbs, too_wide
from recon.interaction.labels.pooling import pool_color, world_points
from recon.interaction.labels.reference_frames import (
    COLOR_SIGMAS,
    References,
    View,
    as_references,
    find_references,
    gather,
    halved,
    lab,
    relative_moves,
    view,
)
from recon.interaction.labels.spreading import follow_surroundings, pool_in_space
from recon.interaction.parts.moving_part import MovingPart
from recon.recording import Intrinsics, Recording
from twin import geometry as geo
from twin.errors import ReconstructionError
from twin.geometry import Array
from twin.runs.keys import Stage
from twin.runs.loop import Loop, untold
from twin.runs.setting import Settings, setting
from twin.runs.threads import each
from twin.scene import HAND_LABEL, STATIC_LABEL, UNKNOWN_LABEL, Trajectory

LABELS = Stage("labels", 14, ("labels",))


@dataclass(frozen=True)
class LabelConfig(Settings):
    """How frames are labelled."""

    every: int = setting(4, "every so many frames one is labelled", unit="frames", at_least=1)


# px; width to which frames are shrunk for the dense test. Chosen by us.
WORKING_WIDTH = 320
# m; error in depth that camera, joint and state may cause together. Chosen by us.
_POSE_ERROR = 0.003
# Frames taken from each time of rest. Chosen by us.
_REFERENCES = 6
# Frames of the whole recording that join as free-space witnesses. Chosen by us.
_WITNESSES = 8
# Log score of a part without any evidence: such a pixel is static. Chosen by us.
_PRIOR_PART = -0.5
_BOX_MARGIN_M = 0.1
_HAND_AT_END = 0.003  # share of the picture, as for references


def label_frames(
    recording: Recording,
    cameras: Trajectory,
    parts: Sequence[MovingPart],
    config: LabelConfig = LabelConfig(),
    noise: DepthNoise = GOOD_SENSOR,
    *,
    frames: Sequence[int] | None = None,
    width: int = WORKING_WIDTH,
    progress: Loop | None = None,
) -> dict[int, NDArray[np.uint8]]:
    """Label images (H, W) at colour resolution: 0 unknown, 1 static, part ids, 255 hand with forearm.

    Args:
        noise: of depth.
        frames: which frames; default every `config.every`-th one that has a camera pose.
        width: px, to which frames are shrunk for the dense test.

    Warns if no rest before or after the motion is without a hand. ReconstructionError: no camera pose.
    """
    known = set(cameras.frames.tolist())
    wanted = range(0, len(recording), config.every) if frames is None else frames
    chosen = [int(f) for f in wanted if int(f) in known]
    if not chosen:
        raise ReconstructionError("no frame to label has a camera pose", "label frames the cameras cover")
    factor = max(1, round(recording.intrinsics.width / width))
    refs = find_references(
        recording,
        cameras,
        parts,
        factor=factor,
        slack=_POSE_ERROR,
        noise=noise,
        per_phase=_REFERENCES,
        witnesses=_WITNESSES,
    )
    _warn(refs)
    camera = recording.intrinsics.binned(factor)
    boxes = [_part_box(refs, cameras, p, camera, _POSE_ERROR, noise) for p in parts]

    def look(frame: int) -> tuple[View, F32, NDArray[np.bool_]]:
        seen = view(recording, frame, factor)
        return seen, *first_scores(seen, refs, cameras, parts, boxes, camera, _POSE_ERROR, noise)

    looks = [seen for _, seen in zip((progress or untold)(chosen, "labels"), each(look, chosen), strict=True)]
    views, scores, stays = (list(column) for column in zip(*looks, strict=True))
    pool_in_space(views, scores, stays, cameras, parts, camera, COLOR_SIGMAS * refs.color_sigma, noise)
    _weigh(views, scores, COLOR_SIGMAS * refs.color_sigma)
    pool_color(views, scores)
    rests = Rests.of(views, cameras, parts, camera, refs.color_sigma, _POSE_ERROR, noise)
    ids = np.array([STATIC_LABEL, *(p.id for p in parts), HAND_LABEL], np.uint8)

    def final(k: int) -> NDArray[np.uint8]:
        return _final(recording, views[k], scores[k], factor, ids, rests)

    out = dict(zip(chosen, each(final, range(len(views))), strict=True))
    if frames is None:
        _warn_of_ends(out)
    return out


def _weigh(views: Sequence[View], scores: Sequence[F32], scale: float) -> None:
    """Add to the scores what is likely beforehand, and where there is no depth what stands around."""

    def weigh(k: int) -> None:
        scores[k][1:-1] += _PRIOR_PART
        follow_surroundings(scores[k], views[k], scale)

    deque(each(weigh, range(len(views))), maxlen=0)


def _warn(refs: References) -> None:
    for k, free in enumerate(refs.rest_without_hand):
        if not free:
            where = {0: "before the first motion", len(refs.rest_without_hand) - 1: "after the last motion"}
            warnings.warn(
                f"no frame {where.get(k, 'between two motions')} is free of the hand: part and hand labels will be "
                "less exact there; record a second of rest without the hand",
                stacklevel=3,
            )


def _warn_of_ends(labels: dict[int, NDArray[np.uint8]]) -> None:
    """Warn when the recording, or the window of a walk, starts or ends with the hand in the picture."""
    for when, frame, which in (("start", min(labels), "first"), ("end", max(labels), "last")):
        share = float(np.mean(labels[frame] == HAND_LABEL))
        if share > _HAND_AT_END:
            warnings.warn(
                f"the frames {when} with the hand in the picture ({share:.1%} of the {which}): what it hides there is "
                "less sure; record a second of rest without the hand",
                stacklevel=3,
            )


def _part_box(
    refs: References,
    cameras: Trajectory,
    part: MovingPart,
    camera: Intrinsics,
    slack: float,
    noise: DepthNoise,
) -> tuple[Array, Array] | None:
    """Lower and upper corner (3,) that surely hold the part at state 0; None when nothing is known of it.

    The part's board and, of a slide, what its front drags behind it; else what other references see through,
    in references that show no hand. `_BOX_MARGIN_M` and half of the size are added.
    """
    if part.board is not None:
        slides = part.joint.kind == "prismatic"
        ways = (-DEEP, 0.0, DEEP) if slides else (0.0,)
        return _around(np.concatenate([part.board + way * part.joint.axis for way in ways]), part.board)
    views = [halved(View(f, d, c)) for f, d, c in zip(refs.frames, refs.depth, refs.color, strict=True)]
    small, half = as_references(views, np.zeros(len(views), bool), refs.color_sigma), camera.strided(2)

    def moved_points(k: int) -> Array:
        seen, pose = views[k], part.pose(refs.frames[k])
        if pose is None:
            return np.zeros((0, 3))
        moves = relative_moves(cameras, (), seen.frame, refs.frames)[0]
        moves[k] = np.nan
        violation = gather(seen, small, moves, half, slack, noise)[1]
        moved = replace(seen, depth=np.where(violation > 1.5, seen.depth, np.float32(0)))
        return geo.transform(geo.invert_pose(pose), world_points(moved, half, cameras.pose(seen.frame)))

    found = list(each(moved_points, np.flatnonzero(refs.trusted).tolist()))
    points = np.concatenate(found) if found else np.zeros((0, 3))
    if len(points) < 50:
        return None
    return _around(points, points)


def _around(points: Array, sized: Array) -> tuple[Array, Array]:
    """The box of most of the points (n, 3), with a margin by the size of others (m, 3)."""
    low, high = np.percentile(points, [0.5, 99.5], axis=0)
    size = float(np.ptp(np.percentile(sized, [0.5, 99.5], axis=0), axis=0).max())
    margin = _BOX_MARGIN_M + 0.5 * size
    return low - margin, high + margin


def _final(
    recording: Recording,
    seen: View,
    score: F32,
    factor: int,
    ids: NDArray[np.uint8],
    rests: Rests,
) -> NDArray[np.uint8]:
    """Neighbours agree, then the full grid follows colour and depth."""
    scale = COLOR_SIGMAS * rests.color_sigma
    belief = agree(score, seen.color, seen.depth, scale, 3, 6, 3.0)
    drop_crumbs(belief)
    rests.drop_armless(belief, seen)
    color, depth = recording.frame(seen.frame)
    labels = upsample_labels(
        belief, seen.color, seen.depth, lab(color), np.asarray(depth, np.float32), factor, scale, ids
    )
    hand = labels == HAND_LABEL
    labels[too_wide(hand, np.asarray(depth, np.float32), recording.intrinsics.fx)] = UNKNOWN_LABEL
    if not (depth > 0).any():
        labels[:] = UNKNOWN_LABEL
    return labels
