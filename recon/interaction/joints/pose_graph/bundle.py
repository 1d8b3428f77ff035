"""Least-squares fit of one joint to absolute part poses, all frames at once.

T_world_part(t) = pose(s_t) T_world_rest. The error log(P_t^-1 pose(s_t) T_world_rest) lives at the part's
origin, where a pose tracker's noise does. States appear each in one error only and leave by Schur, so a step
costs what N 6x11 blocks cost.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recon.interaction.joints.observations import Kind
from recon.interaction.joints.pose_graph.screws import motion_jacobian, right_inverse, twist_of
from twin import geometry as geo
from twin.geometry import Array
from twin.joint import moved_axis
from twin.robust import CAUCHY_95, cauchy, cauchy_loss, chi2_scale

FLOOR = 1e-6  # m and rad: least noise, so that exact poses stay solvable
# Noise of a marker or pose tracker, of one coordinate: its shape is assumed, its scale follows the data. One
# millimetre weighs as much as one degree, which on real logged doors leaves neither the shifts nor the turns
# to explain the other.
_NOISE = 0.002
_NOISE_RAD = float(np.radians(2.0))
_CAUCHY = 6.0 * CAUCHY_95**2  # as for points, for six coordinates


@dataclass(frozen=True, eq=False)
class PoseBundle:
    """kind, axis (3,), pivot (3,) nearest the part's origin, state (N,), T_world_rest (4, 4), error (N, 6) =
    (v, w) at the part's origin, sigma (m) and sigma_rad of one coordinate, covariance of joint tangent then
    states."""

    kind: Kind
    axis: Array
    pivot: Array
    state: Array
    T_world_rest: Array
    error: Array
    sigma: float
    sigma_rad: float
    covariance: Array

    @property
    def good(self) -> NDArray[np.bool_]:
        """Poses (N,) within 99.9 % (chi-square, 6: 22.5) of the noise, assumed or measured, the larger."""
        return np.asarray(chi2(self.error, max(self.sigma, _NOISE), max(self.sigma_rad, _NOISE_RAD)) < 22.5)


def chi2(error: Array, sigma: float, sigma_rad: float) -> Array:
    """Squared errors (N,) in units of the noise."""
    return np.asarray((error[:, :3] ** 2).sum(1) / sigma**2 + (error[:, 3:] ** 2).sum(1) / sigma_rad**2)


def refine_poses(
    T_world_part: Array,
    kind: Kind,
    axis: Array,
    pivot: Array,
    state: Array,
    rest: Array,
    iterations: int = 30,
) -> PoseBundle:
    """Gauss-Newton with Cauchy weights from a near start; both noises follow the data until settled."""
    a, p, s = axis, pivot, state
    error = _errors(T_world_part, kind, a, p, s, rest)
    centre = np.median(T_world_part[:, :3, 3], axis=0)
    damping = 1e-8
    for _ in range(iterations):
        sigma, sigma_rad = _noise(error)
        # keep the pivot near the part, where tilt and shift are least correlated
        p = geo.nearest_point_on_line(centre, p, a)
        n, (ratio, along, _), schur, gradient = _reduced(kind, a, p, s, rest, error, sigma, sigma_rad)
        cost = _cost(error, sigma, sigma_rad)
        new_cost = np.inf
        while damping < 1e8:
            delta = -np.linalg.solve(schur + damping * np.diag(np.diag(schur)), gradient)
            new_a, new_p = moved_axis(a, p, delta[:n])
            new_rest, new_s = rest @ geo.exp_se3(delta[n:]), s + along - ratio @ delta
            new_error = _errors(T_world_part, kind, new_a, new_p, new_s, new_rest)
            new_cost = _cost(new_error, sigma, sigma_rad)
            if new_cost <= cost * (1.0 + 1e-12):
                break
            damping *= 10.0
        else:
            break
        a, p, s, rest, error, damping = new_a, new_p, new_s, new_rest, new_error, max(damping / 10.0, 1e-12)
        if cost - new_cost < 1e-6 and _noise(error)[0] > 0.999 * sigma:
            break
    sigma, sigma_rad = _noise(error)
    covariance = _covariance(kind, a, p, s, rest, error, sigma, sigma_rad)
    return PoseBundle(kind, a, p, s, rest, error, sigma, sigma_rad, covariance)


def _errors(T_world_part: Array, kind: Kind, axis: Array, pivot: Array, state: Array, rest: Array) -> Array:
    model = geo.exp_se3(state[:, None] * twist_of(kind, axis, pivot)) @ rest
    return geo.log_se3(geo.invert_pose(T_world_part) @ model)


def _cost(error: Array, sigma: float, sigma_rad: float) -> float:
    return float(_CAUCHY * cauchy_loss(chi2(error, sigma, sigma_rad), _CAUCHY).sum())


def _noise(error: Array) -> tuple[float, float]:
    """sigma (m) and sigma_rad of one coordinate: the assumed shape, scaled to the median error."""
    scale = float(np.sqrt(chi2_scale(chi2(error, _NOISE, _NOISE_RAD), dof=6)))
    return max(_NOISE * scale, FLOOR), max(_NOISE_RAD * scale, FLOOR)


def _reduced(
    kind: Kind,
    axis: Array,
    pivot: Array,
    state: Array,
    rest: Array,
    error: Array,
    sigma: float,
    sigma_rad: float,
) -> tuple[int, tuple[Array, Array, Array], Array, Array]:
    """Number of unknowns; back-substitution; Schur matrix and gradient over joint and rest pose."""
    right = right_inverse(error)
    carry = right @ _adjoint(geo.invert_pose(rest))
    by_joint = carry @ motion_jacobian(kind, axis, pivot, state)
    by_state = carry @ twist_of(kind, axis, pivot)
    jac = np.concatenate([by_joint, right], axis=2)
    scale = np.array([1.0 / sigma] * 3 + [1.0 / sigma_rad] * 3)
    weight = cauchy(chi2(error, sigma, sigma_rad), _CAUCHY)
    jac = jac * (scale[:, None] * np.sqrt(weight)[:, None, None])
    js = by_state * scale * np.sqrt(weight)[:, None]
    r = error * scale * np.sqrt(weight)[:, None]
    diag = np.maximum((js**2).sum(1), 1e-12)
    cross = np.einsum("tia,ti->ta", jac, js)
    pull = (js * r).sum(1)
    schur = np.einsum("tia,tib->ab", jac, jac) - (cross / diag[:, None]).T @ cross
    gradient = np.einsum("tia,ti->a", jac, r) - cross.T @ (pull / diag)
    n = by_joint.shape[2]
    # the rest pose may slide along the joint while all states shift back: hold that direction
    slide = np.zeros(len(schur))
    slide[n:] = _adjoint(geo.invert_pose(rest)) @ twist_of(kind, axis, pivot)
    schur = schur + np.outer(slide, slide) * diag.sum()
    schur[np.diag_indices_from(schur)] *= 1.0 + 1e-10
    return n, (cross / diag[:, None], -pull / diag, diag), schur, gradient


def _adjoint(pose: Array) -> Array:
    """Adjoint (6, 6) of a pose (4, 4) for twists (v, w)."""
    r = pose[:3, :3]
    return np.asarray(np.block([[r, geo.skew(pose[:3, 3]) @ r], [np.zeros((3, 3)), r]]))


def _covariance(
    kind: Kind,
    axis: Array,
    pivot: Array,
    state: Array,
    rest: Array,
    error: Array,
    sigma: float,
    sigma_rad: float,
) -> Array:
    """Covariance of joint tangent and states, widened for errors which repeat from pose to pose."""
    n, (ratio, _, diag), schur, _ = _reduced(kind, axis, pivot, state, rest, error, sigma, sigma_rad)
    inverse = np.linalg.inv(schur)
    top = inverse[:n, :n]
    cross = -inverse[:n] @ ratio.T
    states = np.diag(1.0 / diag) + ratio @ inverse @ ratio.T
    out = np.block([[top, cross], [cross.T, states]])
    r = np.clip(error / np.array([sigma] * 3 + [sigma_rad] * 3), -3.0, 3.0)
    energy = float((r**2).sum())
    rho = float((r[1:] * r[:-1]).sum()) / energy if energy > 0 else 0.0
    rho = min(max(rho, 0.0), 0.95)
    return np.asarray(0.5 * (out + out.T) * (1.0 + rho) / (1.0 - rho))
