"""Mass, inertia, friction and joint resistance of parts: filled in from their surface and a table of materials."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from twin.physics.materials import Material as Material
from twin.physics.materials import MaterialTable as MaterialTable
from twin.physics.materials import read_materials as read_materials
from twin.physics.surface_mass import shell_inertial as shell_inertial
from twin.scene import Part, PartPhysics, Twin

# Numbers that somebody took the trouble to find out: nothing but the user replaces them.
KEPT = ("measured", "user")


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
        renew: replace values that the twin has already, unless the user measured or stated them; otherwise only missing
            ones are filled.
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
            part.physics
            if part.physics is not None and not renew
            else joint_and_contact(part, material, table)
        )
        parts.append(with_known(replace(part, inertial=inertial, physics=physics), part))
    return replace(twin, parts=tuple(parts))


def joint_and_contact(
    part: Part, material: Material, table: MaterialTable, chosen_by: str = ""
) -> PartPhysics:
    """Friction and density of a material, damping and frictionloss of the joint's type, all from the table.

    chosen_by: who named the material, kept in the density's source.
    """
    joint = table.joints[part.joint.kind]
    word, _, detail = material.density.source.partition(": ")
    name = f"{material.name}, {chosen_by}" if chosen_by else material.name
    density = replace(material.density, source=f"{word}: {name}: {detail}")
    return PartPhysics(material.friction, joint["damping"], joint["frictionloss"], density)


def with_known(part: Part, earlier: Part) -> Part:
    """The part with those numbers of an earlier state of it that the user measured or stated, and what others added to it;
    the tensor grows with the mass."""
    inertial, physics = part.inertial, part.physics
    if inertial is not None and earlier.inertial is not None and earlier.inertial.mass.origin in KEPT:
        inertial = inertial.with_mass(earlier.inertial.mass)
    if physics is not None and earlier.physics is not None:
        known = {k: q for k, q in vars(earlier.physics).items() if q.origin in KEPT}
        physics = replace(physics, **known)
    return replace(part, inertial=inertial, physics=physics, extra={**earlier.extra, **part.extra})


def keep_known(twin: Twin, earlier: Twin) -> Twin:
    """A twin made again, with what the user measured, stated or added to the earlier one from the same recording.

    Parts are the same that have the same name and joint type.
    """
    made_from = [None if t.recorded is None else t.recorded.fingerprint for t in (twin, earlier)]
    if made_from[0] is None or made_from[0] != made_from[1]:
        return twin
    before = {(p.name, p.joint.kind): p for p in earlier.parts}
    parts = [with_known(p, before.get((p.name, p.joint.kind), p)) for p in twin.parts]
    return replace(twin, parts=tuple(parts), extra={**earlier.extra, **twin.extra})
