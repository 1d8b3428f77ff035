"""Whether two interactions handled the same part: equal joints, and surfaces that lie on each other."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from recon.interaction.parts.moving_part import MovingPart
from recon.recording import Recording
from twin import geometry as geo
from twin.geometry import Array
from twin.joint import Joint
from twin.runs.threads import each
from twin.scene import Revolute, Trajectory
from twin.voxels import voxel_centres, voxel_keys

# rad and m by which the joints of one part may differ in two interactions: five times what is found of right
# ones. Neighbours in a row lie farther apart.
_AXIS = float(np.radians(10.0))
_PIVOT_M = 0.06
# m; side of the cells of a part's surface, and how far apart surfaces of one part may lie: drift of the
# cameras over a walk.
_CELL_M = 0.015
_NEAR_M = 0.03
# Share of the smaller surface that lies on the other one, for both to be one part's.
OVERLAP = 0.6
# Of the best overlap that the state in which the part was left must reach: then nobody moved it meanwhile.
_AS_LEFT = 0.85
# Of the best overlap: of such states that with the nearest surfaces is taken.
_ALIKE = 0.95
# Steps of the states that are tried, rad and m.
STEP = {"revolute": float(np.radians(2.0)), "prismatic": 0.01}
# Frames whose pixels make a part's surface, and labelled pixels left out between two.
_FRAMES = 12
_EVERY = 3


@dataclass(frozen=True, eq=False)
class Surface:
    """Cells (n, 3) m of a part's surface at state 0."""

    points: Array

    @cached_property
    def tree(self) -> cKDTree:
        """The points, to ask for the nearest one."""
        return cKDTree(self.points)

    def lies_on(self, other: Surface, pose: Array) -> tuple[float, float]:
        """Share of the smaller one that lies on the other, this one moved by a pose (4, 4), and how far its
        points lie off, m, at most `_NEAR_M` each."""
        if not len(self.points) or not len(other.points):
            return 0.0, _NEAR_M
        there, back = geo.transform(pose, self.points), geo.transform(geo.invert_pose(pose), other.points)
        off = [
            tree.query(points, distance_upper_bound=_NEAR_M)[0]  # farther ones are infinitely far
            for tree, points in ((other.tree, there), (self.tree, back))
        ]
        share, away = max((float((d < _NEAR_M).mean()), -float(np.minimum(d, _NEAR_M).mean())) for d in off)
        return share, -away

    def covered_by(self, other: Surface, pose: Array) -> float:
        """Share of this surface, moved by a pose (4, 4), that lies on the other one."""
        if not len(self.points) or not len(other.points):
            return 0.0
        away = other.tree.query(geo.transform(pose, self.points), distance_upper_bound=_NEAR_M)[0]
        return float((away < _NEAR_M).mean())


@dataclass(frozen=True)
class Match:
    """A part found again: its state there is sign * (state here) + offset; `as_left`: as it was left."""

    sign: float
    offset: float
    as_left: bool


def surface_of(
    part: MovingPart, recording: Recording, cameras: Trajectory, labels: Mapping[int, NDArray[np.uint8]]
) -> Surface:
    """The surface that the labels of an interaction show of a part."""
    shown = [f for f in sorted(labels) if part.state(f) is not None and bool((labels[f] == part.id).any())]
    picked = np.unique(np.linspace(0, len(shown) - 1, min(_FRAMES, len(shown))).round().astype(int))
    clouds = [np.zeros((0, 3))]
    for frame in (shown[k] for k in picked):
        depth = recording.depth(frame)[::_EVERY, ::_EVERY]
        y, x = np.nonzero((labels[frame][::_EVERY, ::_EVERY] == part.id) & (depth > 0))
        pixels = _EVERY * np.stack([x, y], axis=-1).astype(float)
        points = recording.intrinsics.backproject(pixels, depth[y, x].astype(float))
        pose, camera = part.pose(frame), cameras.pose(frame)
        if pose is not None and camera is not None:
            clouds.append(geo.transform(geo.invert_pose(pose) @ camera, points))
    keys, count = np.unique(
        voxel_keys(np.concatenate(clouds).astype(np.float32), _CELL_M), return_counts=True
    )
    return Surface(np.asarray(voxel_centres(keys[count > 1], _CELL_M), float))


def match(known: Joint, surface: Surface, left: float, other: Joint, its: Surface) -> Match | None:
    """Whether a part with a joint and a surface is a known one, and in which state it was at its state 0.

    left: state in which the known part was left.
    """
    if known.kind != other.kind or geo.line_angle(known.axis, other.axis) > _AXIS:
        return None
    if isinstance(known, Revolute) and isinstance(other, Revolute):
        centre = surface.points.mean(axis=0) if len(surface.points) else known.pivot
        feet = [geo.nearest_point_on_line(centre, j.pivot, j.axis) for j in (known, other)]
        if np.linalg.norm(feet[0] - feet[1]) > _PIVOT_M:
            return None
    sign = float(np.sign(known.axis @ other.axis))
    span = max(other.upper - other.lower, known.upper - known.lower)
    step = STEP[known.kind]
    tried = np.arange(known.lower - span, known.upper + span + step, step)
    as_left, _ = surface.lies_on(its, known.pose(left))
    seen = np.array(list(each(lambda s: surface.lies_on(its, known.pose(float(s))), tried.tolist())))
    shares, away = seen.T
    best = float(shares.max())
    if max(as_left, best) < OVERLAP:
        return None
    if as_left >= _AS_LEFT * best:
        return Match(sign, left, True)
    alike = np.flatnonzero(shares >= _ALIKE * best)
    return Match(sign, float(tried[alike[np.argmin(away[alike])]]), False)
