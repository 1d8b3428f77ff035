"""When a fitted part surely moves and surely rests, and which tracks move while it rests."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from recon.interaction.joints.result import MotionFit
from recon.interaction.motion.intervals import Interval, state_intervals
from recon.interaction.motion.movers import Movers
from recon.interaction.motion.spread import spread
from recon.interaction.parts.config import REST_TOLERANCE

# Frames between motion and what surely is rest. Chosen by us.
REST_MARGIN = 3
# Share of the range within which a part rests for sure: each frame's own uncertainty would call slow starts
# rest, and this is well above both. Chosen by us.
_SURE_REST = 0.05


def moving_spans(fit: MotionFit) -> tuple[Interval, ...]:
    """When the fitted part surely moves: its slow starts and ends count as rest."""
    noise = fit.joint.sigma.state if fit.joint.sigma else 0.0
    return state_intervals(fit.frames, fit.state, noise, _SURE_REST)


def rest_spans(fit: MotionFit, frames: int) -> list[tuple[int, int]]:
    """Spans of frames in which the fitted part rests, a few frames away from its motion."""
    spans, start = [], 0
    for interval in (*moving_spans(fit), Interval(frames + 1, frames + 2)):
        first, last = start, min(interval.first - REST_MARGIN, frames - 1)
        if last - first >= REST_MARGIN:
            spans.append((first, last))
        start = interval.last + REST_MARGIN
    return spans


def known_rest_spans(fit: MotionFit, frames: int) -> list[tuple[int, int]]:
    """Spans of rest cut to the frames whose state is known: past these the part may move on."""
    spans = []
    for first, last in rest_spans(fit, frames):
        known = fit.frames[(fit.frames >= first) & (fit.frames <= last)]
        if len(known) and known[-1] - known[0] >= REST_MARGIN:
            spans.append((int(known[0]), int(known[-1])))
    return spans


def restless(
    movers: Movers, chosen: NDArray[np.bool_], rests: Sequence[tuple[int, int]]
) -> NDArray[np.bool_]:
    """Tracks (K,) that move while the part rests: on the hand, or drifting."""
    out = np.zeros_like(chosen)
    points, visible = movers.points_world[:, chosen], movers.visible[:, chosen]
    for first, last in rests:
        strays, count = spread(points[first : last + 1], visible[first : last + 1], 0.9)
        out[chosen] |= (strays > REST_TOLERANCE) & (count >= 6)
    return out
