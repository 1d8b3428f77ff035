"""What is drawn of a surface: its own vertices only, and never so flat that a reader refuses it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from twin import geometry as geo
from twin.geometry import Array
from twin.mesh import compact
from twin.scene import Mesh

# m, chosen by us: a tenth of what the check allows of bounds, and far above a reader's smallest volume
SHEET = 1e-5
_SPACINGS = 8  # of single precision, in which readers keep a mesh; chosen by us


def drawn(mesh: Mesh) -> Mesh:
    """The mesh as writers write it: without vertices that no face uses, and without faces of no area.

    A flat mesh (a sheet seen from one side) encloses nothing, and MuJoCo refuses it in URDF and in USD, where
    nothing says that it is a shell; a single triangle it refuses everywhere. It gets its back: every face
    once more, turned around, and SHEET behind. Mass and collision shapes come from the twin.
    """
    used, faces = compact(mesh.faces)
    vertices = mesh.vertices[used]
    colors, texture = None if mesh.colors is None else mesh.colors[used], mesh.texture
    normals, area = geo.triangle_normals(vertices[faces])
    if not area.sum() > 0:
        return Mesh(vertices[:0], faces[:0], None if colors is None else colors[:0])
    thick = max(SHEET, _SPACINGS * float(np.spacing(np.float32(np.abs(vertices).max()))))
    if _thickness(vertices[faces], normals, area) >= thick:
        return Mesh(vertices, faces, colors, texture)
    behind = (vertices[faces] - thick * normals[:, None]).reshape(-1, 3)
    back = len(vertices) + np.arange(len(behind)).reshape(-1, 3)[:, ::-1]
    return Mesh(
        np.concatenate([vertices, behind]),
        np.concatenate([faces, np.asarray(back, dtype=np.int32)]),
        None if colors is None else np.concatenate([colors, colors[faces.ravel()]]),
        None if texture is None else replace(texture, uv=np.concatenate([texture.uv, texture.uv[:, ::-1]])),
    )


def _thickness(corners: Array, normals: Array, area: Array) -> float:
    """Mean distance (m) of the faces' planes from their common centroid: readers multiply it by area."""
    middles = corners.mean(axis=1)
    centroid = area @ middles / area.sum()
    return float(area @ np.abs(np.einsum("fi,fi->f", normals, middles - centroid)) / area.sum())
