"""Large meshes with fewer triangles: quadric edge collapse (Garland and Heckbert 1997), as fast-simplification does it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from twin import geometry as geo
from twin.collision.closed_pieces import enclosed
from twin.collision.convex import Hull, hull_of
from twin.collision.solid import pieces_of
from twin.scene import Mesh

_SAME_VOLUME = 0.02  # share, chosen by us: what the noise of a scan takes from a body


def decimated(mesh: Mesh, faces: int) -> Mesh:
    """The mesh with at most about `faces` triangles; corners at the same place are one and those of no face are left out."""
    if len(mesh.faces) <= faces:
        return mesh
    import fast_simplification

    welded = _welded(mesh)
    if len(welded.faces) <= faces:
        return welded
    middle = (welded.vertices.min(axis=0) + welded.vertices.max(axis=0)) / 2
    size = max(
        float(np.abs(welded.vertices - middle).max()), 1e-12
    )  # its thresholds are for numbers about one
    vertices, triangles = fast_simplification.simplify(
        (welded.vertices - middle) / size, welded.faces.astype(np.int32), target_count=faces
    )
    return Mesh(vertices * size + middle, triangles)


def decimated_body(body: Mesh, faces: int) -> Mesh | None:
    """A closed piece with at most about `faces` triangles that is one closed piece again and holds as much; else None."""
    if len(body.faces) <= faces:
        return body
    hull = hull_of(body.vertices)
    if hull is not None and abs(enclosed(body)) > (1 - _SAME_VOLUME) * hull.volume:
        return _fewer_corners(hull)
    pieces = pieces_of(decimated(body, faces))
    if not pieces:
        return None
    small, closed = max(pieces, key=lambda row: row[0].area)  # beside it may lie crumbs that came off
    held = abs(enclosed(body))
    return small if closed and abs(abs(enclosed(small)) - held) <= _SAME_VOLUME * held else None


def _fewer_corners(hull: Hull) -> Mesh | None:
    """The hull of the corners that reach furthest in 1000 even directions (Fibonacci lattice)."""
    z = 1.0 - (2.0 * np.arange(1000) + 1.0) / 1000.0
    angle = np.pi * (3.0 - np.sqrt(5.0)) * np.arange(1000)
    ways = np.stack([np.sqrt(1 - z * z) * np.cos(angle), np.sqrt(1 - z * z) * np.sin(angle), z], axis=1)
    reach = [int(np.argmax(hull.vertices @ way)) for way in ways]
    small = hull_of(hull.vertices[np.unique(reach)])
    return None if small is None else small.mesh


def joined(meshes: Sequence[Mesh]) -> Mesh:
    """All meshes as one, without colours."""
    start = np.cumsum([0, *(len(m.vertices) for m in meshes)])
    return Mesh(
        np.concatenate([m.vertices for m in meshes]),
        np.concatenate([m.faces + n for m, n in zip(meshes, start, strict=False)]),
    )


def _welded(mesh: Mesh) -> Mesh:
    """The mesh with equal corners joined: edges of a soup of triangles can't be collapsed."""
    used = np.zeros(len(mesh.vertices), bool)
    used[mesh.faces] = True
    size = max(float(np.ptp(mesh.vertices[used], axis=0).max()), 1e-12)
    first, which = geo.unique_rows(np.round(mesh.vertices / (1e-7 * size)).astype(np.int64))
    faces = which[mesh.faces]
    whole = (faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])
    kept, index = np.unique(faces[whole], return_inverse=True)
    return Mesh(mesh.vertices[first[kept]], index.reshape(-1, 3).astype(np.int32))
