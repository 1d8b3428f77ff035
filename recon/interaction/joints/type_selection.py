"""Slide or hinge, from motion alone: a hinge must earn its two extra unknowns, and must look like a hinge.

Residuals alone choose a hinge tens of metres away for a drawer. So: noise no smaller than a floor, the
Bayesian information criterion (Schwarz 1978), and two guards on range and radius.

A hint from elsewhere (a model that looked at pictures) may tip what motion leaves open: it counts as much as
the margin that the rule asks of a hinge anyway, and stands in for the least range, which no data of ours has
chosen. Clear motion overrules it. What the user says of a type is no hint: motion is not asked then.

FunREC, supplement 3.5: ablation A1 is the paper without its model; the rule here takes its place.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from recon.interaction.joints.config import MAX_RADIUS, MIN_DELTA_BIC, MIN_RANGE
from recon.interaction.joints.observations import Kind
from twin.errors import ConfigError
from twin.geometry import Array

HINT_WEIGHT = 20.0  # BIC, as MIN_DELTA_BIC: prior weight of a hint; chosen by us
TRUNCATE = 9.0  # squared standard deviations at which an observation stops counting (3 sigma)


@dataclass(frozen=True)
class TypeEvidence:
    """Why a joint is what it is.

    delta_bic: BIC of the slide less that of the hinge, above 0 speaks for the hinge (0 when there was no
    hinge to compare). range: rad, turned by the best hinge. radius: m, its distance from the part.
    """

    delta_bic: float
    range: float
    radius: float


@dataclass(frozen=True)
class TypeHint:
    """Somebody's word for a joint type: `source`: a part of this kind moves in recording frames first..last.

    weight: BIC by which it moves the evidence towards its kind; infinite for a word that no motion overrules.
    """

    kind: Kind
    first: int
    last: int
    source: str
    weight: float = HINT_WEIGHT

    def __post_init__(self) -> None:
        if not 0 <= self.first < self.last or not self.weight >= 0:
            raise ConfigError(f"a joint hint needs first < last and a weight >= 0, got {self}")

    @property
    def certain(self) -> bool:
        """Whether motion is not asked."""
        return self.weight == np.inf


def hint_about(hints: Sequence[TypeHint], state: Array) -> TypeHint | None:
    """The hint that overlaps most with the motion of state (T,), or None. Certain hints go first."""
    certain = next((h for h in hints if h.certain), None)
    if certain is not None or not hints:
        return certain
    low, high = np.quantile(state, [0.02, 0.98])
    margin = 0.05 * (high - low)
    moving = np.flatnonzero((state > low + margin) & (state < high - margin))
    if not len(moving):
        return None
    shared = [min(h.last, int(moving[-1])) - max(h.first, int(moving[0])) for h in hints]
    best = int(np.argmax(shared))
    return hints[best] if shared[best] > 0 else None


def truncated_chi2(square: Array, sigma: float, dof: int = 3) -> float:
    """Sum of squared residual lengths over sigma^2, each at most TRUNCATE times its degrees of freedom."""
    return float(np.minimum(square / sigma**2, TRUNCATE * dof).sum())


def delta_bic(chi2_prismatic: float, chi2_revolute: float, values: int) -> float:
    """BIC(slide) - BIC(hinge): a hinge has two more unknowns. values: measured coordinates."""
    return chi2_prismatic - chi2_revolute - 2.0 * float(np.log(max(values, 2)))


def decide(evidence: TypeEvidence, hint: TypeHint | None = None) -> tuple[Kind, str]:
    """The joint type and the sentence that explains it."""
    if hint is not None and hint.certain:
        return hint.kind, f"said by {hint.source}"
    kind, why = _by_motion(evidence)
    if hint is None:
        return kind, why
    if hint.kind == kind:
        return kind, f"{why}; so does the hint say ({hint.source})"
    towards = hint.weight if hint.kind == "revolute" else -hint.weight
    may_turn = evidence.delta_bic + towards > MIN_DELTA_BIC and evidence.radius <= MAX_RADIUS
    if may_turn == (hint.kind == "revolute"):
        return hint.kind, f"hint {hint.kind} ({hint.source}; motion leaves it open: {_facts(evidence)})"
    return kind, f"{why}; overrules the hint {hint.kind} ({hint.source})"


def _facts(evidence: TypeEvidence) -> str:
    turned = float(np.degrees(evidence.range))
    return f"hinge over slide by {evidence.delta_bic:.0f} BIC, {turned:.1f} deg at {evidence.radius:.2f} m"


def _by_motion(evidence: TypeEvidence) -> tuple[Kind, str]:
    facts = _facts(evidence)
    if evidence.delta_bic <= MIN_DELTA_BIC:
        return "prismatic", f"motion ({facts}; needs {MIN_DELTA_BIC:g} BIC)"
    if evidence.range < MIN_RANGE:
        return "prismatic", f"motion ({facts}; needs {np.degrees(MIN_RANGE):g} deg)"
    if evidence.radius > MAX_RADIUS:
        return "prismatic", f"motion ({facts}; at most {MAX_RADIUS:g} m)"
    return "revolute", f"motion ({facts})"
