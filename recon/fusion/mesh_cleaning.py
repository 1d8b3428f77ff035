"""Meshes made ready for simulation: noise pieces dropped, faces reduced to a budget."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.spatial import cKDTree

from twin import geometry as geo
from twin.geometry import Array
from twin.mesh import compact, decimated, vertex_pieces

Faces = NDArray[np.int32]


def keep_large_pieces(
    vertices: Array, faces: Faces, min_share: float, max_gap: float = np.inf
) -> tuple[Array, Faces]:
    """The connected pieces that belong to one body; unused vertices go.

    A piece stays when its area is at least `min_share` of the largest piece's and it lies within `max_gap`
    metres of the largest piece, or of another one that stays.
    """
    if not len(faces):
        return vertices[:0], faces
    piece = vertex_pieces(faces, len(vertices))
    area = np.bincount(
        piece[faces[:, 0]], weights=geo.triangle_areas(vertices[faces]), minlength=piece.max() + 1
    )
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
    used, left = compact(faces[np.isin(piece[faces[:, 0]], kept)])
    return vertices[used], left


def reduce_faces(vertices: Array, faces: Faces, budget: int) -> tuple[Array, Faces]:
    """At most `budget` faces, by quadric error decimation."""
    if len(faces) <= budget:
        return vertices, faces
    v, f = decimated(vertices.astype(np.float32), faces, budget)
    used, left = compact(f[geo.triangle_areas(v[f]) > 1e-12])
    return v[used], left


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
