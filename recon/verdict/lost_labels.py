"""Whether the labels find a part's surface wherever the twin brings it: at both ends of its travel."""

from __future__ import annotations

from collections.abc import Mapping

import cv2
import numpy as np
from numpy.typing import NDArray

from recon.parts.moving_part import MovingPart
from recon.verdict.posed import PosedTwin
from twin.geometry import Array
from twin.scene import HAND_LABEL, STATIC_LABEL

_END = 0.1  # share of the travel within which a state is at an end; chosen by us
_FEWEST = 20  # pixels of the thinned picture that tell; chosen by us


def least_labelled(
    twin: PosedTwin, part: MovingPart, labels: Mapping[int, NDArray[np.uint8]]
) -> tuple[int, float] | None:
    """Of the two ends of a part's travel the one where less of its surface is labelled as it: the frame that shows half of them more, and
    the share of the pixels that see the surface and are labelled part or room. None where no end is in view."""
    state = np.interp(sorted(labels), part.motion.frames, part.motion.state)
    low, high = part.motion.state.min(), part.motion.state.max()
    near = _END * (high - low)
    ends = [
        _labelled(twin, part, labels, np.array(sorted(labels))[at])
        for at in (state <= low + near, state >= high - near)
    ]
    told = [shown for end in ends if (shown := middle(end)) is not None]
    return min(told, key=lambda end: end[1], default=None)


def _labelled(
    twin: PosedTwin, part: MovingPart, labels: Mapping[int, NDArray[np.uint8]], frames: Array
) -> list[tuple[int, float]]:
    """Frame and share of each frame that shows enough of the part. Pixels at its rim are not asked: a board seen edge-on is little else."""
    out = []
    for frame in frames.tolist():
        image = twin.thinned(labels[frame])
        mine = (twin.expected(frame).owner == part.id).astype(np.uint8)
        shown = (cv2.erode(mine, np.ones((3, 3), np.uint8)) > 0) & (twin.seen(frame) > 0)
        shown &= (image >= STATIC_LABEL) & (image < HAND_LABEL)
        if shown.sum() >= _FEWEST:
            out.append((frame, float((image[shown] == part.id).mean())))
    return out


def middle(shares: list[tuple[int, float]]) -> tuple[int, float] | None:
    """Of frames and their shares the median by share: the lower of the two in the middle of an even number. None of none."""
    return sorted(shares, key=lambda share: share[1])[(len(shares) - 1) // 2] if shares else None
