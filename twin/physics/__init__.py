"""Mass, inertia, friction and joint resistance of parts, from their surface and a table of materials."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from twin.physics.joints import armature as armature
from twin.physics.joints import inertia_about as inertia_about
from twin.physics.joints import resistance, weight_on_lever
from twin.physics.materials import Material as Material
from twin.physics.materials import MaterialTable as MaterialTable
from twin.physics.materials import read_materials as read_materials
from twin.physics.parts import inertial_of as inertial_of
from twin.physics.parts import physics_of as physics_of
from twin.physics.parts import weight_load as weight_load
from twin.physics.rests import Rest as Rest
from twin.physics.rests import rests as rests
from twin.physics.rests import unheld as unheld
from twin.physics.rests import with_rests as with_rests
from twin.physics.rests import without_rests as without_rests
from twin.physics.surface_mass import shell_inertial as shell_inertial
from twin.quantities import Quantity
from twin.scene import Inertial, Part, PartPhysics, Twin

# Numbers that somebody took the trouble to find out: nothing but the user replaces them.
KEPT = ("measured", "user")


def with_physics(
    twin: Twin,
    materials: Mapping[str, str] | None = None,
    table: MaterialTable | None = None,
    renew: bool = False,
) -> Twin:
    """Give moving parts mass, inertia, friction and resistance, enough to stay where they rested.

    Args:
        materials: part name -> material name; parts that are not named get the table's default.
        table: the table of materials, by default assets/materials.toml.
        renew: replace values that the twin has already, unless the user measured or stated them; otherwise
            only missing ones are filled.
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
        new = replace(part, inertial=inertial)
        physics = (
            part.physics
            if part.physics is not None and not renew
            else joint_and_contact(new, material, table)
        )
        parts.append(with_known(replace(new, physics=physics), part, table))
    return with_rests(replace(twin, parts=tuple(parts)), table)


def joint_and_contact(
    part: Part, material: Material, table: MaterialTable, chosen_by: str = ""
) -> PartPhysics:
    """Friction and density of a material; by the joint's law damping and frictionloss, all from the table.

    chosen_by: who named the material, kept in the density's source. Raises SceneError without a mass.
    """
    resists = resistance(part.joint, inertial_of(part), table.joints[part.joint.kind])
    word, _, detail = material.density.source.partition(": ")
    name = f"{material.name}, {chosen_by}" if chosen_by else material.name
    density = replace(material.density, source=f"{word}: {name}: {detail}")
    return PartPhysics(material.friction, resists["damping"], resists["frictionloss"], density)


def weighed(part: Part, inertial: Inertial, table: MaterialTable | None = None) -> Part:
    """The part with another mass; a damping or frictionloss that nobody stated follows it, by the table.

    A frictionloss from rests grows with the weight on its lever; `with_rests` finds it again from labels.
    """
    before, part = part.inertial, replace(part, inertial=inertial)
    if part.physics is None:
        return part
    law = (read_materials() if table is None else table).joints[part.joint.kind]
    follows = {
        k: q
        for k, q in resistance(part.joint, inertial, law).items()
        if getattr(part.physics, k).origin == "default"
    }
    loss = part.physics.frictionloss
    if loss.origin == "recording" and before is not None:
        grown = weight_on_lever(part.joint, inertial) / weight_on_lever(part.joint, before)
        low, high = loss.interval
        follows["frictionloss"] = Quantity(loss.value * grown, loss.source, (low * grown, high * grown))
    return replace(part, physics=part.physics.but(follows))


def with_known(part: Part, earlier: Part, table: MaterialTable | None = None) -> Part:
    """The part with those numbers of an earlier state of it that the user measured or stated, and what others
    added to it; the tensor grows with the mass."""
    before = earlier.inertial
    known_mass = before is not None and before.mass.origin in KEPT
    if before is not None and known_mass and part.inertial is not None and part.inertial.mass != before.mass:
        part = weighed(part, part.inertial.with_mass(before.mass), table)
    if part.physics is not None and earlier.physics is not None:
        known = {k: q for k, q in earlier.physics.numbers.items() if q.origin in KEPT}
        catch = earlier.physics.catch or part.physics.catch  # there is none that nobody asked for
        part = replace(part, physics=replace(part.physics.but(known), catch=catch))
    return replace(part, extra={**earlier.extra, **part.extra})


def static_friction(twin: Twin) -> float:
    """Sliding friction of the static scene, which is assumed: the parts' mean, or the default material's."""
    values = [p.physics.friction.value for p in twin.parts if p.physics is not None]
    if values:
        return float(np.mean(values))
    table = read_materials()
    return table.material(table.default).friction.value


def keep_known(twin: Twin, earlier: Twin) -> Twin:
    """A twin made again, with what the user measured, stated or added to the earlier one of its recording.

    Parts are the same that have the same name and joint type.
    """
    made_from = [None if t.recorded is None else t.recorded.fingerprint for t in (twin, earlier)]
    if made_from[0] is None or made_from[0] != made_from[1]:
        return twin
    before = {(p.name, p.joint.kind): p for p in earlier.parts}
    parts = [with_known(p, before.get((p.name, p.joint.kind), p)) for p in twin.parts]
    return with_rests(replace(twin, parts=tuple(parts), extra={**earlier.extra, **twin.extra}))
