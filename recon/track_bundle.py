"""Least-squares bundle of one joint on 3D tracks: joint, state of every frame and landmarks.

A part point X (at state 0) is seen at y = pose(s_t) X. Pulling an observation back, z = pose(s_t)^-1 y, leaves a
landmark that is the weighted mean of its z: the landmarks leave in closed form (the Schur complement of isotropic
noise is exact), and what remains is a dense system of the 2 or 4 joint unknowns and one state a frame.
The joint unknowns are the tangent of `twin.scene.Joint`: tilts about two directions normal to the axis, then, for a
revolute joint, shifts of the axis along them.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray

from twin import geometry as geo
from twin.geometry import Array

Kind = Literal["prismatic", "revolute"]

CHI3_MEDIAN = 1.5382  # median of the length of a standard normal 3-vector
CAUCHY = (
    3.0 * 2.385**2
)  # 2.385: 95 % efficiency in one dimension (Holland and Welsch 1977); length^2 adds three
SIGMA_MIN = 1e-5  # m; keeps weights finite on exact data
_NEGLIGIBLE = (
    1e-8  # change of chi-square that ends a refinement; far below noise, for the sake of exact input
)


@dataclass(frozen=True, eq=False)
class Observations:
    """Tracks by track: points (K, T, 3) m, zero where not seen; weight (K, T), 0 where not seen."""

    points: Array
    weight: Array

    @classmethod
    def of(cls, points: Array, visible: NDArray[np.bool_], confidence: Array | None = None) -> Observations:
        """From points (T, K, 3) with NaN where not visible (T, K); confidence (T, K) multiplies the weights."""
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


@dataclass(frozen=True, eq=False)
class Bundle:
    """A refined model: residual (K, T) m with NaN where not seen, robust weight (K, T), noise sigma (m, one coordinate).

    covariance: of the joint's tangent (2 or 4) followed by the states (T), under the gauge of a fixed mean state.
    landmarks (K, 3): points at state 0.
    """

    model: Model
    landmarks: Array
    residual: Array
    weight: Array
    sigma: float
    covariance: Array


@njit(cache=True)
def pull_back(points, weight, revolute, axis, pivot, state):  # type: ignore[no-untyped-def]
    """z (K, T, 3) = pose(state_t)^-1 points; zero where the weight is zero."""
    n_tracks, n_frames = weight.shape
    out = np.zeros((n_tracks, n_frames, 3))
    for t in range(n_frames):
        if revolute:
            c, s = np.cos(state[t]), -np.sin(state[t])
            for k in range(n_tracks):
                if weight[k, t] > 0.0:
                    d0 = points[k, t, 0] - pivot[0]
                    d1 = points[k, t, 1] - pivot[1]
                    d2 = points[k, t, 2] - pivot[2]
                    along = (axis[0] * d0 + axis[1] * d1 + axis[2] * d2) * (1.0 - c)
                    out[k, t, 0] = pivot[0] + c * d0 + s * (axis[1] * d2 - axis[2] * d1) + along * axis[0]
                    out[k, t, 1] = pivot[1] + c * d1 + s * (axis[2] * d0 - axis[0] * d2) + along * axis[1]
                    out[k, t, 2] = pivot[2] + c * d2 + s * (axis[0] * d1 - axis[1] * d0) + along * axis[2]
        else:
            for k in range(n_tracks):
                if weight[k, t] > 0.0:
                    for i in range(3):
                        out[k, t, i] = points[k, t, i] - state[t] * axis[i]
    return out


@njit(cache=True)
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


@njit(cache=True)
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
                out[k, i] = np.median(buffer[:n])
    return out


@njit(cache=True)
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


@njit(cache=True)
def _jacobian(y, z, revolute, axis, basis, pivot, angle, out):  # type: ignore[no-untyped-def]
    """Columns of dz: the two tilts, the two shifts (revolute), the state; out (3, 5)."""
    if not revolute:
        for b in range(2):
            u0, u1, u2 = basis[0, b], basis[1, b], basis[2, b]
            out[0, b] = -angle * (u1 * axis[2] - u2 * axis[1])
            out[1, b] = -angle * (u2 * axis[0] - u0 * axis[2])
            out[2, b] = -angle * (u0 * axis[1] - u1 * axis[0])
        for i in range(3):
            out[i, 4] = -axis[i]
        return
    c, s = np.cos(angle), -np.sin(angle)
    zd0, zd1, zd2 = z[0] - pivot[0], z[1] - pivot[1], z[2] - pivot[2]
    yd0, yd1, yd2 = y[0] - pivot[0], y[1] - pivot[1], y[2] - pivot[2]
    for b in range(2):
        u0, u1, u2 = basis[0, b], basis[1, b], basis[2, b]
        # w x (z - p) - R (w x (y - p)), with R = rotation by -angle
        m0, m1, m2 = u1 * yd2 - u2 * yd1, u2 * yd0 - u0 * yd2, u0 * yd1 - u1 * yd0
        al = (axis[0] * m0 + axis[1] * m1 + axis[2] * m2) * (1.0 - c)
        out[0, b] = u1 * zd2 - u2 * zd1 - (c * m0 + s * (axis[1] * m2 - axis[2] * m1) + al * axis[0])
        out[1, b] = u2 * zd0 - u0 * zd2 - (c * m1 + s * (axis[2] * m0 - axis[0] * m2) + al * axis[1])
        out[2, b] = u0 * zd1 - u1 * zd0 - (c * m2 + s * (axis[0] * m1 - axis[1] * m0) + al * axis[2])
        # (I - R) u, with u normal to the axis
        out[0, 2 + b] = u0 - c * u0 - s * (axis[1] * u2 - axis[2] * u1)
        out[1, 2 + b] = u1 - c * u1 - s * (axis[2] * u0 - axis[0] * u2)
        out[2, 2 + b] = u2 - c * u2 - s * (axis[0] * u1 - axis[1] * u0)
    out[0, 4] = -(axis[1] * zd2 - axis[2] * zd1)
    out[1, 4] = -(axis[2] * zd0 - axis[0] * zd2)
    out[2, 4] = -(axis[0] * zd1 - axis[1] * zd0)


@njit(cache=True)
def _assemble(points, z, weight, landmarks, revolute, axis, basis, pivot, state):  # type: ignore[no-untyped-def]
    """Hessian (n + T, n + T) and gradient of half the weighted squared residual, landmarks eliminated track by track."""
    n_tracks, n_frames = weight.shape
    n = 4 if revolute else 2
    hessian, gradient = np.zeros((n + n_frames, n + n_frames)), np.zeros(n + n_frames)
    jac, column = np.zeros((n_frames, 3, 5)), np.zeros((3, n + n_frames))
    for k in range(n_tracks):
        total = 1e-300
        column[:] = 0.0  # sums of w J over the track: what the landmark takes out
        first, last = n_frames, -1
        for t in range(n_frames):
            w = weight[k, t]
            if w <= 0.0:
                continue
            first, last = min(first, t), t
            _jacobian(points[k, t], z[k, t], revolute, axis, basis, pivot, state[t], jac[t])
            total += w
            for i in range(3):
                r = z[k, t, i] - landmarks[k, i]
                js = w * jac[t, i, 4]
                hessian[n + t, n + t] += js * jac[t, i, 4]
                gradient[n + t] += js * r
                column[i, n + t] = js
                for a in range(n):
                    ja = w * jac[t, i, a]
                    column[i, a] += ja
                    gradient[a] += ja * r
                    hessian[n + t, a] += ja * jac[t, i, 4]
                    for b in range(a + 1):
                        hessian[a, b] += ja * jac[t, i, b]
        for i in range(3):
            for a in range(n):
                scaled = column[i, a] / total
                for b in range(a + 1):
                    hessian[a, b] -= scaled * column[i, b]
            for t in range(first, last + 1):
                scaled = column[i, n + t] / total
                if scaled != 0.0:
                    for a in range(n):
                        hessian[n + t, a] -= scaled * column[i, a]
                    for b in range(n + first, n + t + 1):
                        hessian[n + t, b] -= scaled * column[i, b]
    for a in range(n + n_frames):
        for b in range(a):
            hessian[b, a] = hessian[a, b]
    return hessian, gradient


def normal_equations(obs: Observations, weight: Array, model: Model) -> tuple[Array, Array]:
    """Hessian (n + T, n + T) and gradient (n + T,) of half the weighted squared residual, landmarks eliminated."""
    revolute = model.kind == "revolute"
    basis = geo.orthogonal_basis(model.axis)[:, :2].copy()
    z = pull_back(obs.points, weight, revolute, model.axis, model.pivot, model.state)
    marks = weighted_means(z, weight)
    hessian, gradient = _assemble(
        obs.points, z, weight, marks, revolute, model.axis, basis, model.pivot, model.state
    )
    return np.asarray(hessian), np.asarray(gradient)


def step(model: Model, delta: ArrayLike) -> Model:
    """The model moved by (2 or 4 joint tangents, T states)."""
    basis, delta = geo.orthogonal_basis(model.axis)[:, :2], geo.as_float(delta)
    n = 4 if model.kind == "revolute" else 2
    axis = geo.unit(geo.exp_so3(basis @ delta[:2]) @ model.axis)
    pivot = model.pivot + basis @ delta[2:4] if n == 4 else model.pivot
    return replace(model, axis=axis, pivot=pivot, state=model.state + delta[n:])


def residuals(
    obs: Observations, model: Model, sigma: float, rounds: int = 3, near: Array | None = None
) -> tuple[Array, Array, Array]:
    """Squared residuals (K, T), robust weights (K, T) and landmarks (K, 3), landmarks by iterated robust means that start
    at `near` (K, 3) when given, else at the medians."""
    z = pull_back(obs.points, obs.weight, model.kind == "revolute", model.axis, model.pivot, model.state)
    marks = median_landmarks(z, obs.weight) if near is None else near
    for _ in range(rounds):
        weight = robust_weight(obs.weight, squared_residuals(z, obs.weight, marks), sigma)
        marks = weighted_means(z, weight)
    square = squared_residuals(z, obs.weight, marks)
    return square, robust_weight(obs.weight, square, sigma), marks


def robust_weight(weight: Array, square: Array, sigma: float) -> Array:
    """Cauchy weights times the given ones."""
    return np.asarray(weight / (1.0 + square / (CAUCHY * sigma**2)))


def noise_sigma(square: Array, weight: Array, unknowns: int) -> float:
    """Noise of one coordinate (m) by the median residual, corrected for the fitted unknowns."""
    seen = weight > 0
    count = int(seen.sum())
    if not count:
        return SIGMA_MIN
    spare = max(3 * count - unknowns, 3) / (3 * count)
    return max(float(np.sqrt(np.median(square[seen]) / spare)) / CHI3_MEDIAN, SIGMA_MIN)


def _cost(square: Array, weight: Array, sigma: float) -> float:
    c = CAUCHY * sigma**2
    return float(0.5 * c * (weight * np.log1p(square / c)).sum())


def smoothness(information: Array, state: Array) -> Array:
    """Hessian (T, T) of the smoothness prior on the state, strong only in frames that the data leave open.

    The prior says that second differences are of the size that well observed frames show (twice their RMS); a frame
    whose own data are three times sharper than that is left alone, so that well observed motion is not bent.
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
            np.add.at(out, (inner + a, inner + b), left * right * strength)
    return out


@njit(cache=True)
def solve_positive(matrix, right):  # type: ignore[no-untyped-def]
    """Solution (n, c) of a positive definite system (n, n), right sides (n, c), by Cholesky.

    The systems are small: LAPACK's threads cost more than they save, hundredfold on a busy machine.
    """
    n = len(matrix)
    low = np.zeros((n, n))
    for i in range(n):
        for j in range(i + 1):
            total = matrix[i, j]
            for k in range(j):
                total -= low[i, k] * low[j, k]
            low[i, j] = np.sqrt(max(total, 1e-300)) if i == j else total / low[j, j]
    out = right.copy()
    for c in range(out.shape[1]):
        for i in range(n):
            for k in range(i):
                out[i, c] -= low[i, k] * out[k, c]
            out[i, c] /= low[i, i]
        for i in range(n - 1, -1, -1):
            for k in range(i + 1, n):
                out[i, c] -= low[k, i] * out[k, c]
            out[i, c] /= low[i, i]
    return out


def refine(obs: Observations, start: Model, sigma: float, iterations: int) -> Bundle:
    """Levenberg-Marquardt on the Cauchy cost, noise scale rescaled from the data twice.

    Args:
        obs: tracks of one part (outlying observations allowed). start: near the solution. sigma: first noise scale, m.
    """
    model = start
    n = 4 if model.kind == "revolute" else 2
    frames_seen = (obs.weight > 0).any(axis=0)
    unknowns = 3 * len(obs.points) + int(frames_seen.sum()) + n
    square, weight, marks = residuals(obs, model, sigma)
    damping = 1e-4
    rescale_at = {2, 5, 9}
    for iteration in range(iterations):
        if iteration in rescale_at:
            sigma = noise_sigma(square, obs.weight, unknowns)
            weight = robust_weight(obs.weight, square, sigma)
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
        if change < _NEGLIGIBLE * sigma**2 and iteration > max(rescale_at):
            break
    covariance = _covariance(obs, square, weight, model, sigma, unknowns)
    residual = np.where(obs.weight > 0, np.sqrt(square), np.nan)
    return Bundle(model, marks, residual, weight, sigma, covariance)


def _system(obs: Observations, weight: Array, model: Model, sigma: float) -> tuple[Array, Array, Array]:
    """Prior (T, T), Hessian and gradient with prior and gauge, all in units of squared metres (times sigma^2)."""
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
    """Slide the pivot along the axis to the landmarks' centroid, where tilt and shift are least correlated."""
    if model.kind == "prismatic":
        return model
    per_track = weight.sum(axis=1)
    centre = (per_track[:, None] * landmarks).sum(0) / max(float(per_track.sum()), 1e-12)
    return replace(model, pivot=geo.nearest_point_on_line(centre, model.pivot, model.axis))


def _covariance(
    obs: Observations, square: Array, weight: Array, model: Model, sigma: float, unknowns: int
) -> Array:
    """Covariance of joint tangent and states: inverse Hessian times the M-estimator's noise factor (Huber 1981)."""
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
    """How many successive observations of a track count as one: (1 + rho) / (1 - rho) of the lag-one correlation.

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
