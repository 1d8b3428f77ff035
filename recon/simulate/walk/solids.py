"""Many boxes at once: where they are, and whether they meet."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from twin.geometry import Array
from twin.scene import Box

# Signs (8, 3) of a box's corners
_SIGNS = np.array(list(product((-1.0, 1.0), repeat=3)))
# Length of a cross product below which two axes count as parallel
_PARALLEL = 1e-6


@dataclass(frozen=True)
class Solids:
    """n boxes: `centres` (n, 3) m, `axes` (n, 3, 3) with unit columns, `halves` (n, 3) m."""

    centres: Array
    axes: Array
    halves: Array

    @staticmethod
    def of(boxes: Iterable[Box], pose: Array | None = None) -> Solids:
        """The boxes moved by `pose` (4, 4)."""
        found = list(boxes)
        poses = np.array([b.T_world_box for b in found]).reshape(-1, 4, 4)
        if pose is not None:
            poses = pose @ poses
        return Solids(poses[:, :3, 3], poses[:, :3, :3], np.array([b.size / 2 for b in found]).reshape(-1, 3))

    @staticmethod
    def joined(parts: Sequence[Solids]) -> Solids:
        """All of them."""
        if not parts:
            return Solids(np.zeros((0, 3)), np.zeros((0, 3, 3)), np.zeros((0, 3)))
        return Solids(
            *(np.concatenate([getattr(p, k) for p in parts]) for k in ("centres", "axes", "halves"))
        )

    def moved(self, pose: Array) -> Solids:
        """The same, moved by `pose` (4, 4)."""
        turn = pose[:3, :3]
        return Solids(self.centres @ turn.T + pose[:3, 3], turn @ self.axes, self.halves)

    @property
    def corners(self) -> Array:
        """The corners (n, 8, 3)."""
        local = _SIGNS * self.halves[:, None]
        return self.centres[:, None] + np.einsum("nij,nkj->nki", self.axes, local)

    @property
    def bounds(self) -> tuple[Array, Array]:
        """Smallest and largest corner (3,) of all."""
        every = self.corners.reshape(-1, 3)
        return every.min(axis=0), every.max(axis=0)


def meets(one: Solids, other: Solids, slack: float) -> bool:
    """Whether any box of one overlaps any of the other by more than `slack` m along every direction that
    could part them (separating axes of two boxes)."""
    if not len(one.centres) or not len(other.centres):
        return False
    i, j = _near(one, other)
    if not len(i):
        return False
    a, b = one.axes[i], other.axes[j]
    gap = other.centres[j] - one.centres[i]
    crossed = np.cross(a.transpose(0, 2, 1)[:, :, None], b.transpose(0, 2, 1)[:, None])
    directions = np.concatenate(
        [a.transpose(0, 2, 1), b.transpose(0, 2, 1), crossed.reshape(len(i), 9, 3)], axis=1
    )
    length = np.linalg.norm(directions, axis=2)
    unit = directions / np.maximum(length, _PARALLEL)[..., None]
    reach = np.zeros(length.shape)
    for axes, halves in ((a, one.halves[i]), (b, other.halves[j])):
        reach += np.einsum("nkd,nd->nk", np.abs(np.einsum("nkc,ncd->nkd", unit, axes)), halves)
    depth = reach - np.abs(np.einsum("nkc,nc->nk", unit, gap))
    depth[length < _PARALLEL] = np.inf
    return bool(np.any(np.all(depth > slack, axis=1)))


def _near(one: Solids, other: Solids) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Pairs of boxes whose balls meet."""
    radius = np.linalg.norm(one.halves, axis=1)[:, None] + np.linalg.norm(other.halves, axis=1)
    apart = np.linalg.norm(one.centres[:, None] - other.centres, axis=2)
    i, j = np.nonzero(apart < radius)
    return i.astype(np.int64), j.astype(np.int64)
