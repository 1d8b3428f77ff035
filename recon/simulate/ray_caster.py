"""Ray casting on triangle meshes: a thin, typed front of Open3D's RaycastingScene (Embree, no GL)."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import open3d as o3d
from numpy.typing import NDArray

from twin.geometry import Array

NO_HIT = np.uint32(0xFFFFFFFF)


class FirstHits(NamedTuple):
    """First hits of n rays: ray parameter (inf: none), mesh id (NO_HIT), face, (u, v), unit shading
    normal."""

    t: NDArray[np.float32]
    mesh: NDArray[np.uint32]
    face: NDArray[np.uint32]
    uv: NDArray[np.float32]
    flat: NDArray[np.float32]


class Caster:
    """Meshes that rays (n, 6) = start and direction, float32, are cast at."""

    def __init__(self) -> None:
        self._scene = o3d.t.geometry.RaycastingScene()

    def add(self, vertices: NDArray[Any], faces: NDArray[Any]) -> int:
        """Add a mesh: vertices (V, 3), faces (F, 3). Returns its id, counting from 0."""
        return int(self._scene.add_triangles(_tensor(vertices, np.float32), _tensor(faces, np.uint32)))

    def first(self, rays: NDArray[Any]) -> FirstHits:
        """First hits of rays (n, 6)."""
        found = self._scene.cast_rays(_tensor(rays, np.float32))
        keys = ("t_hit", "geometry_ids", "primitive_ids", "primitive_uvs", "primitive_normals")
        return FirstHits(*(found[k].numpy() for k in keys))

    def blocked(self, rays: NDArray[Any], far: float = 1.0) -> NDArray[np.bool_]:
        """Whether start + t direction, 0 <= t <= far, meets anything, for rays (n, 6)."""
        blocked: NDArray[np.bool_] = self._scene.test_occlusions(_tensor(rays, np.float32), 0.0, far).numpy()
        return blocked

    def distance(self, point: Array) -> float:
        """Distance in metres of a point (3,) from the nearest surface."""
        return float(self._scene.compute_distance(_tensor(point[None], np.float32)).numpy()[0])


def _tensor(values: NDArray[Any], dtype: type[np.generic]) -> Any:
    core: Any = o3d.core
    return core.Tensor.from_numpy(np.ascontiguousarray(values, dtype=dtype))
