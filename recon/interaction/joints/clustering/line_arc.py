"""Line and arc hypotheses of single tracks, and the joint each of them speaks for."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recon.interaction.joints.observations import Observations
from twin import geometry as geo
from twin.geometry import Array

_LENGTH = 0.3  # m, about half a door: how much rotation weighs against translation when joints are compared
_ARC_STEPS = 4  # Gauss-Newton steps of the circle after its algebraic start


@dataclass(frozen=True, eq=False)
class TrackShapes:
    """For every track: error (K,) m RMS of its better shape, arc (K,) bool, screw (K, 6) of its motion: unit
    vector of (common centre's velocity, 0.3 m times angular velocity), positive along its motion."""

    error: Array
    arc: NDArray[np.bool_]
    screw: Array


def track_shapes(obs: Observations, sigma: float) -> TrackShapes:
    """Fit a line and an arc to every track; an arc must earn its unknowns (Bayesian information criterion).

    sigma: noise of one coordinate in metres.
    """
    w = (obs.weight > 0).astype(np.float64)
    count = np.maximum(w.sum(1), 1.0)
    mean = (w[..., None] * obs.points).sum(1) / count[:, None]
    centred = (obs.points - mean[:, None]) * w[..., None]
    values, vectors = np.linalg.eigh(np.einsum("kti,ktj->kij", centred, centred))
    normal, second, first = vectors[..., 0], vectors[..., 1], vectors[..., 2]
    line_square = np.maximum(values[:, 0] + values[:, 1], 0.0)
    u, v = np.einsum("kti,ki->kt", centred, first), np.einsum("kti,ki->kt", centred, second)
    centre, arc_square = _circles(u, v, w)
    arc_square = arc_square + np.maximum(values[:, 0], 0.0)
    arc = (line_square - arc_square) / sigma**2 > 3.0 * np.log(3.0 * count)
    error = np.sqrt(np.where(arc, arc_square, line_square) / count)
    middle = np.average(mean, axis=0, weights=count)
    way = _net_motion(obs.points, w)
    direction = first * np.where((first * way).sum(1) < 0, -1.0, 1.0)[:, None]
    pivot = mean + centre[:, :1] * first + centre[:, 1:] * second
    turn_sense = np.cross(normal, mean - pivot)
    axis = normal * np.where((turn_sense * way).sum(1) < 0, -1.0, 1.0)[:, None]
    slide = np.concatenate([direction, np.zeros_like(direction)], axis=1)
    hinge = np.concatenate([np.cross(axis, middle - pivot), _LENGTH * axis], axis=1)
    screw = np.where(arc[:, None], hinge, slide)
    return TrackShapes(error, arc, geo.unit(screw))


def _net_motion(points: Array, w: Array) -> Array:
    """Mean of the later half of each track less that of the earlier half (K, 3)."""
    run = np.cumsum(w, axis=1)
    late = w * (run > 0.5 * run[:, -1:])
    early = w - late
    return np.asarray(
        np.einsum("kt,kti->ki", late, points) / np.maximum(late.sum(1), 1)[:, None]
        - np.einsum("kt,kti->ki", early, points) / np.maximum(early.sum(1), 1)[:, None]
    )


def _circles(u: Array, v: Array, w: Array) -> tuple[Array, Array]:
    """Centres (K, 2) and squared radial errors (K,) of circles by points (K, T): Kasa, Gauss-Newton."""
    z = u**2 + v**2
    design = np.stack([u, v, np.ones_like(u)], axis=-1) * w[..., None]
    normal = np.einsum("kti,ktj->kij", design, design)
    normal += 1e-9 * np.maximum(np.trace(normal, axis1=1, axis2=2), 1e-12)[:, None, None] * np.eye(3)
    right = np.einsum("kti,kt->ki", design, z * w)
    solution = np.linalg.solve(normal, right[..., None])[..., 0]
    centre = solution[:, :2] / 2.0
    radius = np.sqrt(np.maximum(solution[:, 2] + (centre**2).sum(1), 1e-12))
    for _ in range(_ARC_STEPS):
        du, dv = u - centre[:, :1], v - centre[:, 1:]
        distance = np.maximum(np.hypot(du, dv), 1e-9)
        error = (distance - radius[:, None]) * w
        jac = np.stack([-du / distance, -dv / distance, -np.ones_like(u)], axis=-1) * w[..., None]
        hessian = np.einsum("kti,ktj->kij", jac, jac)
        hessian += 1e-6 * np.maximum(np.trace(hessian, axis1=1, axis2=2), 1e-12)[:, None, None] * np.eye(3)
        step = -np.linalg.solve(hessian, np.einsum("kti,kt->ki", jac, error)[..., None])[..., 0]
        step *= np.minimum(1.0, 0.5 * radius / np.maximum(np.linalg.norm(step, axis=1), 1e-12))[:, None]
        centre, radius = centre + step[:, :2], np.maximum(radius + step[:, 2], 1e-6)
    error = (np.hypot(u - centre[:, :1], v - centre[:, 1:]) - radius[:, None]) * w
    return centre, np.asarray((error**2).sum(1))
