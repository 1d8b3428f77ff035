"""Collision shapes that somebody stated: whether each is the convex body that engines take it for."""

from __future__ import annotations

import numpy as np

from twin import geometry as geo
from twin.collision.convex import Hull, hull_of, triangles_of
from twin.collision.decimation import decimated
from twin.collision.pieces import pieces_of
from twin.collision.solid import Solid, spread
from twin.errors import SceneError
from twin.geometry import Array
from twin.mesh import used_vertices
from twin.scene import Mesh, Twin

_HOLLOW = 0.04  # of a shape's diagonal, chosen by us: noise of 1.5 mm on 100 mm of board stays below
_SHEET = 1e-5  # m, chosen by us: thinner is flat, no engine takes it for a body
_FACES = 5000  # a shape of more is judged by as many
_POINTS = 3000  # on the hull, and on the surface
_ROUGH = 0.75  # of an open surface may look inward by more: noise turns faces at its edges


def require_convex(twin: Twin) -> None:
    """Raises SceneError naming the first stated collision mesh that is not convex or is flat."""
    for owner in twin.owners:
        for k, shape in enumerate(owner.collision):
            if not isinstance(shape, Mesh):
                continue
            if _flat(shape):
                raise SceneError(
                    f"collision[{k}] of {owner.name!r} is flat: its {len(shape.faces)} faces enclose nothing",
                    "give it a thickness, or leave the list empty and `twin export` makes shapes",
                )
            depth, size = hollow(shape)
            if depth > _HOLLOW * size:
                raise SceneError(
                    f"collision[{k}] of {owner.name!r} is not convex: its hull lies up to {1e3 * depth:.3g} mm off its surface, "
                    f"{depth / size:.0%} of its size, where {_HOLLOW:.0%} are allowed",
                    "split it into convex pieces, or leave the list empty and `twin export` makes it",
                )


def _flat(mesh: Mesh) -> bool:
    """Whether the faces lie in one plane, or there are none."""
    points = used_vertices(mesh)
    if len(points) < 4:
        return True
    _, _, axes = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)
    return float(np.ptp(points @ axes[2])) < _SHEET


def hollow(mesh: Mesh) -> tuple[float, float]:
    """How deep (m) a mesh falls in behind its convex hull, and the hull's diagonal (m).

    That is the greatest distance of the hull from the surface, which suits thin and noisy bodies, unlike a
    share of volume, and asks nothing of what lies inside. Where sides are missing, less if the faces there
    are lie on the hull: how far they are, the way they face, from its outside. A flat mesh has no inside: 0.
    """
    size = (
        float(np.linalg.norm(np.ptp(mesh.vertices[mesh.faces].reshape(-1, 3), axis=0)))
        if len(mesh.faces)
        else 0.0
    )
    if size <= 0:
        return 0.0, 1.0
    small = decimated(Mesh((mesh.vertices - mesh.vertices[mesh.faces[0, 0]]) / size, mesh.faces), _FACES)
    triangles = triangles_of(small)
    hull = hull_of(triangles.reshape(-1, 3)) if len(triangles) else None
    if hull is None:
        return 0.0, size
    off = np.abs(Solid([], [small]).signed_distance(spread(hull.vertices[hull.faces], _POINTS)[0]))
    depth = float(off.max())
    if depth > _HOLLOW and not all(closed for _, closed in pieces_of(small)):
        points, normals = spread(triangles, _POINTS)
        sides = [float(np.quantile(_way_out(hull, points, s * normals), _ROUGH)) for s in (1, -1)]
        depth = min(depth, *sides)
    return depth * size, size


def _way_out(hull: Hull, points: Array, directions: Array) -> Array:
    """How far (n,) m it is from points (n, 3) in a hull along unit directions (n, 3) to its outside."""
    corners = hull.vertices[hull.faces]
    normal, _ = geo.triangle_normals(corners)
    toward = directions @ normal.T
    room = np.einsum("ij,ij->i", corners[:, 0], normal) - points @ normal.T
    far = np.where(toward > 1e-6, np.maximum(room, 0.0) / np.maximum(toward, 1e-6), np.inf)
    return np.asarray(far.min(axis=1))
