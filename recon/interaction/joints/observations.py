"""Observed tracks, a joint with its states, and how far the one is off the other.

A part point X (at state 0) is seen at y = pose(s_t) X. Pulling an observation back, z = pose(s_t)^-1 y,
leaves a landmark that is a mean of its z.

FunREC, supplement 1.2: weights, no PROSAC.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
from numba import njit
from numpy.typing import NDArray

from recon.dense.order import median
from twin.geometry import Array
from twin.robust import CAUCHY_95, LENGTH3_MEDIAN, cauchy

Kind = Literal["prismatic", "revolute"]
KINDS: tuple[Kind, ...] = ("prismatic", "revolute")

CAUCHY = 3.0 * CAUCHY_95**2  # length^2 adds three coordinates
SIGMA_MIN = 1e-5  # m; keeps weights finite on exact data


@dataclass(frozen=True, eq=False)
class Observations:
    """Tracks by track: points (K, T, 3) m, zero where not seen; weight (K, T), 0 where not seen."""

    points: Array
    weight: Array

    @cached_property
    def unrest(self) -> Array:
        """Squared distance (K, T) of each observation from its track's median point; zero where not seen."""
        return np.asarray(
            squared_residuals(self.points, self.weight, median_landmarks(self.points, self.weight))
        )

    @classmethod
    def of(cls, points: Array, visible: NDArray[np.bool_], confidence: Array | None = None) -> Observations:
        """From points (T, K, 3) with NaN where not visible (T, K); confidence (T, K) weighs."""
        seen = visible & np.isfinite(points).all(-1)
        weight = seen.astype(np.float64) if confidence is None else np.where(seen, confidence, 0.0)
        weight = np.nan_to_num(np.clip(weight, 0.0, None))
        return cls(
            np.ascontiguousarray(np.where(weight[..., None] > 0, points, 0.0).swapaxes(0, 1)),
            np.ascontiguousarray(weight.T),
        )

    def take(
        self, tracks: NDArray[np.bool_] | NDArray[np.int64], frames: NDArray[np.int64] | None = None
    ) -> Observations:
        """Some tracks, and only some frames when given."""
        p, w = self.points[tracks], self.weight[tracks]
        if frames is not None:
            p, w = p[:, frames], w[:, frames]
        return Observations(np.ascontiguousarray(p), np.ascontiguousarray(w))


@dataclass(frozen=True, eq=False)
class Model:
    """A joint and its state (T,) in every frame; pivot is unused when prismatic."""

    kind: Kind
    axis: Array
    pivot: Array
    state: Array

    def __post_init__(self) -> None:
        for name in ("axis", "pivot", "state"):  # loops are compiled anew for each other layout of memory
            object.__setattr__(self, name, np.require(getattr(self, name), np.float64, ["C", "W"]))


@njit(cache=True, nogil=True)
def pull_back(points, weight, revolute, axis, pivot, state):  # type: ignore[no-untyped-def]
    """z (K, T, 3) = pose(state_t)^-1 points; zero where the weight is zero."""
    n_tracks, n_frames = weight.shape
    out = np.zeros((n_tracks, n_frames, 3))
    cosine, sine = np.cos(state), -np.sin(state)
    for k in range(n_tracks):
        for t in range(n_frames):
            if weight[k, t] <= 0.0:
                continue
            if revolute:
                c, s = cosine[t], sine[t]
                d0 = points[k, t, 0] - pivot[0]
                d1 = points[k, t, 1] - pivot[1]
                d2 = points[k, t, 2] - pivot[2]
                along = (axis[0] * d0 + axis[1] * d1 + axis[2] * d2) * (1.0 - c)
                out[k, t, 0] = pivot[0] + c * d0 + s * (axis[1] * d2 - axis[2] * d1) + along * axis[0]
                out[k, t, 1] = pivot[1] + c * d1 + s * (axis[2] * d0 - axis[0] * d2) + along * axis[1]
                out[k, t, 2] = pivot[2] + c * d2 + s * (axis[0] * d1 - axis[1] * d0) + along * axis[2]
            else:
                for i in range(3):
                    out[k, t, i] = points[k, t, i] - state[t] * axis[i]
    return out


@njit(cache=True, nogil=True)
def weighted_means(z, weight):  # type: ignore[no-untyped-def]
    """Landmarks (K, 3): weighted mean over the frames."""
    n_tracks, n_frames = weight.shape
    out = np.zeros((n_tracks, 3))
    for k in range(n_tracks):
        total = 1e-300
        for t in range(n_frames):
            total += weight[k, t]
            for i in range(3):
                out[k, i] += weight[k, t] * z[k, t, i]
        for i in range(3):
            out[k, i] /= total
    return out


@njit(cache=True, nogil=True)
def median_landmarks(z, weight):  # type: ignore[no-untyped-def]
    """Landmarks (K, 3): median of every coordinate over the frames in which a track is seen."""
    n_tracks, n_frames = weight.shape
    out = np.zeros((n_tracks, 3))
    buffer = np.empty(n_frames)
    for k in range(n_tracks):
        for i in range(3):
            n = 0
            for t in range(n_frames):
                if weight[k, t] > 0.0:
                    buffer[n] = z[k, t, i]
                    n += 1
            if n:
                out[k, i] = median(buffer, n)
    return out


@njit(cache=True, nogil=True)
def squared_residuals(z, weight, landmarks):  # type: ignore[no-untyped-def]
    """|z - landmark|^2 (K, T); zero where not seen."""
    n_tracks, n_frames = weight.shape
    out = np.zeros((n_tracks, n_frames))
    for k in range(n_tracks):
        for t in range(n_frames):
            if weight[k, t] > 0.0:
                for i in range(3):
                    d = z[k, t, i] - landmarks[k, i]
                    out[k, t] += d * d
    return out


def residuals(
    obs: Observations, model: Model, sigma: float, rounds: int = 3, near: Array | None = None
) -> tuple[Array, Array, Array]:
    """Squared residuals (K, T), robust weights (K, T) and landmarks (K, 3), landmarks by iterated robust
    means that start at `near` (K, 3) when given, else at the medians."""
    z = pull_back(obs.points, obs.weight, model.kind == "revolute", model.axis, model.pivot, model.state)
    start = median_landmarks(z, obs.weight) if near is None else near
    square, weight, marks = _robust_means(z, obs.weight, start, CAUCHY * sigma**2, rounds)
    return square, weight, marks


@njit(cache=True, nogil=True)
def _robust_means(z, given, start, scale2, rounds):  # type: ignore[no-untyped-def]
    """Squared residuals and Cauchy weights (K, T) about means (K, 3) reweighted `rounds` times."""
    n_tracks, n_frames = given.shape
    square, weight, marks = np.zeros((n_tracks, n_frames)), np.zeros((n_tracks, n_frames)), start.copy()
    for k in range(n_tracks):
        for turn in range(rounds + 1):
            total, sum0, sum1, sum2 = 1e-300, 0.0, 0.0, 0.0
            for t in range(n_frames):
                if given[k, t] <= 0.0:
                    continue
                d0, d1, d2 = z[k, t, 0] - marks[k, 0], z[k, t, 1] - marks[k, 1], z[k, t, 2] - marks[k, 2]
                square[k, t] = d0 * d0 + d1 * d1 + d2 * d2
                w = given[k, t] / (1.0 + square[k, t] / scale2)
                weight[k, t] = w
                total += w
                sum0 += w * z[k, t, 0]
                sum1 += w * z[k, t, 1]
                sum2 += w * z[k, t, 2]
            if turn < rounds:
                marks[k, 0], marks[k, 1], marks[k, 2] = sum0 / total, sum1 / total, sum2 / total
    return square, weight, marks


def robust_weight(weight: Array, square: Array, sigma: float) -> Array:
    """Cauchy weights times the given ones."""
    return cauchy(square, CAUCHY * sigma**2, weight)


def noise_sigma(square: Array, weight: Array, unknowns: int) -> float:
    """Noise of one coordinate (m) by the median residual, corrected for the fitted unknowns."""
    seen = weight > 0
    count = int(seen.sum())
    if not count:
        return SIGMA_MIN
    spare = max(3 * count - unknowns, 3) / (3 * count)
    return max(float(np.sqrt(np.median(square[seen]) / spare)) / LENGTH3_MEDIAN, SIGMA_MIN)
