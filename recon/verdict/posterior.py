"""How likely a part is right, by all doubts about it: log odds that add up, calibrated on open recordings.

A logistic regression (maximum a posteriori, Gaussian priors about what we expected) on parts of recordings
whose truth is known: benchmarks/calibrate.py, and its page benchmarks/verdicts.md, which has the reliability.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from recon.verdict.doubt import SURELY, Doubt
from twin.verdict import Verdict

# Log odds of a part without a doubt.
SOUND = 4.59
# What a doubt of each type takes from them, times its amount.
WEIGHTS: Mapping[str, float] = {
    "AxisUnsure": 1.20,
    "PivotUnsure": 1.03,
    "RangeUnsure": 1.20,
    "TooShort": 1.20,
    "NeverRests": 1.20,
    "ClosedEndUnsure": 1.40,
    "CreepsAtRest": 1.22,
    "CamerasDrift": 1.20,
    "HandWhereNobodyIs": 1.19,
    "HandMovesNothing": 1.20,
    "SmallSurface": 1.20,
    "SurfaceUnseen": 1.20,
    "SurfaceContradicted": 1.20,
    "BareBorder": 1.46,
    "LabelledElsewhere": 0.67,
    "StaticSeenThrough": 1.25,
    "Unexplained": 1.28,
    "SeenThrough": 1.20,
    "MotionUnexplained": 1.20,
    "MotionUnseen": 0.58,
    "FewLabels": 1.20,
    "MovesWithDoubted": 1.20,
}
# Probabilities from which on a part is trusted, and below which it is left out.
TRUSTED, REFUSED = 0.95, 0.3


def probability(doubts: Sequence[Doubt]) -> float:
    """Of a part with these doubts: that its joint, its path and its labels are right."""
    if any(d.times == SURELY for d in doubts):
        return 0.0
    return float(1.0 / (1.0 + np.exp(-(SOUND - sum(_worth(d) for d in doubts)))))


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
    return SURELY if doubt.times == SURELY else WEIGHTS[doubt.reason.type] * doubt.amount
