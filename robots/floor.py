"""What a robot stands on: the twin's floor if seen, else a height that is given or assumed, as stated."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from twin.errors import InputError
from twin.geometry import Array
from twin.mesh import sample_surface
from twin.scene import Twin

FloorSource = Literal["seen", "given", "assumed"]
# All chosen by us, in m and m^2.
_SAMPLES = 40_000
_LEVEL = 0.7  # of a normal's z: within 45 degrees of level, as fused floors are rough
_BAND = 0.06  # what counts as one level: noise, and a degree of gravity's error over 3 m
_LEAST = 0.25  # open area of a floor: half of what Spot stands on
_CELL = 0.05
_ABOVE = (0.10, 1.90)  # over a floor that one can stand on there is nothing; a ceiling does not count
_BELOW = 0.05  # what lies deeper than that below a floor is its own edge:
_SHARE = 0.2  # at most so much against its area
_EYES = 0.9  # a level less than this below the eyes is a table's; who kneels still sees the floor 1.1 m below


@dataclass(frozen=True)
class Floor:
    """height: z in m, in the twin's world. source: "seen", "given" by the user, or "assumed"."""

    height: float
    source: FloorSource

    def __post_init__(self) -> None:
        if not np.isfinite(self.height):
            raise InputError(f"the floor's height is {self.height}", "give z in m, in the twin's world")
        if self.source not in get_args(FloorSource):
            raise InputError(
                f"a floor is {self.source!r}", f"it can be {', '.join(map(repr, get_args(FloorSource)))}"
            )

    @property
    def text(self) -> str:
        """For tables and films."""
        return f"{self.source}, z {self._z} m"

    @property
    def _z(self) -> str:
        return f"{round(self.height, 2) + 0.0:.2f}"

    @property
    def warning(self) -> str:
        """What to say of an assumed floor; empty for one that is known."""
        if self.source != "assumed":
            return ""
        return (
            f"the twin shows no floor: it is assumed at the scene's lowest point, z = {self._z} m, and the robot's height "
            "counts from there; give the floor's own in the twin's world with --floor Z"
        )


def floor_of(twin: Twin, given: Floor | float | None = None) -> Floor:
    """The floor, or its height (m, twin's world), that was given; else what `find_floor` says."""
    if given is None:
        return find_floor(twin)
    return given if isinstance(given, Floor) else Floor(float(given), "given")


def find_floor(twin: Twin) -> Floor:
    """The lowest level surface of the static scene if it can be a floor; else the lowest point, assumed.

    A floor is open: on 0.25 m^2 or more nothing stands over it up to a person's height. Nothing but its own
    edge or underside lies below it, and it is 0.9 m or more below where the recording's cameras were. So a
    worktop is none, nor a table or the inside of a cabinet.
    """
    points, normals = sample_surface(twin.static.mesh, _SAMPLES, np.random.default_rng(0))
    on_parts = [
        p.mesh.vertices
        if not len(p.mesh.faces)
        else sample_surface(p.mesh, 2_000, np.random.default_rng(0))[0]
        for p in twin.parts
    ]
    moving = np.concatenate([np.zeros((0, 3)), *on_parts])
    lowest = [float(np.quantile(p[:, 2], 0.002)) for p in (points, moving) if len(p)]
    assumed = Floor(min(lowest, default=0.0), "assumed")
    if not len(points):
        return assumed
    each = twin.static.mesh.area / len(points)
    flat = points[normals[:, 2] > _LEVEL]
    height = _lowest_level(flat[:, 2], _LEAST / each)
    if height is None:
        return assumed
    level = flat[np.abs(flat[:, 2] - height) < _BAND / 2]
    below = points[(points[:, 2] < height - _BELOW) & (normals[:, 2] > -_LEVEL)]
    eyes = None if twin.cameras is None else float(np.median(twin.cameras.T_world_cam[:, 2, 3]))
    known = (
        _open_area(level, np.concatenate([points, moving]), height) >= _LEAST
        and len(below) <= _SHARE * len(level)
        and (eyes is None or height <= eyes - _EYES)
    )
    return Floor(height, "seen") if known else assumed


def _lowest_level(heights: Array, least: float) -> float | None:
    """Height of the lowest band that holds `least` samples of level surface, None where none does."""
    if len(heights) < least:
        return None
    heights = np.sort(heights)
    held = np.searchsorted(heights, heights + _BAND) - np.arange(len(heights))
    enough = np.flatnonzero(held >= least)
    if not len(enough):
        return None
    near = np.arange(enough[0], np.searchsorted(heights, heights[enough[0]] + _BAND))
    first = int(near[np.argmax(held[near])])
    return float(np.median(heights[first : first + held[first]]))


def _open_area(level: Array, scene: Array, height: float) -> float:
    """m^2 of a level surface (n, 3) over which nothing of the scene's points (m, 3) stands."""
    over = scene[(scene[:, 2] > height + _ABOVE[0]) & (scene[:, 2] < height + _ABOVE[1])]

    def cells(points: Array) -> NDArray[np.int64]:
        column, row = np.floor(points[:, :2] / _CELL).astype(np.int64).T
        return np.asarray((column << 32) + row)

    return len(np.setdiff1d(cells(level), cells(over))) * _CELL**2
