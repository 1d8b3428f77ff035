"""Whether the twin explains the video: carried to its states in the frames of rest, does it have the depth that was recorded?

The fit looks at tracks and labels; this looks at all pixels of frames in which nobody moves anything. A part that was missed stands
in the first frames where nothing is in the last ones, or the other way round, and no single static scene agrees with both.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from recon.verdict.posed import PosedTwin, gate, opened

SHARE, FRAMES = (
    1 / 12,
    3,
)  # of the recording at each end, and how many frames of it are looked at; chosen by us


def unexplained(twin: PosedTwin) -> tuple[int, float]:
    """The frame at one end of the recording in which the twin is worst, and the share of its pixels with another depth.

    Of the two ends, the one that is worse on average.
    """
    posed = twin.cameras.frames
    count = max(FRAMES, round(SHARE * len(posed)))
    ends = (np.arange(count), np.arange(len(posed) - count, len(posed)))
    worst = (int(posed[0]), 0.0)
    mean = -1.0
    for rows in ends:
        chosen = rows[np.linspace(0, count - 1, FRAMES).round().astype(int)]
        shares = {int(f): _share(twin, int(f)) for f in posed[chosen]}
        if np.mean(list(shares.values())) > mean:
            mean = float(np.mean(list(shares.values())))
            worst = (max(shares, key=lambda f: shares[f]), mean)
    return worst


def _share(twin: PosedTwin, frame: int) -> float:
    return float(other_depth(twin.seen(frame), twin.expected(frame).depth).mean())


def other_depth(seen: NDArray[np.float32], expected: NDArray[np.float32]) -> NDArray[np.bool_]:
    """Pixels (H, W) whose depth differs from the expected one (0 = unknown, in both), single ones and those beside steps left out."""
    known, off = gate(seen, expected)
    return opened(known & (np.abs(seen - expected) > off))
