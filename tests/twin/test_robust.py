"""Laws of robust statistics: true constants, noise of normal samples with and without outliers, limits of the
weights."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy import stats

from twin import robust
from twin.geometry import Array


def test_constants_are_those_of_the_distributions() -> None:
    assert pytest.approx(1 / stats.norm.ppf(0.75), abs=5e-5) == robust.MAD_SIGMA
    for dof, median in robust.CHI2_MEDIAN.items():
        assert median == pytest.approx(stats.chi2.median(dof), abs=5e-4)
    assert pytest.approx(np.sqrt(stats.chi2.median(3)), abs=5e-5) == robust.LENGTH3_MEDIAN


def test_the_cauchy_scale_keeps_95_percent_of_the_efficiency() -> None:
    """Asymptotic efficiency of an M-estimator of a mean: E[psi']^2 / E[psi^2] under the normal (Huber
    1981)."""
    x = np.linspace(-12, 12, 200_001)
    density, step = stats.norm.pdf(x), x[1] - x[0]
    psi = x * robust.cauchy(x**2, robust.CAUCHY_95**2)
    slope = np.gradient(psi, step)
    efficiency = (slope * density).sum() ** 2 * step**2 / ((psi**2 * density).sum() * step)
    assert efficiency == pytest.approx(0.95, abs=5e-4)


@pytest.mark.parametrize("sigma", [1e-4, 0.3, 20.0])
def test_noise_of_normal_samples(sigma: float) -> None:
    samples = np.random.default_rng(0).normal(0, sigma, 200_000)
    assert robust.mad_sigma(samples) == pytest.approx(sigma, rel=0.01)
    assert robust.mad_sigma(-3.0 * samples) == pytest.approx(3.0 * robust.mad_sigma(samples))
    spoilt = samples.copy()
    spoilt[::5] = 1e6 * sigma
    assert robust.mad_sigma(spoilt) == pytest.approx(sigma * stats.norm.ppf(1 - 0.375 / 2) * 1.4826, rel=0.01)
    assert robust.mad_sigma(np.zeros(0)) == 0.0


@pytest.mark.parametrize("dof", [1, 3, 6])
def test_scale_of_squared_residuals_is_their_variance(dof: int) -> None:
    square = (np.random.default_rng(1).normal(0, 1.7, (100_000, dof)) ** 2).sum(axis=1)
    assert robust.chi2_scale(square, dof) == pytest.approx(1.7**2, rel=0.02)


@pytest.mark.parametrize("weights", [robust.cauchy, robust.geman_mcclure])
def test_weights_fall_from_one_to_none(weights: Callable[[Array, float], Array]) -> None:
    square = np.concatenate([[0.0], np.geomspace(1e-6, 1e12, 200)])
    w = weights(square, 4.0)
    assert w[0] == 1.0
    assert (np.diff(w) < 0).all()
    assert w[-1] < 1e-11
    pull = np.sqrt(square) * w
    top = int(pull.argmax())
    assert pull[-1] < 1e-3 * pull[top], "a far outlier does not pull"
    np.testing.assert_allclose(weights(9.0 * square, 36.0), w)  # residuals count in units of the scale


def test_the_pull_is_greatest_where_the_formulas_say() -> None:
    r = np.linspace(0, 10, 100_001)
    assert r[(r * robust.cauchy(r**2, 4.0)).argmax()] == pytest.approx(2.0, abs=1e-3)
    assert r[(r * robust.geman_mcclure(r**2, 4.0)).argmax()] == pytest.approx(2.0 / np.sqrt(3.0), abs=1e-3)


def test_cauchy_weights_are_the_slope_of_their_loss() -> None:
    square = np.linspace(0.0, 50.0, 2001)
    slope = np.gradient(robust.cauchy_loss(square, 4.0), square[1] - square[0], edge_order=2)
    np.testing.assert_allclose(4.0 * slope[1:-1], robust.cauchy(square, 4.0)[1:-1], rtol=1e-4)
    np.testing.assert_array_equal(robust.cauchy(square, 4.0, 0.25), 0.25 * robust.cauchy(square, 4.0))
