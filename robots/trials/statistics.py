"""How sure a rate or a mean is after so many trials."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import norm, t

CONFIDENCE = 0.95


@dataclass(frozen=True)
class Estimate:
    """A value with its confidence interval."""

    value: float
    low: float
    high: float


def wilson(successes: int, trials: int, confidence: float = CONFIDENCE) -> Estimate:
    """Share of successes with Wilson's score interval, which stays inside 0..1 and is not empty at 0 and 1.

    Source: E. B. Wilson, J. Am. Stat. Assoc. 22 (1927) 209-212.

    Raises:
        ValueError: no trial, or more successes than trials.
    """
    if trials < 1 or not 0 <= successes <= trials:
        raise ValueError(f"{successes} successes in {trials} trials")
    z2, p = float(norm.ppf((1 + confidence) / 2)) ** 2, successes / trials
    middle = (p + z2 / (2 * trials)) / (1 + z2 / trials)
    half = np.sqrt(z2 * (p * (1 - p) / trials + z2 / (4 * trials**2))) / (1 + z2 / trials)
    # Rounding must not cut the value out of its interval at 0 and 1.
    low = 0.0 if successes == 0 else float(middle - half)
    return Estimate(p, low, 1.0 if successes == trials else float(middle + half))


def mean(values: Sequence[float], confidence: float = CONFIDENCE) -> Estimate:
    """Mean with Student's interval; that of a single value is the value.

    Raises:
        ValueError: no value.
    """
    n = len(values)
    if n == 0:
        raise ValueError("the mean of no value")
    middle = float(np.mean(values))
    if n == 1:
        return Estimate(middle, middle, middle)
    half = float(t.ppf((1 + confidence) / 2, n - 1) * np.std(values, ddof=1) / np.sqrt(n))
    return Estimate(middle, middle - half, middle + half)


def binned(errors: Sequence[float], successes: Sequence[bool], bins: int) -> list[tuple[float, Estimate]]:
    """Success over error: trials in equally full bins of error; (mean error, rate, interval) of each."""
    order = np.argsort(np.asarray(errors), kind="stable")
    groups = [g for g in np.array_split(order, bins) if len(g)]
    return [
        (float(np.mean([errors[k] for k in g])), wilson(sum(successes[k] for k in g), len(g))) for g in groups
    ]
