"""From raw 3D tracks to candidate joints: which tracks move, how pairs of frames move, what most tracks follow."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from recon.joint_config import JointConfig
from recon.track_bundle import (
    CHI3_MEDIAN,
    SIGMA_MIN,
    Kind,
    Model,
    Observations,
    median_landmarks,
    pull_back,
    residuals,
    squared_residuals,
)
from twin import geometry as geo
from twin.geometry import Array

_WINDOW = 5  # observations in the running median that measures travel (by us)
_PAIR_ROUNDS = (
    3  # rigid motions sought in one frame pair: the part, the hand that moves with it, what is at rest
)
_LEVER = 0.3  # m; tracks farther from an axis have no more say in its states (by us)
_NOISE_MIN = 1e-4  # m; thresholds never get finer than this


@njit(cache=True)
def _track_statistics(points, weight, window):  # type: ignore[no-untyped-def]
    """Travel (K,) m: largest distance between running medians; seconds (sum of it): squared second differences."""
    n_tracks, n_frames = weight.shape
    travel = np.zeros(n_tracks)
    jerk = np.full((n_tracks, n_frames), np.nan)
    seen = np.empty(n_frames, np.int64)
    half = window // 2
    for k in range(n_tracks):
        n = 0
        for t in range(n_frames):
            if weight[k, t] > 0.0:
                seen[n] = t
                n += 1
        for m in range(1, n - 1):
            if seen[m + 1] - seen[m - 1] == 2:
                total = 0.0
                for i in range(3):
                    a, b, c = points[k, seen[m - 1], i], points[k, seen[m], i], points[k, seen[m + 1], i]
                    total += (a - 2.0 * b + c) ** 2
                jerk[k, seen[m]] = np.sqrt(total / 6.0)
        if n < window:
            continue
        smooth = np.empty((n - 2 * half, 3))
        for m in range(half, n - half):
            for i in range(3):
                buffer = np.empty(window)
                for b in range(window):
                    buffer[b] = points[k, seen[m - half + b], i]
                smooth[m - half, i] = np.median(buffer)
        centre = np.empty(3)
        for i in range(3):
            centre[i] = smooth[:, i].mean()
        # two sweeps reach the ends of the path: farthest from the centre, then farthest from that
        for _ in range(2):
            best, far = -1.0, 0
            for m in range(len(smooth)):
                d = 0.0
                for i in range(3):
                    d += (smooth[m, i] - centre[i]) ** 2
                if d > best:
                    best, far = d, m
            for i in range(3):
                centre[i] = smooth[far, i]
            travel[k] = np.sqrt(best)
    return travel, jerk


def travel_and_noise(obs: Observations) -> tuple[Array, float]:
    """Travel (K,) m of every track (running medians, so single bad observations do not count) and the noise of one
    coordinate in metres (median second difference, in which smooth motion cancels)."""
    travel, jerk = _track_statistics(obs.points, obs.weight, _WINDOW)
    known = jerk[np.isfinite(jerk)]
    sigma = float(np.median(known)) / CHI3_MEDIAN if known.size else 0.0
    return np.asarray(travel), max(sigma, _NOISE_MIN)


@njit(cache=True)
def _best_triple(a, b, triples, tau2):  # type: ignore[no-untyped-def]
    """Best rigid motion from triples (truncated squared error); returns inliers (n,) and their count."""
    n = a.shape[0]
    best_score = 1e300
    best_r, best_t = np.eye(3), np.zeros(3)
    fa, fb = np.empty((3, 3)), np.empty((3, 3))
    for s in range(triples.shape[0]):
        ok = True
        for which in range(2):
            src = a if which == 0 else b
            f = fa if which == 0 else fb
            p0, p1, p2 = src[triples[s, 0]], src[triples[s, 1]], src[triples[s, 2]]
            u, v = p1 - p0, p2 - p0
            w = np.array([u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]])
            nw = np.sqrt((w * w).sum())
            # the bisector of the two edges shares the error between them
            e = u / (np.sqrt((u * u).sum()) + 1e-12) + v / (np.sqrt((v * v).sum()) + 1e-12)
            ne = np.sqrt((e * e).sum())
            if nw < 1e-6 or ne < 1e-3:
                ok = False
                break
            w /= nw
            e /= ne
            f[0], f[1] = e, w
            f[2, 0] = e[1] * w[2] - e[2] * w[1]
            f[2, 1] = e[2] * w[0] - e[0] * w[2]
            f[2, 2] = e[0] * w[1] - e[1] * w[0]
        if not ok:
            continue
        r = fb.T @ fa
        ca = (a[triples[s, 0]] + a[triples[s, 1]] + a[triples[s, 2]]) / 3.0
        cb = (b[triples[s, 0]] + b[triples[s, 1]] + b[triples[s, 2]]) / 3.0
        t = cb - r @ ca
        score = 0.0
        for m in range(n):
            d2 = 0.0
            for i in range(3):
                d = r[i, 0] * a[m, 0] + r[i, 1] * a[m, 1] + r[i, 2] * a[m, 2] + t[i] - b[m, i]
                d2 += d * d
            score += min(d2, tau2)
            if score >= best_score:
                break
        if score < best_score:
            best_score = score
            best_r, best_t = r, t
    inlier = np.zeros(n, np.bool_)
    for m in range(n):
        d2 = 0.0
        for i in range(3):
            d = best_r[i, 0] * a[m, 0] + best_r[i, 1] * a[m, 1] + best_r[i, 2] * a[m, 2] + best_t[i] - b[m, i]
            d2 += d * d
        inlier[m] = d2 < tau2
    return inlier


def best_rigid_inliers(
    a: Array, b: Array, samples: int, tau2: float, rng: np.random.Generator
) -> NDArray[np.bool_]:
    """Points (n,) that follow the rigid motion a -> b (n, 3) best liked by random triples, after one least-squares fit.
    tau2: squared distance in m^2 at which the error is truncated."""
    triples = rng.integers(0, len(a), (samples, 3))
    triples = triples[(np.diff(np.sort(triples, axis=1), axis=1) > 0).all(axis=1)]
    inlier = np.asarray(_best_triple(a, b, triples, tau2))
    if inlier.sum() < 3:
        return inlier
    again = ((geo.transform(geo.fit_rigid(a[inlier], b[inlier]), a) - b) ** 2).sum(-1) < tau2
    return np.asarray(again if again.sum() >= inlier.sum() else inlier)


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """A joint without limits: kind, unit axis (3,), a point on the axis (3,)."""

    kind: Kind
    axis: Array
    pivot: Array


def frame_pairs(obs: Observations, config: JointConfig, least: float) -> NDArray[np.int64]:
    """Pairs of frames (P, 2) between which the tracks move by more than `least` metres, long motions preferred."""
    n_frames = obs.weight.shape[1]
    seen = obs.weight > 0
    rows: list[tuple[int, int]] = []
    worth: list[float] = []
    for gap in sorted({min(g, n_frames - 1) for g in (*config.pair_gaps, n_frames // 2) if n_frames > 1}):
        for i in range(n_frames - gap):
            both = seen[:, i] & seen[:, i + gap]
            if both.sum() < 3:
                continue
            # a quarter that moves will do: background that moves at another time is at rest now
            way = np.linalg.norm(obs.points[both, i + gap] - obs.points[both, i], axis=1)
            moved = float(np.quantile(way, 0.75))
            if moved > least:
                rows.append((i, i + gap))
                worth.append(moved * float(both.sum()))
    order = np.argsort(-np.asarray(worth), kind="stable")
    if len(order) > config.pairs:  # half the best, half spread over the others
        half = config.pairs // 2
        rest = order[half:]
        order = np.concatenate(
            [order[:half], rest[np.linspace(0, len(rest) - 1, config.pairs - half).astype(int)]]
        )
    return np.asarray(rows, dtype=np.int64).reshape(-1, 2)[order]


def pair_hypotheses(
    obs: Observations, sigma: float, config: JointConfig, rng: np.random.Generator
) -> list[Hypothesis]:
    """Joints of both kinds from rigid motions between pairs of frames (triples, truncated squares, least squares)."""
    tau2 = (3.0 * np.sqrt(2.0) * sigma) ** 2 * 1.5
    seen = obs.weight > 0
    found: list[Hypothesis] = []
    least = max(config.min_travel, config.mover_sigmas * sigma)
    for i, j in frame_pairs(obs, config, least):
        both = np.flatnonzero(seen[:, i] & seen[:, j])
        for _ in range(_PAIR_ROUNDS):
            if len(both) < max(config.min_tracks, 4):
                break
            a, b = obs.points[both, i], obs.points[both, j]
            inlier = best_rigid_inliers(a, b, config.samples, tau2, rng)
            if inlier.sum() < config.min_tracks:
                break
            if (
                np.median(np.linalg.norm(b[inlier] - a[inlier], axis=1)) > least
            ):  # else it is at rest between the two
                found += joints_of_motion(geo.fit_rigid(a[inlier], b[inlier]), a[inlier], b[inlier])
            both = both[~inlier]
    return found


def joints_of_motion(pose: Array, before: Array, after: Array) -> list[Hypothesis]:
    """The slide along the mean shift and the hinge of a rigid motion (its pivot by least norm near the points)."""
    shift = (after - before).mean(axis=0)
    out: list[Hypothesis] = []
    if np.linalg.norm(shift) > SIGMA_MIN:
        out.append(Hypothesis("prismatic", geo.unit(shift), before.mean(axis=0)))
    turn = geo.log_so3(pose[:3, :3])
    angle = float(np.linalg.norm(turn))
    if angle > 1e-3:
        axis = turn / angle
        centre = before.mean(axis=0)
        moved = pose[:3, :3] @ centre + pose[:3, 3] - centre
        moved = moved - axis * (moved @ axis)
        # in the plane normal to the axis: p - centre = moved / 2 + cot(angle / 2) (axis x moved) / 2
        pivot = centre + 0.5 * moved + 0.5 / np.tan(angle / 2) * np.cross(axis, moved)
        out.append(Hypothesis("revolute", axis, pivot))
    return out


@njit(cache=True)
def _weighted_median(values, weights):  # type: ignore[no-untyped-def]
    order = np.argsort(values)
    total = weights.sum()
    run = 0.0
    for m in order:
        run += weights[m]
        if run >= 0.5 * total:
            return values[m]
    return values[order[-1]]


@njit(cache=True)
def _wrap(angle, revolute):  # type: ignore[no-untyped-def]
    if revolute:
        return angle - 2.0 * np.pi * np.round(angle / (2.0 * np.pi))
    return angle


@njit(cache=True)
def _additive_states(coord, lever, weight, revolute, sigma, rounds):  # type: ignore[no-untyped-def]
    """States (T,) from coord[k, t] = offset[k] + state[t], by medians then reweighted means.

    coord: angle about the axis or distance along it; lever (K, T): metres per unit. The model is linear, so what most
    tracks share wins whatever the chained start was.
    """
    n_tracks, n_frames = coord.shape
    state = np.zeros(n_frames)
    values, masses = np.empty(n_tracks), np.empty(n_tracks)
    last = -1
    for t in range(n_frames):
        n = 0
        if last >= 0:
            for k in range(n_tracks):
                if weight[k, t] > 0.0 and weight[k, last] > 0.0:
                    values[n] = _wrap(coord[k, t] - coord[k, last], revolute)
                    masses[n] = lever[k, t] * weight[k, t]
                    n += 1
            state[t] = state[last]
            if n:
                state[t] += _weighted_median(values[:n], masses[:n])
        for k in range(n_tracks):
            if weight[k, t] > 0.0:
                last = t
                break
    offset = np.zeros(n_tracks)
    buffer = np.empty(n_frames)
    for _round in range(rounds):
        for k in range(n_tracks):
            n = 0
            first = 0.0
            for t in range(n_frames):
                if weight[k, t] > 0.0:
                    d = coord[k, t] - state[t]
                    if n == 0:
                        first = d
                    buffer[n] = _wrap(d - first, revolute)
                    n += 1
            if n:
                offset[k] = first + np.median(buffer[:n])
        for t in range(n_frames):
            n = 0
            for k in range(n_tracks):
                if weight[k, t] > 0.0:
                    d = _wrap(coord[k, t] - offset[k] - state[t], revolute)
                    values[n] = d
                    m = d * lever[k, t] / (3.0 * sigma)
                    masses[n] = weight[k, t] * lever[k, t] / (1.0 + m * m)
                    n += 1
            if n:
                state[t] += _weighted_median(values[:n], masses[:n])
    return state


def states_of(obs: Observations, joint: Hypothesis, sigma: float, rounds: int = 4) -> Array:
    """State (T,) in every frame under a joint hypothesis, by what most tracks share."""
    if joint.kind == "prismatic":
        coord = obs.points @ joint.axis
        lever = np.ones_like(coord)
    else:
        basis = geo.orthogonal_basis(joint.axis)
        plane = (obs.points - joint.pivot) @ basis[:, :2]
        coord = np.arctan2(plane[..., 1], plane[..., 0])
        lever = np.minimum(
            np.linalg.norm(plane, axis=-1), _LEVER
        )  # or a few far tracks would outvote the part
    return np.asarray(_additive_states(coord, lever, obs.weight, joint.kind == "revolute", sigma, rounds))


def track_support(obs: Observations, model: Model, sigma: float, config: JointConfig) -> Array:
    """How much better each track (K,) follows a model, over everything it was seen, than standing still: 0..1.

    Following is the mean over its observations of 1 - r^2 / tau^2 (not below 0). Standing still is judged alike, and taken
    off: else a model that hardly moves wins by all the tracks that rest most of the time.
    """
    square, _, marks = residuals(obs, model, sigma, rounds=2)
    seen = obs.weight > 0
    count = np.maximum(seen.sum(axis=1), 1)
    tau2 = (config.prune_sigmas * CHI3_MEDIAN * sigma) ** 2
    still = squared_residuals(obs.points, obs.weight, median_landmarks(obs.points, obs.weight))
    moving, resting = (
        (np.clip(1.0 - q / tau2, 0.0, 1.0) * seen).sum(axis=1) / count for q in (square, still)
    )
    gain = np.maximum(moving**2 - resting**2, 0.0)
    return np.asarray(np.where(predicted_travel(obs, model, marks) > config.mover_sigmas * sigma, gain, 0.0))


def predicted_travel(obs: Observations, model: Model, landmarks: Array) -> Array:
    """Path extent (K,) m that the model gives each track over the frames in which it is seen."""
    seen = obs.weight > 0
    state = median_filter(
        model.state, size=min(5, len(model.state)), mode="nearest"
    )  # single frames may jump
    high = np.where(seen, state, -np.inf).max(axis=1)
    low = np.where(seen, state, np.inf).min(axis=1)
    span = np.where(seen.any(axis=1), high - low, 0.0)
    if model.kind == "prismatic":
        return np.asarray(span)
    away = landmarks - model.pivot
    radius = np.linalg.norm(away - np.outer(away @ model.axis, model.axis), axis=1)
    return np.asarray(2.0 * radius * np.sin(np.minimum(span, np.pi) / 2.0))


@njit(cache=True)
def row_medians(values, weight):  # type: ignore[no-untyped-def]
    """Median (K,) of values (K, T) where the weight is positive; infinite for an empty row."""
    out = np.full(len(values), np.inf)
    for k in range(len(values)):
        known = values[k][weight[k] > 0.0]
        if len(known):
            out[k] = np.median(known)
    return out


@njit(cache=True)
def _creep(z, weight, landmarks, state):  # type: ignore[no-untyped-def]
    """Per track: length of the slope of z over the state, its information (sum of squared states), state range."""
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


def creeping(
    obs: Observations, model: Model, sigma: float, members: NDArray[np.bool_], config: JointConfig
) -> NDArray[np.bool_]:
    """Tracks (K,) that move against the part in step with its state, as a hand that turns about the handle does.

    The slope of a track's pulled-back points over the state is zero for a rigid member. It counts when it exceeds four
    standard deviations (one in a thousand by chance; the deviation is rescaled by the members' own median, since real
    tracks creep) and adds up to more than `search_sigma` metres over the motion.
    """
    _, weight, marks = residuals(obs, model, sigma)
    z = pull_back(obs.points, weight, model.kind == "revolute", model.axis, model.pivot, model.state)
    slope, information, span = _creep(z, weight, marks, model.state).T
    score = slope * np.sqrt(information) / sigma
    scale = max(1.0, float(np.median(score[members])) / CHI3_MEDIAN) if members.any() else 1.0
    return np.asarray((score > 4.0 * scale) & (slope * span > config.search_sigma))


def follows(obs: Observations, model: Model, sigma: float, config: JointConfig) -> NDArray[np.bool_]:
    """Tracks (K,) whose median residual stays within `prune_sigmas` times that of pure noise and that do not creep."""
    square, _, marks = residuals(obs, model, sigma)
    middle = np.sqrt(row_medians(square, obs.weight))
    moved = predicted_travel(obs, model, marks) > config.mover_sigmas * sigma
    near = middle < config.prune_sigmas * CHI3_MEDIAN * sigma
    return np.asarray(near & moved & ~creeping(obs, model, sigma, near & moved, config))
