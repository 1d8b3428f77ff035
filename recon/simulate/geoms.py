"""Surface meshes of MJCF geoms."""

from __future__ import annotations

import mujoco
import numpy as np
import trimesh
from numpy.typing import NDArray

from twin.errors import InputError
from twin.geometry import Array

PLANE_HALF_SIZE = 4.0  # metres; MuJoCo planes are infinite, a recording needs the part around the camera


def geom_mesh(model: mujoco.MjModel, geom: int) -> tuple[Array, NDArray[np.int64]]:
    """Vertices (V, 3) and faces (F, 3) of a geom in its own frame.

    Raises InputError for kinds that have no surface mesh here (height fields, signed distance functions).
    """
    kind = mujoco.mjtGeom(int(model.geom_type[geom]))
    size = np.asarray(model.geom_size[geom], dtype=np.float64)
    if kind == mujoco.mjtGeom.mjGEOM_MESH:
        return _model_mesh(model, int(model.geom_dataid[geom]))
    if kind == mujoco.mjtGeom.mjGEOM_BOX:
        mesh = trimesh.creation.box(extents=2.0 * size)
    elif kind == mujoco.mjtGeom.mjGEOM_SPHERE:
        mesh = trimesh.creation.icosphere(subdivisions=3, radius=size[0])
    elif kind == mujoco.mjtGeom.mjGEOM_ELLIPSOID:
        mesh = trimesh.creation.icosphere(subdivisions=3, radius=1.0)
        mesh.apply_scale(size)
    elif kind == mujoco.mjtGeom.mjGEOM_CYLINDER:
        mesh = trimesh.creation.cylinder(radius=size[0], height=2.0 * size[1], sections=24)
    elif kind == mujoco.mjtGeom.mjGEOM_CAPSULE:
        mesh = trimesh.creation.capsule(radius=size[0], height=2.0 * size[1], count=[16, 24])
    elif kind == mujoco.mjtGeom.mjGEOM_PLANE:
        half = np.where(size[:2] > 0.0, np.minimum(size[:2], PLANE_HALF_SIZE), PLANE_HALF_SIZE)
        corners = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]) * [half[0], half[1], 0.0]
        return corners.astype(np.float64), np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int64)
    else:
        raise InputError(
            f"geom {model.geom(geom).name or geom} is of kind {kind.name}, which can't be rendered",
            "use primitive or mesh geoms, or leave its body out with `exclude`",
        )
    return np.asarray(mesh.vertices, dtype=np.float64), np.asarray(mesh.faces, dtype=np.int64)


def _model_mesh(model: mujoco.MjModel, mesh: int) -> tuple[Array, NDArray[np.int64]]:
    v0, nv = int(model.mesh_vertadr[mesh]), int(model.mesh_vertnum[mesh])
    f0, nf = int(model.mesh_faceadr[mesh]), int(model.mesh_facenum[mesh])
    vertices = np.asarray(model.mesh_vert[v0 : v0 + nv], dtype=np.float64)
    return vertices, np.asarray(model.mesh_face[f0 : f0 + nf], dtype=np.int64)
