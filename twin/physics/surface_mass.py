"""Mass, centre and inertia of a part from its surface and a material, with the intervals in which they lie.

A reconstructed part is a surface, not a solid. Each triangle stands for a slab of material behind it (against
its normal):

- where the opposite side of the same board was seen too, at most `_MAX_BOARD` times the table's thickness
  behind, each side stands for half of what lies between them, and never for more than half the table's
  thickness;
- where only one side was seen, it stands for the table's whole thickness.

What lies behind several faces, as at a board's rim, counts for the nearest one alone. So a board counts once,
whichever of its sides were seen, and hollow furniture weighs panel area x thickness x density, never what its
hull would hold.

FunREC, supplement 4: geometry and a table in place of a model.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from twin import geometry as geo
from twin.by_surface import by_surface
from twin.errors import SceneError
from twin.geometry import Array
from twin.mesh import signed_volume
from twin.physics.mass_bounds import shape_bounds
from twin.physics.materials import Material
from twin.quantities import Inertial, Quantity
from twin.scene import Mesh

# chosen by us: two opposite faces further apart than this many thicknesses bound a hollow, not a board
_MAX_BOARD = 2.5
_STEP_IN = 1e-5  # m: a ray starts a little inside so that it can't hit its own face
_FACING = -0.3  # cosine: the other side of a board faces the other way, up to noise
# points behind each face that ask whether another face is nearer; 12 change masses by less than 0.5 %
_DEPTHS = 6
# board thicknesses: faces are cut until no edge is longer; half of it changes masses by about 1 %
_EDGE = 1.4
_MOST_FACES = 30_000  # but not into many more than these; a mesh of over twice as many is decimated
# times as many at most, chosen by us: boards reach 4; each sliver across a fan would become thousands
_SLIVERS = 8


@by_surface
def shell_inertial(mesh: Mesh, material: Material) -> Inertial:
    """Mass (kg), centre and inertia tensor of a surface of boards of `material`, with intervals.

    The mass lies between thin boards of light material and thick ones of heavy material. Intervals of centre
    and tensor hold for any spread of such boards: a heavy front on a light box, glass in a frame.

    Bodies that overlap are joined first, so that what they share weighs once; where that can't be, they count
    by their surface as it is (twin.soundness.overlaps tells).

    Raises SceneError for a mesh without area.
    """
    if mesh.area < 1e-9:
        raise SceneError("a part's mesh has no area, so its mass can't be estimated", "give the part a mesh")
    # imports SciPy, which a table of materials has no need of
    from twin.collision.union import OVERLAP, united

    whole = united(mesh)
    if whole is not None and whole.share > OVERLAP:
        mesh = whole.mesh
    t, rho = material.thickness, material.density
    shell = _Shell.of(mesh, t.value)
    share = shell.slabs(t.value)
    thin, thickest = (shell.slabs(v) for v in t.interval)
    light, heavy = shell.areas * thin * rho.interval[0], shell.areas * thickest * rho.interval[1]
    mass = shell.areas * share * rho.value
    total = float(mass.sum())
    interval = (min(float(light.sum()), total), max(float(heavy.sum()), total))
    source = f"geometry: surface area x thickness x density of {material.name}"
    com, tensor = _slab_moments(shell.mesh, shell.normals, share, mass)
    outside = shell.mesh.vertices[shell.mesh.faces].mean(axis=1)
    middles = [outside - shell.normals * thick[:, None] / 2 for thick in (thin, share, thickest)]
    weights = (np.minimum(light, mass), mass, np.maximum(heavy, mass))
    factors, box = shape_bounds(middles, weights, com, tensor)
    spread = (factors[0] * interval[0] / total, factors[1] * interval[1] / total)
    return Inertial(Quantity(total, source, interval), com, tensor, source, spread, box)


@dataclass(frozen=True, eq=False)
class _Shell:
    """A surface cut into small faces: areas (F,) m^2, normals (F, 3), depth (F,) m of the board."""

    mesh: Mesh
    areas: Array
    normals: Array
    gap: Array
    solid: float | None

    @staticmethod
    def of(mesh: Mesh, thickness: float) -> _Shell:
        from twin.collision.decimation import decimated

        solid = _closed_volume(mesh)
        small = decimated(mesh, 2 * _MOST_FACES)
        if _pieces(_longest_sides(small), _edge(small, thickness)) > _SLIVERS * _MOST_FACES:
            small = decimated(mesh, _MOST_FACES // 8)
        fine = _cut(small, thickness)
        normals, areas = geo.triangle_normals(fine.vertices[fine.faces])
        return _Shell(fine, areas, normals, behind(fine, normals, _MAX_BOARD * thickness), solid)

    def slabs(self, thickness: float) -> Array:
        """Thickness (F,) of the material that each face stands for; nothing is counted twice."""
        both = np.isfinite(self.gap)
        share = np.where(both, np.minimum(np.where(both, self.gap, 0.0), thickness) / 2, thickness)
        share = share * self._own(share)
        total = float(self.areas @ share)
        return share * min(1.0, self.solid / total) if self.solid is not None else share

    def _own(self, share: Array) -> Array:
        """Share (F,) of what lies behind each face that lies behind no other face nearer to it."""
        nodes, weights = np.polynomial.legendre.leggauss(_DEPTHS)  # in no step with a regular mesh
        depths = (nodes + 1.0) / 2.0
        centres = self.mesh.vertices[self.mesh.faces].mean(axis=1)
        points = centres[:, None] - self.normals[:, None] * (share[:, None] * depths)[:, :, None]
        closest = _scene(self.mesh).compute_closest_points(_tensor(points.reshape(-1, 3)))
        other = closest["primitive_ids"].numpy().reshape(points.shape[:2]).astype(np.int64)
        away = points - closest["points"].numpy().reshape(points.shape)
        distance = np.linalg.norm(away, axis=2)
        normal = self.normals[other]
        nearer = distance < 0.999 * share[:, None] * depths - 1e-6
        turned = np.einsum("fki,fi->fk", normal, self.normals) < np.sqrt(0.5)
        inside = np.einsum("fki,fki->fk", away, normal) < 0
        taken = nearer & turned & inside & (distance <= share[other])
        return 1.0 - taken @ weights / 2.0


def _cut(mesh: Mesh, thickness: float) -> Mesh:
    """The mesh with no edge longer than a board is thick, as far as the number of faces allows."""
    from trimesh.remesh import subdivide_to_size

    edge, sides = _edge(mesh, thickness), _longest_sides(mesh)
    longest = float(sides.max())
    while _pieces(sides, edge) > _SLIVERS * _MOST_FACES:
        edge *= 1.5
    if longest <= edge:
        return mesh
    rounds = int(np.ceil(np.log2(longest / edge))) + 2
    vertices, faces = subdivide_to_size(mesh.vertices, mesh.faces, edge, max_iter=2 * rounds)
    return Mesh(vertices, faces)


def _edge(mesh: Mesh, thickness: float) -> float:
    """Longest edge (m) that the faces of a mesh are cut to."""
    return max(_EDGE * thickness, float(np.sqrt(4.0 * mesh.area / _MOST_FACES)))


def _longest_sides(mesh: Mesh) -> Array:
    """Longest side (F,) m of each face."""
    corners = mesh.vertices[mesh.faces]
    return np.asarray(np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1))


def _pieces(sides: Array, edge: float) -> float:
    """Number of faces from faces of these longest sides (F,), each cut in four until none is over `edge`."""
    return float((4.0 ** np.ceil(np.log2(np.maximum(sides / edge, 1.0)))).sum())


def _slab_moments(mesh: Mesh, normals: Array, thickness: Array, mass: Array) -> tuple[Array, Array]:
    """Centre of mass (3,) and tensor (3, 3) about it of slabs of `thickness` (F,) behind each face.

    Second moment of a uniform triangle: m / 12 (aa' + bb' + cc' + ss'), s = a + b + c; a slab adds m t^2 / 12
    nn'. The thickness keeps the tensor of a flat mesh positive and inside the triangle inequality.
    """
    corners = mesh.vertices[mesh.faces] - (normals * thickness[:, None] / 2)[:, None]
    com = (mass[:, None] * corners.mean(axis=1)).sum(0) / mass.sum()
    corners = corners - com
    s = corners.sum(axis=1)
    second = np.einsum("f,fki,fkj->ij", mass / 12, corners, corners) + np.einsum(
        "f,fi,fj->ij", mass / 12, s, s
    )
    second += np.einsum("f,fi,fj->ij", mass * thickness**2 / 12, normals, normals)
    tensor = np.trace(second) * np.eye(3) - second
    return com, (tensor + tensor.T) / 2


def behind(mesh: Mesh, normals: Array, reach: float) -> Array:
    """Distance (F,) m from each face, against its normal, to a face that looks the other way, or inf."""
    start = mesh.vertices[mesh.faces].mean(axis=1) - _STEP_IN * normals
    hit = _scene(mesh).cast_rays(_tensor(np.concatenate([start, -normals], axis=1)), 1)
    distance = hit["t_hit"].numpy().astype(np.float64) + _STEP_IN
    found = np.isfinite(distance) & (distance <= reach)
    other = hit["primitive_ids"].numpy()[found]
    opposite = np.einsum("fi,fi->f", normals[found], normals[other]) < _FACING
    out = np.full(len(normals), np.inf)
    out[np.flatnonzero(found)[opposite]] = distance[found][opposite]
    return out


def _tensor(values: Array) -> Any:
    import open3d as o3d

    return o3d.core.Tensor.from_numpy(np.ascontiguousarray(values, dtype=np.float32))


def _scene(mesh: Mesh) -> Any:
    """The mesh as something that answers rays and nearest points."""
    import open3d as o3d

    scene = o3d.t.geometry.RaycastingScene(1)
    faces = o3d.core.Tensor.from_numpy(np.ascontiguousarray(mesh.faces, dtype=np.uint32))
    scene.add_triangles(_tensor(mesh.vertices), faces)
    return scene


def _closed_volume(mesh: Mesh) -> float | None:
    """Enclosed volume (m^3) of a closed, consistently wound mesh; None for an open one."""
    faces = geo.unique_rows(np.round(mesh.vertices / 1e-7).astype(np.int64))[1][mesh.faces]
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    forward = edges[geo.unique_rows(edges)[0]]
    back = edges[:, ::-1][geo.unique_rows(edges[:, ::-1])[0]]
    if forward.shape != back.shape or not np.array_equal(forward, back):
        return None
    volume = signed_volume(mesh.vertices[mesh.faces] - mesh.vertices.mean(axis=0))
    return volume if volume > 1e-9 else None
