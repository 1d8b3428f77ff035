"""Colours for the video: MuJoCo draws one colour a mesh, so a coloured mesh is cut into pieces of similar colour."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.cluster.vq import kmeans2

from twin.mesh import compact, decimated
from twin.scene import Mesh

AnyArray = NDArray[Any]
_GREY = np.array([0.72, 0.70, 0.67])


def painted(mesh: Mesh, colours: int, max_faces: int) -> list[tuple[Mesh, AnyArray]]:
    """Pieces of at most `colours` colours and `max_faces` faces together, each with its rgb (3,) in 0..1."""
    vertices: AnyArray = mesh.vertices
    faces: AnyArray = mesh.faces
    rgb: AnyArray | None = mesh.colors
    if len(faces) > max_faces:
        vertices, faces, rgb = _decimated(mesh, max_faces)
    if len(faces) == 0:
        return []
    if rgb is None:
        return [(_piece(vertices, faces), _GREY)]
    face_rgb = rgb[faces].mean(axis=1) / 255.0
    distinct = len(np.unique(face_rgb.round(2), axis=0))
    centres, label = kmeans2(
        face_rgb, min(colours, distinct), minit="++", rng=np.random.default_rng(0), missing="warn"
    )
    return [
        (_piece(vertices, faces[label == k]), np.clip(centres[k], 0, 1))
        for k in range(len(centres))
        if np.count_nonzero(label == k) > 3
    ]


def _decimated(mesh: Mesh, max_faces: int) -> tuple[AnyArray, AnyArray, AnyArray | None]:
    from scipy.spatial import cKDTree

    vertices, faces = decimated(mesh.vertices.astype(np.float32), mesh.faces, max_faces)
    if mesh.colors is None:
        return vertices, faces, None
    return vertices, faces, mesh.colors[cKDTree(mesh.vertices).query(vertices)[1]]


def _piece(vertices: AnyArray, faces: AnyArray) -> Mesh:
    used, left = compact(faces)
    return Mesh(vertices[used], left)
