"""What is known of furniture: it stands level, its doors hang plumb, its runners are square to its front.

Hinges and runners lie along a direction of the room in all but odd pieces. It is taken as a further
observation of the axis, which counts where the recording says less.
"""

from __future__ import annotations

import numpy as np

from recon.observation.room import Room
from twin import geometry as geo
from twin.geometry import Array
from twin.joint import Joint, turned_covariance

# All chosen by us. rad, one standard deviation of an axis to the room's direction: a spirit level shows a
# tenth of that, play of hinges and runners is more.
_LEVEL = float(np.radians(0.3))
# Share of axes that lie along no direction of the room: slanted lids, furniture askew to the walls.
_ODD = 0.05
# Degrees of freedom of Student's distribution of the axis' own error: it is told by few spans of motion.
_FREEDOM = 8.0
# Probability of one direction from which on it is taken.
_SURE = 0.9


def with_room_known(joint: Joint, state: Array, covariance: Array, room: Room) -> tuple[Joint, Array, Array]:
    """Joint, states (n,) and their covariance (d + n, d + n) with the room's directions known.

    The axis lies along one of them, give or take `_LEVEL`, or anywhere; its own error is Student's. Where one
    of these is sure, the axis is drawn to it, and what hangs on it goes along (Kalman 1960); a fit that
    disagrees by more than it claims counts less, by the scale of Student's mixture (Lange et al. 1989).
    """
    own = covariance[:2, :2]
    told = [
        (_tilt(joint, u), (_LEVEL**2 + s**2) * np.eye(2))
        for u, s in zip(room.directions.T, room.sigma, strict=True)
    ]
    odds = [_ODD / (2.0 * np.pi), *((1.0 - _ODD) / len(told) * _student(m, own + known) for m, known in told)]
    best = int(np.argmax(odds))
    if best == 0 or odds[best] < _SURE * sum(odds):
        return joint, state, covariance
    middle, known = told[best - 1]
    scale = _scale(middle, own, known)
    covariance = scale * covariance
    gain = np.linalg.solve(covariance[:2, :2] + known, covariance[:2]).T
    delta, d = gain @ middle, joint.dof
    covariance = covariance - gain @ covariance[:2]
    moved = joint.plus(delta[:d])
    carried = geo.exp_so3(joint.basis @ delta[:2]) @ joint.basis
    covariance[:d, :d] = turned_covariance(covariance[:d, :d], carried, moved.basis)
    return moved, state + delta[-len(state) :], covariance


def _tilt(joint: Joint, direction: Array) -> Array:
    """The tilt (2,), rad, that turns the axis to a direction or against it, as the joint's tangent has it."""
    about = joint.basis.T @ np.cross(joint.axis, direction * np.copysign(1.0, direction @ joint.axis))
    return np.asarray(
        about * geo.line_angle(joint.axis, direction) / max(float(np.linalg.norm(about)), 1e-12)
    )


def _student(off: Array, shape: Array) -> float:
    """Density of Student's distribution in two dimensions."""
    square = float(off @ np.linalg.solve(shape, off))
    spread = 2.0 * np.pi * np.sqrt(float(np.linalg.det(shape)))
    return float((1.0 + square / _FREEDOM) ** (-0.5 * _FREEDOM - 1.0) / spread)


def _scale(middle: Array, own: Array, known: Array) -> float:
    """By how much the covariance of a fit grows that lies this far off what is known; at least 1."""
    scale = 1.0
    for _ in range(20):
        moved = scale * own @ np.linalg.solve(scale * own + known, middle)
        scale = max((_FREEDOM + float(moved @ np.linalg.solve(own, moved))) / (_FREEDOM + 2.0), 1.0)
    return scale
