"""The pinhole camera of a recording's pictures."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from twin.errors import InputError
from twin.geometry import Array


@dataclass(frozen=True)
class Intrinsics:
    """Pinhole camera without distortion, pixel centres at integers; focal lengths and centre in pixels."""

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float

    def __post_init__(self) -> None:
        values = (self.width, self.height, self.fx, self.fy, self.cx, self.cy)
        if not np.all(np.isfinite(values)) or min(self.width, self.height, self.fx, self.fy) <= 0:
            raise InputError(
                f"intrinsics must be finite with positive size and focal lengths, got {values}",
                "give width, height, fx, fy, cx, cy in pixels",
            )
        if not (0 <= self.cx < self.width and 0 <= self.cy < self.height):
            raise InputError(
                f"principal point ({self.cx}, {self.cy}) lies outside the {self.width}x{self.height} image",
                "give the intrinsics of this resolution",
            )

    @property
    def matrix(self) -> Array:
        """K (3, 3)."""
        return np.array([[self.fx, 0, self.cx], [0, self.fy, self.cy], [0, 0, 1.0]])

    def scaled(self, width: int, height: int) -> Intrinsics:
        """The same camera at another resolution; pixel centres stay at integers."""
        sx, sy = width / self.width, height / self.height
        cx, cy = (self.cx + 0.5) * sx - 0.5, (self.cy + 0.5) * sy - 0.5
        return Intrinsics(width, height, self.fx * sx, self.fy * sy, cx, cy)

    @property
    def vector(self) -> Array:
        """(fx, fy, cx, cy), for compiled kernels."""
        return np.array([self.fx, self.fy, self.cx, self.cy])

    def binned(self, factor: int) -> Intrinsics:
        """The camera whose pixels are blocks of `factor` x `factor`; what fills no block at the right and
        below is cut off."""
        cx, cy = ((c + 0.5) / factor - 0.5 for c in (self.cx, self.cy))
        return Intrinsics(
            self.width // factor, self.height // factor, self.fx / factor, self.fy / factor, cx, cy
        )

    def strided(self, step: int) -> Intrinsics:
        """The camera of every `step`-th pixel from the first on, as image[::step, ::step]."""
        width, height = -(-self.width // step), -(-self.height // step)
        return Intrinsics(width, height, *(self.vector / step).tolist())

    def backproject(self, pixels: Array, depth: Array) -> Array:
        """Camera points (..., 3) in metres of pixels (..., 2) = (x, y) at depth (...) metres."""
        x = (pixels[..., 0] - self.cx) / self.fx * depth
        y = (pixels[..., 1] - self.cy) / self.fy * depth
        return np.stack([x, y, np.asarray(depth, dtype=np.float64)], axis=-1)

    def project(self, points_cam: Array) -> Array:
        """Pixels (..., 2) of camera points (..., 3); depth must be positive."""
        z = points_cam[..., 2]
        return np.stack(
            [points_cam[..., 0] / z * self.fx + self.cx, points_cam[..., 1] / z * self.fy + self.cy], axis=-1
        )
