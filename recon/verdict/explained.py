"""Whether the twin explains the video: carried to its states in the frames of rest, does it have the depth that was recorded?

The fit looks at tracks and labels; this looks at all pixels of frames in which nobody moves anything. A part that was missed stands
in the first frames where nothing is in the last ones, or the other way round, and no single static scene agrees with both.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import cv2
import numpy as np
import open3d as o3d
from numpy.typing import NDArray

from recon.parts.moving_part import MovingPart
from recon.recording import Intrinsics, Recording
from twin import geometry as geo
from twin.geometry import Array
from twin.scene import Mesh, Trajectory

WIDTH = 160  # px to which pictures are thinned out
SHARE, FRAMES = (
    1 / 12,
    3,
)  # of the recording at each end, and how many frames of it are looked at; chosen by us
# m and multiples: another depth is one that differs by more than both. Six medians of the frame's own differences are 4 sigma.
GATE_M, GATE_MEDIANS = 0.03, 6.0
# Beside steps in depth (m, and share of the depth) a pixel of the mesh may be one of the picture's other side.
_STEP_M, _STEP_SHARE, _BESIDE = 0.05, 0.03, 5


def unexplained(
    recording: Recording, cameras: Trajectory, static: Mesh, parts: Sequence[tuple[MovingPart, Mesh | None]]
) -> tuple[int, float]:
    """The frame at one end of the recording in which the twin is worst, and the share of its pixels with another depth.

    Of the two ends, the one that is worse on average. parts: meshes at state 0.
    """
    count = max(FRAMES, round(SHARE * len(cameras.frames)))
    ends = (np.arange(count), np.arange(len(cameras.frames) - count, len(cameras.frames)))
    worst = (int(cameras.frames[0]), 0.0)
    mean = -1.0
    for rows in ends:
        chosen = rows[np.linspace(0, count - 1, FRAMES).round().astype(int)]
        shares = {int(cameras.frames[k]): _share(recording, cameras, int(k), static, parts) for k in chosen}
        if np.mean(list(shares.values())) > mean:
            mean = float(np.mean(list(shares.values())))
            worst = (max(shares, key=lambda f: shares[f]), mean)
    return worst


def _share(
    recording: Recording,
    cameras: Trajectory,
    row: int,
    static: Mesh,
    parts: Sequence[tuple[MovingPart, Mesh | None]],
) -> float:
    frame, step = int(cameras.frames[row]), max(1, recording.intrinsics.width // WIDTH)
    posed = [static]
    for part, mesh in parts:
        if mesh is not None:
            state = float(np.interp(frame, part.motion.frames, part.motion.state))
            posed.append(mesh.transformed(part.joint.pose(state)))
    expected = _depth(posed, recording.intrinsics.strided(step), cameras.T_world_cam[row])
    seen = recording.depth(frame)[::step, ::step]
    return float(other_depth(seen, expected).mean())


def other_depth(seen: NDArray[np.float32], expected: NDArray[np.float32]) -> NDArray[np.bool_]:
    """Pixels (H, W) whose depth differs from the expected one (0 = unknown, in both), single ones and those beside steps left out."""
    both = (seen > 0) & (expected > 0)
    kernel = np.ones((_BESIDE, _BESIDE), np.uint8)
    jump = cv2.dilate(expected, kernel) - cv2.erode(expected, kernel)
    both &= jump <= _STEP_M + _STEP_SHARE * expected
    if not both.any():
        return both
    off = np.abs(seen - expected)
    bad = both & (off > max(GATE_M, GATE_MEDIANS * float(np.median(off[both]))))
    return cv2.morphologyEx(bad.astype(np.uint8), cv2.MORPH_OPEN, np.ones((3, 3), np.uint8)).astype(bool)


def _depth(meshes: Sequence[Mesh], camera: Intrinsics, T_world_cam: Array) -> NDArray[np.float32]:
    """Depth (H, W) along z of the nearest surface, metres, 0 where there is none."""
    core: Any = o3d.core  # its stubs know no array
    scene = o3d.t.geometry.RaycastingScene()
    for mesh in meshes:
        if len(mesh.faces):
            vertices = np.ascontiguousarray(mesh.vertices, dtype=np.float32)
            faces = np.ascontiguousarray(mesh.faces, dtype=np.uint32)
            scene.add_triangles(core.Tensor(vertices), core.Tensor(faces))
    y, x = np.mgrid[0 : camera.height, 0 : camera.width]
    pixels = np.stack([x, y], axis=-1).astype(np.float64)
    ahead = geo.rotate(T_world_cam, camera.backproject(pixels, np.ones(x.shape)))
    rays = np.concatenate([np.broadcast_to(T_world_cam[:3, 3], ahead.shape), ahead], axis=-1)
    depth: NDArray[np.float32] = scene.cast_rays(core.Tensor(rays.astype(np.float32)))["t_hit"].numpy()
    return np.where(np.isfinite(depth), depth, np.float32(0.0))
