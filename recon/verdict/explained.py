"""Whether the twin explains the video: does it have the recorded depth in its states of rest?

The fit looks at tracks and labels; this looks at all pixels of frames in which nobody moves anything. A part
that was missed stands in the first frames where nothing is in the last ones, or the other way round, and no
single static scene agrees with both.
"""

from __future__ import annotations

from collections.abc import Mapping

import cv2
import numpy as np
from numpy.typing import NDArray

from recon.verdict.hands import hand_in_view
from recon.verdict.posed import PosedTwin, gate, opened, wide
from twin.scene import STATIC_LABEL

# Share of the recording at each end. Chosen by us
SHARE = 1 / 12
# Frames of it looked at, labelled ones if any. Chosen by us
FRAMES = 3
# Pixels of the thinned picture beside a hand: coarse sensors smear its rim over them. Chosen by us
_RIM = np.ones((5, 5), np.uint8)
THROUGHOUT = 24  # frames of the whole recording; chosen by us


def unexplained(twin: PosedTwin, labels: Mapping[int, NDArray[np.uint8]]) -> tuple[int, float]:
    """The frame at an end of the recording where the twin is worst, and the share with another depth.

    The end that is worse on average, without moving pixels labelled hand and their rim. labels: label images
    by frame.
    """
    posed = twin.cameras.frames
    count = max(FRAMES, round(SHARE * len(posed)))
    worst, mean = (int(posed[0]), 0.0), -1.0
    for rows, sign in ((posed[:count], 1), (posed[len(posed) - count :], -1)):
        shares = {f: _share(twin, f, labels.get(f), sign) for f in _looked_at(rows, labels)}
        if np.mean(list(shares.values())) > mean:
            mean = float(np.mean(list(shares.values())))
            worst = (max(shares, key=lambda f: shares[f]), mean)
    return worst


def static_seen_through(twin: PosedTwin) -> tuple[int, float]:
    """The frame, of some spread over the whole recording, in which most of what does not move is seen farther
    than the twin has it, and that share of the picture: something stood there, and went while nobody looked,
    or was missed as it moved. No hand is farther."""
    posed = twin.cameras.frames
    rows = np.unique(np.linspace(0, len(posed) - 1, THROUGHOUT).round().astype(int))
    shares = {int(f): _through(twin, int(f)) for f in posed[rows]}
    worst = max(shares, key=lambda f: shares[f])
    return worst, shares[worst]


def _through(twin: PosedTwin, frame: int) -> float:
    seen, expected = twin.seen(frame), twin.expected(frame)
    known, off = gate(seen, expected.depth)
    through = known & (seen > expected.depth + off) & (expected.owner == STATIC_LABEL)
    return float(wide(through, expected.depth, twin.camera).mean())


def _looked_at(frames: NDArray[np.int64], labels: Mapping[int, NDArray[np.uint8]]) -> list[int]:
    """Some of the frames, evenly spread."""
    known = [int(f) for f in frames if f in labels] or [int(f) for f in frames]
    return [known[k] for k in np.unique(np.linspace(0, len(known) - 1, FRAMES).round().astype(int))]


def _share(twin: PosedTwin, frame: int, image: NDArray[np.uint8] | None, sign: int) -> float:
    expected = twin.expected(frame).depth
    other = wide(other_depth(twin.seen(frame), expected), expected, twin.camera)
    if image is not None and other.any():
        other &= cv2.dilate(hand_in_view(twin, frame, image, sign).astype(np.uint8), _RIM) == 0
    return float(other.mean())


def other_depth(seen: NDArray[np.float32], expected: NDArray[np.float32]) -> NDArray[np.bool_]:
    """Pixels (H, W) whose depth differs from the expected one (0 = unknown), not single or beside steps."""
    known, off = gate(seen, expected)
    return opened(known & (np.abs(seen - expected) > off))
