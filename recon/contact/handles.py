"""What of a part a hand can take hold of: the bar or knob that stands off a face, or else a free edge."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from scipy.spatial import cKDTree

from recon.contact.faces import SurfaceSamples, faces_before
from twin import geometry as geo
from twin.geometry import Array
from twin.handles import (
    CELL,
    STANDS_OFF,
    Face,
    frame_of,
    is_bar,
    long_side,
    outermost_face,
    pieces_of,
    upright,
)
from twin.scene import Joint, Revolute

_AROUND_M = 0.12  # a fist is some 10 cm wide
_HALF_FIST_M = 0.05
_INTO_FIST_M = 0.02  # a finger's thickness
_GUESSED_WIDTH_M = 0.02


@dataclass(frozen=True, eq=False)
class Handle:
    """Something to hold. centre: (3,) m, middle of the held section. rotation: (3, 3), columns = closing,
    along the handle, out of the part. width: m along the closing direction. depth: m from the centre out to
    the surface. low, high: m, ends along the handle relative to the centre. shape: (n, 3), its surface."""

    kind: Literal["bar", "knob", "edge", "unseen handle"]
    centre: Array
    rotation: Array
    width: float
    depth: float
    low: float
    high: float
    shape: Array

    @property
    def surface_point(self) -> Array:
        """Point (3,) of the surface in front of the centre."""
        return np.asarray(self.centre + self.depth * self.rotation[:, 2])

    def distance(self, points: Array) -> Array:
        """Distances (n,) of points (n, 3) to the handle's middle line."""
        local = (points - self.centre) @ self.rotation
        beyond = np.maximum(np.maximum(self.low - local[:, 1], local[:, 1] - self.high), 0.0)
        return np.asarray(np.linalg.norm(np.stack([local[:, 0], beyond, local[:, 2]]), axis=0))

    def along(self, points: Array) -> Array:
        """Coordinates (n,) of points (n, 3) along the handle, from the centre."""
        return np.asarray((points - self.centre) @ self.rotation[:, 1])

    def shifted(self, along: float) -> Handle:
        """The section of a bar or an edge `along` m farther, no farther than its end; others have but one."""
        if self.kind in ("knob", "unseen handle"):
            return self
        step = float(np.clip(along, self.low, self.high))
        if self.kind == "bar":
            return _section(self.shape, self.rotation, float(self.centre @ self.rotation[:, 1]) + step, "bar")
        centre = self.centre + step * self.rotation[:, 1]
        return replace(self, centre=centre, low=self.low - step, high=self.high - step)


def find_handle(surface: SurfaceSamples, touch: Array, joint: Joint) -> Handle | None:
    """The bar or knob near the hand, None when nothing stands off a face there.

    Args:
        touch: points (n, 3) on the hand's surface near the part.
    """
    hand = np.median(touch, axis=0)
    for face in faces_before(surface, hand):
        off = face.stands_off(surface.points)
        around = off & (np.linalg.norm(surface.points - hand, axis=1) < _AROUND_M)
        piece = _held_piece(surface.points[around], touch)
        if piece is not None and face.low_enough(piece):
            return _describe(piece, surface.points[off], face, hand, joint)
    return None


def _held_piece(points: Array, touch: Array) -> Array | None:
    """The connected points (n, 3) that the hand touches most."""
    if len(points) < 30:
        return None
    pieces = pieces_of(points)
    near = np.exp(-((cKDTree(touch).query(pieces.middle)[0] / 0.03) ** 2))  # a finger is some 2 cm thick
    held = int(np.argmax(np.bincount(pieces.piece, near + 1e-6)))
    piece = points[pieces.of_points == held]
    touching = cKDTree(touch).query(piece)[0].min() < 0.04
    return piece if len(piece) >= 30 and touching else None


def _describe(piece: Array, off: Array, face: Face, hand: Array, joint: Joint) -> Handle:
    """Direction, ends and section of a handle from its outer half, which leaves the posts out.

    What lies on a bar's line is the bar's, though a hand may hide the joint. off: (n, 3) off the face.
    """
    normal = face.normal
    shape, top = face.outer_half(piece)
    along, length, width = long_side(shape, normal)
    away = hand - shape.mean(axis=0)
    away -= (away @ normal) * normal
    if length < _HALF_FIST_M and np.linalg.norm(away) > _HALF_FIST_M:
        # The fist is not about this piece: it is what the hand left to see of a bar that leads to the hand.
        along = geo.unit(away)
        rotation = frame_of(along, normal)
        return _section(shape, rotation, float(hand @ along), "bar")
    if not is_bar(length, width):
        along = upright(normal, _hinge(joint))
        rotation = frame_of(along, normal)
        return _section(shape, rotation, float(np.mean(np.quantile(shape @ along, [0.02, 0.98]))), "knob")
    side = np.cross(along, normal)
    aside = np.abs((off - np.median(shape, axis=0)) @ side) < 0.5 * width + 0.5 * CELL
    height = face.height(off)
    shape = off[aside & (height > 0.5 * top) & (height < top + CELL)]
    along, _, _ = long_side(shape, normal)
    rotation = frame_of(along, normal)
    return _section(shape, rotation, float(hand @ along), "bar")


def _section(shape: Array, rotation: Array, at: float, kind: Literal["bar", "knob"]) -> Handle:
    """The section around the coordinate `at` along the handle, or at its end; unseen as elsewhere.

    A bar may go on for half a fist beyond what was seen of it, in the hand.
    """
    local = shape @ rotation
    beyond = _HALF_FIST_M if kind == "bar" else 0.0
    low, high = (float(q) for q in np.quantile(local[:, 1], [0.01, 0.99]) + [-beyond, beyond])
    at = float(np.clip(at, low, high))
    near = local[np.abs(local[:, 1] - at) < 0.03] if kind == "bar" else local
    if len(near) < 20:
        near = local
    c0, c1 = np.quantile(near[:, 0], [0.03, 0.97])
    top = float(np.quantile(near[:, 2], 0.97))
    # A scan sees the front of a bar better than its back, so its depth is taken from its width.
    depth = min(0.5 * float(c1 - c0), 0.02)
    centre = rotation @ np.array([0.5 * (c0 + c1), at, top - depth])
    return Handle(kind, centre, rotation, float(c1 - c0), depth, low - at, high - at, shape)


def _hinge(joint: Joint) -> Array | None:
    return joint.axis if isinstance(joint, Revolute) else None


def find_edge(surface: SurfaceSamples, touch: Array, joint: Joint) -> Handle:
    """The free edge that the hand pinches: of the largest face before it, on the side of the hand's centre.

    The closing direction goes through the panel, the third direction out of it over the edge.
    """
    hand = np.median(touch, axis=0)
    faces = faces_before(surface, hand)
    if not faces:
        faces = [outermost_face(surface.points, geo.orthogonal_basis(joint.axis)[:, 0])]
    face = faces[0]
    flat = face.points
    nearest = flat[int(np.argmin(np.linalg.norm(flat - hand, axis=1)))]
    around = flat[np.linalg.norm(flat - nearest, axis=1) < _AROUND_M]
    inward = around.mean(axis=0) - nearest
    inward -= (inward @ face.normal) * face.normal
    if np.linalg.norm(inward) < 1e-6:
        inward = upright(face.normal, _hinge(joint))
    out = -geo.unit(inward)
    along = np.cross(out, face.normal)
    reach = float(np.quantile(around @ out, 0.99))
    strip = surface.points[
        (np.linalg.norm(surface.points - nearest, axis=1) < _AROUND_M) & (surface.points @ out > reach - 0.03)
    ]
    low, high = np.quantile(strip @ face.normal, [0.02, 0.98])
    rotation = np.stack([face.normal, along, out], axis=1)
    at = float(hand @ along)
    centre = rotation @ np.array([0.5 * (low + high), at, reach - 0.012])
    return Handle("edge", centre, rotation, float(high - low), 0.012, -0.05, 0.05, strip)


def around_edge(edge: Handle, touch: Array) -> bool:
    """Whether the hand's surface (n, 3) reaches over the edge or lies on the panel, not before it."""
    local = (touch - edge.centre) @ edge.rotation
    over = np.mean(local[:, 2] > edge.depth)
    return bool(over > 0.25 or np.median(local[:, 0]) < 0.5 * edge.width + STANDS_OFF)


def unseen_handle(edge: Handle, touch: Array, eye: Array, joint: Joint) -> Handle:
    """A handle that is missing from the mesh, in the fist: a little behind what the eye (3,) sees of it.

    Its thickness is a guess; it stands upright, or as the hinge does.
    """
    normal = edge.rotation[:, 0]
    hand = np.median(touch, axis=0)
    along = upright(normal, _hinge(joint))
    rotation = frame_of(along, normal)
    centre = hand + _INTO_FIST_M * geo.unit(hand - eye)
    half = _HALF_FIST_M
    return Handle("unseen handle", centre, rotation, _GUESSED_WIDTH_M, 0.0, -half, half, touch)
