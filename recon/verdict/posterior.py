"""How likely a part is right, by all doubts about it: log odds that add up, calibrated on open recordings.

A logistic regression (maximum a posteriori, Gaussian priors about what we expected) on parts of recordings
whose truth is known: benchmarks/calibrate.py, and its page benchmarks/verdicts.md, which has the reliability.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from recon.verdict.doubt import SURELY, Doubt
from twin.verdict import Verdict

# The questions that a part is asked, and the doubts that answer each: the worst of them counts.
QUESTIONS: Mapping[str, tuple[str, ...]] = {
    "joint": ("AxisUnsure", "PivotUnsure", "RangeUnsure"),
    "closed end": ("ClosedEndUnsure",),
    "attached": ("StandsFree",),
    "surface": ("SurfaceUnseen",),
    "size": ("SmallSurface",),
    "depth": ("Unexplained", "StaticSeenThrough", "SeenThrough", "CamerasDrift"),
    "labels": ("BareBorder",),
    "alone": ("MovesWithDoubted",),
}
# Log odds of a part without a doubt.
SOUND = 4.21
# What a doubt about each question takes from them, times its amount.
WEIGHTS: Mapping[str, float] = {
    "joint": 1.08,
    "closed end": 1.18,
    "attached": 1.28,
    "surface": 1.13,
    "size": 1.24,
    "depth": 1.20,
    "labels": 1.35,
    "alone": 1.55,
}
# Probabilities from which on a part is trusted, and below which it is left out.
TRUSTED, REFUSED = 0.95, 0.3


def probability(doubts: Sequence[Doubt]) -> float:
    """Of a part with these doubts: that its joint, its path and its labels are right."""
    if any(d.times == SURELY for d in doubts):
        return 0.0
    takes = sum(
        max((_worth(d) for d in doubts if d.reason.type in q), default=0.0) for q in QUESTIONS.values()
    )
    return float(1.0 / (1.0 + np.exp(takes - SOUND)))


def verdict_of(doubts: Sequence[Doubt]) -> Verdict:
    """Trusted, doubtful or refused by that probability, with the doubts as reasons, the weightiest first.

    What is trusted all the same keeps no reason. Of what is refused those doubts refuse that would alone, or
    the weightiest.
    """
    p = round(probability(doubts), 4)
    if p >= TRUSTED:
        return Verdict((), p)
    by_weight = sorted(doubts, key=_worth, reverse=True)
    refused = p < REFUSED
    return Verdict(
        tuple(
            d.reason.at_level("refused" if refused and (k == 0 or probability([d]) < REFUSED) else "doubtful")
            for k, d in enumerate(by_weight)
        ),
        p,
    )


def _worth(doubt: Doubt) -> float:
    if doubt.times == SURELY:
        return SURELY
    return next(WEIGHTS[q] for q, types in QUESTIONS.items() if doubt.reason.type in types) * doubt.amount
