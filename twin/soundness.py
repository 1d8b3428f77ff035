"""Refuses parts that no mesh stands for, and tells of meshes in which bodies overlap."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from twin import geometry as geo
from twin.errors import SceneError
from twin.geometry import Array
from twin.scene import Mesh, Part, Twin

_CROSSING = 0.002  # m, chosen by us: above the noise of a scanned surface, below any board
# of a part's area, chosen by us: folds of a scan are no harm (3 % of a drawer with 1.5 mm of noise)
_SHARE = 0.1
_FACES = 10_000  # looked at in a larger mesh: every triangle is tried against every other


def require_sound(twin: Twin) -> None:
    """Raises SceneError that names the first moving part with an empty mesh.

    Also where shapes and mass are stated: a file that lost its faces looks like one that never had any.
    """
    for part in twin.parts:
        if not len(part.mesh.faces) or part.mesh.area < 1e-9:
            raise SceneError(
                f"the mesh of part {part.name!r} is empty",
                "give the part a surface or leave it out",
            )


def overlaps(twin: Twin) -> list[str]:
    """One line for every moving part whose mesh holds the same space twice, with share and outcome.

    Boards that touch are fine. The static scene is left out: it has no mass, its shapes follow its surface.
    """
    return [line for part in twin.parts if (line := _overlap(part))]


def _overlap(part: Part) -> str:
    from twin.collision.decimation import decimated
    from twin.collision.union import OVERLAP, united

    whole = united(part.mesh)
    if whole is not None and whole.share > OVERLAP:
        from_surface = part.inertial is None or part.inertial.mass.origin == "geometry"
        mass = "mass is that of their union" if from_surface else "mass is as stated"
        return f"bodies of part {part.name!r} overlap by {whole.share:.1%} of their volume; its {mass}"
    share, at = crossing(decimated(part.mesh, _FACES))
    if share <= _SHARE:
        return ""
    where = " ".join(f"{x:.3f}" for x in at)
    return (
        f"the mesh of part {part.name!r} passes through itself on {share:.0%} of its area, for example at ({where}) m, and "
        "can't be united into one body; what is made from its surface may count the same space twice"
    )


def crossing(mesh: Mesh) -> tuple[float, Array]:
    """Share (0..1) of area in triangles that cross another by over 2 mm, and a point (3,) m on one."""
    import open3d as o3d

    shape = o3d.geometry.TriangleMesh(
        o3d.utility.Vector3dVector(np.array(mesh.vertices)), o3d.utility.Vector3iVector(np.array(mesh.faces))
    )
    pairs = np.asarray(shape.get_self_intersecting_triangles(), dtype=np.int64).reshape(-1, 2)
    corners = mesh.vertices[mesh.faces]
    pairs = pairs[_depth(corners, pairs) > _CROSSING]
    if not len(pairs):
        return 0.0, np.zeros(3)
    areas = geo.triangle_areas(corners)
    return float(areas[np.unique(pairs)].sum() / areas.sum()), corners[pairs[0, 0]].mean(axis=0)


def _depth(corners: Array, pairs: NDArray[np.int64]) -> Array:
    """How far (n,) m both triangles of each pair reach to both sides of the other's plane."""
    depth = np.full(len(pairs), np.inf)
    for one, other in (pairs.T, pairs.T[::-1]):
        t = corners[other]
        normal, _ = geo.triangle_normals(t)
        height = np.einsum("nki,ni->nk", corners[one] - t[:, :1], normal)
        depth = np.minimum(depth, np.minimum(height.max(axis=1), -height.min(axis=1)))
    return depth
