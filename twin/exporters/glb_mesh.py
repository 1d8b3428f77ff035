"""Meshes of a .glb: one primitive a visual, with photographs, else vertex colours, else one colour."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from twin import geometry as geo
from twin.exporters.glb_buffer import INDICES, VERTICES, GlbBuffer
from twin.exporters.links import Visual
from twin.exporters.obj import corner_normals
from twin.exporters.texture import photo_atlas
from twin.geometry import Array
from twin.mesh import GREY
from twin.scene import Mesh

_DULL = 0.9  # roughness of furniture board and painted walls; chosen by us
_STEPS = 2**16  # of texture coordinates, within which corners are one: a tenth of a texel of 4096
_U16 = 2**16 - 1


def add_mesh(buffer: GlbBuffer, shown: Visual, light: bool = False) -> int:
    """Number of the glTF mesh of a visual. light: with one normal a vertex."""
    mesh = shown.mesh
    baked = None if mesh.texture is None else photo_atlas(mesh, np.arange(len(mesh.faces)))
    faces = mesh.faces if baked is None else mesh.faces[baked.order]
    normals, normal = _vertex_normals(mesh.vertices, faces) if light else corner_normals(mesh.vertices, faces)
    vertex = faces.ravel().astype(np.int64)
    columns = [vertex, normal.ravel()]
    if baked is not None:
        columns += list(np.round(baked.uv * _STEPS).astype(np.int64).T)
    first, index = geo.unique_rows(np.stack(columns, axis=1))

    def vertices(values: NDArray[Any], **more: Any) -> int:
        return buffer.accessor(values, VERTICES, **more)

    attributes = {
        "POSITION": vertices(mesh.vertices[vertex[first]].astype(np.float32), bounds=True),
        "NORMAL": vertices(normals[normal.ravel()[first]].astype(np.float32)),
    }
    material: dict[str, Any] = {"metallicFactor": 0.0, "roughnessFactor": _DULL}
    if baked is not None and baked.image is not None:
        # v of glTF goes down
        attributes["TEXCOORD_0"] = vertices((baked.uv[first] * [1, -1] + [0, 1]).astype(np.float32))
        material["baseColorTexture"] = {"index": buffer.texture(baked.image)}
    elif mesh.colors is not None and shown.color is None:
        attributes["COLOR_0"] = vertices(_linear_colors(mesh)[vertex[first]], normalized=True)
    else:
        plain = np.full(3, GREY / 255) if shown.color is None else np.array(shown.color)
        material["baseColorFactor"] = [*map(float, linear(plain)), 1.0]
    small = len(first) <= _U16
    indices = index.astype(np.uint16 if small else np.uint32)[:, None]
    primitive = {
        "attributes": attributes,
        "indices": buffer.accessor(indices, INDICES),
        "material": buffer.add("materials", {"pbrMetallicRoughness": material, "doubleSided": shown.basis == "seen"}),
    }  # fmt: skip
    return buffer.add("meshes", {"name": shown.name, "primitives": [primitive]})


def _vertex_normals(vertices: Array, faces: NDArray[np.int32]) -> tuple[Array, NDArray[np.int32]]:
    """Normals (V, 3), of the faces around each vertex by their area, and the index (F, 3) of each corner."""
    areas = geo.vector_areas(vertices[faces])
    corner, owner = faces.ravel(), np.arange(faces.size) // 3
    total = np.stack([np.bincount(corner, a[owner], len(vertices)) for a in areas.T], axis=1)
    length = np.linalg.norm(total, axis=1, keepdims=True)
    return np.where(length > 1e-15, total / np.maximum(length, 1e-300), (0.0, 0.0, 1.0)), faces


def _linear_colors(mesh: Mesh) -> NDArray[np.uint16]:
    """Vertex colours (V, 4) of a mesh that has them; 8 bits of linear colour are too few where it is dark."""
    assert mesh.colors is not None
    rgb = np.round(linear(mesh.colors / 255) * _U16).astype(np.uint16)
    return np.column_stack([rgb, np.full(len(rgb), _U16, np.uint16)])


def linear(srgb: Array) -> Array:
    """Linear colour of sRGB values in 0..1 (IEC 61966-2-1)."""
    return np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)
