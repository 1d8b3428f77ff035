"""Triangle meshes: points on surfaces, connected pieces, used vertices, edges, enclosed volume, fewer faces.

Single triangles' areas and normals: `twin.geometry` (numpy alone); the law-abiding mesh: `twin.scene.Mesh`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from twin import geometry as geo
from twin.geometry import Array
from twin.scene import Mesh, Texture

GREY = 180  # of what has no colour, beside what has
Faces = NDArray[np.integer[Any]]


def on_triangles(corners: Array, u: Array, v: Array) -> Array:
    """Points (n, 3) on triangles (n, 3, 3) from the unit square: u, v (n,) in 0..1, even on each triangle.

    The square root that this takes is that of Osada et al. 2002, "Shape distributions", section 4.1.
    """
    root = np.sqrt(u)
    weights = np.stack([1 - root, root * (1 - v), root * v], axis=1)
    return np.asarray(np.einsum("nk,nkd->nd", weights, corners))


def sample_surface(mesh: Mesh, count: int, rng: np.random.Generator) -> tuple[Array, Array]:
    """Points (count, 3) m at random, evenly by area, and the unit normals (count, 3) of their faces.

    Both are (0, 3) for a mesh without area.
    """
    corners = mesh.vertices[mesh.faces]
    normals, area = geo.triangle_normals(corners)
    if not area.sum() > 0:
        return np.zeros((0, 3)), np.zeros((0, 3))
    face = rng.choice(len(area), count, p=area / area.sum())
    u, v = rng.random(count), rng.random(count)
    return on_triangles(corners[face], u, v), normals[face]


def joined(meshes: Sequence[Mesh]) -> Mesh:
    """All meshes as one: grey if only others have colours, textured if all with faces share an image."""
    if not meshes:
        return Mesh(np.zeros((0, 3)), np.zeros((0, 3), np.int32))
    starts = np.cumsum([0, *(len(m.vertices) for m in meshes)])
    faces = np.concatenate([m.faces + n for m, n in zip(meshes, starts, strict=False)])
    colors = None
    if any(m.colors is not None for m in meshes):
        colors = np.concatenate(
            [np.full((len(m.vertices), 3), GREY, np.uint8) if m.colors is None else m.colors for m in meshes]
        )
    textures = [m.texture for m in meshes if len(m.faces)]
    first, texture = (textures[0] if textures else None), None
    if first is not None and all(t is not None and np.array_equal(t.image, first.image) for t in textures):
        texture = Texture(np.concatenate([t.uv for t in textures if t]), first.image, first.seen)
    return Mesh(np.concatenate([m.vertices for m in meshes]), faces, colors, texture)


def compact(faces: Faces) -> tuple[NDArray[np.int64], NDArray[np.int32]]:
    """The vertices (n,) that faces (F, 3) use, in rising order, and the faces in these numbers."""
    used, index = np.unique(faces, return_inverse=True)
    return used.astype(np.int64), index.reshape(-1, 3).astype(np.int32)


def used_vertices(mesh: Mesh) -> Array:
    """Vertices (n, 3) m that a face uses: the others are no part of the surface."""
    return np.asarray(mesh.vertices[np.unique(mesh.faces)])


def edges(faces: Faces) -> NDArray[np.int64]:
    """Ends (3F, 2) of the faces' edges, the lower first; an edge of face k in rows 3k to 3k + 2."""
    return np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2).astype(np.int64), axis=1)


def vertex_pieces(faces: Faces, vertices: int) -> NDArray[np.intp]:
    """Number (vertices,) of each vertex' connected piece; an unused vertex is a piece of its own."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    if not vertices:
        return np.zeros(0, np.intp)
    ends = edges(faces)
    graph = coo_matrix((np.ones(len(ends), np.int8), (ends[:, 0], ends[:, 1])), shape=(vertices, vertices))
    return np.asarray(connected_components(graph, directed=False)[1], dtype=np.intp)


def signed_volume(corners: Array) -> float:
    """Volume (m^3) that closed triangles (F, 3, 3) enclose, negative where they are wound inside out.

    Sum of the tetrahedra over the origin (Zhang and Chen 2001): give corners near the origin, for digits.
    """
    a, b, c = (np.ascontiguousarray(corners[:, k]) for k in range(3))
    return float(np.einsum("fi,fi->", a, np.cross(b, c)) / 6)


def decimated(vertices: NDArray[Any], faces: Faces, budget: int) -> tuple[Array, NDArray[np.int32]]:
    """About `budget` faces by quadric error (Garland and Heckbert 1997), by fast-simplification.

    Precision is that of `vertices`, thresholds suit lengths of about one; borders stay.
    """
    import fast_simplification

    fewer, left = fast_simplification.simplify(  # copies: it wants arrays that may be written to
        np.array(vertices, order="C"), np.array(faces, np.int32, order="C"), target_count=budget
    )
    return np.asarray(fewer, np.float64), np.asarray(left, np.int32)
