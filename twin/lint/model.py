"""The one neutral description that all readers fill and all rules read.

It keeps what is *written*: a limit in radians where the format wants degrees stays in radians, an absolute
path stays absolute. Poses, axes, pivots and points are in the file's world at rest (every joint at zero),
metres; None where they can't be known.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from twin.geometry import Array

WORLD = "world"  # what does not move at all
Format = Literal["urdf", "mjcf", "usd"]
Kind = Literal["revolute", "continuous", "prismatic", "fixed", "free", "other"]
Severity = Literal["error", "warning"]


@dataclass(frozen=True, eq=False)
class FileMesh:
    """A triangle mesh as it lies in the file: `vertices` (N, 3), `faces` (M, 3)."""

    vertices: Array
    faces: NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Shape:
    """Geometry of a body. `points` (N, 3) span it in the world; `surface` is set for meshes that can be read,
    `problem` says why one can't. `approximation` is USD's token, empty when none is written, None in other
    formats. `scale` (3,) is what the scene does to it. `upright` (N, 3) are the points of a mesh whose file
    counts y upwards when a reader turns it to z, None for others."""

    element: str
    body: str
    role: Literal["collision", "visual"]
    kind: str
    points: Array | None = None
    surface: FileMesh | None = None
    problem: str = ""
    approximation: str | None = None
    scale: Array = field(default_factory=lambda: np.ones(3))
    upright: Array | None = None


@dataclass(frozen=True, eq=False)
class Body:
    """A rigid body. `mass`, `com`, `inertia` (3, 3 about the com, any axes) as written, None if not written.

    `inferred` names what the mass comes from if not written ("default density", "density"), else "".
    `weightless` says why its shapes weigh nothing. `scale` (3,) are the lengths of its axes in the world.
    """

    name: str
    element: str
    mass: float | None = None
    inertia: Array | None = None
    inferred: str = ""
    weightless: str = ""
    scale: Array = field(default_factory=lambda: np.ones(3))


@dataclass(frozen=True, eq=False)
class Joint:
    """A joint from `parent` to `child`. `lower` and `upper` as written, in `unit`; None when not written.
    `axis` (3,) as written; `axis_world`, `pivot_world` (3,) at rest. `gap` (m, rad) is how far apart the two
    bodies see the joint's frame (USD writes it twice). `missing` names fields that the format demands.
    `loop`: closes a loop on purpose. `implied`: not in the file: readers fix a URDF's root to the world."""

    name: str
    element: str
    kind: Kind
    parent: str
    child: str
    unit: Literal["rad", "deg", "m", ""] = ""
    lower: float | None = None
    upper: float | None = None
    axis: Array | None = None
    axis_world: Array | None = None
    pivot_world: Array | None = None
    gap: tuple[float, float] = (0.0, 0.0)
    missing: tuple[str, ...] = ()
    loop: bool = False
    implied: bool = False


@dataclass(frozen=True)
class Reference:
    """Another file that this one names. `path` is where it is looked for, None when that can't be told (a web
    address, a package that is not beside the file)."""

    element: str
    written: str
    path: Path | None


@dataclass(frozen=True)
class StageUnits:
    """What a USD stage says about its units; None where it says nothing. `others` are (layer, key, value) of
    the layers it is made of where they say something else: USD does not convert between them."""

    metres: float | None
    kilograms: float | None
    up: str | None
    others: tuple[tuple[str, str, str], ...] = ()


@dataclass(frozen=True)
class Fault:
    """What a rule found: where, the value, what is wrong with it and what to do."""

    severity: Severity
    element: str
    value: str
    problem: str
    remedy: str


@dataclass(frozen=True)
class Behaviour:
    """What MuJoCo said and did with the file; see twin.lint.simulate. `refused` is its reason not to load it,
    `skipped` ours not to ask. The lists hold faults."""

    refused: str = ""
    skipped: str = ""
    overlaps: tuple[Fault, ...] = ()
    stuck: tuple[Fault, ...] = ()
    drifts: tuple[Fault, ...] = ()


@dataclass(frozen=True, eq=False)
class LintModel:
    """A file as read. `names` are (kind, name, element): names must differ within a kind. `unread` are texts
    that should be numbers and are not: (element, text)."""

    path: Path
    format: Format
    bodies: tuple[Body, ...] = ()
    joints: tuple[Joint, ...] = ()
    shapes: tuple[Shape, ...] = ()
    references: tuple[Reference, ...] = ()
    names: tuple[tuple[str, str, str], ...] = ()
    unread: tuple[tuple[str, str], ...] = ()
    units: StageUnits | None = None
    refused: str = ""
    behaviour: Behaviour | None = None

    def body(self, name: str) -> Body | None:
        """The body of that name."""
        return next((b for b in self.bodies if b.name == name), None)

    def groups(self) -> dict[str, str]:
        """Body name -> representative of what is rigidly attached to it; WORLD for what can't move."""
        up: dict[str, str] = {b.name: b.name for b in self.bodies} | {WORLD: WORLD}

        def root(name: str) -> str:
            while up.setdefault(name, name) != name:
                name = up[name]
            return name

        for j in self.joints:
            if j.kind == "fixed":
                parent, child = root(j.parent), root(j.child)
                if parent != child:
                    up[parent if child == WORLD else child] = WORLD if child == WORLD else parent
        return {name: root(name) for name in up}

    def moving(self) -> Iterator[tuple[Joint, list[Body], list[Shape]]]:
        """Every movable joint with the bodies and shapes that move rigidly with its child."""
        group = self.groups()
        for j in self.joints:
            if j.kind == "fixed" or group.get(j.child, WORLD) == WORLD:
                continue
            mine = group[j.child]
            yield (
                j,
                [b for b in self.bodies if group[b.name] == mine],
                [s for s in self.shapes if group.get(s.body) == mine],
            )
