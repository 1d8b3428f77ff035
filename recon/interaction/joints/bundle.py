"""Least-squares bundle of one joint on 3D tracks: joint, state of every frame and landmarks.

FunREC, supplement 1.4, eq. 3: fits the tracks themselves in place of relative poses.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from recon.interaction.joints.cholesky import solve_positive
from recon.interaction.joints.normal_equations import normal_equations
from recon.interaction.joints.observations import (
    CAUCHY,
    Model,
    Observations,
    noise_sigma,
    pull_back,
    residuals,
    robust_weight,
    weighted_means,
)
from twin import geometry as geo
from twin.geometry import Array
from twin.joint import moved_axis
from twin.robust import cauchy_loss

# Change of chi-square that ends a refinement: far below noise, for the sake of exact input
_NEGLIGIBLE = 1e-8
# The same where another one follows: a twentieth of a sigma along the last direction that still changes
ROUGHLY = 2e-3


@dataclass(frozen=True, eq=False)
class Bundle:
    """A refined model: residual (K, T) m, NaN where not seen, robust weight (K, T), noise sigma (m).

    landmarks (K, 3): at state 0. spread: finds the covariance, which few who refine ask for.
    """

    model: Model
    landmarks: Array
    residual: Array
    weight: Array
    sigma: float
    spread: Callable[[], Array]

    @cached_property
    def covariance(self) -> Array:
        """Of the joint's tangent, then states (T), mean state fixed."""
        return self.spread()


def step(model: Model, delta: ArrayLike) -> Model:
    """The model moved by (2 or 4 joint tangents, T states)."""
    delta = geo.as_float(delta)
    n = 4 if model.kind == "revolute" else 2
    axis, pivot = moved_axis(model.axis, model.pivot, delta[:n])
    return replace(model, axis=axis, pivot=pivot, state=model.state + delta[n:])


def _cost(square: Array, weight: Array, sigma: float) -> float:
    c = CAUCHY * sigma**2
    return float(0.5 * c * (weight * cauchy_loss(square, c)).sum())


def smoothness(information: Array, state: Array) -> Array:
    """Hessian (T, T) of the smoothness prior on the state, strong only in frames that the data leave open.

    The prior says that second differences are of the size that well observed frames show (twice their RMS); a
    frame whose own data are three times sharper than that is left alone: well observed motion is not bent.
    """
    n = len(state)
    if n < 3:
        return np.diag(np.full(n, 1e-12 + 1e-9 * float(information.max(initial=0.0))))
    second = np.diff(state, 2)
    known = np.minimum(np.minimum(information[:-2], information[1:-1]), information[2:]) > 0.1 * np.median(
        information
    )
    typical = (
        2.0 * float(np.sqrt(np.mean(second[known] ** 2))) if known.any() else float(np.abs(second).max())
    )
    variance = max(typical, 1e-6) ** 2
    open_frame = 1.0 / (1.0 + (information * variance / 9.0) ** 2)
    strength = np.maximum(np.maximum(open_frame[:-2], open_frame[1:-1]), open_frame[2:]) / variance
    out, inner = np.zeros((n, n)), np.arange(n - 2)
    for a, left in enumerate((1.0, -2.0, 1.0)):
        for b, right in enumerate((1.0, -2.0, 1.0)):
            out[inner + a, inner + b] += left * right * strength
    return out


def refine(
    obs: Observations,
    start: Model,
    sigma: float,
    iterations: int,
    negligible: float = _NEGLIGIBLE,
    farthest: float = np.inf,
) -> Bundle:
    """Levenberg-Marquardt on the Cauchy cost, noise scale rescaled from the data three times or more.

    Args:
        obs: tracks of one part (outlying observations allowed).
        start: near the solution.
        sigma: first noise scale, m.
        iterations: at most.
        negligible: change of chi-square that ends it.
        farthest: distance (m) of a hinge's axis from its landmarks that ends it, too: on the tracks of a
            slide it moves away for ever.
    """
    model = start
    n = 4 if model.kind == "revolute" else 2
    frames_seen = (obs.weight > 0).any(axis=0)
    unknowns = 3 * len(obs.points) + int(frames_seen.sum()) + n
    square, weight, marks = residuals(obs, model, sigma)
    damping = 1e-4
    rescale_at, rescaled, settled = {2, 5, 9}, 0, False
    for iteration in range(iterations):
        if iteration in rescale_at or settled:
            sigma = noise_sigma(square, obs.weight, unknowns)
            weight = robust_weight(obs.weight, square, sigma)
            rescaled += 1
        prior, hessian, gradient = _system(obs, weight, model, sigma)
        cost = _cost(square, obs.weight, sigma) + 0.5 * model.state @ prior @ model.state
        moved = False
        for _ in range(6):
            damped = hessian + damping * np.diag(np.diag(hessian))
            trial = _recentred(step(model, -solve_positive(damped, gradient[:, None])[:, 0]), marks, weight)
            t_square, t_weight, t_marks = residuals(obs, trial, sigma, near=marks)
            t_cost = _cost(t_square, obs.weight, sigma) + 0.5 * trial.state @ prior @ trial.state
            if t_cost <= cost * (1 + 1e-12):
                moved = True
                break
            damping = min(damping * 10.0, 1e6)
        if not moved:
            break
        change = cost - t_cost
        model, square, weight, marks = trial, t_square, t_weight, t_marks
        damping = max(damping / 10.0, 1e-12)
        settled = bool(change < negligible * sigma**2)
        if (settled and rescaled >= len(rescale_at)) or _radius(model, marks) > farthest:
            break
    residual = np.where(obs.weight > 0, np.sqrt(square), np.nan)
    return Bundle(
        model,
        marks,
        residual,
        weight,
        sigma,
        lambda: _covariance(obs, square, weight, model, sigma, unknowns),
    )


def _radius(model: Model, landmarks: Array) -> float:
    """Distance (m) of a hinge's axis from its landmarks' mean; 0 for a slide."""
    if model.kind == "prismatic":
        return 0.0
    away = landmarks.mean(axis=0) - model.pivot
    return float(np.linalg.norm(away - (away @ model.axis) * model.axis))


def _system(obs: Observations, weight: Array, model: Model, sigma: float) -> tuple[Array, Array, Array]:
    """Prior (T, T), Hessian and gradient with prior and gauge, in squared metres (times sigma^2)."""
    hessian, gradient = normal_equations(obs, weight, model)
    n = len(gradient) - len(model.state)
    information = np.diag(hessian)[n:] / sigma**2
    prior = smoothness(information, model.state) * sigma**2
    hessian[n:, n:] += prior
    gradient[n:] += prior @ model.state
    # every state may shift together with the landmarks: hold the mean still
    scale = float(np.trace(hessian[n:, n:])) / max(len(model.state), 1) ** 2
    hessian[n:, n:] += scale
    hessian[np.diag_indices_from(hessian)] += 1e-12 * max(float(np.diag(hessian).max()), 1e-12)
    return prior, hessian, gradient


def _recentred(model: Model, landmarks: Array, weight: Array) -> Model:
    """Slide the pivot along the axis to the landmarks' centroid: tilt and shift are least correlated."""
    if model.kind == "prismatic":
        return model
    per_track = weight.sum(axis=1)
    centre = (per_track[:, None] * landmarks).sum(0) / max(float(per_track.sum()), 1e-12)
    return replace(model, pivot=geo.nearest_point_on_line(centre, model.pivot, model.axis))


def _covariance(
    obs: Observations, square: Array, weight: Array, model: Model, sigma: float, unknowns: int
) -> Array:
    """Covariance of tangent and states: inverse Hessian by the M-estimator's noise factor (Huber 1981)."""
    _, hessian, _ = _system(obs, weight, model, sigma)
    seen = obs.weight > 0
    count = max(int(seen.sum()), 1)
    w = weight[seen] / np.maximum(obs.weight[seen], 1e-12)
    slope = float(np.mean(w - 2.0 / 3.0 * w * (1.0 - w)))
    spare = max(3 * count - unknowns, 3) / (3 * count)
    noise = float(np.mean(w**2 * square[seen])) / 3.0 / spare
    factor = (
        noise * float(np.mean(w)) / max(slope, 1e-3) ** 2 * correlation_factor(obs, square, weight, model)
    )
    return np.asarray(solve_positive(hessian, np.eye(len(hessian))) * max(factor, 1e-20))


def correlation_factor(obs: Observations, square: Array, weight: Array, model: Model) -> float:
    """How many observations of a track count as one: (1 + rho) / (1 - rho) of the lag-one correlation.

    White noise gives 1. Tracks that drift or share a depth bias repeat their error from frame to frame.
    """
    del square
    z = pull_back(obs.points, obs.weight, model.kind == "revolute", model.axis, model.pivot, model.state)
    r = z - weighted_means(z, weight)[:, None]
    both = np.minimum(weight[:, 1:], weight[:, :-1])
    product = float((both * (r[:, 1:] * r[:, :-1]).sum(-1)).sum())
    energy = float((both * 0.5 * ((r[:, 1:] ** 2).sum(-1) + (r[:, :-1] ** 2).sum(-1))).sum())
    if energy < 1e-18:
        return 1.0
    frames = np.maximum((weight > 0).sum(1), 2)
    rho = product / energy + float(np.mean(1.0 / frames))  # removing each track's mean lowers rho by 1/n
    rho = min(max(rho, 0.0), 0.95)
    return (1.0 + rho) / (1.0 - rho)
