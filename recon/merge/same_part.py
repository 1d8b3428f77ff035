"""Whether two interactions handled the same part: equal joints, and surfaces that lie on each other."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from recon.dense import looks
from recon.interaction.parts.moving_part import MovingPart
from recon.recording import Recording
from recon.recording.intrinsics import Intrinsics
from twin import geometry as geo
from twin.geometry import Array
from twin.joint import Joint
from twin.runs.threads import each
from twin.scene import HAND_LABEL, UNKNOWN_LABEL, Revolute, Trajectory
from twin.voxels import voxel_centres, voxel_keys

# rad and m by which the joints of one part may differ in two interactions: five times what is found of right
# ones. Neighbours in a row lie farther apart.
_AXIS = float(np.radians(10.0))
_PIVOT_M = 0.06
# m; side of the cells of a part's surface, and how far apart surfaces of one part may lie: drift of the
# cameras over a walk.
CELL_M = 0.015
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
_FRAMES = 16
_EVERY = 3
# m by which depth may differ from a cell's middle that a frame shows. Chosen by us.
_VOTE_M = 0.02


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
    """The surface that the labels of an interaction show of a part.

    A cell is of it that more frames show there, labelled as it, than show it labelled otherwise or see
    through it. One frame's word counts where no other tells.
    """
    shown = [f for f in sorted(labels) if part.state(f) is not None and bool((labels[f] == part.id).any())]
    picked = np.unique(np.linspace(0, len(shown) - 1, min(_FRAMES, len(shown))).round().astype(int))
    views = [
        _View(recording.depth(f), labels[f], geo.invert_pose(T) @ pose)
        for f in (shown[k] for k in picked)
        if (pose := part.pose(f)) is not None and (T := cameras.pose(f)) is not None
    ]
    camera = recording.intrinsics
    clouds = [v.points(camera, part.id) for v in views]
    keys = np.unique(voxel_keys(np.concatenate([np.zeros((0, 3)), *clouds]).astype(np.float32), CELL_M))
    cells = np.asarray(voxel_centres(keys, CELL_M), float)
    votes = sum((v.votes(cells, camera, part.id) for v in views), np.zeros(len(cells), np.int64))
    return Surface(cells[votes > 0])


@dataclass(frozen=True, eq=False)
class _View:
    """Depth (H, W) m and labels (H, W) of a frame, and the pose (4, 4) of a part at state 0 in its camera."""

    depth: NDArray[np.float32]
    labels: NDArray[np.uint8]
    T_cam_part: Array

    def points(self, camera: Intrinsics, part: int) -> Array:
        """Points (n, 3) of the pixels that are labelled as the part, at its state 0."""
        depth = self.depth[::_EVERY, ::_EVERY]
        y, x = np.nonzero((self.labels[::_EVERY, ::_EVERY] == part) & (depth > 0))
        pixels = _EVERY * np.stack([x, y], axis=-1).astype(float)
        points = camera.backproject(pixels, depth[y, x].astype(float))
        return geo.transform(geo.invert_pose(self.T_cam_part), points)

    def votes(self, cells: Array, camera: Intrinsics, part: int) -> NDArray[np.int64]:
        """For each of cells (n, 3) 1 where it is seen and labelled as the part, -1 where it is labelled
        otherwise or seen through, 0 where nothing tells."""
        depth = np.ascontiguousarray(self.depth, np.float32)
        lens = camera.fx, camera.fy, camera.cx, camera.cy
        seen = looks.look(cells, self.T_cam_part, depth, *lens, _VOTE_M, 0.0)
        ahead = geo.transform(self.T_cam_part, cells)
        at = np.rint(camera.project(ahead)).astype(int) if len(cells) else np.zeros((0, 2), int)
        x, y = np.clip(at[:, 0], 0, camera.width - 1), np.clip(at[:, 1], 0, camera.height - 1)
        label = self.labels[y, x]
        told = np.where(label == part, 1, np.where(np.isin(label, (UNKNOWN_LABEL, HAND_LABEL)), 0, -1))
        return np.where(seen == looks.SAME, told, np.where(seen == looks.THROUGH, -1, 0))


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
