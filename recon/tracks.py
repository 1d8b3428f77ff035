"""Point tracks through a recording."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from twin.errors import SceneError
from twin.geometry import Array


@dataclass(frozen=True, eq=False)
class Tracks:
    """T frames, K tracks: points_cam (T, K, 3) m in each frame's camera, pixels (T, K, 2), visible (T, K) bool,
    confidence (T, K) in 0..1. Points and pixels are NaN exactly where a track is not visible."""

    points_cam: Array
    pixels: Array
    visible: NDArray[np.bool_]
    confidence: Array

    def __post_init__(self) -> None:
        t, k = self.visible.shape
        for name, shape in (("points_cam", (t, k, 3)), ("pixels", (t, k, 2)), ("confidence", (t, k))):
            if getattr(self, name).shape != shape:
                raise SceneError(f"tracks: {name} must have shape {shape}, got {getattr(self, name).shape}")
        for name in ("points_cam", "pixels"):
            finite = np.isfinite(getattr(self, name)).all(axis=-1)
            if not np.array_equal(finite, self.visible):
                raise SceneError(f"tracks: {name} must be NaN exactly where a track is not visible")

    def __len__(self) -> int:
        return self.visible.shape[1]
