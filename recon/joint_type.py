"""Slide or hinge, from motion alone: a hinge must earn its two extra unknowns, and must look like a hinge.

Residuals alone choose a hinge tens of metres away for a drawer. So: noise no smaller than a floor, the Bayesian
information criterion (Schwarz 1978), and two guards on range and radius.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from recon.joint_config import JointConfig
from recon.track_bundle import Kind
from twin.geometry import Array

TRUNCATE = 9.0  # squared standard deviations at which an observation stops counting (3 sigma)


@dataclass(frozen=True)
class TypeEvidence:
    """Why a joint is what it is.

    delta_bic: BIC of the slide less that of the hinge, above 0 speaks for the hinge (0 when there was no hinge to
    compare). range: rad, turned by the best hinge. radius: m, its distance from the part. residual_prismatic,
    residual_revolute: RMS residual of both models in metres.
    """

    delta_bic: float
    range: float
    radius: float
    residual_prismatic: float
    residual_revolute: float


def truncated_chi2(square: Array, sigma: float, dof: int = 3) -> float:
    """Sum of squared residual lengths over sigma^2, each at most TRUNCATE times its degrees of freedom."""
    return float(np.minimum(square / sigma**2, TRUNCATE * dof).sum())


def delta_bic(chi2_prismatic: float, chi2_revolute: float, values: int) -> float:
    """BIC(slide) - BIC(hinge): a hinge has two more unknowns. values: measured coordinates."""
    return chi2_prismatic - chi2_revolute - 2.0 * float(np.log(max(values, 2)))


def decide(evidence: TypeEvidence, config: JointConfig) -> tuple[Kind, str]:
    """The joint type and the sentence that explains it."""
    dbic = evidence.delta_bic
    turned = float(np.degrees(evidence.range))
    facts = f"hinge over slide by {dbic:.0f} BIC, {turned:.1f} deg at {evidence.radius:.2f} m"
    if dbic <= config.min_delta_bic:
        return "prismatic", f"motion ({facts}; needs {config.min_delta_bic:g} BIC)"
    if evidence.range < config.min_range:
        return "prismatic", f"motion ({facts}; needs {np.degrees(config.min_range):g} deg)"
    if evidence.radius > config.max_radius:
        return "prismatic", f"motion ({facts}; at most {config.max_radius:g} m)"
    return "revolute", f"motion ({facts})"
