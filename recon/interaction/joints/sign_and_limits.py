"""Sign, zero and limits of a measured motion, carried through its covariance.

FunREC, supplement 4: quantiles in place of extremes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from recon.interaction.joints.observations import Model
from twin import geometry as geo
from twin.geometry import Array
from twin.joint import turned_covariance
from twin.scene import JointSigma, Prismatic, Revolute

# of the range: at most this far from the start is still the first rest pose (as for intervals)
REST_SHARE = 0.02


@dataclass(frozen=True, eq=False)
class Oriented:
    """A joint with limits and uncertainty; state (n,) and state_sigma (n,) of the given frames. shift: the
    state, in the new sense, of what was state 0 before."""

    joint: Prismatic | Revolute
    state: Array
    state_sigma: Array
    shift: float


def orient(model: Model, covariance: Array, frames: NDArray[np.int64], quantile: float) -> Oriented:
    """Zero at the first rest pose, positive along the net motion (of the larger excursion if it returns).

    Args:
        model: state for every frame.
        covariance: joint tangent, then states.
        frames: those with a trusted state.
        quantile: limits are the quantiles q and 1 - q of the smoothed state.
    """
    raw = model.state[frames]
    smooth = smoothed(raw)
    low, high = np.quantile(smooth, [quantile, 1.0 - quantile])
    span = float(high - low)
    n = len(covariance) - len(model.state)
    spread = float(np.sqrt(np.median(np.diag(covariance)[n:][frames])))
    rest = first_rest(smooth, min(REST_SHARE * span, 3.0 * spread))
    zero = float(raw[:rest].mean())
    net = float(np.median(smooth[-3:])) - zero
    if abs(net) < 0.25 * span:
        net = float(high - zero) if high - zero >= zero - low else float(low - zero)
    sign = -1.0 if net < 0 else 1.0
    state = sign * (raw - zero)
    pick = np.zeros((len(frames), len(model.state)))
    pick[np.arange(len(frames)), frames] = 1.0
    pick[:, frames[:rest]] -= 1.0 / rest
    variance = np.einsum("ij,jk,ik->i", pick, covariance[n:, n:], pick)
    state_sigma = np.sqrt(np.maximum(variance, 0.0))
    top = float(np.quantile(sign * (smooth - zero), 1.0 - quantile))
    bottom = float(np.quantile(sign * (smooth - zero), quantile))
    # a part that really moved both ways from where it started
    lower = bottom if bottom < -0.1 * span else 0.0
    joint = joint_of(model, covariance[:n, :n], sign, lower, max(top, 0.0), float(np.median(state_sigma)))
    return Oriented(joint, state, state_sigma, -sign * zero)


def smoothed(state: Array) -> Array:
    """Running median over five states: single bad states do not reach the limits."""
    return np.asarray(median_filter(state, size=min(5, len(state)), mode="nearest"))


def first_rest(smooth: Array, tolerance: float) -> int:
    """How many leading states stay within `tolerance` of the first ones (>= 1): the first rest pose."""
    start = float(np.median(smooth[:3]))
    away = np.flatnonzero(np.abs(smooth - start) > tolerance)
    return max(int(away[0]) if len(away) else len(smooth), 1)


def joint_of(
    model: Model, covariance: Array, sign: float, lower: float, upper: float, state_sigma: float
) -> Prismatic | Revolute:
    """The twin's joint: axis in the wanted sense, covariance turned into that axis' basis."""
    axis = geo.unit(sign * model.axis)
    old, new = (geo.orthogonal_basis(a)[:, :2] for a in (model.axis, axis))
    cov = turned_covariance(covariance, old, new)
    sigma = JointSigma.of(cov, state_sigma)
    if model.kind == "prismatic":
        return Prismatic(axis=axis, lower=lower, upper=upper, covariance=cov, sigma=sigma)
    return Revolute(axis=axis, lower=lower, upper=upper, covariance=cov, sigma=sigma, pivot=model.pivot)
