"""Fewer triangles for large meshes: quadric edge collapse (Garland and Heckbert 1997, fast-simplification).

It keeps borders, so a surface in shreds, or one cut by T-junctions, stays large, and the time it takes grows
with the square of the faces around one corner. There, and in what it leaves too large, corners are joined
cell by cell (Rossignac and Borrel 1993), which ends on any mesh.
"""

from __future__ import annotations

import numpy as np

from twin import geometry as geo
from twin.collision.closed_pieces import enclosed
from twin.collision.convex import Hull, hull_of
from twin.collision.pieces import pieces_of
from twin.mesh import compact, edges
from twin.mesh import decimated as quadric
from twin.scene import Mesh

_SAME_VOLUME = 0.02  # share, chosen by us: what the noise of a scan takes from a body
_MORE = 1.2  # times the triangles asked for, chosen by us: collapses come a few hundred at a time
# times the triangles asked for, chosen by us: cells of a centimetre on a door, so that it keeps its handle
_FINER = 2
# share of edges with one face, chosen by us: 0.01-0.05 on a scan with holes, 0.45 where T-junctions cut it
_SHREDS = 0.2
# mean number of faces around the corners of a face, chosen by us: 7 on a scan, 60 at the poles of a fine ball
_CROWDED = 500


def decimated(mesh: Mesh, faces: int) -> Mesh:
    """The mesh with about `faces` triangles, twice in shreds; equal corners are one, unused ones go."""
    if len(mesh.faces) <= faces:
        return mesh
    welded = _welded(mesh)
    if len(welded.faces) <= faces:
        return welded
    if _open_share(welded) > _SHREDS or _crowding(welded) > _CROWDED:
        return _clustered(welded, _FINER * faces)
    middle = (welded.vertices.min(axis=0) + welded.vertices.max(axis=0)) / 2
    # its thresholds are for numbers about one
    size = max(float(np.abs(welded.vertices - middle).max()), 1e-12)
    vertices, triangles = quadric((welded.vertices - middle) / size, welded.faces, faces)
    small = Mesh(vertices * size + middle, triangles)
    return small if len(triangles) <= _MORE * faces else _clustered(_welded(small), faces)


def decimated_body(body: Mesh, faces: int) -> Mesh | None:
    """A closed piece in about `faces` triangles, again one closed piece that holds as much; else None."""
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


def _welded(mesh: Mesh) -> Mesh:
    """The mesh with equal corners joined: edges of a soup of triangles can't be collapsed."""
    used = np.zeros(len(mesh.vertices), bool)
    used[mesh.faces] = True
    size = max(float(np.ptp(mesh.vertices[used], axis=0).max()), 1e-12)
    first, which = geo.unique_rows(np.round(mesh.vertices / (1e-7 * size)).astype(np.int64))
    faces = which[mesh.faces]
    whole = (faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])
    used, left = compact(faces[whole])
    return Mesh(mesh.vertices[first[used]], left)


def _open_share(mesh: Mesh) -> float:
    """Share of the edges that one face has for itself."""
    return float(np.mean(np.bincount(geo.unique_rows(edges(mesh.faces))[1]) == 1))


def _crowding(mesh: Mesh) -> float:
    """Mean number of faces around the corners of a face."""
    around = np.bincount(mesh.faces.ravel()).astype(np.float64)
    return float((around**2).sum() / around.sum())


def _clustered(mesh: Mesh, faces: int) -> Mesh:
    """At most `faces` triangles: the corners in each cell of a grid become their mean, in small cells.

    Of triangles with the same three corners one stays, so that a board thinner than a cell keeps its surface.
    """
    low = mesh.vertices.min(axis=0)
    cell = max(0.5 * float(np.sqrt(mesh.area / faces)), 1e-6 * float(np.ptp(mesh.vertices)), 1e-12)
    while True:
        first, which = geo.unique_rows(np.floor((mesh.vertices - low) / cell).astype(np.int64))
        joined_up = which[mesh.faces]
        ordered = np.sort(joined_up, axis=1)
        whole = np.flatnonzero((ordered[:, 0] != ordered[:, 1]) & (ordered[:, 1] != ordered[:, 2]))
        kept = whole[np.sort(geo.unique_rows(ordered[whole])[0])]
        if len(kept) <= faces:
            break
        cell *= float(np.clip(np.sqrt(len(kept) / faces), 1.05, 2.0))
    count = np.bincount(which, minlength=len(first))
    mean = [np.bincount(which, weights=column, minlength=len(first)) / count for column in mesh.vertices.T]
    used, left = compact(joined_up[kept])
    return Mesh(np.stack(mean, axis=1)[used], left)
