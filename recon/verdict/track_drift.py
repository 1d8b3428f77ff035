"""How far resting tracks seem to move while a part does: tracks and cameras drift."""

from __future__ import annotations

import numpy as np

from recon.interaction.motion.movers import Movers
from recon.interaction.parts.static_spans import REST_MARGIN
from twin.geometry import Array
from twin.scene import Motion

# Fewest tracks that see both rests. Chosen by us.
_FEWEST_TRACKS = 20


def track_drift(motion: Motion, movers: Movers) -> float | None:
    """Median distance (m) of resting tracks from before the part moves to after; None with too few tracks."""
    spans = motion.intervals
    if not spans:
        return None
    first, last = spans[0][0] - REST_MARGIN, spans[-1][1] + REST_MARGIN
    resting = np.flatnonzero(~movers.moving)
    before, after = (
        _middle(movers.points_world[frames][:, resting])
        for frames in (slice(0, max(first, 0)), slice(last, None))
    )
    moved = np.linalg.norm(after - before, axis=1)
    moved = moved[np.isfinite(moved)]
    return float(np.median(moved)) if len(moved) >= _FEWEST_TRACKS else None


def _middle(points: Array) -> Array:
    """Median (K, 3) over the frames of points (T, K, 3); NaN where a track is seen in fewer than three."""
    out = np.full(points.shape[1:], np.nan)
    often = np.isfinite(points[..., 0]).sum(axis=0) >= 3
    if often.any():
        out[often] = np.nanmedian(points[:, often], axis=0)
    return out
