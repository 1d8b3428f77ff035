"""Whether the labels and the twin have a part at the same place: at both ends of its travel."""

from __future__ import annotations

from collections.abc import Mapping

import cv2
import numpy as np
from numpy.typing import NDArray

from recon.interaction.parts.moving_part import MovingPart
from recon.verdict.posed import PosedTwin, gate, without_narrow
from twin.geometry import Array

_END = 0.1  # share of the travel within which a state is at an end; chosen by us
_FEWEST = 20  # pixels of the thinned picture that tell; chosen by us
# Pixels of the thinned picture. In what is narrower, as a door that is seen edge-on, a pixel of outline to
# either side is more than a fifth of it. Of seven doors seen so (open recordings, looked at) the right ones
# have .73 to .79 without and .92 to .97 with one pixel of tolerance, one that is labelled elsewhere .02.
_NARROW = 10

Bits = NDArray[np.bool_]


def least_labelled(
    twin: PosedTwin, part: MovingPart, labels: Mapping[int, NDArray[np.uint8]]
) -> tuple[int, float] | None:
    """Of the two ends of a part's travel the one where labels and twin agree less: the frame in the middle of
    those of that end, and the intersection over union of the pixels that are labelled as the part and those
    that should show it. None where no end is in view."""
    state = np.interp(sorted(labels), part.motion.frames, part.motion.state)
    low, high = part.motion.state.min(), part.motion.state.max()
    near = _END * (high - low)
    ends = [
        _overlaps(twin, part, labels, np.array(sorted(labels))[at])
        for at in (state <= low + near, state >= high - near)
    ]
    told = [shown for end in ends if (shown := middle(end)) is not None]
    return min(told, key=lambda end: end[1], default=None)


def _overlaps(
    twin: PosedTwin, part: MovingPart, labels: Mapping[int, NDArray[np.uint8]], frames: Array
) -> list[tuple[int, float]]:
    """Frame and intersection over union of each frame that shows enough of the part.

    What is labelled hand and is nearer than the part hides it; what is labelled hand and is not, is the
    part's. In pieces that are narrow the outlines may differ by a pixel.
    """
    out = []
    for frame in frames.tolist():
        expected, seen = twin.expected(frame), twin.seen(frame)
        mine = (expected.owner == part.id) & (seen > 0)
        labelled = (twin.thinned(labels[frame]) == part.id) & (seen > 0)
        shown = mine & (seen >= expected.depth - gate(seen, expected.depth)[1])
        either = int((labelled | shown).sum())
        if either >= _FEWEST:
            other = (labelled & ~mine) | (shown & ~labelled)
            beside = (labelled & _grown(mine)) | (shown & _grown(labelled))
            other &= ~(_narrow(labelled | shown) & beside)
            out.append((frame, (either - int(other.sum())) / either))
    return out


def _grown(mask: Bits) -> Bits:
    """A mask (H, W) and the pixels that touch it."""
    return np.asarray(cv2.dilate(mask.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0)


def _narrow(mask: Bits) -> Bits:
    """The connected pieces of a mask (H, W) into which no square of `_NARROW` pixels fits."""
    _, pieces = cv2.connectedComponents(mask.astype(np.uint8))
    return mask & ~np.isin(pieces, np.unique(pieces[without_narrow(mask, _NARROW)]))


def middle(shares: list[tuple[int, float]]) -> tuple[int, float] | None:
    """Of frames and their shares the median by share, the lower of two middles. None of none."""
    return sorted(shares, key=lambda share: share[1])[(len(shares) - 1) // 2] if shares else None
