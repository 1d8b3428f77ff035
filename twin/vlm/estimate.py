"""A model's estimate of a part's mass, checked against its geometry and weighed against geometry x table.

A model sees one picture; the surface is measured. What contradicts the surface is refused or left out, and
said. What remains is one more uncertain opinion: the mass is the product of two log-normal distributions,
that of geometry x table, whose interval is taken as 95 %, and that of the model, whose error is the state of
the art's. On ABO-500 the mean of |ln(mass / truth)| is
0.77, a factor of 2.2 (NeRF2Physics; Zhai et al., CVPR 2024); for a normal error of the logarithm that is a
standard deviation of 0.77 sqrt(pi / 2).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from twin.errors import SceneError, ServiceError
from twin.geometry import Array
from twin.mesh import used_vertices
from twin.physics import KEPT, joint_and_contact, weighed
from twin.physics.edit import Edited, changes, followed, with_part
from twin.physics.materials import Material, MaterialTable, read_materials
from twin.physics.surface_mass import shell_inertial
from twin.quantities import Quantity
from twin.scene import Mesh, Part, Twin
from twin.vlm.answer import PhysicalAnswer

MEAN_LOG_ERROR = 0.77
SIGMA = MEAN_LOG_ERROR * float(np.sqrt(np.pi / 2))
_Z95 = 1.96
# Factor to which a picture tells a length. Chosen by us.
_LENGTH = 2.0
# Factor to which it tells a moment, by that length. Chosen by us.
_MOMENT = 5.0
_DENSITY = (5.0, 23_000.0)  # kg/m^3, from foams to osmium
_FLAT = 1e-5  # m: thinner points have no hull
_SOLID = 1.1  # a part fills no more than its hull, up to the mesh's own error


@dataclass(frozen=True, eq=False)
class Body:
    """What the surface fixes: edges (3,) m of its box, longest first, hull's volume m^3, mass bounds kg."""

    edges: tuple[float, float, float]
    volume: float
    mass: tuple[float, float]


def body_of(mesh: Mesh, table: MaterialTable) -> Body:
    """Bounds of a part: from the thinnest, lightest sheet of the table behind half its surface to its hull
    filled with the table's densest material. A hull thinner than the table's thickest board, as that of a
    front seen from one side, is given that thickness.

    Raises SceneError for a mesh without area.
    """
    if mesh.area < 1e-9:
        raise SceneError("a part's mesh has no area, so nothing can be said about its size", "give it a mesh")
    extents, hull = _extents(used_vertices(mesh))
    rows = table.materials.values()
    board = max(m.thickness.interval[1] for m in rows)
    volume = max(hull, mesh.area / 2 * board)
    least = (
        mesh.area / 2 * min(m.thickness.interval[0] for m in rows) * min(m.density.interval[0] for m in rows)
    )
    a, b, c = (float(v) for v in extents)
    return Body((a, b, c), volume, (least, volume * max(m.density.interval[1] for m in rows)))


def _extents(points: Array) -> tuple[Array, float]:
    """Edges (3,) m of the tightest box around points, longest first, and the volume m^3 of their hull."""
    from trimesh import PointCloud

    centred = points - points.mean(axis=0)
    along = np.ptp(centred @ np.linalg.svd(centred, full_matrices=False)[2].T, axis=0)
    if along.min() < _FLAT:
        return np.sort(along)[::-1], 0.0
    cloud = PointCloud(points)
    return np.sort(cloud.bounding_box_oriented.primitive.extents)[::-1], float(cloud.convex_hull.volume)


@dataclass(frozen=True)
class Verdict:
    """What of an answer holds against the part (mass None: it does not), and why the rest does not."""

    mass: float | None
    material: str
    left_out: tuple[str, ...]


def judge(answer: PhysicalAnswer, part: Part, body: Body) -> Verdict:
    """Compare an answer with the part.

    Raises ServiceError for an impossible mass or lengths not in metres: nothing of it can be trusted.
    """
    low, high = body.mass
    if not low <= answer.mass <= high:
        raise ServiceError(
            f"the model's answer is refused: {answer.mass:g} kg is no mass of {part.name}, whose surface allows "
            f"{low:.2g} to {high:.3g} kg",
            "ask again with --refresh, or weigh it: twin physics set",
        )
    left_out: list[str] = []
    stated = np.sort(answer.dimensions)[::-1][:2]
    ratio = stated / np.array(body.edges[: len(stated)])
    shown = " x ".join(f"{v:g}" for v in stated)
    size = " x ".join(f"{v:.2f}" for v in body.edges[:2])
    if np.all(ratio > 10) or np.all(ratio < 0.1):
        raise ServiceError(
            f"the model's answer is refused: its lengths {shown} are not the metres of {part.name}, {size} m",
            "ask again with --refresh",
        )
    if np.any(ratio > _LENGTH) or np.any(ratio < 1 / _LENGTH):
        left_out.append(
            f"its size {shown} m and the mass that follows from it: the surface measures {size} m"
        )
    fits = not left_out
    if not _DENSITY[0] <= answer.density <= _DENSITY[1]:
        left_out.append(f"its density {answer.density:g} kg/m³: no solid has it")
    elif answer.mass / answer.density > _SOLID * body.volume:
        left_out.append(
            f"its density {answer.density:g} kg/m³: {answer.mass:g} kg of it need more room than {part.name} has"
        )
    tensor = _tensor_problem(answer, part)
    if tensor:
        left_out.append(f"its inertia tensor: {tensor}")
    return Verdict(answer.mass if fits else None, answer.material, tuple(left_out))


def _tensor_problem(answer: PhysicalAnswer, part: Part) -> str:
    moments = np.linalg.eigvalsh(answer.inertia)
    if moments[0] <= 0:
        return "a body has positive moments only"
    if moments[2] > (moments[0] + moments[1]) * 1.01:
        return "its moments break the triangle inequality"
    if part.inertial is None:
        return ""
    own = np.linalg.eigvalsh(part.inertial.inertia) * answer.mass / part.inertial.mass.value
    if np.any(moments > _MOMENT * own) or np.any(moments[1:] < own[1:] / _MOMENT):
        return "it does not follow from its mass and the part's shape"
    return ""


def combined(geometry: Quantity, stated: float) -> Quantity | None:
    """The product of both log-normal distributions; None where they contradict each other at the 95 % level.

    geometry: value and 95 % interval. The model's weight is by inverse variances of ln(mass).
    """
    low, high = geometry.interval
    own = max(float(np.log(high / low)) / (2 * _Z95), 1e-9)
    apart = float(np.log(stated / geometry.value))
    if abs(apart) > _Z95 * np.hypot(own, SIGMA):
        return None
    weight = own**2 / (own**2 + SIGMA**2)
    sigma = float(np.sqrt(weight)) * SIGMA
    value = geometry.value * float(np.exp(weight * apart))
    spread = float(np.exp(_Z95 * sigma))
    return Quantity(value, geometry.source, (value / spread, value * spread))


def apply(
    twin: Twin, key: int | str, answer: PhysicalAnswer, model: str, table: MaterialTable | None = None
) -> Edited:
    """Give a part the mass that geometry x table and the answer agree on, and the material of the answer.

    A mass or friction measured or stated by the user stays. Centre and tensor always come from the mesh.

    Raises ServiceError when the answer contradicts the part.
    """
    table = table or read_materials()
    old = twin.part(key)
    verdict = judge(answer, old, body_of(old.mesh, table))
    doubts = [f"{old.name}: left out of the model's answer: {text}" for text in verdict.left_out]
    name = verdict.material.lower().replace(" ", "_").replace("-", "_")
    known = table.materials.get(name)
    if known is None:
        doubts.append(
            f"{old.name}: the model's material {verdict.material!r} is not in the table; {table.default} is used"
        )
    material = known or table.material(table.default)
    inertial = shell_inertial(old.mesh, material)
    if old.inertial is not None and old.inertial.mass.origin in KEPT:
        doubts.append(
            f"{old.name}: its mass stays {old.inertial.mass.value:.3g} kg, which was {old.inertial.mass.origin}"
        )
        inertial = inertial.with_mass(old.inertial.mass)
    elif verdict.mass is not None:
        mass, doubt = _mass(inertial.mass, verdict.mass, material, model)
        inertial = inertial.with_mass(mass)
        doubts += [f"{old.name}: {doubt}"] if doubt else []
    new = weighed(old, inertial, table)
    physics = joint_and_contact(new, material, table, f"named by {model}" if known else "")
    if new.physics is not None:
        friction = new.physics.friction if new.physics.friction.origin in KEPT else physics.friction
        physics = replace(new.physics, friction=friction, density=physics.density)
    new = replace(new, physics=physics)
    edited = with_part(twin, new, table)
    new = edited.part(old.id)
    return Edited(edited, changes(old, new), (*doubts, *followed(twin, edited, new)))


def _mass(geometry: Quantity, stated: float, material: Material, model: str) -> tuple[Quantity, str]:
    """The mass to use, and what is odd about the model's."""
    low, high = geometry.interval
    both = combined(geometry, stated)
    if both is None:
        told = f"{stated:.3g} kg and {low:.3g} to {high:.3g} kg from surface and {material.name} contradict each other"
        return geometry, f"the model's mass is not used: {told}"
    source = f"vlm: {model} says {stated:.3g} kg, weighed against surface area x thickness x density of {material.name}"
    odd = "" if low <= stated <= high else (
        f"the model's {stated:.3g} kg lie outside of {low:.3g} to {high:.3g} kg, which surface and {material.name} give"
    )  # fmt: skip
    return replace(both, source=source), odd
