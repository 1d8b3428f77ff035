"""Which tracks follow a joint with its states, and how well."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from recon.dense.order import median
from recon.interaction.joints.config import MOVER_SIGMAS, PRUNE_SIGMAS, SEARCH_SIGMA
from recon.interaction.joints.observations import (
    Model,
    Observations,
    pull_back,
    residuals,
)
from twin.geometry import Array
from twin.robust import LENGTH3_MEDIAN


def track_support(obs: Observations, model: Model, sigma: float) -> Array:
    """How much better each track (K,) follows a model, wherever seen, than standing still: 0..1.

    Following is the mean over its observations of 1 - r^2 / tau^2 (not below 0). Standing still is judged
    alike, and taken off: else a model that hardly moves wins by all the tracks that rest most of the time.
    """
    square, _, marks = residuals(obs, model, sigma, rounds=2)
    seen = obs.weight > 0
    count = np.maximum(seen.sum(axis=1), 1)
    tau2 = (PRUNE_SIGMAS * LENGTH3_MEDIAN * sigma) ** 2
    moving, resting = (
        (np.clip(1.0 - q / tau2, 0.0, 1.0) * seen).sum(axis=1) / count for q in (square, obs.unrest)
    )
    gain = np.maximum(moving**2 - resting**2, 0.0)
    return np.asarray(np.where(predicted_travel(obs, model, marks) > MOVER_SIGMAS * sigma, gain, 0.0))


def predicted_travel(obs: Observations, model: Model, landmarks: Array) -> Array:
    """Path extent (K,) m that the model gives each track over the frames in which it is seen."""
    seen = obs.weight > 0
    # single frames may jump
    state = median_filter(model.state, size=min(5, len(model.state)), mode="nearest")
    high = np.where(seen, state, -np.inf).max(axis=1)
    low = np.where(seen, state, np.inf).min(axis=1)
    span = np.where(seen.any(axis=1), high - low, 0.0)
    if model.kind == "prismatic":
        return np.asarray(span)
    away = landmarks - model.pivot
    radius = np.linalg.norm(away - np.outer(away @ model.axis, model.axis), axis=1)
    return np.asarray(2.0 * radius * np.sin(np.minimum(span, np.pi) / 2.0))


@njit(cache=True, nogil=True)
def row_medians(values, weight):  # type: ignore[no-untyped-def]
    """Median (K,) of values (K, T) where the weight is positive; infinite for an empty row."""
    out = np.full(len(values), np.inf)
    for k in range(len(values)):
        known = values[k][weight[k] > 0.0]
        if len(known):
            out[k] = median(known, len(known))
    return out


@njit(cache=True, nogil=True)
def _creep(z, weight, landmarks, state):  # type: ignore[no-untyped-def]
    """Per track: length of the slope of z over the state, its information (squared states), state range."""
    n_tracks, n_frames = weight.shape
    out = np.zeros((n_tracks, 3))
    for k in range(n_tracks):
        total, mean = 1e-300, 0.0
        low, high = np.inf, -np.inf
        for t in range(n_frames):
            if weight[k, t] > 0.0:
                total += weight[k, t]
                mean += weight[k, t] * state[t]
                low, high = min(low, state[t]), max(high, state[t])
        mean /= total
        square = 0.0
        product = np.zeros(3)
        for t in range(n_frames):
            if weight[k, t] > 0.0:
                c = state[t] - mean
                square += weight[k, t] * c * c
                for i in range(3):
                    product[i] += weight[k, t] * c * (z[k, t, i] - landmarks[k, i])
        if square > 1e-18:
            out[k, 0] = np.sqrt((product * product).sum()) / square
            out[k, 1] = square
            out[k, 2] = high - low
    return out


def creeping(obs: Observations, model: Model, sigma: float, members: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Tracks (K,) that move against the part in step with its state, as a hand that turns about a handle.

    The slope of a track's pulled-back points over the state is zero for a rigid member. It counts when it
    exceeds four standard deviations (one in a thousand by chance; the deviation is rescaled by the members'
    own median, since real tracks creep) and adds up to more than `SEARCH_SIGMA` metres over the motion.
    """
    _, weight, marks = residuals(obs, model, sigma)
    z = pull_back(obs.points, weight, model.kind == "revolute", model.axis, model.pivot, model.state)
    slope, information, span = _creep(z, weight, marks, model.state).T
    score = slope * np.sqrt(information) / sigma
    scale = max(1.0, float(np.median(score[members])) / LENGTH3_MEDIAN) if members.any() else 1.0
    return np.asarray((score > 4.0 * scale) & (slope * span > SEARCH_SIGMA))


def follows(obs: Observations, model: Model, sigma: float) -> NDArray[np.bool_]:
    """Tracks (K,) with a median residual within `PRUNE_SIGMAS` times that of pure noise and without creep."""
    square, _, marks = residuals(obs, model, sigma)
    middle = np.sqrt(row_medians(square, obs.weight))
    moved = predicted_travel(obs, model, marks) > MOVER_SIGMAS * sigma
    near = middle < PRUNE_SIGMAS * LENGTH3_MEDIAN * sigma
    return np.asarray(near & moved & ~creeping(obs, model, sigma, near & moved))
