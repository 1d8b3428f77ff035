"""Meshes made ready for simulation: noise pieces dropped, faces reduced to a budget."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from twin.geometry import Array

Faces = NDArray[np.int32]


def face_areas(vertices: Array, faces: Faces) -> Array:
    """Area (f,) in m^2 of each face."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    return np.asarray(0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1))


def keep_large_pieces(
    vertices: Array, faces: Faces, min_share: float, max_gap: float = np.inf
) -> tuple[Array, Faces]:
    """The connected pieces that belong to one body; unused vertices go.

    A piece stays when its area is at least `min_share` of the largest piece's and it lies within `max_gap` metres of the
    largest piece, or of another one that stays.
    """
    if not len(faces):
        return vertices[:0], faces
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]]])
    n = len(vertices)
    graph = coo_matrix((np.ones(len(edges), np.int8), (edges[:, 0], edges[:, 1])), shape=(n, n))
    _, piece = connected_components(graph, directed=False)
    area = np.bincount(piece[faces[:, 0]], weights=face_areas(vertices, faces), minlength=piece.max() + 1)
    waiting = [int(k) for k in np.argsort(-area) if area[k] >= min_share * area.max()]
    kept = [waiting.pop(0)]
    fringe = list(kept)
    while fringe and waiting:
        tree = cKDTree(vertices[piece == fringe.pop(0)])
        near = [
            k for k in waiting if np.isinf(max_gap) or tree.query(vertices[piece == k])[0].min() <= max_gap
        ]
        kept += near
        fringe += near
        waiting = [k for k in waiting if k not in near]
    return compact(vertices, faces[np.isin(piece[faces[:, 0]], kept)])


def compact(vertices: Array, faces: Faces) -> tuple[Array, Faces]:
    """Drop vertices that no face uses."""
    used, inverse = np.unique(faces, return_inverse=True)
    return vertices[used], inverse.reshape(-1, 3).astype(np.int32)


def reduce_faces(vertices: Array, faces: Faces, budget: int) -> tuple[Array, Faces]:
    """At most `budget` faces, by quadric error decimation."""
    if len(faces) <= budget:
        return vertices, faces
    import fast_simplification

    v, f = fast_simplification.simplify(
        np.ascontiguousarray(vertices, np.float32), np.ascontiguousarray(faces, np.int32), target_count=budget
    )
    f = np.asarray(f, np.int32)
    f = f[face_areas(np.asarray(v, np.float64), f) > 1e-12]
    return compact(np.asarray(v, np.float64), f)


def smooth(vertices: Array, faces: Faces, rounds: int) -> Array:
    """Taubin smoothing (1995), lambda 0.5 and mu -0.53: takes noise off without shrinking."""
    if rounds == 0 or not len(faces):
        return vertices
    n = len(vertices)
    e = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    e = np.concatenate([e, e[:, ::-1]])
    graph = coo_matrix((np.ones(len(e)), (e[:, 0], e[:, 1])), shape=(n, n)).tocsr()
    graph.data[:] = 1.0
    degree = np.maximum(np.asarray(graph.sum(axis=1)), 1.0)
    v = np.array(vertices)
    for _ in range(rounds):
        for step in (0.5, -0.53):
            v += step * (graph @ v / degree - v)
    return v
