"""Robust statistics: noise by the median, chi-square medians, and weights against outliers in least squares.

A weight w(r^2) multiplies r^2 in reweighted least squares; `scale2` is the squared residual of doubt.
"""

from __future__ import annotations

import numpy as np

from twin.geometry import Array

MAD_SIGMA = 1.4826  # standard deviation over median absolute deviation of a normal variable: 1 / 0.67449
CHI2_MEDIAN = {1: 0.455, 3: 2.366, 6: 5.348}  # medians of the chi-square distribution, by degrees of freedom
LENGTH3_MEDIAN = 1.5382  # median of the length of a standard normal 3-vector, sqrt(2.366)
CAUCHY_95 = 2.385  # sigmas: the Cauchy scale with 95 % efficiency in one dimension (Holland and Welsch 1977)


def mad_sigma(deviations: Array) -> float:
    """Standard deviation of normal deviations (n,) from a known middle, by their median size; 0 of none.

    Half of them may be outliers (Hampel 1974).
    """
    return MAD_SIGMA * float(np.median(np.abs(deviations))) if len(deviations) else 0.0


def chi2_scale(square: Array, dof: int) -> float:
    """By how much the median of squared residuals (n,) of `dof` coordinates each exceeds their noise."""
    return float(np.median(square)) / CHI2_MEDIAN[dof]


def geman_mcclure(square: Array, scale2: float) -> Array:
    """Weights 1 / (1 + r^2 / scale2)^2 (Geman and McClure 1985): far outliers' pull r w goes to zero."""
    return np.asarray(1.0 / (1.0 + square / scale2) ** 2)


def cauchy(square: Array, scale2: float, weight: Array | float = 1.0) -> Array:
    """Cauchy weights 1 / (1 + r^2 / scale2), times a given one: far outliers' pull r w falls as 1 / r."""
    return np.asarray(weight / (1.0 + square / scale2))


def cauchy_loss(square: Array, scale2: float) -> Array:
    """What Cauchy weights minimise, log(1 + r^2 / scale2), in units of scale2: r^2 / scale2 for small r."""
    return np.asarray(np.log1p(square / scale2))
