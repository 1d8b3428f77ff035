"""Surfaces: triangle meshes with corner normals, a material and the frame in which their texture sticks."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import trimesh
from numpy.typing import NDArray

from recon.simulate.textures import Material
from twin import geometry as geo
from twin.geometry import Array

# chosen by us: facets of a cylinder with 24 sides are smoothed, edges of a box are not
SMOOTH_ANGLE_DEG = 40.0


@dataclass(frozen=True)
class Surface:
    """A mesh of one material. `vertices` (V, 3) m and `corner_normals` (F, 3, 3) are in the frame of its
    object: the world at state 0 for furniture. `T_texture_object` (4, 4) maps to texture coordinates."""

    name: str
    vertices: Array
    faces: NDArray[np.int64]
    material: Material
    T_texture_object: Array = field(default_factory=lambda: np.eye(4))
    corner_normals: Array | None = None

    def with_normals(self) -> Array:
        """Corner normals (F, 3, 3), computed when they were not given."""
        if self.corner_normals is not None:
            return self.corner_normals
        return corner_normals(self.vertices, self.faces)


def corner_normals(vertices: Array, faces: NDArray[np.int64], angle_deg: float = SMOOTH_ANGLE_DEG) -> Array:
    """Unit normals (F, 3, 3) of each face corner: the area-weighted mean of the faces around the vertex that
    meet this face at less than `angle_deg`, so that edges stay sharp and curved surfaces look round.
    """
    weighted = geo.vector_areas(vertices[faces])
    length = np.linalg.norm(weighted, axis=1, keepdims=True)
    flat = np.where(length > 0, weighted / np.maximum(length, 1e-30), [0.0, 0.0, 1.0])
    # vertices at one place count as one, so that meshes stored as triangle soups are smoothed too
    _, merged = np.unique(np.round(vertices, 6), axis=0, return_inverse=True)
    flat_index = merged.reshape(-1)[faces].reshape(-1)
    order = np.argsort(flat_index, kind="stable")
    starts = np.searchsorted(flat_index[order], np.arange(flat_index.max() + 1 if len(flat_index) else 0))
    ends = np.append(starts[1:], len(order))
    counts = (ends - starts)[flat_index]
    own = np.repeat(np.arange(len(flat_index)), counts)
    first = np.repeat(np.cumsum(counts) - counts, counts)
    other = order[np.repeat(starts[flat_index], counts) + np.arange(len(own)) - first]
    near = np.einsum("ij,ij->i", flat[own // 3], flat[other // 3]) > np.cos(np.radians(angle_deg))
    total = np.zeros((len(flat_index), 3))
    np.add.at(total, own[near], weighted[other[near] // 3])
    norm = np.linalg.norm(total, axis=1, keepdims=True)
    fallback = np.repeat(flat, 3, axis=0)
    return np.where(norm > 0, total / np.maximum(norm, 1e-30), fallback).reshape(-1, 3, 3)


def merged_mesh(surfaces: list[Surface]) -> trimesh.Trimesh:
    """All surfaces as one mesh, in the frame that they share."""
    base = np.cumsum([0, *(len(s.vertices) for s in surfaces[:-1])])
    faces = np.concatenate([s.faces + b for s, b in zip(surfaces, base, strict=True)])
    return trimesh.Trimesh(np.concatenate([s.vertices for s in surfaces]), faces, process=False)


def box(size: tuple[float, float, float]) -> tuple[Array, NDArray[np.int64]]:
    """Vertices and faces of a box of full `size` about the origin."""
    mesh = trimesh.creation.box(extents=size)
    return np.asarray(mesh.vertices, dtype=np.float64), np.asarray(mesh.faces, dtype=np.int64)
