"""Gauss-Newton over a joint and all its states; what each term's plane lies at is eliminated exactly."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from recon.interaction.refine.terms import Terms, linearise
from recon.interaction.refine.ties import add_board
from twin.geometry import Array
from twin.robust import chi2_scale, geman_mcclure, mad_sigma
from twin.scene import Joint

# Share of the range that a resting part may seem to move in a frame; chosen by us, ten times good data's.
_REST_SHARE = 0.002


def step(
    joint: Joint, state: Array, start: Array, rests: NDArray[np.bool_], terms: Terms
) -> tuple[Joint, Array]:
    """One robust Gauss-Newton step over the joint's tangent, all states, and a board's normal."""
    value, jac = linearise(joint, state, terms)
    weight, _ = robust_weights(value, terms)
    h, g = reduced(terms.term, terms.frame, weight, value, jac, len(state))
    d = jac.shape[1] - 1
    h, g = add_board(h, g, joint, state, weight, terms)
    seen = np.diag(h)[d:] / max(float(np.diag(h)[d:].mean()), 1e-12)
    h, g = add_priors(h, g, d, state, start, rests)
    # The zero of the states is free: their mean stays, each frame weighed by what it sees. The planes'
    # normals are not eliminated and gain by turning all frames; where one frame is held that a hand hides, or
    # where each counts alike, those that see little pay for it.
    h[d:, d:] += float(np.diag(h)[d:].mean()) * np.outer(seen, seen)
    delta = -np.linalg.solve(h, g)
    return joint.plus(delta[: joint.dof]), state + delta[d:]


def robust_weights(value: Array, terms: Terms) -> tuple[Array, Array]:
    """Geman-McClure weights (n,) about each term's weighted mean (K,); the scale comes from the data."""
    weight = 1.0 / terms.sigma**2
    robust = np.ones_like(weight)
    if not len(weight):
        return weight, np.zeros(len(terms.normals))
    count = len(terms.normals)
    for _ in range(3):
        total = np.bincount(terms.term, weight * robust, count)
        mean = np.bincount(terms.term, weight * robust * value, count) / np.maximum(total, 1e-12)
        chi2 = ((value - mean[terms.term]) / terms.sigma) ** 2
        scale2 = max(chi2_scale(chi2, dof=1), 0.05) * 9.0
        robust = geman_mcclure(chi2, scale2)
    return np.asarray(weight * robust / max(scale2 / 9.0, 1e-12)), np.asarray(mean)


def add_priors(
    h: Array, g: Array, d: int, state: Array, start: Array, rests: NDArray[np.bool_]
) -> tuple[Array, Array]:
    """Where the data say little, ask for small second differences, and for states within a fifth of the range
    from where they started, so that unseen frames at the ends don't run away."""
    n = len(state)
    second = np.diff(state, 2)
    noise = mad_sigma(second)
    spread = float(np.quantile(np.abs(second), 0.95)) if n > 2 else 0.0
    sigma = max(noise, spread, 1e-5)
    rows = np.zeros((n - 2, n))
    k = np.arange(n - 2)
    rows[k, k], rows[k, k + 1], rows[k, k + 2] = 1.0, -2.0, 1.0
    h[d:, d:] += rows.T @ rows / sigma**2
    g[d:] += rows.T @ second / sigma**2
    anchor = max(0.2 * float(np.ptp(start)), 1e-3)
    k = np.flatnonzero(rests[:-1] & rests[1:])
    rows = np.zeros((len(k), n))
    rows[np.arange(len(k)), k], rows[np.arange(len(k)), k + 1] = -1.0, 1.0
    still = max(_REST_SHARE * float(np.ptp(start)), 1e-5)
    h[d:, d:] += rows.T @ rows / still**2
    g[d:] += rows.T @ np.diff(state)[k] / still**2
    every = d + np.arange(n)
    h[every, every] += 1.0 / anchor**2
    away = state - start
    g[every] += (away - away.mean()) / anchor**2
    scale = float(np.diag(h).mean())
    h[np.diag_indices_from(h)] += 1e-9 * scale
    return h, g


@njit(cache=True, nogil=True)
def reduced(term, frame, weight, value, jac, n_states):  # type: ignore[no-untyped-def]
    """Normal equations of joint and states without every term's offset. Observations are sorted by term."""
    d = jac.shape[1] - 1
    size = d + n_states
    h = np.zeros((size, size))
    g = np.zeros(size)
    a = np.zeros(size)
    used = np.empty(size, np.int64)
    listed = np.zeros(size, np.bool_)
    start = 0
    while start < len(term):
        stop = start
        while stop < len(term) and term[stop] == term[start]:
            stop += 1
        if stop - start > 1:
            total, mean = 0.0, 0.0
            for o in range(start, stop):
                total += weight[o]
                mean += weight[o] * value[o]
            mean /= total
            for i in range(d):
                a[i] = 0.0
                used[i] = i
            count = d
            for o in range(start, stop):
                a[d + frame[o]] = 0.0
                listed[d + frame[o]] = False
            for o in range(start, stop):
                r = value[o] - mean
                s = d + frame[o]
                w = weight[o]
                for i in range(d):
                    ji = jac[o, i]
                    g[i] += w * ji * r
                    a[i] += w * ji
                    h[i, s] += w * ji * jac[o, d]
                    h[s, i] += w * ji * jac[o, d]
                    for k in range(d):
                        h[i, k] += w * ji * jac[o, k]
                g[s] += w * jac[o, d] * r
                h[s, s] += w * jac[o, d] * jac[o, d]
                a[s] += w * jac[o, d]
                if not listed[s]:
                    listed[s] = True
                    used[count] = s
                    count += 1
            for i in range(count):
                for k in range(count):
                    h[used[i], used[k]] -= a[used[i]] * a[used[k]] / total
        start = stop
    return h, g
