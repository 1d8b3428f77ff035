"""What the frames say together: lag and registration of depth, focal length, rest, and the hand."""

from __future__ import annotations

import numpy as np

from recon.inspection.changes import Depths, arm_in_view, depths_of, moving_shares
from recon.inspection.finding import Unknown
from recon.inspection.findings import finding
from recon.inspection.focal import fit_focal
from recon.inspection.glance import Stretch
from recon.inspection.lag import fit_lag
from recon.inspection.registration import REACH, EdgeTable, edge_table, offset
from recon.interaction.motion.intervals import REST_SECONDS
from recon.recording import Recording
from twin.cause import Cause

Found = list[Cause | Unknown]

_FOCAL = 0.02  # a door half a metre wide becomes 1 cm too wide or too narrow
_SURE = 3.0  # standard deviations
# px of 640: tracks leave out a pixel beside edges of depth; beyond it they take the background's depth
_SHIFT = 1.5
# px of 640, at the left and right border: told by thirds of the picture, and so half as well as a shift
_BORDER = 3.0
_LAG = 0.025  # s: a part that is opened at 0.4 m/s moves 1 cm, which counts as movement
_LEAST_EDGES = 500  # pixels on edges of depth in a frame that would meet edges of colour if they could
# share of the picture with depth, as `frame_checks` asks for: the rims of holes are edges of nothing
_KNOWN = 0.65
_MOVES = 0.003  # share of the picture: a metre away 6 cm x 6 cm, less than a fist
_ENDS = 3  # frames at the beginning and the end that have to agree
_EVERY = 4  # frames: how often the hand is looked for in between


def focal(stretches: list[Stretch], recording: Recording) -> Found:
    """The stated focal length against the one under which tracks move rigidly."""
    fit = fit_focal(stretches)
    if fit is None:
        return [Unknown("focal length", "too few points can be followed from frame to frame")]
    if _SURE * fit.sigma > _FOCAL:
        return [Unknown("focal length", f"the camera turns too little: known within {_SURE * fit.sigma:.0%}")]
    if abs(fit.ratio - 1) <= _FOCAL:
        return []
    stated = recording.intrinsics.fx
    return [finding("WrongFocal", stated, stated * fit.ratio, fit.sigma)]


def lag(stretches: list[Stretch], recording: Recording) -> Found:
    """By how much depth lags behind colour."""
    fit = fit_lag(stretches)
    if fit is None:
        return [Unknown("lag of depth", "nothing moves by which it would show")]
    late, sigma = fit.frames * stretches[0].seconds, fit.sigma * stretches[0].seconds
    if abs(late) <= max(_LAG, _SURE * sigma):
        return []
    usual = float(np.median(np.diff(recording.times)))
    return [finding("DepthDelayed", round(late / usual), late, sigma)]


def registration(stretches: list[Stretch], recording: Recording) -> Found:
    """Shift and scale between depth and colour."""
    tables = [edge_table(s) for s in stretches]
    table = EdgeTable(*(np.concatenate([getattr(t, name) for t in tables]) for name in ("score", "count")))
    found: Found = []
    where = offset(table)
    small = stretches[0].small.intrinsics
    full = recording.intrinsics.width / small.width  # px of the recording in one of the inspected size
    least = _SHIFT * small.width / 640
    if not np.isfinite(where.shift).any():
        known = np.median([x.known for s in stretches for x in s.facts])
        if where.nowhere and where.edges >= _LEAST_EDGES * len(table.score) and known >= _KNOWN:
            return [finding("NoCommonEdges", where.edges, REACH * full)]
        return [Unknown("registration", "depth shows too few edges, or too many holes")]
    # edges of colour lie to the left of those of depth when depth lies too far right
    x, y = (
        -_surely(interval, max(least, _SURE * sigma)) * full
        for interval, sigma in zip(where.shift, where.sigma[:2], strict=True)
    )
    border = 0.0  # where some of the times tell none it is not known
    if np.isfinite([*where.border, where.sigma[2]]).all():
        widest = max(_BORDER * small.width / 640, _SURE * float(where.sigma[2]))
        border = -_surely(where.border, widest) * full
    if x or y or border:
        found.append(finding("Misregistered", x or None, y or None, border or None))
    for axis, interval in zip("xy", where.shift, strict=True):
        if not np.isfinite(interval).all():
            found.append(Unknown(f"registration along {axis}", "too few edges of depth are edges of colour"))
    return found


def _surely(interval: np.ndarray, least: float) -> float:
    """The value of an interval (2,) that is nearest zero if it is beyond `least`, else 0, also if unknown."""
    low, high = interval
    nearest = low if low > 0 else high if high < 0 else 0.0
    return float(nearest) if abs(nearest) > least else 0.0


def rest_and_hand(stretches: list[Stretch]) -> Found:
    """Whether the recording begins and ends at rest, and without the hand."""
    first, last = depths_of(stretches[0]), depths_of(stretches[-1])
    if first is None or last is None:
        why = "too few points can be followed to find the cameras"
        return [Unknown("rest", why), Unknown("hand", why)]
    return [*_rest(stretches, [first, last]), *_hand(first, last)]


def _rest(stretches: list[Stretch], ends: list[Depths]) -> Found:
    gap = max(1, round(REST_SECONDS / stretches[0].seconds))
    shares = []
    for depths in ends:
        n = len(depths.depth) - gap
        if n < 2 * _ENDS:
            return [Unknown("rest", f"{n + gap} frames are too few")]
        frames = np.unique([*range(_ENDS), *range(_ENDS, n - _ENDS, _EVERY), *range(n - _ENDS, n)])
        shares.append(moving_shares(depths, gap, frames))
    before, after = float(np.median(shares[0][:_ENDS])), float(np.median(shares[1][-_ENDS:]))
    if np.isnan(before) or np.isnan(after):
        return [Unknown("rest", "the first or the last frames share too few points with the others")]
    most = float(np.nanmax(np.concatenate(shares)))
    if most < _MOVES:
        # of a long one the motion may not have been looked at
        return [] if len(stretches) > 1 else [finding("NothingMoves", most)]
    if max(before, after) < _MOVES:
        return []
    return [finding("NoRest", before >= _MOVES, after >= _MOVES, REST_SECONDS, max(before, after))]


def _hand(first: Depths, last: Depths) -> Found:
    seen = []
    for depths in [first] if last is first else [first, last]:
        n = len(depths.depth)
        frames = sorted({*range(_ENDS), *range(_ENDS, n - _ENDS, _EVERY), *range(n - _ENDS, n)})
        seen.append(np.array([arm_in_view(depths, f) for f in frames]))
    before, after = bool(seen[0][:_ENDS].all()), bool(seen[-1][-_ENDS:].all())
    share = float(np.concatenate(seen).mean())
    return [finding("HandAlwaysThere", before, after, share)] if before or after else []
