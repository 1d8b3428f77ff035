"""Numbers that a file states about a part: mass, friction, joint resistance, each with the file as its source."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from twin import geometry as geo
from twin.errors import FuntwinError, InputError, SceneError
from twin.geometry import Array
from twin.importers.source import Source, SourceBody, joined_mass
from twin.physics.edit import given
from twin.scene import Inertial, Part, PartPhysics, Quantity


def with_stated(source: Source, part: Part, bodies: Sequence[SourceBody], T: Array, notes: list[str]) -> Part:
    """The part with the numbers that the file states in place of those from the table of materials.

    bodies: what moves as the part, the one with the joint first. T (4, 4): from the file's rest pose to state 0.
    """
    joint = bodies[0].joint
    assert joint is not None
    assert part.physics is not None
    note = f"stated in {source.path.name}"
    try:
        values = {
            name: given(name, value, note=note)
            for name, value in (
                ("damping", joint.damping),
                ("frictionloss", joint.frictionloss),
            )
            if value is not None
        }
        rough = [f for b in bodies for f in b.friction]
        if rough:
            values["friction"] = _mean(rough, note)
        inertial = _inertial(part, bodies, T, note, notes)
    except FuntwinError as e:
        raise InputError(f"{source.path}: body {bodies[0].name!r}: {e.problem}", e.remedy) from e
    physics: PartPhysics = replace(part.physics, **values)
    return replace(part, inertial=inertial, physics=physics)


def _mean(values: Sequence[float], note: str) -> Quantity:
    """The mean of what a part's shapes state; where they differ, the interval holds all."""
    low, high = min(values), max(values)
    if low == high:
        return given("friction", low, note=note)
    return given("friction", float(np.mean(values)), (low, high), note=f"{note}, mean of its shapes")


def _inertial(part: Part, bodies: Sequence[SourceBody], T: Array, note: str, notes: list[str]) -> Inertial:
    """Mass, centre and tensor as stated; a tensor that no body can have is replaced by that of the surface."""
    assert part.inertial is not None
    told = joined_mass([b.mass for b in bodies if b.mass is not None])
    if told is None or not any(b.stated for b in bodies):
        return part.inertial
    mass = given("mass", told.mass, note=note)
    turned = T[:3, :3] @ told.inertia @ T[:3, :3].T
    try:
        return Inertial(mass, geo.transform(T, told.com[None])[0], (turned + turned.T) / 2)
    except SceneError as e:
        notes.append(f"body {bodies[0].name!r}: {e.problem}; its mass is spread over the surface instead")
        return part.inertial.with_mass(mass)
