"""What no camera saw of a body: closed pieces, each with its reason and with what bounds it.

Numpy only; types check their own laws. `twin.completion` infers, `twin.exporters` writes one or both layers.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from twin.errors import SceneError
from twin.geometry import Array
from twin.names import require_legal
from twin.quantities import Described, frozen_array, set_field
from twin.shapes import Box, Collision, Mesh

Basis = Literal["evidence", "assumed"]
BASES: tuple[Basis, ...] = get_args(Basis)
# of what infers: raised whenever the same twin may get other pieces, so that a twin on disk gets them anew
VERSION = 12
PLAIN = (180, 180, 180)  # sRGB of what nobody saw the colour of


@dataclass(frozen=True, eq=False, repr=False)
class Inferred(Described):
    """A piece of a body that no camera saw whole, in the world at state 0.

    name: unique on its body. role: what it is, in one word: front, floor, side, back, handle. mesh: closed.
    basis: "evidence" where what was seen bounds it on every side that matters, "assumed" where nothing does.
    reason: one line for people. color (3,) sRGB: plain. shapes: its collision shapes.
    """

    name: str
    role: str
    mesh: Mesh
    basis: Basis
    reason: str
    shapes: tuple[Collision, ...] = ()
    color: NDArray[np.uint8] = field(default_factory=lambda: np.array(PLAIN, np.uint8))

    def __post_init__(self) -> None:
        require_legal(self.name)
        if not self.role.isidentifier():
            raise SceneError(f"the role of an inferred piece is one word, got {self.role!r}")
        if self.basis not in BASES:
            raise SceneError(f"an inferred piece rests on {' or '.join(BASES)}, got {self.basis!r}")
        if not self.reason.strip() or not self.reason.isprintable():
            raise SceneError(f"the reason of an inferred piece must be one line of text, got {self.reason!r}")
        set_field(self, "color", frozen_array(self.color, (3,), "colour", np.uint8))


@dataclass(frozen=True, eq=False, repr=False)
class Interior(Described):
    """Free space in furniture where things are kept: a box in the world at state 0, moving with its body."""

    name: str
    box: Box

    def __post_init__(self) -> None:
        require_legal(self.name)


@dataclass(frozen=True, eq=False, repr=False)
class Completion(Described):
    """The inferred layer of one body, beside its seen mesh, which stays as it is.

    shown: the seen triangles that are drawn beside the pieces: all but shreds and what a piece stands in for,
    as a blurred handle. pieces: what is inferred. collision: shapes of what is seen and lies in no piece.
    interiors: free space inside. version: of what inferred it. kind: what a moving part is, in one word as
    drawer, sliding_door, door, flap, lid; empty where nobody knows. room: of the static scene, the seen
    triangles that belong to no furniture of the parts; room_collision: their shapes. limits: of a part, the
    ends of its joint's range that it was inferred for; None of the static scene.
    """

    shown: Mesh
    pieces: tuple[Inferred, ...] = ()
    collision: tuple[Collision, ...] = ()
    interiors: tuple[Interior, ...] = ()
    room: Mesh | None = None
    room_collision: tuple[Collision, ...] = ()
    version: int = VERSION
    kind: str = ""
    limits: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        if self.kind and not self.kind.isidentifier():
            raise SceneError(f"what a part is is one word, got {self.kind!r}")
        for what in ("pieces", "interiors"):
            names = [p.name for p in getattr(self, what)]
            if len({n.lower() for n in names}) != len(names):
                raise SceneError(f"{what} of one body must have different names, got {names}")

    @property
    def shapes(self) -> tuple[Collision, ...]:
        """All collision shapes of the body: those of its pieces, and of what lies in none."""
        return (*(s for p in self.pieces for s in p.shapes), *self.collision)

    @property
    def assumed(self) -> tuple[Inferred, ...]:
        """The pieces that nothing bounds."""
        return tuple(p for p in self.pieces if p.basis == "assumed")


def box_mesh(T_world_box: Array, size: Array, color: NDArray[np.uint8] | None = None) -> Mesh:
    """A box (4, 4), full size (3,) m, as a closed mesh of twelve outward triangles; vertex colour (3,)."""
    box = Box(T_world_box, size)
    faces = [
        (0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5), (0, 4, 5), (0, 5, 1), (2, 3, 7), (2, 7, 6), (0, 2, 6), (0, 6, 4), (1, 5, 7), (1, 7, 3),
    ]  # fmt: skip
    colors = None if color is None else np.tile(np.asarray(color, np.uint8), (8, 1))
    return Mesh(box.corners, np.array(faces, np.int32), colors)
