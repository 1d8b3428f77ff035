"""Joints that a board's shape and the room suggest: hinges at edges, slides along the normal and edges."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product

import cv2
import numpy as np

from recon.interaction.joints.observations import Kind
from twin import geometry as geo
from twin.geometry import Array

# m from a plane within which points lie on the plane. Chosen by us.
_ON_PLANE_M = 0.02
# Tries of three points for a plane, and points of which those on each are counted. Chosen by us.
_TRIES, _COUNTED = 200, 500
# How far (m) beyond an edge its hinge may lie: next to its hinge a board hardly leaves its place, so the
# surface seen to leave ends before it, by that gap over the sine of the opening. Chosen by us.
_BEYOND_M = (0.0, 0.05, 0.1)
# Quantile of the points that is an edge, so that single points do not shift the edge. Chosen by us.
_LENGTH = 0.98
# Rad within which an axis may be a direction of the room. Chosen by us.
_OF_ROOM = np.radians(12.0)


@dataclass(frozen=True, eq=False)
class Proposed:
    """A joint that may carry a surface: unit axis (3,), and for hinges a pivot (3,) m, in the world."""

    kind: Kind
    axis: Array
    pivot: Array

    def poses(self, states: Array) -> Array:
        """World motions (n, 4, 4) of the states (n,), rad or m."""
        out = np.tile(np.eye(4), (len(states), 1, 1))
        if self.kind == "prismatic":
            out[:, :3, 3] = states[:, None] * self.axis
        else:
            out[:, :3, :3] = geo.exp_so3(states[:, None] * self.axis)
            out[:, :3, 3] = self.pivot - out[:, :3, :3] @ self.pivot
        return out


def proposed_joints(points: Array) -> list[Proposed]:
    """Three slides of the rectangle about a surface's points (n, 3), and hinges at and beyond its edges."""
    normal, on = plane_of(points)
    basis = geo.orthogonal_basis(normal)[:, :2]
    flat = (on - on.mean(axis=0)) @ basis
    (_, _), (_, _), angle = cv2.minAreaRect(flat.astype(np.float32))
    turn = np.deg2rad(angle)
    sides = basis @ np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    along = (on - on.mean(axis=0)) @ sides
    low, high = np.quantile(along, [1 - _LENGTH, _LENGTH], axis=0)
    middle = on.mean(axis=0) + sides @ (0.5 * (low + high))
    out = [Proposed("prismatic", d, middle) for d in (normal, sides[:, 0], sides[:, 1])]
    for k in range(2):
        half = 0.5 * (high[k] - low[k])
        for gap, sign in product(_BEYOND_M, (-1.0, 1.0)):
            edge = middle + sides[:, k] * sign * (half + gap)
            out.append(Proposed("revolute", sides[:, 1 - k], edge))
    return out


def along_room(joints: Sequence[Proposed], room: Array) -> list[Proposed]:
    """The joints with axes turned onto the direction of the room (3, m) next to each, if one is near."""
    out = []
    for joint in joints:
        at = int(np.argmax(np.abs(joint.axis @ room))) if room.shape[1] else None
        if at is not None and geo.line_angle(joint.axis, room[:, at]) < _OF_ROOM:
            out.append(replace(joint, axis=room[:, at] * np.sign(joint.axis @ room[:, at])))
    return out


def plane_of(points: Array) -> tuple[Array, Array]:
    """Unit normal (3,) of the plane of most points (RANSAC, Fischler and Bolles 1981), and those points."""
    rng = np.random.default_rng(0)
    some = points[:: max(1, len(points) // _COUNTED)]
    foot, normal, most = points[0], np.zeros(3), 0
    for _ in range(_TRIES):
        a, b, c = points[rng.choice(len(points), 3, replace=False)]
        across = np.cross(b - a, c - a)
        length = float(np.linalg.norm(across))
        if length < 1e-9:
            continue
        count = int((np.abs((some - a) @ across) < _ON_PLANE_M * length).sum())
        if count > most:
            foot, normal, most = a, across / length, count
    best = np.abs((points - foot) @ normal) < _ON_PLANE_M
    on = points[best]
    return np.asarray(np.linalg.svd(on - on.mean(axis=0), full_matrices=False)[2][2]), on
