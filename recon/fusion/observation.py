"""What one frame shows of a body."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recon.dense.depth import F32
from recon.recording import Intrinsics
from twin.geometry import Array


@dataclass(frozen=True, eq=False)
class Observation:
    """One frame as the field sees it.

    depth: (h, w) m. own: (h, w) body's pixels. cosine: (h, w) of ray and normal. T_cam_body: field to camera.
    """

    depth: F32
    own: NDArray[np.bool_]
    cosine: F32
    camera: Intrinsics
    T_cam_body: Array


def own_points(seen: Observation, stride: int) -> Array:
    """Points (n, 3) of the body's pixels in field coordinates."""
    y, x = np.nonzero(seen.own[::stride, ::stride] & (seen.depth[::stride, ::stride] > 0))
    y, x = y * stride, x * stride
    z = seen.depth[y, x].astype(np.float64)
    p = seen.camera.backproject(np.stack([x, y], axis=1), z)
    rotation, shift = seen.T_cam_body[:3, :3], seen.T_cam_body[:3, 3]
    return np.asarray((p - shift) @ rotation)
