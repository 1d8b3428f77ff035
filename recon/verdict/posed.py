"""What the twin, carried to its states, should look like: depth, and whose surface it is."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from recon.interaction.parts.moving_part import MovingPart
from recon.recording import Intrinsics, Recording
from twin import geometry as geo
from twin.geometry import Array
from twin.scene import STATIC_LABEL, UNKNOWN_LABEL, Mesh, Trajectory

WIDTH = 160  # px to which pictures are thinned out
# m: another depth differs by more than this and by so many medians of a frame's differences; six are 4 sigma.
GATE_M = 0.03
GATE_MEDIANS = 6.0
# narrower ones are gaps closed by fusion, or an edge it drew on; a joint's gap and twice a voxel; by us
_GAP_M = 0.025
# Beside steps in depth a pixel of the mesh may be one of the other side: m and share of the depth of a step.
_STEP_M = 0.05
_STEP_SHARE = 0.03
# px that count as beside.
_BESIDE = 5


@dataclass(frozen=True, eq=False)
class Expected:
    """Depth (H, W) m along z, 0 without surface, and owner (H, W): the surface's label, 0 without."""

    depth: NDArray[np.float32]
    owner: NDArray[np.uint8]


@dataclass(frozen=True, eq=False)
class PosedTwin:
    """A twin to be looked at in any state. parts: with meshes at state 0, None for one without a surface."""

    recording: Recording
    cameras: Trajectory
    static: Mesh
    parts: Sequence[tuple[MovingPart, Mesh | None]]

    @property
    def step(self) -> int:
        """Every so many-th pixel is looked at."""
        return max(1, self.recording.intrinsics.width // WIDTH)

    @property
    def camera(self) -> Intrinsics:
        return self.recording.intrinsics.strided(self.step)

    def seen(self, frame: int) -> NDArray[np.float32]:
        """Recorded depth (H, W) m, 0 where unknown."""
        return np.asarray(self.recording.depth(frame)[:: self.step, :: self.step], np.float32)

    def thinned(self, image: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """A label image thinned out like depth."""
        return image[:: self.step, :: self.step]

    def T_world_cam(self, frame: int) -> Array:
        """Pose (4, 4) of the camera of a frame that has one."""
        return np.asarray(self.cameras.T_world_cam[int(np.searchsorted(self.cameras.frames, frame))])

    def states(self, frame: int) -> dict[int, float]:
        """State of each part by its id."""
        return {
            p.id: float(np.interp(frame, p.motion.frames, p.motion.state))
            for p, mesh in self.parts
            if mesh is not None
        }

    def expected(self, frame: int, states: Mapping[int, float] | None = None) -> Expected:
        """A frame's view with a known camera. states: by part id; by default the frame's, then it is kept."""
        if states is None:
            if frame not in self._kept:
                self._kept[frame] = self.expected(frame, self.states(frame))
            return self._kept[frame]
        T_world_cam = self.T_world_cam(frame)
        depth = _cast(self._static, self._rays, T_world_cam)
        owner = np.where(depth > 0, STATIC_LABEL, UNKNOWN_LABEL).astype(np.uint8)
        for part, scene in self._scenes:
            pose = geo.invert_pose(part.pose_at(states))
            near = _cast(scene, self._rays, pose @ T_world_cam)
            first = (near > 0) & ((depth == 0) | (near < depth))
            depth, owner = np.where(first, near, depth), np.where(first, np.uint8(part.id), owner)
        return Expected(depth, owner)

    @cached_property
    def _kept(self) -> dict[int, Expected]:
        return {}

    @cached_property
    def _static(self) -> Any:
        return _scene(self.static)

    @cached_property
    def _scenes(self) -> list[tuple[MovingPart, Any]]:
        return [(part, _scene(mesh)) for part, mesh in self.parts if mesh is not None]

    @cached_property
    def _rays(self) -> Array:
        y, x = np.mgrid[0 : self.camera.height, 0 : self.camera.width]
        return self.camera.backproject(np.stack([x, y], axis=-1).astype(np.float64), np.ones(x.shape))


def gate(seen: NDArray[np.float32], expected: NDArray[np.float32]) -> tuple[NDArray[np.bool_], float]:
    """Pixels (H, W) to compare (known in both, not beside a step), and how far (m) other depths differ."""
    both = (seen > 0) & (expected > 0)
    kernel = np.ones((_BESIDE, _BESIDE), np.uint8)
    jump = cv2.dilate(expected, kernel) - cv2.erode(expected, kernel)
    both &= jump <= _STEP_M + _STEP_SHARE * expected
    if not both.any():
        return both, GATE_M
    return both, max(GATE_M, GATE_MEDIANS * float(np.median(np.abs(seen - expected)[both])))


def wide(mask: NDArray[np.bool_], depth: NDArray[np.float32], camera: Intrinsics) -> NDArray[np.bool_]:
    """A mask (H, W) without what is narrower than `_GAP_M` at the median of its depths (H, W) m: fused
    surfaces close the gap beside a front, and end a little beyond their edge. A strip at the picture's border
    is as narrow as it is seen."""
    if not mask.any():
        return mask
    px = _GAP_M * camera.fx / float(np.median(depth[mask]))
    return without_narrow(mask, max(3, math.ceil(px)))


def opened(mask: NDArray[np.bool_], untold: NDArray[np.bool_] | None = None) -> NDArray[np.bool_]:
    """A mask (H, W) without single pixels. untold (H, W): pixels that are not known, which may be of it or
    not: a surface that is seen in spots is no single pixel."""
    return np.asarray(mask & without_narrow(mask if untold is None else mask | untold, 3))


def without_narrow(mask: NDArray[np.bool_], size: int) -> NDArray[np.bool_]:
    """A mask (H, W) without what no square of so many pixels within the picture fits into."""
    kernel = np.ones((size, size), np.uint8)
    # An even square has no middle: turned about, it has as many pixels behind as it had before.
    before = size // 2
    behind = size - 1 - before
    held = cv2.erode(
        mask.astype(np.uint8), kernel, anchor=(before, before), borderType=cv2.BORDER_CONSTANT, borderValue=0
    )
    return np.asarray(cv2.dilate(held, kernel, anchor=(behind, behind)).astype(bool))


def _scene(mesh: Mesh) -> Any:
    import open3d as o3d  # takes long, and nothing before the verdict needs it

    core: Any = o3d.core  # its stubs know no array
    scene = o3d.t.geometry.RaycastingScene()
    if len(mesh.faces):
        vertices = np.ascontiguousarray(mesh.vertices, dtype=np.float32)
        faces = np.ascontiguousarray(mesh.faces, dtype=np.uint32)
        scene.add_triangles(core.Tensor(vertices), core.Tensor(faces))
    return scene


def _cast(scene: Any, rays: Array, T_scene_cam: Array) -> NDArray[np.float32]:
    """Depth (H, W) along z of the nearest surface, metres, 0 without. rays (H, W, 3): points at 1 m depth."""
    import open3d as o3d

    core: Any = o3d.core
    ahead = geo.rotate(T_scene_cam, rays)
    both = np.concatenate([np.broadcast_to(T_scene_cam[:3, 3], ahead.shape), ahead], axis=-1)
    depth: NDArray[np.float32] = scene.cast_rays(core.Tensor(both.astype(np.float32)))["t_hit"].numpy()
    return np.where(np.isfinite(depth), depth, np.float32(0.0))
