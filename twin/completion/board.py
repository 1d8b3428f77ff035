"""A board of a part or a carcass: a box in a frame of furniture, with the basis of its measures."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from twin import geometry as geo
from twin.completion.cloud import Cloud
from twin.geometry import Array
from twin.inferred import Basis, Inferred, box_mesh
from twin.scene import Box

# m by which boards are drawn inside their faces, behind the seen surface; a depth buffer resolves it at 3 m
INSET = 0.0003
_SURE = 0.01  # m: a seen surface that lies deeper in a board than noise says that the board is not there
_CONTRADICTED = 0.15  # share of a board's largest face that such a surface may have; chosen by us
_THINNEST = 0.003  # m
_EQUAL = 0.001  # m between the ends of equal boards


@dataclass(frozen=True, eq=False)
class Board:
    """A box from corner low (3,) to high (3,) m in a frame; role, basis and reason as of an InferredPiece."""

    name: str
    role: str
    low: Array
    high: Array
    basis: Basis
    reason: str

    @property
    def size(self) -> Array:
        """Full edge lengths (3,) m."""
        return self.high - self.low

    @property
    def real(self) -> bool:
        """Whether the box has volume."""
        return bool(np.all(self.size >= _THINNEST))

    def contradicted(self, cloud: Cloud) -> bool:
        """Whether seen surface runs through the board's inside."""
        deep = np.minimum(_SURE, 0.45 * self.size)
        inside = cloud.where(cloud.within(self.low + deep, self.high - deep))
        return inside.size > _CONTRADICTED * float(np.sort(self.size)[1:].prod())

    def box(self, T_world_frame: Array) -> Box:
        """As a shape in the world."""
        middle = geo.make_pose(translation=(self.low + self.high) / 2)
        return Box(T_world_frame @ middle, self.size)

    def piece(self, T_world_frame: Array, color: NDArray[np.uint8]) -> Inferred:
        """As an inferred piece in the world, its box the collision shape."""
        box = self.box(T_world_frame)
        drawn = box_mesh(box.T_world_box, np.maximum(box.size - 2 * INSET, _THINNEST / 2))
        return Inferred(self.name, self.role, drawn, self.basis, self.reason, (box,), color)


def distinct(boards: Iterable[Board]) -> list[Board]:
    """Boards of one frame without those that equal an earlier one, as both faces of a thin one do."""
    out: list[Board] = []
    for b in boards:
        ends = np.array([b.low, b.high])
        if all(np.abs(ends - [o.low, o.high]).max() > _EQUAL for o in out):
            out.append(b)
    return out
