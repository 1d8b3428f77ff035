"""A surface at rest, and the evidence for it at any pose in any picture."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from recon.dense.looks import SAME
from recon.interaction.boards.proposals import plane_of
from recon.interaction.boards.seeds import Seed
from recon.observation.likelihood import log_odds
from recon.observation.pictures import Pictures
from twin import geometry as geo
from twin.geometry import Array

# All chosen by us.
# Points of a surface that are carried; more cost time and rank no joint otherwise.
POINTS = 200
# Share of a surface in view in a row that looks at the surface.
_IN_VIEW = 0.2
# Fewest such rows for a mean over them.
_FEWEST_ROWS = 5
# Standard deviations of noise, and m, within which depths agree.
_SIGMAS, _LEAST_M = 4.0, 0.012
# The same for a surface that is still where it rested, of like colour (8-bit Lab).
_STILL_SIGMAS, _STILL_M, _STILL_COLOUR = 2.5, 0.01, np.array([40.0, 10.0, 10.0])
# Least cosine of the view on a surface at rest, of which pixels are counted.
_GRAZING = 0.15
# Share of what a joint explains that it loses with an axis along no direction of the room nor the board's
# normal, and the standard deviation (rad) of axes: an odd piece is unlikely, never impossible.
_ODD, _ODD_AXIS = 0.2, np.radians(1.5)
# Share of what a surface explains that it loses if its outline follows no edge: it is a piece of something.
_UNBOUNDED = 0.5


@dataclass(frozen=True, eq=False)
class Shared:
    """What all surfaces of a recording share: pictures, the origin (T, h, w) of their pixels, rows that
    compare joints, the seconds (T,) of all rows, and the directions (3, m) of the room."""

    pictures: Pictures
    origin: NDArray[np.uint8]
    rows: NDArray[np.int64]
    seconds: Array
    room: Array

    def thinned(self, every: int, kept: Iterable[int]) -> Shared:
        """The same with each so manieth of its rows, and some that are kept."""
        return replace(self, rows=np.union1d(self.rows[::every], [self.rows[-1], *kept]).astype(np.int64))

    def prior(self, axis: Array, normal: Array) -> float:
        """Weight, at most 1, of a joint with this axis for a board with this normal."""
        off = (
            np.arccos(min(float(np.abs(axis @ np.column_stack([self.room, normal])).max()), 1.0)) / _ODD_AXIS
        )
        return float(1.0 - _ODD * (1.0 - np.exp(-0.5 * off**2)))


@dataclass(frozen=True, eq=False)
class Carrier:
    """A surface at its rest, some of its points and their Lab colours, and the px m^2 of each at 1 m."""

    shared: Shared
    seed: Seed
    normal: Array
    points: Array
    tint: Array
    size: Array

    @staticmethod
    def of(shared: Shared, seed: Seed, most: int = POINTS) -> Carrier:
        """A few of its points, evenly chosen. The normal faces the camera."""
        count = len(seed.points)
        some = min(most, count)
        chosen = ((np.arange(some) + 0.5) * count / some).astype(np.int64)
        points = seed.points[chosen]
        normal, _ = plane_of(seed.points)
        away = points - shared.pictures.T_world_cam[seed.rest][:3, 3]
        normal = -normal * np.sign((away @ normal).mean())
        facing = np.maximum(-(away @ normal) / np.linalg.norm(away, axis=1), _GRAZING)
        ahead = away @ shared.pictures.T_world_cam[seed.rest][:3, 2]
        size = count / len(points) * ahead**2 / facing
        return Carrier(shared, seed, normal, points, seed.tint[chosen], size)

    @property
    def area(self) -> int:
        """Pixels at rest."""
        return len(self.seed.points)

    @cached_property
    def still(self) -> NDArray[np.bool_]:
        """Which points (T, n) each row sees where they rest, in depth and colour."""
        p = self.shared.pictures
        out = np.zeros((len(p.frames), len(self.points)), bool)
        for row in range(len(p.frames)):
            same = p.look(self.points, row, _STILL_SIGMAS, _STILL_M) == SAME
            ahead = geo.transform(p.T_cam_world[row], self.points[same])
            x, y = np.rint(p.camera.project(ahead)).astype(int).T
            unlike = np.abs(p.colour[row, y, x].astype(np.float64) - self.tint[same]) > _STILL_COLOUR
            out[row, np.flatnonzero(same)[~unlike.any(axis=1)]] = True
        return out

    def scores(self, poses: Array, rows: NDArray[np.int64]) -> Array:
        """Evidence (rows, n), px, at poses (rows, n, 4, 4)."""
        s, rest = self.shared, self.seed.rest
        p = s.pictures
        return np.asarray(
            log_odds(
                (self.points, self.normal, self.tint, self.size),
                self.still,
                rows,
                np.ascontiguousarray(poses),
                p.T_cam_world,
                (p.near, p.far, p.colour),
                s.origin,
                (self.seed.mask, p.near[rest], p.far[rest], p.T_cam_world[rest]),
                p.lens,
                self.gates,
            )
        )

    @property
    def gates(self) -> tuple[float, float]:
        """Base (m) and slope (1/m) of depths that agree."""
        return self.shared.pictures.gates(_SIGMAS, _LEAST_M)

    def seen(self, pose: Array, row: int) -> NDArray[np.int8]:
        """What a row says of its points (n,) at a pose (4, 4): see `recon.dense.looks.look`."""
        return self.shared.pictures.look(geo.transform(pose, self.points), row, _SIGMAS, _LEAST_M)

    def along(self, poses: Array, rows: NDArray[np.int64]) -> Array:
        """The same (rows,) at one pose (rows, 4, 4) each."""
        return self.scores(poses[:, None], rows)[:, 0]

    def mean(self, scores: Array, rows: NDArray[np.int64]) -> float:
        """Mean of scores (rows,) over the rows that look at the surface: others say nothing of it."""
        looks = self.looks[rows]
        return float(scores[looks if looks.sum() >= _FEWEST_ROWS else slice(None)].mean())

    @cached_property
    def looks(self) -> NDArray[np.bool_]:
        """Rows (T,) in whose picture part of it rests."""
        p = self.shared.pictures
        ahead = geo.transform(p.T_cam_world, self.points)
        pixels = p.camera.project(np.where(ahead[..., 2:] > 0.1, ahead, [0.0, 0.0, 1.0]))
        inside = (ahead[..., 2] > 0.1) & np.all(
            (pixels >= 0) & (pixels < [p.camera.width, p.camera.height]), axis=-1
        )
        return np.asarray(inside.mean(axis=1) >= _IN_VIEW)

    @cached_property
    def unknown(self) -> float:
        """Its mean score, px, if it stays, then leaves to somewhere unknown: what a joint must exceed."""
        rows = self.shared.rows
        stays = self.along(np.tile(np.eye(4), (len(rows), 1, 1)), rows)
        return self.mean(np.maximum(stays, 0.0), rows)

    def gain(self, poses: Array, rows: NDArray[np.int64]) -> float:
        """Px a row that it explains at poses (rows, 4, 4) beyond leaving, at least 0."""
        beyond = max(self.mean(self.along(poses, rows), rows) - self.unknown, 0.0)
        return beyond * (1.0 - _UNBOUNDED * (1.0 - self.seed.bounded))
