"""What both readers fill: bodies with what is known about them, in the file's world at its rest pose."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from twin.geometry import Array
from twin.scene import Box, Collision, Joint, Mesh, Prismatic, Revolute

WORLD = "world"  # the body that stands still, in either format
Closed = float | str  # a coordinate of the file's joint, "lower" or "upper"


@dataclass(frozen=True, eq=False)
class SourceJoint:
    """A hinge or slide. axis, pivot (3,): unit and m, in the world at rest. `rest`, `lower`, `upper` are in
    the file's own coordinate, m or rad; without limits they are None. closed, open: where keyframes of those
    names have it, None without them. damping, frictionloss: None where the file states none."""

    name: str
    kind: Literal["revolute", "prismatic"]
    axis: Array
    pivot: Array
    rest: float = 0.0
    lower: float | None = None
    upper: float | None = None
    closed: float | None = None
    open: float | None = None
    damping: float | None = None
    frictionloss: float | None = None

    @property
    def from_rest(self) -> Joint:
        """The joint as it stands in the world at rest; its state there is 0."""
        return Prismatic(self.axis) if self.kind == "prismatic" else Revolute(self.axis, pivot=self.pivot)


@dataclass(frozen=True, eq=False)
class SourceMass:
    """Mass (kg), centre (3,) m and tensor (3, 3) kg m^2 about it, in the world at rest."""

    mass: float
    com: Array
    inertia: Array


@dataclass(frozen=True, eq=False)
class SourceBody:
    """A rigid body. `parent` names another, None the world. friction: of each shape that touches.

    stated: whether the file states the mass, not only its reader. refused: why a twin can't carry how it
    moves. loose: it stands on nothing. shapes: False when some of its collision shapes can't be used.
    """

    name: str
    parent: str | None
    joint: SourceJoint | None = None
    visual: tuple[Mesh, ...] = ()
    collision: tuple[Collision, ...] = ()
    mass: SourceMass | None = None
    stated: bool = True
    friction: tuple[float, ...] = ()
    refused: str = ""
    loose: bool = False
    shapes: bool = True


@dataclass(frozen=True, eq=False)
class Source:
    """A file as read: `bodies` with parents before their children, `notes` what of it no twin holds.

    never_touching: pairs of names of bodies that move against each other, that both have collision shapes,
    and that the file never lets touch. Two parts never touch when each body of the one and each body of the
    other, shapes given, are such a pair. URDF says nothing of contacts: the set is empty.
    """

    path: Path
    name: str
    bodies: tuple[SourceBody, ...]
    notes: tuple[str, ...] = ()
    never_touching: frozenset[frozenset[str]] = frozenset()


def joined_mass(masses: Sequence[SourceMass]) -> SourceMass | None:
    """Mass, centre and tensor of bodies that move as one; None when nothing weighs anything."""
    total = sum(m.mass for m in masses)
    if total <= 0:
        return None
    com = np.asarray(sum(m.mass * m.com for m in masses) / total)
    tensor = np.zeros((3, 3))
    for m in masses:
        d = m.com - com
        tensor += m.inertia + m.mass * (d @ d * np.eye(3) - np.outer(d, d))
    return SourceMass(total, com, tensor)


def surface_of(shape: Collision) -> Mesh:
    """A collision shape as a surface."""
    if isinstance(shape, Mesh):
        return shape
    from twin.importers.shapes import box

    return box(shape.size).transformed(shape.T_world_box)


def moved(shape: Collision, T: Array) -> Collision:
    """A collision shape elsewhere."""
    return shape.transformed(T) if isinstance(shape, Mesh) else Box(T @ shape.T_world_box, shape.size)
