"""Where a pedestal can stand."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from robots.config import PlanConfig
from twin.geometry import Array
from twin.mesh import sample_surface
from twin.scene import Mesh

_POINTS = 80_000  # surface samples of the static scene
_ROOM = 0.03  # m kept around the pedestal
_SHOULDER = 0.5  # m above the base that must be free


class Ground:
    """What a pedestal can stand on."""

    def __init__(self, static: Mesh, footprint: float, floor: float) -> None:
        points, _ = sample_surface(static, _POINTS, np.random.default_rng(0))
        self.floor = floor
        self._tree = cKDTree(points[:, :2]) if len(points) else None
        self._heights, self._footprint = points[:, 2], footprint
        self._expected = _POINTS / max(static.area, 1e-9) * np.pi * footprint**2

    def supports(self, poses: Array, handle: float, config: PlanConfig) -> Array:
        """Height (B,) of what a pedestal under each pose stands on: floor or level surface; or NaN.

        Nothing may be above the support within the footprint up to the shoulder, nor up to the handle: a base
        under a table or inside a cupboard is shut in. Poses beyond the wanted number are left out (NaN).
        """
        if self._tree is None:
            return np.full(len(poses), self.floor)
        out, found = np.full(len(poses), np.nan), 0
        for k, pose in enumerate(poses):
            near = self._tree.query_ball_point(pose[:2, 3], self._footprint + _ROOM)
            z, base = self._heights[near], pose[2, 3]
            z = z[z > self.floor + 0.05]
            if np.any((z > base) & (z < max(base + _SHOULDER, handle))):
                continue
            top = z[z <= base].max(initial=self.floor)
            level = top == self.floor or np.count_nonzero(np.abs(z - top) < 0.015) > 0.7 * self._expected
            if level and config.pedestal[0] <= base - top <= config.pedestal[1]:
                out[k], found = top, found + 1
                if found == config.candidates:
                    break
        return out
