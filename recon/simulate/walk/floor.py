"""The floor as a grid: where a person can stand, and ways round the furniture and what stands open."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from scipy.ndimage import distance_transform_edt, gaussian_filter1d, map_coordinates
from skimage.graph import route_through_array

from recon.simulate.walk.solids import Solids
from twin.geometry import Array

# m of a cell's side
CELL = 0.04
# m that a walking person's middle keeps from what is in the way, where there is room
BODY = 0.30
# m less than which nobody squeezes through
SQUEEZE = 0.17
# m from which on more room makes no way better
_WIDE = 0.7
# m over the floor above which a box is in nobody's way
_HEADROOM = 1.9
# m between the points of a way, and along it over which its corners are rounded
_STEP, _ROUND = 0.03, 0.16


@dataclass(frozen=True)
class Floor:
    """Metres `clear` (X, Y) from each cell to the nearest obstacle, and the grid's corner `low` (2,)."""

    clear: Array
    low: Array

    @staticmethod
    def of(low: Array, high: Array, obstacles: Solids) -> Floor:
        """The floor between a room's inner corners (3,) with boxes on it."""
        shape = np.ceil((high[:2] - low[:2]) / CELL).astype(int)
        taken = np.zeros((shape[1], shape[0]), np.uint8)
        corners = obstacles.corners
        for box in corners[corners[:, :, 2].min(axis=1) < _HEADROOM]:
            spots = np.round((box[:, :2] - low[:2]) / CELL - 0.5).astype(np.int32)
            cv2.fillConvexPoly(taken, cv2.convexHull(spots), (1.0,))
        walled = np.pad(taken.T, 1, constant_values=1)
        clear = CELL * np.asarray(distance_transform_edt(walled == 0))[1:-1, 1:-1]
        return Floor(clear, low[:2].copy())

    def clearance(self, places: Array) -> Array:
        """Metres (n,) from places (n, 2) to the nearest obstacle; 0 outside."""
        at = ((places - self.low) / CELL - 0.5).T
        return np.asarray(map_coordinates(self.clear, at, order=1, mode="constant", cval=0.0))

    def way(self, start: Array, goal: Array) -> Array | None:
        """Points (n, 2) from start to goal (2,), a few cm apart, if there is a way; it keeps to the wide."""
        a, b = self._cell(start), self._cell(goal)
        room = np.clip((self.clear - SQUEEZE) / (_WIDE - SQUEEZE), 0.0, 1.0)
        cost = 1.0 + 6.0 * (1.0 - room) ** 2 + np.where(self.clear < BODY, 12.0, 0.0)
        cost[self.clear < SQUEEZE] = -1.0
        for near in (a, b):
            cost[near] = abs(cost[near])
        try:
            cells, total = route_through_array(cost, a, b, fully_connected=True, geometric=True)
        except ValueError:
            return None
        if not np.isfinite(total):
            return None
        points = np.concatenate(
            [start[None], self.low + (np.array(cells[1:-1]).reshape(-1, 2) + 0.5) * CELL, goal[None]]
        )
        rough = _spaced(points)
        for wide in (_ROUND, 0.5 * _ROUND, 0.25 * _ROUND):
            smooth = _rounded(rough, wide / _STEP)
            if len(smooth) < 3 or self.clearance(smooth[1:-1]).min() > SQUEEZE:
                return smooth
        return rough

    def spots(self, room: float) -> Array:
        """Middles (n, 2) of all cells with at least `room` m about them."""
        return np.asarray(self.low + (np.argwhere(self.clear >= room) + 0.5) * CELL)

    def _cell(self, place: Array) -> tuple[int, int]:
        cell = np.clip(((place - self.low) / CELL).astype(int), 0, np.array(self.clear.shape) - 1)
        return int(cell[0]), int(cell[1])


def _spaced(points: Array) -> Array:
    """The same way in equal steps."""
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    count = max(2, round(along[-1] / _STEP) + 1)
    at = np.linspace(0.0, along[-1], count)
    return np.stack([np.interp(at, along, points[:, k]) for k in (0, 1)], axis=1)


def _rounded(points: Array, sigma: float) -> Array:
    """Smoothed with its ends kept: reflected through them."""
    reach = min(len(points) - 1, int(4 * sigma) + 1)
    before = 2 * points[0] - points[reach:0:-1]
    after = 2 * points[-1] - points[-2 : -reach - 2 : -1]
    smooth = gaussian_filter1d(np.concatenate([before, points, after]), sigma, axis=0)
    return np.asarray(smooth[reach : reach + len(points)])


def path_length(points: Array) -> float:
    """Metres along points (n, 2)."""
    return float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
