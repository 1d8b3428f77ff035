"""Unit screws of joints, and how motions change with them."""

from __future__ import annotations

import numpy as np

from recon.interaction.joints.observations import Kind
from twin import geometry as geo
from twin.geometry import Array


def twist_of(kind: Kind, axis: Array, pivot: Array) -> Array:
    """Unit screw (6,) = (v, w) of a joint."""
    if kind == "prismatic":
        return np.concatenate([axis, np.zeros(3)])
    return np.concatenate([np.cross(pivot, axis), axis])


def motion_jacobian(kind: Kind, axis: Array, pivot: Array, distance: Array) -> Array:
    """Right-hand derivative (E, 6, 2 or 4) of exp(d xi) by the joint tangent, for distances (E,)."""
    basis = geo.orthogonal_basis(axis)[:, :2]
    tilt = np.cross(basis.T, axis).T  # da = w x a
    if kind == "prismatic":
        return np.asarray(distance[:, None, None] * np.concatenate([tilt, np.zeros((3, 2))]))
    along = np.cross(pivot, tilt.T).T
    d_xi = np.block([[along, tilt], [tilt, np.zeros((3, 2))]])
    a = _ad(twist_of(kind, axis, pivot))
    a1 = a @ d_xi
    d = distance[:, None, None]
    return np.asarray(d * d_xi - (1.0 - np.cos(d)) * a1 + (d - np.sin(d)) * (a @ a1))


def _ad(twist: Array) -> Array:
    """ad (..., 6, 6) of twists (v, w)."""
    out = np.zeros((*twist.shape[:-1], 6, 6))
    w, v = geo.skew(twist[..., 3:]), geo.skew(twist[..., :3])
    out[..., :3, :3], out[..., 3:, 3:], out[..., :3, 3:] = w, w, v
    return out


def right_inverse(e: Array) -> Array:
    """Inverse right Jacobian of SE(3), by its Bernoulli series to sixth order (1e-8 at 0.5 rad)."""
    a = _ad(e)
    a2 = a @ a
    a4 = a2 @ a2
    return np.asarray(np.eye(6) + a / 2.0 + a2 / 12.0 - a4 / 720.0 + a4 @ a2 / 30240.0)
