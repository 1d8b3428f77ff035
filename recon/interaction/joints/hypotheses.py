"""From raw 3D tracks to candidate joints: which tracks move, and how they move between pairs of frames."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from recon.dense.order import median, quantile
from recon.interaction.joints.config import MIN_TRACKS, MIN_TRAVEL, MOVER_SIGMAS, PAIR_GAPS, SAMPLES
from recon.interaction.joints.observations import (
    SIGMA_MIN,
    Kind,
    Observations,
)
from twin import geometry as geo
from twin.geometry import Array
from twin.robust import LENGTH3_MEDIAN

_WINDOW = 5  # observations in the running median that measures travel (by us)
# rigid motions sought in one frame pair: the part, the hand that moves with it, what is at rest
_PAIR_ROUNDS = 3
_NOISE_MIN = 1e-4  # m; thresholds never get finer than this


@njit(cache=True, nogil=True)
def _track_statistics(points, weight, window):  # type: ignore[no-untyped-def]
    """Travel (K,) m: largest distance of running medians; seconds (summed): squared second differences."""
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
                smooth[m - half, i] = median(buffer, window)
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
    """Travel (K,) m of every track (running medians, so single bad observations do not count) and the noise
    of one coordinate in metres (median second difference, in which smooth motion cancels)."""
    travel, jerk = _track_statistics(obs.points, obs.weight, _WINDOW)
    known = jerk[np.isfinite(jerk)]
    sigma = float(np.median(known)) / LENGTH3_MEDIAN if known.size else 0.0
    return np.asarray(travel), max(sigma, _NOISE_MIN)


@njit(cache=True, nogil=True)
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
    """Points (n,) that follow the rigid motion a -> b (n, 3) best liked by random triples, after one
    least-squares fit. tau2: squared distance in m^2 at which the error is truncated."""
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


@njit(cache=True, nogil=True)
def _ways(points, seen, gap):  # type: ignore[no-untyped-def]
    """For each frame (T - gap,): tracks seen there and `gap` on, and the way (m) of their upper quarter."""
    tracks, frames = seen.shape
    count, way = np.zeros(frames - gap, np.int64), np.zeros(frames - gap)
    square = np.empty(tracks)
    for i in range(frames - gap):
        n = 0
        for k in range(tracks):
            if seen[k, i] and seen[k, i + gap]:
                square[n] = 0.0
                for d in range(3):
                    square[n] += (points[k, i + gap, d] - points[k, i, d]) ** 2
                n += 1
        count[i] = n
        if n:
            for k in range(n):
                square[k] = np.sqrt(square[k])
            way[i] = quantile(square, n, 0.75)
    return count, way


def frame_pairs(obs: Observations, most: int, least: float) -> NDArray[np.int64]:
    """At most `most` pairs of frames (P, 2) in which the tracks move by over `least` metres, long first."""
    n_frames = obs.weight.shape[1]
    seen = obs.weight > 0
    rows: list[tuple[int, int]] = []
    worth: list[float] = []
    for gap in sorted({min(g, n_frames - 1) for g in (*PAIR_GAPS, n_frames // 2) if n_frames > 1}):
        # a quarter that moves will do: background that moves at another time is at rest now
        for i, (both, moved) in enumerate(zip(*_ways(obs.points, seen, gap), strict=True)):
            if both >= 3 and moved > least:
                rows.append((i, i + gap))
                worth.append(float(moved * both))
    order = np.argsort(-np.asarray(worth), kind="stable")
    if len(order) > most:  # half the best, half spread over the others
        half = most // 2
        rest = order[half:]
        order = np.concatenate([order[:half], rest[np.linspace(0, len(rest) - 1, most - half).astype(int)]])
    return np.asarray(rows, dtype=np.int64).reshape(-1, 2)[order]


def pair_hypotheses(
    obs: Observations, sigma: float, pairs: int, rng: np.random.Generator
) -> list[Hypothesis]:
    """Joints of both kinds from rigid motions of at most `pairs` frame pairs (triples, truncated squares)."""
    tau2 = (3.0 * np.sqrt(2.0) * sigma) ** 2 * 1.5
    seen = obs.weight > 0
    found: list[Hypothesis] = []
    least = max(MIN_TRAVEL, MOVER_SIGMAS * sigma)
    for i, j in frame_pairs(obs, pairs, least):
        both = np.flatnonzero(seen[:, i] & seen[:, j])
        for _ in range(_PAIR_ROUNDS):
            if len(both) < max(MIN_TRACKS, 4):
                break
            a, b = obs.points[both, i], obs.points[both, j]
            inlier = best_rigid_inliers(a, b, SAMPLES, tau2, rng)
            if inlier.sum() < MIN_TRACKS:
                break
            # else it is at rest between the two
            if np.median(np.linalg.norm(b[inlier] - a[inlier], axis=1)) > least:
                found += joints_of_motion(geo.fit_rigid(a[inlier], b[inlier]), a[inlier], b[inlier])
            both = both[~inlier]
    return found


def joints_of_motion(pose: Array, before: Array, after: Array) -> list[Hypothesis]:
    """The slide along the mean shift and the hinge of a rigid motion (pivot of least norm)."""
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
