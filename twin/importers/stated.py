"""Numbers that a file states of a part: mass, friction, joint resistance, with the file as source."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace

import numpy as np

from twin import geometry as geo
from twin.errors import FuntwinError, InputError, SceneError
from twin.geometry import Array
from twin.importers.source import Source, SourceBody, joined_mass
from twin.physics.edit import given
from twin.scene import Inertial, Part, Quantity


@contextmanager
def _of(source: Source, bodies: Sequence[SourceBody]) -> Iterator[str]:
    """The source text of stated numbers; a number that can't be is refused with its body."""
    try:
        yield f"stated in {source.path.name}"
    except FuntwinError as e:
        raise InputError(f"{source.path}: body {bodies[0].name!r}: {e.problem}", e.remedy) from e


def stated_mass(source: Source, bodies: Sequence[SourceBody]) -> Quantity | None:
    """The mass of what moves as one part; None where the file does not state it."""
    told = joined_mass([b.mass for b in bodies if b.mass is not None])
    if told is None or not any(b.stated for b in bodies):
        return None
    with _of(source, bodies) as note:
        return given("mass", told.mass, note=note)


def stated_inertial(
    source: Source, bodies: Sequence[SourceBody], T: Array, notes: list[str]
) -> Inertial | None:
    """Mass, centre and tensor as stated; None without, or, with a note, where no body has that tensor.

    bodies: the part's, the one with the joint first. T (4, 4): from the file's rest pose to state 0.
    """
    told, mass = joined_mass([b.mass for b in bodies if b.mass is not None]), stated_mass(source, bodies)
    if told is None or mass is None:
        return None
    turned = T[:3, :3] @ told.inertia @ T[:3, :3].T
    try:
        return Inertial(mass, geo.transform(T, told.com[None])[0], (turned + turned.T) / 2)
    except SceneError as e:
        notes.append(f"body {bodies[0].name!r}: {e.problem}; its mass is spread over the surface instead")
        return None


def with_stated(source: Source, part: Part, bodies: Sequence[SourceBody]) -> Part:
    """A part with numbers from its surface and the table of materials, replaced by those the file states."""
    joint, mass = bodies[0].joint, stated_mass(source, bodies)
    assert joint is not None
    assert part.inertial is not None
    assert part.physics is not None
    told = {"damping": joint.damping, "frictionloss": joint.frictionloss}
    rough = [f for b in bodies for f in b.friction]
    with _of(source, bodies) as note:
        values = {k: given(k, v, note=note) for k, v in told.items() if v is not None}
        if rough:
            values["friction"] = _mean(rough, note)
    inertial = part.inertial if mass is None or mass == part.inertial.mass else part.inertial.with_mass(mass)
    return replace(part, inertial=inertial, physics=part.physics.but(values))


def _mean(values: Sequence[float], note: str) -> Quantity:
    """The mean of what a part's shapes state; where they differ, the interval holds all."""
    low, high = min(values), max(values)
    if low == high:
        return given("friction", low, note=note)
    return given("friction", float(np.mean(values)), (low, high), note=f"{note}, mean of its shapes")
