"""Numbers that a user gives: a weighed mass, a material, friction and joint resistance, with sources."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from twin.errors import InputError, SceneError
from twin.physics import KEPT, joint_and_contact, weighed
from twin.physics.materials import Material, MaterialTable, read_materials
from twin.physics.rests import unheld, with_rests
from twin.physics.surface_mass import shell_inertial
from twin.physics.text import described
from twin.placed import replaced
from twin.quantities import Inertial, Quantity
from twin.scene import Part, Twin
from twin.units import UNITS

# Half width of the interval of a number that came without one, as a share of it; chosen by us. A kitchen or
# luggage scale is good to 2 %, a force or friction measured by hand to 10 %, a number from memory or a data
# sheet of another model to 20 %.
_MEASURED = {"mass": 0.02}
_MEASURED_ELSE = 0.10
_STATED = 0.20


@dataclass(frozen=True)
class Change:
    """One number before (None: there was none) and after."""

    name: str
    before: str | None
    after: str
    source: str


@dataclass(frozen=True)
class Edited:
    """The changed twin, what changed, and what looks wrong about it."""

    twin: Twin
    changes: tuple[Change, ...]
    warnings: tuple[str, ...]


def given(
    name: str,
    value: float,
    interval: tuple[float, float] | None = None,
    measured: bool = False,
    note: str = "",
    unit: str = "",
) -> Quantity:
    """A number from the user; interval: 2 % of a weighed mass, 10 % of measurements, 20 % of statements.

    Args:
        name: one of `UNITS`, or what the user calls it.
        value: in its unit.
        interval: low and high end.
        measured: on this part; else it is only stated.
        note: where it comes from, for people.
        unit: of a name that is none of `UNITS`.

    Raises InputError: not finite, negative (a mass or a number out of `UNITS`: or zero), or off its interval.
    """
    some = name == "mass" or name not in UNITS
    unit = unit or UNITS[name]
    if not np.isfinite(value) or value < 0 or (some and value == 0):
        least = "positive" if some else "zero or more"
        raise InputError(f"{name} must be {least}, got {value:g}", f"give it in {unit}")
    if interval is None:
        width = value * (_MEASURED.get(name, _MEASURED_ELSE) if measured else _STATED)
        interval = (value - width, value + width)
    low, high = interval
    if not (np.isfinite(low) and np.isfinite(high) and low <= high):
        raise InputError(f"the interval of {name} is reversed or not finite: {low:g} to {high:g}", "LOW HIGH")
    if low < 0 or not low <= value <= high:
        raise InputError(
            f"{name} {value:g} must lie inside its interval {low:g} to {high:g}, which holds nothing negative",
            f"give the interval in {unit}",
        )
    word = "measured" if measured else "user"
    return Quantity(float(value), f"{word}: {note or 'given by the user'}", (float(low), float(high)))


def set_physics(
    twin: Twin,
    key: int | str,
    values: Mapping[str, Quantity],
    material: str | None = None,
    table: MaterialTable | None = None,
) -> Edited:
    """Replace numbers of one part and keep the others.

    Args:
        key: name or id of the part.
        values: "mass", "friction", "damping", "frictionloss", from `given`.
        material: a name of the table; how mass is spread, density and friction then come from it, and so does
            the mass unless it was measured or stated by the user.

    Centre and tensor keep the surface's shape and grow with the mass, as do unstated damping, frictionloss.

    Raises SceneError, ConfigError for an unknown part or material; InputError for an unknown quantity.
    """
    unknown = sorted(set(values) - set(UNITS))
    if unknown:
        raise InputError(f"{unknown[0]!r} can't be set", f"what can: {', '.join(UNITS)}")
    table = table or read_materials()
    old = twin.part(key)
    chosen = table.material(material or table.default)
    prior = _prior(old, chosen)
    inertial = old.inertial
    if material or inertial is None:
        fresh = prior or shell_inertial(old.mesh, chosen)  # the second tells what is wrong with the mesh
        keep = inertial is not None and inertial.mass.origin in KEPT
        inertial = fresh.with_mass(inertial.mass) if keep and inertial is not None else fresh
    if "mass" in values:
        inertial = inertial.with_mass(values["mass"])
    new = replace(old, inertial=inertial) if inertial is old.inertial else weighed(old, inertial, table)
    physics = new.physics or joint_and_contact(new, chosen, table)
    if material:
        named = joint_and_contact(new, chosen, table, "named by the user")
        friction = physics.friction if physics.friction.origin in KEPT else named.friction
        physics = replace(physics, density=named.density, friction=friction)
    new = replace(new, physics=physics.but({k: v for k, v in values.items() if k != "mass"}))
    edited = with_part(twin, new, table)
    new = edited.part(old.id)
    return Edited(
        edited, changes(old, new), (*_doubts(old, inertial.mass, prior), *followed(twin, edited, new))
    )


def with_part(twin: Twin, new: Part, table: MaterialTable) -> Twin:
    """The twin with another state of one of its parts, and joints that hold all where they rested."""
    return with_rests(replaced(twin, new), table)


def followed(before: Twin, after: Twin, edited: Part) -> tuple[str, ...]:
    """What else a change of one part brought, a line each: joints that follow; that it won't rest there."""
    pairs = zip(before.parts, after.parts, strict=True)
    others = ((b.name, c) for a, b in pairs if b.id != edited.id for c in changes(a, b))
    told = [f"{name}: its {c.name} follows: {c.before} is now {c.after}, {c.source}" for name, c in others]
    return (*told, *(line for line in unheld(after) if line.startswith(f"{edited.name} ")))


def _prior(part: Part, material: Material) -> Inertial | None:
    """What the surface alone says about the part's mass; None for a mesh without area."""
    try:
        return shell_inertial(part.mesh, material)
    except SceneError:
        return None


def _doubts(part: Part, mass: Quantity, prior: Inertial | None) -> tuple[str, ...]:
    if prior is None or mass.origin not in KEPT:
        return ()
    low, high = prior.mass.interval
    if low <= mass.interval[1] and mass.interval[0] <= high:
        return ()
    why = prior.mass.source.partition(": ")[2]
    told = (
        f"{part.name}: {mass.value:.3g} kg lies outside of {low:.3g} to {high:.3g} kg, which its {why} allow"
    )
    return (f"{told}: check the unit, the material (--material) and whether the mesh holds the whole part",)


def changes(old: Part, new: Part) -> tuple[Change, ...]:
    """What differs between two states of a part, in the words of `described`."""
    before = {name: (text, source) for name, text, source in described(old)}
    now = described(new)
    gone = before.keys() - {name for name, _, _ in now}
    told = [
        Change(name, before[name][0] if name in before else None, text, source)
        for name, text, source in now
        if before.get(name) != (text, source)
    ]
    return (*told, *(Change(name, before[name][0], "none", "taken away") for name in sorted(gone)))
