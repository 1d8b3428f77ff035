"""The front of a part as one board: outline and thickness."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from twin.completion.board import Board
from twin.completion.cloud import OUT, SIDE, UP, Cloud, filled_share, layers, outline
from twin.geometry import Array
from twin.inferred import Basis

FRONT_THICKNESS = 0.018  # m, the usual thickness of chipboard (assets/materials.toml has 12 to 22 mm)
BENT = 0.005  # m: a fused surface bends away from its plane about one voxel before its edge
_DEEPEST = 0.06  # m, no front is thicker
_THINNEST = 0.006  # m
_BACK = 0.08  # share of the front whose back tells its thickness
_BOARDS = (0.012, 0.022)  # m, of fronts (assets/materials.toml)
# m by which a fused board may seem thicker or thinner than it is: more is no board of the usual thickness
_BLUR = 0.006
_AS_BOARDS = f"thickness assumed, {1000 * FRONT_THICKNESS:.0f} mm as boards have"
_RIM = 0.0006  # m^2 of rim that tell it
_NEAR_RIM = 0.015  # m
_FILLED = 0.45  # share of the rectangle that must be surface: what is less is no board
_ON_PLANE = 0.012  # m


@dataclass(frozen=True, eq=False)
class Leaf:
    """The front: corners (2, 2) in side and up, thickness m with its basis, and words for its source."""

    corners: Array
    thickness: float
    basis: Basis
    told: str

    @property
    def size(self) -> Array:
        """Width and height (2,) m."""
        return self.corners[1] - self.corners[0]

    def board(self, role: str) -> Board:
        """The front as a board whose outer face is the frame's plane."""
        low = np.array([*self.corners[0], -self.thickness])
        high = np.array([*self.corners[1], 0.0])
        return Board(role, role, low, high, self.basis, f"{role}: outline seen, {self.told}")


def find_leaf(cloud: Cloud) -> Leaf | None:
    """The front of a part in the plane out = 0; None if the surface there fills no rectangle."""
    found = [k for k in layers(cloud, OUT, 1, 0.002) if abs(k.offset) < _ON_PLANE]
    if not found:
        return None
    points = np.concatenate([k.cloud.points for k in found])[:, [SIDE, UP]]
    corners = outline(points)
    if corners is None or filled_share(points, corners) < _FILLED:
        return None
    corners = corners + np.array([[-BENT], [BENT]])
    thickness, basis, told = _thickness(cloud, corners)
    return Leaf(corners, thickness, basis, told)


def _thickness(cloud: Cloud, corners: Array) -> tuple[float, Basis, str]:
    low, high = np.array([*corners[0], -_DEEPEST]), np.array([*corners[1], -_THINNEST / 2])
    backs = layers(cloud.where(cloud.within(low, high)), OUT, -1, _BACK * float(np.prod(high[:2] - low[:2])))
    if backs:
        seen = max(_THINNEST, -backs[0].offset)
        if abs(seen - FRONT_THICKNESS) > _BLUR:
            return seen, "evidence", f"back seen {1000 * seen:.0f} mm behind"
        t = (seen + FRONT_THICKNESS) / 2  # the faces of a fused board push each other apart
        return t, "evidence", f"back seen {1000 * seen:.0f} mm behind, taken as {1000 * t:.0f} mm"
    depths = []
    for axis in (SIDE, UP):
        for sign, edge in ((-1, corners[0, axis]), (1, corners[1, axis])):
            near = cloud.facing(axis, sign) & (np.abs(cloud.points[:, axis] - edge) < _NEAR_RIM)
            near &= (cloud.points[:, OUT] > -_DEEPEST) & (cloud.points[:, OUT] < 0.003)
            rim = -cloud.points[near, OUT]
            if len(rim) * cloud.area > _RIM:
                depths.append((len(rim), 2.0 * float(np.median(rim))))  # a rim is seen evenly over its depth
    if depths:
        rim = max(depths)[1] - BENT
        if not _BOARDS[0] <= rim <= _BOARDS[1]:  # a skirt of noise
            return FRONT_THICKNESS, "evidence", f"rim seen, {_AS_BOARDS}"
        t = (
            rim + FRONT_THICKNESS
        ) / 2  # a rim is hardly wider than what a fused surface resolves: boards' usual one counts as much
        return t, "evidence", f"rim seen about {1000 * rim:.0f} mm deep, taken as {1000 * t:.0f} mm"
    return FRONT_THICKNESS, "assumed", _AS_BOARDS
