"""The cabinets of the parts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from twin.completion.carcass import Carcass, find_carcass
from twin.completion.cloud import OUT, Cloud
from twin.completion.room import Bound, Front, FurnitureSplit
from twin.geometry import Array
from twin.scene import Mesh, Part, Prismatic

# Least cosine between the normals of a wall and a front in line. Chosen by us.
_ALIGNED = float(np.cos(np.radians(8.0)))
# m. Of two faces of a wall nearer than this the farther is the wall, the other is cladding.
_CLAD = 0.03


@dataclass(frozen=True, eq=False)
class Opening:
    """A front with the part that it belongs to, and the cabinet around it."""

    part: Part
    front: Front
    carcass: Carcass

    @property
    def inside(self) -> tuple[Array, Array]:
        """Low and high corner (3,) of the cabinet's inside, up to its front, in the front's frame."""
        return self.carcass.low, np.array([*self.carcass.high[:2], 0.0])


def openings(
    parts: Sequence[Part], fronts: Sequence[Front | None], mesh: Mesh, found: FurnitureSplit
) -> list[Opening]:
    """The cabinets of the parts that have a flat front."""
    out = []
    furniture = mesh.of(found.furniture)
    for part, front in zip(parts, fronts, strict=True):
        if front is None:
            continue
        cloud = Cloud.of(furniture, front.frame.T_world_frame)
        corners = front.leaf.corners.copy()
        # two doors wide at least
        if front.frame.kind == "sliding_door" and isinstance(part.joint, Prismatic):
            way = front.frame.T_world_frame[:3, :2].T @ part.joint.axis
            way = way * np.where(np.abs(way) > 0.5, np.maximum(front.leaf.size, part.joint.upper), 0.0)
            corners = np.stack(
                [np.minimum(corners[0], corners[0] + way), np.maximum(corners[1], corners[1] + way)]
            )
        wall = wall_behind(front, found.bounds)
        out.append(Opening(part, front, find_carcass(front, cloud, wall, corners, part.name)))
    return out


def wall_behind(front: Front, bounds: Sequence[Bound]) -> float | None:
    """Where (m along out, negative) a wall or the floor lies behind a front; None if none was seen.

    Behind cladding, such as tiles above a worktop, the furniture stands at the wall itself.
    """
    T = front.frame.T_world_frame
    found = [b.offset - float(b.normal @ T[:3, 3]) for b in bounds if b.normal @ T[:3, OUT] > _ALIGNED]
    behind = [h for h in found if h < -0.05]
    return min(h for h in behind if h > max(behind) - _CLAD) if behind else None
