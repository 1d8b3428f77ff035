"""Which of the static scene is the furniture of the moving parts, and which the room around it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from twin import geometry as geo
from twin.completion.cloud import FACING, OUT, Cloud, layers
from twin.completion.frame import PartFrame
from twin.completion.leaf import Leaf
from twin.geometry import Array
from twin.scene import Mesh
from twin.voxels import voxel_keys, voxel_pieces

_BEHIND = 0.03  # share of the scene that may lie behind a wall or below a floor: noise, a doorway
_OFF = 0.04  # m behind it
_ON = 0.025  # m within which surface is the wall's
_WALL = 0.15  # m^2 of it
_YAW = np.radians(5.0)  # bins in which walls are looked for
_YAW_SHARE = 0.04  # of the upright surface that faces one way
_MOST_YAWS = 8
_CELL = 0.025  # m: what is nearer than one to two of these belongs together
_AROUND = 0.06  # m around a front where its furniture begins
_DEEP = 1.0  # m behind a front
_BEFORE = 0.03  # m before it
_PLINTH = 0.2  # m above the floor, the highest plinth
# share of a piece that lies under the furniture; a picture cuts off more of that than of a plinth
_MOSTLY = 0.5
_WITHIN = 0.02  # m inside a front's edges: what is seen behind there is the furniture's inside


@dataclass(frozen=True, eq=False)
class Front:
    """A part's frame and front."""

    frame: PartFrame
    leaf: Leaf

    def local(self, points: Array) -> Array:
        """World points (n, 3) in the frame."""
        return geo.transform(geo.invert_pose(self.frame.T_world_frame), points)

    def behind(self, points: Array, margin: float, before: float = 0.0) -> NDArray[np.bool_]:
        """Which world points (n, 3) lie behind the front, up to `margin` m beside, `before` m before it."""
        p = self.local(points)
        corners = self.leaf.corners + np.array([[-margin], [margin]])
        inside = geo.every((p[:, :2] > corners[0]) & (p[:, :2] < corners[1]))
        return np.asarray(inside & (p[:, OUT] < before) & (p[:, OUT] > -_DEEP))


@dataclass(frozen=True, eq=False)
class Bound:
    """A wall or the floor: unit normal (3,) into the room, normal @ x == offset on it."""

    normal: Array
    offset: float


@dataclass(frozen=True, eq=False)
class FurnitureSplit:
    """The static scene's triangles (F,) that are furniture, and the room's bounds, a seen floor first."""

    furniture: NDArray[np.bool_]
    bounds: tuple[Bound, ...]
    floor: Bound | None


def split_furniture(mesh: Mesh, fronts: Sequence[Front]) -> FurnitureSplit:
    """Furniture is what hangs together with the surroundings of the fronts, less floor and walls.

    A wall is a large upright face with next to nothing behind, a floor a level one with nothing below.
    """
    corners = mesh.vertices[mesh.faces]
    normals, _ = geo.triangle_normals(corners)
    middles = corners.mean(axis=1)
    if not len(middles):
        return FurnitureSplit(np.zeros(0, bool), (), None)
    found = list(_bounds(mesh))
    floor = next((b for b in found if b.normal[2] > FACING), None)
    inside = np.zeros(len(middles), bool)
    for f in fronts:
        inside |= f.behind(middles, -_WITHIN)
    of_room = np.zeros(len(middles), bool)
    for b in found:
        of_room |= (np.abs(middles @ b.normal - b.offset) < _ON) & (normals @ b.normal > 0.7)
    left = np.flatnonzero(~of_room | inside)
    chosen = np.zeros(len(middles), bool)
    if len(left):
        keys, cell = np.unique(voxel_keys(middles[left].astype(np.float32), _CELL), return_inverse=True)
        piece = voxel_pieces(keys)[cell]
        near = np.zeros(len(left), bool)
        for f in fronts:
            near |= f.behind(middles[left], _AROUND, _BEFORE)
        chosen[left] = np.isin(piece, np.unique(piece[near]))
        if floor is not None and fronts and chosen.any():
            low = _below(fronts[0], floor, middles[chosen | inside], middles[left])
            share = np.bincount(piece, low) / np.maximum(np.bincount(piece), 1)
            chosen[left] |= (share > _MOSTLY)[piece]
    return FurnitureSplit(chosen | inside, tuple(found), floor)


def _below(front: Front, floor: Bound, furniture: Array, points: Array) -> NDArray[np.bool_]:
    """Which points (n, 3) are low under the furniture (m, 3): a plinth, or legs that seem to hang loose."""
    ours, theirs = front.local(furniture), front.local(points)
    low, high = np.quantile(ours, 0.01, axis=0) - _AROUND, np.quantile(ours, 0.99, axis=0) + _AROUND
    axes = [0, 1, 2]
    axes.remove(int(np.argmax(np.abs(front.frame.T_world_frame[2, :3]))))  # the upright one
    above = points @ floor.normal - floor.offset
    return np.asarray(
        (above < _PLINTH) & geo.every((theirs[:, axes] > low[axes]) & (theirs[:, axes] < high[axes]))
    )


def _bounds(mesh: Mesh) -> Iterator[Bound]:
    """Floor and walls."""
    for n in ([0.0, 0.0, 1.0], *_upright(mesh)):
        normal = np.asarray(n)
        cloud = Cloud.of(mesh, geo.make_pose(geo.orthogonal_basis(normal)))
        along = cloud.points[:, OUT]
        for layer in sorted(layers(cloud, OUT, 1, _WALL), key=lambda k: k.offset)[:2]:
            if np.mean(along < layer.offset - _OFF) < _BEHIND:
                yield Bound(normal, layer.offset)


def _upright(mesh: Mesh) -> list[Array]:
    """Level directions (3,) that much of the upright surface faces, the most first."""
    normals, areas = geo.triangle_normals(mesh.vertices[mesh.faces])
    upright = np.abs(normals[:, 2]) < 0.3
    if not upright.any():
        return []
    yaw = np.arctan2(normals[upright, 1], normals[upright, 0])
    weight = areas[upright]
    bins = np.linspace(-np.pi, np.pi, round(2 * np.pi / _YAW) + 1)
    held = np.histogram(yaw, bins, weights=weight)[0]
    smooth = held + np.roll(held, 1) + np.roll(held, -1)
    out: list[Array] = []
    for k in np.argsort(-smooth, kind="stable"):
        if smooth[k] < _YAW_SHARE * weight.sum() or len(out) == _MOST_YAWS:
            break
        at = (bins[k] + bins[k + 1]) / 2
        near = np.abs((yaw - at + np.pi) % (2 * np.pi) - np.pi) < 2 * _YAW
        mean = np.array(
            [(weight[near] * np.cos(yaw[near])).sum(), (weight[near] * np.sin(yaw[near])).sum(), 0.0]
        )
        n = geo.unit(mean)
        if all(n @ other < FACING for other in out):
            out.append(n)
    return out
