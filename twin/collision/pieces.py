"""Connected pieces of a mesh, and which of them are closed."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from twin import geometry as geo
from twin.geometry import Array
from twin.mesh import compact, edges, vertex_pieces
from twin.scene import Mesh

_SAME = 1e-7  # m: corners nearer than this are one


# taken one by one, chosen by us: furniture has tens of bodies, a scan tens of thousands of shreds
_PIECES = 1000


def pieces_of(mesh: Mesh) -> list[tuple[Mesh, bool]]:
    """The connected pieces of a mesh and whether each is closed: edges meet an even number of its faces.

    Corners at the same place are one, faces without area are left out, and bodies that touch along an edge
    are two. Of more than 1000 pieces the smallest, of least area, are one open piece: shreds.
    """
    if not len(mesh.faces):
        return []
    first, joined = geo.unique_rows(np.round(mesh.vertices / _SAME).astype(np.int64))
    faces = joined[mesh.faces]
    vertices = mesh.vertices[first]
    faces = faces[(faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])]
    turn = (np.argmin(faces, axis=1)[:, None] + np.arange(3)) % 3  # a face given twice is one
    faces = faces[np.sort(geo.unique_rows(np.take_along_axis(faces, turn, axis=1))[0])]
    kept, shreds = _largest(faces, _linked_by_corners(faces), vertices)
    out = [] if shreds is None else [(_piece(shreds, vertices), False)]
    for own in kept:
        own = _without_seams(own, vertices)
        apart = _split(own, _linked_by_edges(own))
        bodies = apart if all(map(_is_closed, apart)) else [own]
        for body in bodies:
            out.append((_piece(body, vertices), _is_closed(body)))
    return out


def _piece(faces: NDArray[np.int64], vertices: Array) -> Mesh:
    """Faces with the vertices that they use."""
    used, faces_of_used = compact(faces)
    return Mesh(vertices[used], faces_of_used)


def _largest(
    faces: NDArray[np.int64], label: NDArray[np.int64], vertices: Array
) -> tuple[list[NDArray[np.int64]], NDArray[np.int64] | None]:
    """The faces of each of the `_PIECES` largest pieces, and those of all others together."""
    count = int(label.max(initial=-1)) + 1
    if count <= _PIECES:
        return _split(faces, label), None
    area = np.bincount(label, weights=geo.triangle_areas(vertices[faces]), minlength=count)
    small = np.zeros(count, bool)
    small[np.argsort(-area, kind="stable")[_PIECES:]] = True
    return _split(faces[~small[label]], label[~small[label]]), faces[small[label]]


def _without_seams(faces: NDArray[np.int64], vertices: Array) -> NDArray[np.int64]:
    """Without pairs of faces that coincide, as where two boards touch, unless more than seams would go."""
    first, which = geo.unique_rows(np.sort(faces, axis=1))
    left = faces[np.sort(first[np.bincount(which) % 2 == 1])]
    if len(left) in (0, len(faces)) or not _is_closed(left):
        return faces
    spans = [np.ptp(vertices[f.ravel()], axis=0) for f in (left, faces)]
    return left if np.allclose(*spans) else faces


def _is_closed(faces: NDArray[np.int64]) -> bool:
    return bool(np.all(np.bincount(geo.unique_rows(edges(faces))[1]) % 2 == 0))


def _linked_by_corners(faces: NDArray[np.int64]) -> NDArray[np.int64]:
    """Number of the connected piece (F,) that each face is in."""
    return vertex_pieces(faces, int(faces.max(initial=-1)) + 1)[faces[:, 0]]


def _linked_by_edges(faces: NDArray[np.int64]) -> NDArray[np.int64]:
    """The same, but for edges at which other than two faces meet: there bodies touch."""
    ends, owner = edges(faces), np.repeat(np.arange(len(faces)), 3)
    edge = geo.unique_rows(ends)[1]
    order = np.argsort(edge, kind="stable")
    first = np.flatnonzero(np.bincount(edge)[edge[order]] == 2)[::2]
    joins = (owner[order[first]], owner[order[first + 1]])
    graph = coo_matrix((np.ones(len(first)), joins), shape=(len(faces),) * 2)
    return np.asarray(connected_components(graph, directed=False)[1])


def _split(faces: NDArray[np.int64], label: NDArray[np.int64]) -> list[NDArray[np.int64]]:
    order = np.argsort(label, kind="stable")
    return np.split(faces[order], np.flatnonzero(np.diff(label[order])) + 1) if len(faces) else []
