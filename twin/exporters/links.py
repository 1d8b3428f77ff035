"""Links, joints and visuals: the types of the one intermediate model that all writers read."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from twin.geometry import Array
from twin.scene import Box, Collision, Mesh
from twin.verdict import Verdict


@dataclass(frozen=True, eq=False)
class TreeCatch:
    """What holds the closed part beside friction.

    Attributes:
        force: along the joint, N or N m.
        width: from the closed state, m or rad, in which it acts.
        place: (3,) m in the link's frame, of a magnet that would do it.
        sources: of force and width.
    """

    force: float
    width: float
    place: Array
    sources: tuple[str, str]


@dataclass(frozen=True, eq=False)
class TreeJoint:
    """Joint of a link to its parent, at the link's origin. Axis (3,) unit, limits m or rad, SI for the rest.

    holds: its friction stands for what held the part at rest, and must not creep. catch: None without one.
    times, states (n,): s from the recording's first camera, and the states recorded there.
    """

    name: str
    kind: Literal["revolute", "prismatic"]
    axis: Array
    lower: float
    upper: float
    damping: float
    frictionloss: float
    armature: float
    holds: bool
    catch: TreeCatch | None = None
    times: Array = field(default_factory=lambda: np.zeros(0))
    states: Array = field(default_factory=lambda: np.zeros(0))

    @property
    def caught(self) -> str:
        """What the catch does, in words; empty without one."""
        if self.catch is None:
            return ""
        force, width = ("N m", "rad") if self.kind == "revolute" else ("N", "m")
        return f"a catch holds {self.catch.force:.4g} {force} within {self.catch.width:.4g} {width} of closed ({self.catch.sources[0]})"


@dataclass(frozen=True, eq=False)
class Visual:
    """A visual of a link, in its frame: `<link>_visual`, seen, or `<link>_inferred_<piece>`.

    basis: "seen", or what an inferred piece rests on; role and reason as of that piece. color: (r, g, b) in
    0..1 of a piece, which is plain; None where the mesh has its own.
    """

    name: str
    mesh: Mesh
    basis: Literal["seen", "evidence", "assumed"] = "seen"
    role: str = "part"
    reason: str = ""
    color: tuple[float, float, float] | None = None


@dataclass(frozen=True, eq=False)
class Region:
    """Free space inside furniture: a box in its link's frame."""

    name: str
    box: Box


@dataclass(frozen=True, eq=False)
class Link:
    """One rigid body; everything is in the link's frame.

    parent: name of the parent link, None of a static one. offset (3,): origin in the parent's frame. shapes:
    name -> collision shape. mass in kg, inertia (3, 3) about com (3,). grasp (4, 4): frame of the contact
    path, columns as in ContactPath, and the width (m) of what is held there. kind: what it is, in one word.
    """

    name: str
    parent: str | None
    offset: Array
    visuals: tuple[Visual, ...]
    shapes: Mapping[str, Collision]
    friction: float
    mass: float
    com: Array
    inertia: Array
    joint: TreeJoint | None = None
    grasp: Array | None = None
    grasp_width: float = 0.0
    regions: tuple[Region, ...] = ()
    kind: str = ""

    @property
    def collision(self) -> tuple[Collision, ...]:
        """The collision shapes."""
        return tuple(self.shapes.values())

    @property
    def drawn(self) -> Array:
        """Vertices (n, 3) m of all that is drawn."""
        return np.concatenate([v.mesh.vertices for v in self.visuals]) if self.visuals else np.zeros((0, 3))


@dataclass(frozen=True, eq=False)
class Tree:
    """Links in depth-first order, the root first; source names what the model was made from.

    verdict: on the twin, or None; told: its line, or why there is none. whole: with the inferred layer.
    filtered: pairs of links that don't collide, each part and its parent among them. meeting: pairs of links
    whose shapes overlap while a part opens, with the deepest overlap (m); filtered ones too.
    """

    name: str
    links: tuple[Link, ...]
    source: str = "twin.json"
    verdict: Verdict | None = None
    told: str = ""
    whole: bool = False
    filtered: tuple[tuple[str, str], ...] = ()
    meeting: Mapping[tuple[str, str], float] = field(default_factory=dict)

    @property
    def root(self) -> Link:
        return self.links[0]

    @property
    def standing(self) -> list[Link]:
        """The links that stand still: the root, and the room where it is apart."""
        return [k for k in self.links if k.parent is None]

    def children(self, name: str) -> list[Link]:
        return [k for k in self.links if k.parent == name]

    @property
    def moving(self) -> list[Link]:
        return [k for k in self.links if k.joint is not None]


def spawn(region: Region) -> Array:
    """Where a thing is put down, in a region's link frame (3,): its floor's middle. Axes are the world's."""
    corners = region.box.corners
    return np.array([*corners[:, :2].mean(axis=0), corners[:, 2].min()])


def clear_of_each_other(tree: Tree) -> str:
    """Whether the collision shapes of the links keep clear of each other while a part opens, and which don't;
    a part and the part that carries it are not looked at."""
    moving = {k.name for k in tree.moving}
    carried = [
        f"{k.name} may overlap {k.parent}, which carries it" for k in tree.moving if k.parent in moving
    ]
    if not tree.meeting:
        apart = f", but {' and '.join(carried)}" if carried else ""
        return f"the collision shapes keep clear of each other{apart}"
    pairs = [f"{a} and {b} (by up to {1e3 * d:.1f} mm)" for (a, b), d in tree.meeting.items()]
    return f"these collision shapes overlap while a part opens: {', '.join(pairs)}"


def catches_lost(tree: Tree) -> list[str]:
    """What a format that has no catches loses of them, a text for each."""
    caught = [k.joint for k in tree.moving if k.joint is not None and k.joint.catch is not None]
    return [f"{j.name}: {j.caught}: written, not simulated" for j in caught]


def numbers(values: object) -> str:
    """Numbers for a text format, with as many digits as it takes to read back the same double."""
    return " ".join(repr(float(v) + 0.0) for v in np.asarray(values, dtype=np.float64).ravel())
