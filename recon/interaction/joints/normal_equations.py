"""Normal equations of one joint on 3D tracks.

A landmark is the weighted mean of its pulled-back observations (`joints.observations`): the landmarks
leave in closed form (the Schur complement of isotropic noise is exact), and what remains is a dense system of
the 2 or 4 joint unknowns and one state a frame. The joint unknowns are the tangent of `twin.scene.Joint`:
tilts about two directions normal to the axis, then, for a revolute joint, shifts of the axis along them.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from recon.interaction.joints.observations import Model, Observations, pull_back, weighted_means
from twin import geometry as geo
from twin.geometry import Array


@njit(cache=True, nogil=True)
def _jacobian(points, pulled, k, t, revolute, axis, basis, pivot, turn, out):  # type: ignore[no-untyped-def]
    """Columns (3, 5) of dz (track k, frame t): tilts, shifts (revolute), state. turn: a, cos(-a), sin(-a)."""
    angle, c, s = turn
    if not revolute:
        for b in range(2):
            u0, u1, u2 = basis[0, b], basis[1, b], basis[2, b]
            out[0, b] = -angle * (u1 * axis[2] - u2 * axis[1])
            out[1, b] = -angle * (u2 * axis[0] - u0 * axis[2])
            out[2, b] = -angle * (u0 * axis[1] - u1 * axis[0])
        for i in range(3):
            out[i, 4] = -axis[i]
        return
    zd0, zd1, zd2 = pulled[k, t, 0] - pivot[0], pulled[k, t, 1] - pivot[1], pulled[k, t, 2] - pivot[2]
    yd0, yd1, yd2 = points[k, t, 0] - pivot[0], points[k, t, 1] - pivot[1], points[k, t, 2] - pivot[2]
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


@njit(cache=True, nogil=True)
def _take_out(hessian, column, total, n, first, last):  # type: ignore[no-untyped-def]
    """Take a track's landmark out of the states' rows first..last: less its columns' products (3, n + T)."""
    c0, c1, c2 = column[0, first:last], column[1, first:last], column[2, first:last]
    for t in range(last - first):
        s0, s1, s2 = c0[t] / total, c1[t] / total, c2[t] / total
        if s0 == 0.0 and s1 == 0.0 and s2 == 0.0:
            continue
        joint, states = hessian[first + t], hessian[first + t, first : first + t + 1]
        for a in range(n):
            joint[a] = joint[a] - s0 * column[0, a] - s1 * column[1, a] - s2 * column[2, a]
        for b in range(len(states)):  # from 0 on, so that the compiler takes several at once
            states[b] = states[b] - s0 * c0[b] - s1 * c1[b] - s2 * c2[b]


@njit(cache=True, nogil=True)
def _assemble(points, z, weight, landmarks, revolute, axis, basis, pivot, state):  # type: ignore[no-untyped-def]
    """Hessian (n + T, n + T) and gradient of half the weighted squared residual without landmarks."""
    n_tracks, n_frames = weight.shape
    n = 4 if revolute else 2
    hessian, gradient = np.zeros((n + n_frames, n + n_frames)), np.zeros(n + n_frames)
    jac, column = np.zeros((3, 5)), np.zeros((3, n + n_frames))
    cosine, sine = np.cos(state), -np.sin(state)
    for k in range(n_tracks):
        total = 1e-300
        column[:] = 0.0  # sums of w J over the track: what the landmark takes out
        first, last = n_frames, -1
        for t in range(n_frames):
            w = weight[k, t]
            if w <= 0.0:
                continue
            first, last = min(first, t), t
            turn = state[t], cosine[t], sine[t]
            _jacobian(points, z, k, t, revolute, axis, basis, pivot, turn, jac)
            total += w
            for i in range(3):
                r = z[k, t, i] - landmarks[k, i]
                js = w * jac[i, 4]
                hessian[n + t, n + t] += js * jac[i, 4]
                gradient[n + t] += js * r
                column[i, n + t] = js
                for a in range(n):
                    ja = w * jac[i, a]
                    column[i, a] += ja
                    gradient[a] += ja * r
                    hessian[n + t, a] += ja * jac[i, 4]
                    for b in range(a + 1):
                        hessian[a, b] += ja * jac[i, b]
        for i in range(3):
            for a in range(n):
                scaled = column[i, a] / total
                for b in range(a + 1):
                    hessian[a, b] -= scaled * column[i, b]
        _take_out(hessian, column, total, n, n + first, n + last + 1)
    for a in range(n + n_frames):
        for b in range(a):
            hessian[b, a] = hessian[a, b]
    return hessian, gradient


def normal_equations(obs: Observations, weight: Array, model: Model) -> tuple[Array, Array]:
    """Hessian (n + T, n + T) and gradient of half the weighted squared residual, landmarks eliminated."""
    revolute = model.kind == "revolute"
    basis = geo.orthogonal_basis(model.axis)[:, :2].copy()
    z = pull_back(obs.points, weight, revolute, model.axis, model.pivot, model.state)
    marks = weighted_means(z, weight)
    hessian, gradient = _assemble(
        obs.points, z, weight, marks, revolute, model.axis, basis, model.pivot, model.state
    )
    return np.asarray(hessian), np.asarray(gradient)
