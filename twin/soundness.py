"""Refuses parts whose mesh can't stand for a body, before anything is written."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from twin.errors import SceneError
from twin.geometry import Array
from twin.scene import Mesh, Twin

_CROSSING = 0.002  # m, chosen by us: above the noise of a scanned surface, below any board
_SHARE = 0.1  # of a part's area, chosen by us: folds of a scanned surface are no harm (3 % of a drawer with 1.5 mm of noise)


def require_sound(twin: Twin) -> None:
    """Raises SceneError that names the first moving part whose mesh is empty or passes through itself.

    Where surfaces cross, mass and collision shapes would count the same space twice. Boards that only touch are sound. The
    static scene is not looked at: it has no mass, and its shapes follow the surface whatever it encloses.
    """
    for part in twin.parts:
        if not len(part.mesh.faces) or part.mesh.area < 1e-9:
            raise SceneError(
                f"the mesh of part {part.name!r} is empty", "give the part a surface or leave it out"
            )
        share, at = crossing(part.mesh)
        if share > _SHARE:
            where = " ".join(f"{x:.3f}" for x in at)
            raise SceneError(
                f"the mesh of part {part.name!r} passes through itself on {100 * share:.0f} % of its area, "
                f"for example at ({where}) m",
                "join the overlapping bodies first, e.g. with trimesh.boolean.union",
            )


def crossing(mesh: Mesh) -> tuple[float, Array]:
    """Share (0..1) of the area on triangles that cross another one by more than 2 mm, and a point (3,) m of one of them."""
    import open3d as o3d

    shape = o3d.geometry.TriangleMesh(
        o3d.utility.Vector3dVector(np.array(mesh.vertices)), o3d.utility.Vector3iVector(np.array(mesh.faces))
    )
    pairs = np.asarray(shape.get_self_intersecting_triangles(), dtype=np.int64).reshape(-1, 2)
    corners = mesh.vertices[mesh.faces]
    pairs = pairs[_depth(corners, pairs) > _CROSSING]
    if not len(pairs):
        return 0.0, np.zeros(3)
    a, b, c = (corners[:, k] for k in range(3))
    areas = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2
    return float(areas[np.unique(pairs)].sum() / areas.sum()), corners[pairs[0, 0]].mean(axis=0)


def _depth(corners: Array, pairs: NDArray[np.int64]) -> Array:
    """How far (n,) m both triangles of each pair reach to both sides of the other's plane."""
    depth = np.full(len(pairs), np.inf)
    for one, other in (pairs.T, pairs.T[::-1]):
        t = corners[other]
        normal = np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0])
        normal /= np.maximum(np.linalg.norm(normal, axis=1), 1e-300)[:, None]
        height = np.einsum("nki,ni->nk", corners[one] - t[:, :1], normal)
        depth = np.minimum(depth, np.minimum(height.max(axis=1), -height.min(axis=1)))
    return depth
