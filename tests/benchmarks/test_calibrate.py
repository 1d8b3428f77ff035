"""The weights of doubts, fitted to rows whose truth is known."""

from __future__ import annotations

import numpy as np

from benchmarks.calibrate import fitted
from recon.verdict.posterior import WEIGHTS


def test_weights_are_found_again_from_many_parts() -> None:
    rng = np.random.default_rng(0)
    true, sound = np.array([2.0, 0.4, 1.0]), 3.0
    amounts = rng.uniform(1.0, 4.0, (4000, 3)) * (rng.random((4000, 3)) < 0.4)
    right = rng.random(4000) < 1.0 / (1.0 + np.exp(amounts @ true - sound))
    base, weights = fitted(amounts, right)
    np.testing.assert_allclose(weights, true, atol=0.2)
    assert abs(base - sound) < 0.3


def test_what_no_row_tells_stays_as_expected_and_nothing_speaks_for_a_part() -> None:
    amounts = np.zeros((60, 2))
    amounts[:30, 0] = 2.0  # a doubt that only right parts have
    right = np.ones(60, bool)
    right[30:34] = False
    _, (falls, stays) = fitted(amounts, right)
    assert 0.0 <= falls < 1.0
    np.testing.assert_allclose(stays, 1.2, atol=1e-3)


def test_the_committed_weights_are_of_all_doubts_and_at_least_zero() -> None:
    assert all(w >= 0.0 for w in WEIGHTS.values())
