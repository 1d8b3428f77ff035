"""Rates over several walks, from the counts of each: what becomes of parts, rooms, interactions and cameras.

Brackets hold Wilson 95 % intervals where the things counted are parts, rooms or interactions. Frames of one
walk are alike, so shares of frames have none. Definitions: docs/metrics.md.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from benchmarks.unseen_page import rate
from recon.evaluation.walk_scores import (
    IntervalCounts,
    LocalErrors,
    PieceScore,
    PoseCounts,
    StateCounts,
    WalkScores,
    total_intervals,
    total_states,
)


@dataclass(frozen=True)
class WalkRates:
    """Sums over walks.

    trusted: parts of the twins that these call trusted, whatever their role; trusted_right: of these the
    right ones. ate_mm: RMSE of the camera centres over all pieces; ate_walks: the same of each walk, and its
    share of the way; torn: walks whose path is in pieces.
    """

    walks: int
    parts: int
    found: int
    right: int
    doubles: int
    mis_solved: int
    invented_trusted: int
    invented_untrusted: int
    trusted: int
    trusted_right: int
    rooms_right: int
    intervals: IntervalCounts
    intervals_matched: IntervalCounts
    states: StateCounts
    states_matched: StateCounts
    local: LocalErrors
    ate_mm: float
    ate_walks: tuple[tuple[float, float], ...]
    torn: int
    poses: PoseCounts


def pooled(walks: Sequence[WalkScores]) -> WalkRates:
    """Sums over walks; no walk gives zeros."""
    pieces = [p for w in walks for p in w.pieces]
    return WalkRates(
        walks=len(walks),
        parts=sum(len(w.parts) for w in walks),
        found=sum(len(w.matched) for w in walks),
        right=sum(w.right for w in walks),
        doubles=sum(w.count("double") for w in walks),
        mis_solved=sum(w.count("mis-solved") for w in walks),
        invented_trusted=sum(w.count("invented", True) for w in walks),
        invented_untrusted=sum(w.count("invented", False) for w in walks),
        trusted=sum(f.trusted for w in walks for f in w.found),
        trusted_right=sum(p.right and p.trusted for w in walks for p in w.parts),
        rooms_right=sum(w.room_right for w in walks),
        intervals=total_intervals(w.intervals for w in walks),
        intervals_matched=total_intervals(w.intervals_matched for w in walks),
        states=total_states(w.states for w in walks),
        states_matched=total_states(w.states_matched for w in walks),
        local=sum((w.local for w in walks), LocalErrors()),
        ate_mm=_rms(pieces),
        ate_walks=tuple(sorted((_rms(w.pieces), _share_of_way(w.pieces)) for w in walks if w.pieces)),
        torn=sum(len(w.pieces) > 1 for w in walks),
        poses=sum((w.poses for w in walks), PoseCounts()),
    )


def _rms(pieces: Sequence[PieceScore]) -> float:
    """mm over all posed frames of some pieces."""
    posed = sum(p.frames for p in pieces)
    return float((sum(p.frames * p.ate_mm**2 for p in pieces) / max(posed, 1)) ** 0.5)


def _share_of_way(pieces: Sequence[PieceScore]) -> float:
    way = sum(p.way_m for p in pieces)
    return _rms(pieces) / 1e3 / way if way > 0 else 0.0


def lines(rates: WalkRates) -> list[tuple[str, str]]:
    """Names and texts of all rates, in the order of docs/metrics.md."""
    r = rates
    return [
        ("walks", str(r.walks)),
        ("parts found", rate(r.found, r.parts)),
        ("parts right", rate(r.right, r.parts)),
        ("rooms right", rate(r.rooms_right, r.walks)),
        ("doubled, mis-solved", f"{r.doubles}, {r.mis_solved}"),
        ("invented trusted, not trusted", f"{r.invented_trusted}, {r.invented_untrusted}"),
        ("trusted that are right", rate(r.trusted_right, r.trusted)),
        ("right that are trusted", rate(r.trusted_right, r.right)),
        *_of_intervals("all", r.intervals),
        *_of_intervals("of found parts", r.intervals_matched),
        ("states right, of found parts", _share(r.states_matched.right, r.states_matched.frames)),
        ("the same, not closed", _share(r.states_matched.opened_right, r.states_matched.opened)),
        ("states unknown, of found parts", _share(r.states_matched.unknown, r.states_matched.frames)),
        ("states right, missed parts charged", _share(r.states.right, r.states.frames)),
        ("local camera error, median", _local(r.local, 0.5)),
        ("local camera error, p90", _local(r.local, 0.9)),
        ("ATE", f"{r.ate_mm:.1f} mm, {r.torn} paths in pieces" if r.walks else "-"),
        ("ATE and its share of the way, medians of walks", _medians(r.ate_walks)),
        ("frames with a pose", _share(r.poses.posed, r.poses.frames)),
        ("frames in a named gap", _share(r.poses.named, r.poses.frames)),
        ("frames with neither", _share(r.poses.neither, r.poses.frames)),
    ]


def _of_intervals(which: str, counts: IntervalCounts) -> list[tuple[str, str]]:
    f1 = f"{counts.f1:.3f}" if counts.true + counts.found else "-"
    return [
        (f"interaction F1, {which}", f1),
        (f"interaction precision, {which}", rate(counts.hits, counts.found)),
        (f"interaction recall, {which}", rate(counts.hits, counts.true)),
    ]


def _share(good: int, of: int) -> str:
    return f"{good}/{of} = {100 * good / of:.1f} %" if of else "-"


def _medians(ate: Sequence[tuple[float, float]]) -> str:
    if not ate:
        return "-"
    mm, share = (float(v) for v in np.median(ate, axis=0))
    return f"{mm:.1f} mm, {100 * share:.2f} %"


def _local(errors: LocalErrors, q: float) -> str:
    found = errors.quantile(q)
    return "-" if found is None else f"{found[0]:.2f} mm, {found[1]:.3f} deg ({len(errors.mm)} pairs)"
