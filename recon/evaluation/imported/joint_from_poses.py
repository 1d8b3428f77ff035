"""A joint from the poses of a part, as FunREC derives it for HOI4D (supplement, 2.3), and its states.

10 000 points on the part's surface are carried by its poses. A hinge: the plane of their motion by PCA, then,
in it, the one centre of all their circles by least squares. A slide: the line through the positions of the
point nearest the part's middle.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from twin import geometry as geo
from twin.geometry import Array

POINTS = 10_000  # FunREC, supplement 2.3
MAX_FIT_FRAMES = 300  # of a HOI4D clip; of more, as many even ones tell the joint
MIN_TURN = np.radians(10.0)  # chosen by us: annotated poses of a sliding part waver by some degrees
MIN_SLIDE = 0.03  # m, chosen by us: annotated poses of a still part waver by a centimetre or two
# m, chosen by us: what is further from one joint's motion is none, a part that is carried
MAX_RESIDUAL = 0.02
_STEPS = 30  # of Gauss and Newton; from the start it takes a handful


@dataclass(frozen=True, eq=False)
class FittedJoint:
    """A joint of a part that moves: unit axis (3,) and, of a hinge, a point (3,) m on it, in the world;
    states (n,) rad or m from the first pose on. residual: RMS in m of points off the joint's motion."""

    kind: Literal["prismatic", "revolute"]
    axis: Array
    pivot: Array
    states: Array
    residual: float


def fit_joint(T_world_part: Array, size: Array) -> FittedJoint | None:
    """The joint of a part whose frame is its box's middle, of this size (3,) m; None for a part at rest.

    T_world_part: (n, 4, 4). The larger states are positive: which end is closed, poses do not tell.
    """
    turn = geo.rotation_angle(np.swapaxes(T_world_part[:1, :3, :3], 1, 2) @ T_world_part[:, :3, :3]).max()
    places = T_world_part[:, :3, 3]
    if turn < MIN_TURN and np.linalg.norm(np.ptp(places, axis=0)) < MIN_SLIDE:
        return None
    points = box_surface(size, POINTS, np.random.default_rng(0))
    fitted = _hinge(T_world_part, points) if turn >= MIN_TURN else _slide(T_world_part, points)
    if abs(fitted.states.min()) <= fitted.states.max():
        return fitted
    return FittedJoint(fitted.kind, -fitted.axis, fitted.pivot, -fitted.states, fitted.residual)


def box_surface(size: Array, count: int, rng: np.random.Generator) -> Array:
    """Points (count, 3) even over the surface of a box around the origin."""
    half = np.asarray(size, dtype=np.float64) / 2.0
    areas = half[[1, 2, 0]] * half[[2, 0, 1]]  # of the faces normal to x, y, z
    normal = rng.choice(3, size=count, p=areas / areas.sum())
    points = rng.uniform(-half, half, (count, 3))
    points[np.arange(count), normal] = np.where(rng.random(count) < 0.5, -half[normal], half[normal])
    return points


def _hinge(T: Array, points: Array) -> FittedJoint:
    basis = geo.orthogonal_basis(_normal(T, points))
    fit = T[np.unique(np.linspace(0, len(T) - 1, min(len(T), MAX_FIT_FRAMES)).astype(np.int64))]
    flat = _carried(fit, points, basis[:, :2])
    centre = _common_centre(flat)
    start = _carried(T[:1], points, basis[:, :2])[0] - centre
    arms = ((_carried(t[None], points, basis[:, :2])[0] - centre) for t in T)
    angles = np.array(
        [np.arctan2(np.sum(start[:, 0] * a[:, 1] - start[:, 1] * a[:, 0]), np.sum(start * a)) for a in arms]
    )
    height = float(np.mean(_carried(fit, points, basis[:, 2:])))
    pivot = basis @ np.array([*centre, height])
    return FittedJoint(
        "revolute", basis[:, 2], pivot, np.unwrap(angles), _off_circles(fit, points, basis, centre)
    )


def _slide(T: Array, points: Array) -> FittedJoint:
    middle = points[np.argmin(np.linalg.norm(points, axis=1))]
    path = geo.transform(T, np.broadcast_to(middle, (len(T), 1, 3)))[:, 0]
    off = path - path.mean(axis=0)
    axis = np.linalg.svd(off, full_matrices=False)[2][0]
    along = off @ axis
    residual = float(np.sqrt(np.mean(np.sum((off - along[:, None] * axis) ** 2, axis=1))))
    return FittedJoint("prismatic", axis, path[0], along - along[0], residual)


def _carried(T: Array, points: Array, axes: Array) -> Array:
    """Coordinates (n, N, k) along `axes` (3, k) of points (N, 3) under poses (n, 4, 4)."""
    return (axes.T @ T[:, :3, :3] @ points.T + (T[:, :3, 3] @ axes)[:, :, None]).swapaxes(1, 2)


def _normal(T: Array, points: Array) -> Array:
    """Direction in which the points' paths, each about its own mean, spread least."""
    moments = np.column_stack([points, np.ones(len(points))])
    S = moments.T @ moments
    A = T[:, :3] - T[:, :3].mean(axis=0)
    return np.asarray(np.linalg.eigh(np.einsum("nij,jk,nlk->il", A, S, A))[1][:, 0])


def _common_centre(flat: Array) -> Array:
    """Centre (2,) of circles on which points (n, N, 2) move, each of its own radius, by least squares.

    The start is the closed form that makes the squared distances of each point even: it is exact without
    noise, and, other than the points' mean, on the right side of a short arc.
    """
    off = flat - flat.mean(axis=0)
    squares = np.sum(flat**2, axis=2)
    H = 2.0 * np.einsum("nki,nkj->ij", off, off)
    centre = np.linalg.lstsq(H, np.einsum("nki,nk->i", off, squares - squares.mean(axis=0)), rcond=None)[0]
    for _ in range(_STEPS):
        arm = flat - centre
        distance = np.maximum(np.linalg.norm(arm, axis=2), 1e-9)
        J = arm / distance[..., None]
        J -= J.mean(axis=0)
        error = distance - distance.mean(axis=0)
        step = np.linalg.lstsq(np.einsum("nki,nkj->ij", J, J), np.einsum("nki,nk->i", J, error), rcond=None)[
            0
        ]
        centre = centre + step
        if np.linalg.norm(step) < 1e-9:
            break
    return np.asarray(centre)


def _off_circles(T: Array, points: Array, basis: Array, centre: Array) -> float:
    """RMS (m) of the points from circles about the axis: in distance and along it."""
    some = points[:: max(1, len(points) // 500)]
    distance = np.linalg.norm(_carried(T, some, basis[:, :2]) - centre, axis=2)
    height = _carried(T, some, basis[:, 2:])[..., 0]
    squares = (distance - distance.mean(axis=0)) ** 2 + (height - height.mean(axis=0)) ** 2
    return float(np.sqrt(np.mean(squares)))
