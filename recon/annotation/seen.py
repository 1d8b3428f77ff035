"""A recording with its cameras, and what outlines in it show of a part."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from recon.annotation.marks import PartMarks
from recon.dense.noise import DepthNoise
from recon.recording import Recording
from recon.tracking.tracks import SparseTracks
from twin import geometry as geo
from twin.errors import InputError
from twin.geometry import Array
from twin.scene import Joint, Mesh, Trajectory

# Relative step in depth that ends a surface. Chosen by us.
_STEP = 0.03
# m and share of the depth by which a reading may differ from the part's; px of a gap that is closed. By us.
_NEAR, _NEAR_SHARE, _GAP = 0.01, 0.01, 7


@dataclass(frozen=True, eq=False)
class Seen:
    """What marks are made on: a recording with the corners in it, the cameras, world z up, and its noise."""

    recording: Recording
    tracks: SparseTracks
    cameras: Trajectory
    noise: DepthNoise

    def world(self, frame: int, places: Array) -> Array:
        """Points (n, 3) of pixels (n, 2) of a frame with a camera; NaN where no depth is known nearby."""
        depth = self.recording.depth(frame)
        shape = np.array(depth.shape[::-1])
        x, y = np.clip(np.rint(places).astype(int), 0, shape - 1).T
        z = depth[y, x].astype(np.float64)
        for k in np.flatnonzero(z <= 0):
            near = depth[max(y[k] - 2, 0) : y[k] + 3, max(x[k] - 2, 0) : x[k] + 3]
            z[k] = np.median(near[near > 0]) if (near > 0).any() else np.nan
        return geo.transform(self.camera(frame), self.recording.intrinsics.backproject(places, z))

    def camera(self, frame: int) -> Array:
        """T_world_cam (4, 4). Raises InputError for a frame without."""
        pose = self.cameras.pose(frame)
        if pose is None:
            raise InputError(f"the camera of frame {frame} is not known", "mark it in another frame")
        return pose

    def pixels(self, frame: int, points: Array) -> Array:
        """Places (n, 2) px of points (n, 3) of the world in a frame with a camera."""
        camera = geo.transform(geo.invert_pose(self.camera(frame)), points)
        return np.where(camera[:, 2:] > 0.05, self.recording.intrinsics.project(camera), np.nan)


def filled(corners: Array, shape: tuple[int, int]) -> NDArray[np.bool_]:
    """The pixels (H, W) within an outline (n, 2) px."""
    image = np.zeros(shape, np.uint8)
    cv2.fillPoly(image, [np.rint(corners).astype(np.int32)], 1)
    return image.astype(bool)


def surface_of(seen: Seen, part: PartMarks, joint: Joint, states: Array) -> Mesh:
    """What all outlines show, at state 0."""
    k = seen.recording.intrinsics
    vertices, faces, count = [], [], 0
    for frame, corners in part.outlines.items():
        depth = seen.recording.depth(frame).astype(np.float64)
        mask = filled(corners, depth.shape[:2]) & (depth > 0)
        number = np.full(depth.shape, -1)
        number[mask] = np.arange(mask.sum()) + count
        y, x = np.nonzero(mask)
        points = geo.transform(
            seen.camera(frame), k.backproject(np.stack([x, y], axis=-1).astype(float), depth[mask])
        )
        vertices.append(geo.transform(geo.invert_pose(joint.pose(float(states[frame]))), points))
        corner = np.stack([number[:-1, :-1], number[:-1, 1:], number[1:, :-1], number[1:, 1:]], axis=-1)
        z = np.stack([depth[:-1, :-1], depth[:-1, 1:], depth[1:, :-1], depth[1:, 1:]], axis=-1)
        whole = (corner >= 0).all(axis=-1) & (np.ptp(z, axis=-1) < _STEP * z.min(axis=-1))
        a, b, c, d = corner[whole].T
        faces += [np.stack([a, c, b], axis=-1), np.stack([b, c, d], axis=-1)]
        count += int(mask.sum())
    if not count:
        raise InputError(f"the outlines of {part.name} show no depth", "draw one in another frame")
    return Mesh(np.concatenate(vertices), np.concatenate(faces).astype(np.int32))


def shown_in(seen: Seen, part: PartMarks, surface: Mesh, pose: Array, frame: int) -> NDArray[np.bool_]:
    """The pixels (H, W) of a frame that show a part: the outline where one was drawn, else its surface at
    state 0, taken there by a pose (4, 4), where nothing stands before it."""
    depth = seen.recording.depth(frame)
    if frame in part.outlines:
        return filled(part.outlines[frame], depth.shape[:2])
    k = seen.recording.intrinsics
    points = geo.transform(pose, surface.vertices)
    points = geo.transform(geo.invert_pose(seen.camera(frame)), points)
    points = points[points[:, 2] > 0.05]
    x, y = np.rint(k.project(points)).astype(int).T
    within = (x >= 0) & (x < k.width) & (y >= 0) & (y < k.height)
    x, y, z = x[within], y[within], points[within, 2]
    alike = np.abs(depth[y, x] - z) < _NEAR + _NEAR_SHARE * z
    image = np.zeros(depth.shape[:2], np.uint8)
    image[y[alike], x[alike]] = 1
    return cv2.morphologyEx(image, cv2.MORPH_CLOSE, np.ones((_GAP, _GAP), np.uint8)).astype(bool)
