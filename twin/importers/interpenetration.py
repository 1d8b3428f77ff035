"""How much deeper a part's surface and the others are in each other at the end of a way than at rest.

Visual meshes are seldom closed and often thin sheets, so that no inside can be relied on. Instead points of
each surface are followed along the way, and the first face of the other surface that each passes is the one
that it goes through. Its depth is how far it ends behind that face, along the face's normal, and no more than
its distance to the other surface: a point that slides along a wall a hair's breadth inside of it is not deep.
Limits: a point that starts inside a solid, or on its surface, is not followed (what leaves a solid is not
deeper); what is under a thousandth of the points, a peg or a wire, is not seen.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from twin import geometry as geo
from twin.collision.solid import spread
from twin.geometry import Array
from twin.scene import Joint, Mesh, Revolute

# All chosen by us.
# m: the way begins this much before the rest pose, so that faces that overlap at rest are passed on it.
_BEFORE = 0.01
# m: a point that starts nearer than this to the other surface slides along it, and may leave by its side.
_TOUCHES = 1e-3
# rad: a hinge turns in steps of at most this, whose chord leaves the arc by 0.3 mm at 1 m.
_STEP = 0.05
# Points on each surface; a front of 0.6 x 0.7 m so has one every 1 cm.
_POINTS = 4000
# Points are drawn until this many, of a surface that reaches beyond what the part can meet.
_DRAWN = 40000
# Share of the points that must be as deep: single ones graze edges.
_SHARE = 1e-3
# m: faces are shifted by up to this along their normals, each by its own share, before they count: of faces
# that coincide, as where boards meet, a ray's count misses some.
_APART = 1e-5
# Directions in which a point counts the faces before it; it is inside when each count is odd.
_DIRECTIONS = np.array([[0.31, 0.52, 0.79], [-0.71, 0.23, 0.66], [0.12, -0.84, -0.53]])


def deeper(part: Mesh, others: Mesh, joint: Joint, to: float) -> float:
    """How much deeper (m) `part` and `others` are in each other at state `to` of `joint` than at state 0.

    Args:
        part: its surface in the world at state 0; it needn't be closed.
        others: the surface of what stands around it; it needn't be closed either.
        joint: how the part moves; its limits don't matter.
        to: m or rad.
    """
    if to == 0 or not len(part.faces) or not len(others.faces):
        return 0.0
    reach = 1.0
    if isinstance(joint, Revolute):
        away = np.linalg.norm(np.cross(part.vertices - joint.pivot, joint.axis), axis=1)
        reach = max(float(away.max()), 1e-3)
    steps = int(np.ceil(abs(to) / _STEP)) if isinstance(joint, Revolute) else 1
    states = np.concatenate([[-np.sign(to) * _BEFORE / reach], np.linspace(0.0, to, steps + 1)])
    poses = joint.poses(states)
    mine = spread(part.vertices[part.faces], _POINTS)[0]
    swept = np.concatenate([geo.transform(T, mine) for T in poses])
    theirs = _within(others, swept.min(axis=0) - _BEFORE, swept.max(axis=0) + _BEFORE)
    back = np.stack([geo.invert_pose(T) for T in poses])
    return max(_common(_passed(mine, others, poses)), _common(_passed(theirs, part, back)))


def _common(depths: Array) -> float:
    """The depth that enough points reach."""
    count = int(np.ceil(_SHARE * _POINTS))
    return float(np.sort(depths)[-count]) if len(depths) >= count else 0.0


def _within(mesh: Mesh, low: Array, high: Array) -> Array:
    """Points (n, 3) of a surface in a box, at most _POINTS."""
    corners = mesh.vertices[mesh.faces]
    near = geo.every((corners.max(axis=1) >= low) & (corners.min(axis=1) <= high))
    if not geo.triangle_areas(corners[near]).sum() > 0:
        return np.zeros((0, 3))
    points = spread(corners[near], _DRAWN)[0]
    return points[geo.every((points >= low) & (points <= high))][:_POINTS]


def _passed(points: Array, mesh: Mesh, poses: Array) -> Array:
    """How much deeper (n,) points (m, 3) are in `mesh` at the last of `poses` (k, 4, 4) than at poses[1].

    Points that are inside, or touch, at the first pose are left out.
    """
    surface = _Surface(mesh)
    start = geo.transform(poses[0], points)
    points = points[~surface.holds(start) & (surface.distance(start) > _TOUCHES)]
    way = np.stack([geo.transform(T, points) for T in poses])
    rest, end = way[1], way[-1]
    depth, free = np.zeros(len(points)), np.ones(len(points), bool)
    for k, (a, b) in enumerate(pairwise(way)):
        share, normal = surface.first(a, b)
        new = np.flatnonzero(free & (share <= 1.0))
        free[new] = False
        since = rest[new] if k == 0 else a[new] + share[new, None] * (b[new] - a[new])
        behind = np.abs(np.einsum("ij,ij->i", normal[new], end[new] - since))
        was = surface.distance(rest[new]) if k == 0 else 0.0
        depth[new] = np.minimum(behind, surface.distance(end[new]) - was)
    return depth


class _Surface:
    """A mesh that answers rays and distances; single precision about its own middle."""

    def __init__(self, mesh: Mesh) -> None:
        self._middle = (mesh.vertices.min(axis=0) + mesh.vertices.max(axis=0)) / 2
        corners = mesh.vertices[mesh.faces] - self._middle
        self._scene: Any = _scene(corners)
        shift = np.random.default_rng(0).uniform(-_APART, _APART, len(corners))
        self._counted: Any = _scene(corners + (shift[:, None] * geo.triangle_normals(corners)[0])[:, None])

    def first(self, start: Array, end: Array) -> tuple[Array, Array]:
        """Share (n,) of the way from `start` to `end` (n, 3) at a face, or inf, and its normal (n, 3)."""
        rays = np.concatenate([start - self._middle, end - start], axis=1)
        still = np.linalg.norm(end - start, axis=1) < 1e-9
        rays[still, 3:] = [1.0, 0.0, 0.0]
        found = self._scene.cast_rays(_tensor(rays), 1)
        share = found["t_hit"].numpy().astype(np.float64)
        return np.where(still, np.inf, share), found["primitive_normals"].numpy().astype(np.float64)

    def distance(self, points: Array) -> Array:
        """Distances (n,) m to the surface."""
        if not len(points):
            return np.zeros(0)
        return np.asarray(self._scene.compute_distance(_tensor(points - self._middle), 1).numpy(), np.float64)

    def holds(self, points: Array) -> NDArray[np.bool_]:
        """Whether points (n, 3) are inside, in whatever direction faces are counted."""
        inside = np.ones(len(points), bool)
        for direction in _DIRECTIONS:
            rays = np.concatenate([points - self._middle, np.tile(direction, (len(points), 1))], axis=1)
            inside &= self._counted.count_intersections(_tensor(rays), 1).numpy() % 2 == 1
        return inside


def _scene(corners: Array) -> Any:
    """Rays against triangles (m, 3, 3) m."""
    import open3d as o3d

    scene = o3d.t.geometry.RaycastingScene(1)
    faces = o3d.core.Tensor.from_numpy(np.arange(3 * len(corners), dtype=np.uint32).reshape(-1, 3))
    scene.add_triangles(_tensor(corners.reshape(-1, 3)), faces)
    return scene


def _tensor(values: Array) -> Any:
    import open3d as o3d

    return o3d.core.Tensor.from_numpy(np.ascontiguousarray(values, dtype=np.float32))
