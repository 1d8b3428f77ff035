"""Mass, inertia and resistance of parts from their surface and a table of materials.

A reconstructed part is a surface, not a solid. Each triangle stands for a slab of material behind it (against its normal):
- where the opposite side of the same board was seen too, at most `_MAX_BOARD` times the table's thickness behind, each
  side stands for half of what lies between them, and never for more than half the table's thickness;
- where only one side was seen, it stands for the table's whole thickness.
So a board counts once, whether one or both of its sides were seen, and a hollow box weighs what its walls weigh. When the
mesh is closed, the slabs (which overlap at edges) are scaled down to the enclosed volume if they exceed it.
Edges of boards seen from the side count their rim once more: up to about a tenth of a cabinet front, inside the interval.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from twin.errors import ConfigError, SceneError, nearest_name
from twin.geometry import Array
from twin.scene import Inertial, Mesh, Part, PartPhysics, Quantity, Twin

_TABLE = Path(__file__).resolve().parents[1] / "assets" / "materials.toml"
_MAX_BOARD = 2.5  # chosen by us: two opposite faces further apart than this many thicknesses bound a hollow, not a board
_STEP_IN = 1e-5  # m: a ray starts a little inside so that it can't hit its own face
_FACING = -0.3  # cosine: the other side of a board faces the other way, up to noise


@dataclass(frozen=True)
class Material:
    """Density kg/m^3, board thickness m and sliding friction."""

    name: str
    density: Quantity
    thickness: Quantity
    friction: Quantity


@dataclass(frozen=True)
class MaterialTable:
    """Materials by name, the default one, and joint resistance by joint type ("revolute": N m and N m s/rad,
    "prismatic": N and N s/m) as frictionloss and damping."""

    default: str
    materials: Mapping[str, Material]
    joints: Mapping[str, Mapping[str, Quantity]]

    def material(self, name: str) -> Material:
        """The material of that name. Raises ConfigError with the nearest name."""
        if name not in self.materials:
            close = nearest_name(name, list(self.materials))
            hint = f"did you mean {close!r}? " if close else ""
            raise ConfigError(
                f"material {name!r} is not in the table", hint + f"known: {', '.join(self.materials)}"
            )
        return self.materials[name]


def read_materials(path: Path = _TABLE) -> MaterialTable:
    """Read a table of materials (TOML, see assets/materials.toml). Raises ConfigError naming file and entry."""
    try:
        data = tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, tomllib.TOMLDecodeError) as e:
        raise ConfigError(
            f"table of materials {path} can't be read: {e}", "start from assets/materials.toml"
        ) from e
    try:
        materials = {
            name: Material(name, *(_quantity(row[k]) for k in ("density", "thickness", "friction")))
            for name, row in data["materials"].items()
        }
        joints = {k: {q: _quantity(v) for q, v in row.items()} for k, row in data["joints"].items()}
        return MaterialTable(materials[data["default"]].name, materials, joints)
    except (KeyError, TypeError, SceneError) as e:
        raise ConfigError(f"table of materials {path}: {e}", "start from assets/materials.toml") from e


def _quantity(row: Mapping[str, Any]) -> Quantity:
    low, high = row["interval"]
    return Quantity(float(row["value"]), str(row["source"]), (float(low), float(high)))


def with_physics(
    twin: Twin,
    materials: Mapping[str, str] | None = None,
    table: MaterialTable | None = None,
    renew: bool = False,
) -> Twin:
    """Give every moving part mass, inertia, friction and joint resistance.

    Args:
        materials: part name -> material name; parts that are not named get the table's default.
        table: the table of materials, by default assets/materials.toml.
        renew: replace values that the twin has already; otherwise only missing ones are filled.
    """
    table = read_materials() if table is None else table
    chosen = dict(materials or {})
    for name in chosen:
        twin.part(name)
    parts = []
    for part in twin.parts:
        material = table.material(chosen.get(part.name, table.default))
        inertial = (
            part.inertial if part.inertial is not None and not renew else shell_inertial(part.mesh, material)
        )
        physics = (
            part.physics if part.physics is not None and not renew else _part_physics(part, material, table)
        )
        parts.append(replace(part, inertial=inertial, physics=physics))
    return replace(twin, parts=tuple(parts))


def _part_physics(part: Part, material: Material, table: MaterialTable) -> PartPhysics:
    joint = table.joints[part.joint.kind]
    density = replace(material.density, source=f"{material.name}: {material.density.source}")
    return PartPhysics(material.friction, joint["damping"], joint["frictionloss"], density)


def shell_inertial(mesh: Mesh, material: Material) -> Inertial:
    """Mass (kg), centre and inertia tensor of a surface that stands for boards of `material`.

    Raises SceneError for a mesh without area.
    """
    areas, normals = _face_frames(mesh)
    if areas.sum() < 1e-9:
        raise SceneError("a part's mesh has no area, so its mass can't be estimated", "give the part a mesh")
    gap = behind(mesh, normals, _MAX_BOARD * material.thickness.value)

    def slabs(thickness: float) -> Array:
        both = np.isfinite(gap)
        share = np.where(both, np.minimum(np.where(both, gap, 0.0), thickness) / 2, thickness)
        solid = _closed_volume(mesh)
        total = float(areas @ share)
        return share * min(1.0, solid / total) if solid is not None else share

    t, rho = material.thickness, material.density
    low, high = (float(areas @ slabs(t.interval[k])) * rho.interval[k] for k in (0, 1))
    share = slabs(t.value)
    mass = float(areas @ share) * rho.value
    source = f"surface area x thickness x density of {material.name}"
    com, tensor = _slab_moments(mesh, normals, share, areas * share * rho.value)
    return Inertial(Quantity(mass, source, (min(low, mass), max(high, mass))), com, tensor)


def _face_frames(mesh: Mesh) -> tuple[Array, Array]:
    """Area (F,) and unit normal (F, 3) of each face; faces without area get a zero normal."""
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    cross = np.cross(b - a, c - a)
    length = np.linalg.norm(cross, axis=1)
    return length / 2, cross / np.maximum(length, 1e-300)[:, None]


def _slab_moments(mesh: Mesh, normals: Array, thickness: Array, mass: Array) -> tuple[Array, Array]:
    """Centre of mass (3,) and tensor (3, 3) about it of slabs of `thickness` (F,) behind each face.

    Second moment of a uniform triangle: m / 12 (aa' + bb' + cc' + ss'), s = a + b + c; a slab adds m t^2 / 12 nn'. The
    thickness keeps the tensor of a flat mesh positive and inside the triangle inequality.
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
    """Distance (F,) m from each face, against its normal, to a face that looks the other way; inf without one in reach."""
    import open3d as o3d

    tensor = o3d.core.Tensor.from_numpy
    scene = o3d.t.geometry.RaycastingScene(1)
    scene.add_triangles(
        tensor(np.ascontiguousarray(mesh.vertices, dtype=np.float32)),
        tensor(np.ascontiguousarray(mesh.faces, dtype=np.uint32)),
    )
    start = mesh.vertices[mesh.faces].mean(axis=1) - _STEP_IN * normals
    hit = scene.cast_rays(tensor(np.concatenate([start, -normals], axis=1).astype(np.float32)), 1)
    distance = hit["t_hit"].numpy().astype(np.float64) + _STEP_IN
    found = np.isfinite(distance) & (distance <= reach)
    other = hit["primitive_ids"].numpy()[found]
    opposite = np.einsum("fi,fi->f", normals[found], normals[other]) < _FACING
    out = np.full(len(normals), np.inf)
    out[np.flatnonzero(found)[opposite]] = distance[found][opposite]
    return out


def _closed_volume(mesh: Mesh) -> float | None:
    """Enclosed volume (m^3) of a closed, consistently wound mesh; None for an open one."""
    _, joined = np.unique(np.round(mesh.vertices / 1e-7).astype(np.int64), axis=0, return_inverse=True)
    faces = joined.ravel()[mesh.faces]
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    forward = np.unique(edges, axis=0)
    back = np.unique(edges[:, ::-1], axis=0)
    if forward.shape != back.shape or not np.array_equal(forward, back):
        return None
    a, b, c = (mesh.vertices[mesh.faces[:, k]] - mesh.vertices.mean(axis=0) for k in range(3))
    volume = float(np.einsum("fi,fi->", a, np.cross(b, c)) / 6)
    return volume if volume > 1e-9 else None
