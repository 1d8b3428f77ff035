"""State of every frame under a candidate joint, by what most tracks share."""

from __future__ import annotations

import numpy as np
from numba import njit

from recon.dense.order import median
from recon.interaction.joints.hypotheses import Hypothesis
from recon.interaction.joints.observations import Observations
from twin import geometry as geo
from twin.geometry import Array

_LEVER = 0.3  # m; tracks farther from an axis have no more say in its states (by us)


@njit(cache=True, nogil=True)
def _weighted_median(values, weights):  # type: ignore[no-untyped-def]
    order = np.argsort(values)
    total = weights.sum()
    run = 0.0
    for m in order:
        run += weights[m]
        if run >= 0.5 * total:
            return values[m]
    return values[order[-1]]


@njit(cache=True, nogil=True)
def _wrap(angle, revolute):  # type: ignore[no-untyped-def]
    if revolute:
        return angle - 2.0 * np.pi * np.round(angle / (2.0 * np.pi))
    return angle


@njit(cache=True, nogil=True)
def _additive_states(coord, lever, weight, revolute, sigma, rounds):  # type: ignore[no-untyped-def]
    """States (T,) from coord[k, t] = offset[k] + state[t], by medians then reweighted means.

    coord: angle about the axis or distance along it; lever (K, T): metres per unit. The model is linear, so
    what most tracks share wins whatever the chained start was.
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
                offset[k] = first + median(buffer, n)
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
        # or a few far tracks would outvote the part
        lever = np.minimum(np.linalg.norm(plane, axis=-1), _LEVER)
    return np.asarray(_additive_states(coord, lever, obs.weight, joint.kind == "revolute", sigma, rounds))
