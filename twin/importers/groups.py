"""Bodies of a file that move as one, and a part among what stands around it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from twin.collision.convex import hull_of
from twin.geometry import Array
from twin.importers.interpenetration import deeper
from twin.importers.source import WORLD, SourceBody, SourceJoint, surface_of
from twin.mesh import joined
from twin.scene import Mesh


@dataclass(frozen=True, eq=False)
class Group:
    """Bodies that move as one, the one with the joint first; `first` is None for what does not move."""

    first: SourceBody | None
    bodies: tuple[SourceBody, ...]

    @property
    def surfaces(self) -> list[Mesh]:
        """What is seen of it; if nothing is, what touches."""
        return _surfaces(self.bodies)

    def fixed_to(self, name: str) -> list[SourceBody]:
        """The body of that name and all that is fixed to it; what is fixed to the world alone is apart."""
        inside = {b.name: b for b in self.bodies if b.name != WORLD}
        top, found = name, {}
        while top in inside and inside[top].parent in inside:
            top = str(inside[top].parent)
        for body in inside.values():  # parents come first
            if body.name == top or body.parent in found:
                found[body.name] = body
        return list(found.values())


@dataclass(frozen=True, eq=False)
class Surroundings:
    """A part and what stands around it, in the file's world at its rest pose, without looks.

    part: with all that hangs on it. carrier: vertices (n, 3) m of what it hangs on, none of what hangs on the
    world. others: all but the part.
    """

    joint: SourceJoint
    part: Mesh
    carrier: Array
    others: Mesh

    def deeper(self, rest: float, position: float) -> float:
        """How much deeper (m) the part is in the others at a position of its joint than at `rest`."""
        joint = self.joint.from_rest
        part = self.part.transformed(joint.pose(rest - self.joint.rest))
        return deeper(part, self.others, joint, position - rest)

    def bulk(self, position: float) -> float:
        """Volume (m^3) of the convex hull of the part and what it hangs on; nan where that is the world."""
        part = self.part.transformed(self.joint.from_rest.pose(position - self.joint.rest))
        hull = hull_of(np.concatenate([part.vertices, self.carrier])) if len(self.carrier) else None
        return np.nan if hull is None else hull.volume


def groups_of(bodies: Sequence[SourceBody]) -> list[Group]:
    """What does not move, then one group for each joint, parents before their children."""
    home: dict[str, str | None] = {}
    members: dict[str | None, list[SourceBody]] = {None: []}
    for body in bodies:
        home[body.name] = body.name if body.joint is not None else home.get(body.parent or "")
        members.setdefault(home[body.name], []).append(body)
    return [Group(b[0] if name is not None else None, tuple(b)) for name, b in members.items()]


def around(groups: Sequence[Group], body: SourceBody) -> Surroundings:
    """The surroundings of the part that a body's joint moves; `groups` are all of the file."""
    assert body.joint is not None
    carried = {body.name}
    mine: list[Mesh] = []
    others: list[Mesh] = []
    for group in groups:
        if any(b.parent in carried for b in group.bodies):
            carried.update(b.name for b in group.bodies)
        with_it = group.first is not None and group.first.name in carried
        (mine if with_it else others).extend(Mesh(m.vertices, m.faces) for m in group.surfaces)
    held = [b for g in groups for b in g.fixed_to(body.parent or "")]
    carrier = np.concatenate([np.zeros((0, 3)), *(m.vertices for m in _surfaces(held))])
    return Surroundings(body.joint, joined(mine), carrier, joined(others))


def _surfaces(bodies: Sequence[SourceBody]) -> list[Mesh]:
    seen = [m for b in bodies for m in b.visual]
    return seen or [surface_of(c) for b in bodies for c in b.collision]
