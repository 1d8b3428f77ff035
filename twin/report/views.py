"""Where pictures of the twin are taken from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from twin import geometry as geo
from twin.geometry import Array
from twin.scene import Mesh, Part, Twin

# m over the floor from which a map is drawn: lines that rise are nearly points. Chosen by us.
_ABOVE_M = 40.0
# m about path and parts.
_MARGIN_M = 0.5


@dataclass(frozen=True, eq=False)
class View:
    """A pinhole camera: T_world_cam (4, 4) with OpenCV axes, size in pixels, horizontal view in radians.

    What lies nearer than `near` metres is cut away.
    """

    T_world_cam: Array
    width: int
    height: int
    fov: float
    near: float = 0.0

    @property
    def matrix(self) -> Array:
        """K (3, 3)."""
        f = self.width / 2 / np.tan(self.fov / 2)
        return np.array([[f, 0, (self.width - 1) / 2], [0, f, (self.height - 1) / 2], [0, 0, 1]])

    def scaled(self, factor: int) -> View:
        """The same view with more pixels."""
        return replace(self, width=self.width * factor, height=self.height * factor)

    def rays(self) -> NDArray[np.float32]:
        """Origins, `near` metres along the view, and unit directions (H, W, 6) float32 in the world."""
        k, (r, t) = self.matrix, (self.T_world_cam[:3, :3], self.T_world_cam[:3, 3])
        rays = np.empty((self.height, self.width, 6), dtype=np.float32)
        x = ((np.arange(self.width) - k[0, 2]) / k[0, 0]).astype(np.float32)[None, :, None]
        y = ((np.arange(self.height) - k[1, 2]) / k[1, 1]).astype(np.float32)[:, None, None]
        d = x * r[:, 0].astype(np.float32) + y * r[:, 1].astype(np.float32) + r[:, 2].astype(np.float32)
        rays[..., :3] = t + self.near * d
        rays[..., 3:] = d / np.sqrt(1 + x**2 + y**2)
        return rays


def look_at(eye: Array, target: Array, points: Array, width: int, height: int) -> View:
    """View from `eye` towards `target` with z up, as wide as it takes to hold the world points (n, 3)."""
    forward = geo.unit(target - eye)
    up = np.array([0.0, 0.0, 1.0]) if abs(forward[2]) < 0.99 else np.array([0.0, 1.0, 0.0])
    right = geo.unit(np.cross(forward, up))
    pose = geo.make_pose(np.stack([right, np.cross(forward, right), forward], 1), eye)
    cam = geo.transform(geo.invert_pose(pose), points)
    cam = cam[cam[:, 2] > 0.1]
    tan = 0.3
    if len(cam):
        tan = max(
            float(np.abs(cam[:, 0] / cam[:, 2]).max()),
            float(np.abs(cam[:, 1] / cam[:, 2]).max()) * width / height,
        )
    return View(pose, width, height, 2 * float(np.arctan(np.clip(tan * 1.25, 0.15, 1.2))))


def part_view(twin: Twin, parts: Sequence[Part], width: int, height: int) -> View:
    """From where the person stood while parts moved, close enough to see them in all their states."""
    swept = _swept(twin, parts)
    target = (swept.min(0) + swept.max(0)) / 2
    return look_at(_stand_point(twin, parts, target), target, swept, width, height)


def overview(twin: Twin, width: int, height: int) -> View:
    """From behind and above the camera path, holding the path and the parts."""
    swept = _swept(twin, twin.parts)
    path = twin.cameras.T_world_cam[:, :3, 3] if twin.cameras is not None else swept
    points = np.concatenate([swept, path])
    target = (points.min(0) + points.max(0)) / 2
    centre = (swept.min(0) + swept.max(0)) / 2
    back = _stand_point(twin, twin.parts, centre) - centre
    back[2] = 0.0
    back = geo.unit(back) if np.linalg.norm(back) > 1e-6 else np.array([0.0, -1.0, 0.0])
    side = np.array([-back[1], back[0], 0.0])
    reach = max(0.6, float(np.linalg.norm(np.ptp(points, axis=0))))
    eye = target + reach * 1.5 * (0.55 * back + 0.7 * side + np.array([0.0, 0.0, 0.55]))
    view = look_at(eye, target, points, width, height)
    depths = geo.transform(geo.invert_pose(view.T_world_cam), points)[:, 2]
    # what stands before the scene would hide it
    return replace(view, near=max(0.0, float(depths.min()) - 0.4))


def above(twin: Twin, width: int, height: int) -> View:
    """From far above, holding path and parts; the first part that a hand held opens downwards."""
    swept = _swept(twin, twin.parts)
    path = twin.cameras.T_world_cam[:, :3, 3] if twin.cameras is not None else swept
    points = np.concatenate([swept, path])
    held = [p.contact.rotation[:, 2] for p in twin.parts if p.contact is not None]
    down = np.array([*held[0][:2], 0.0]) if held else np.array([0.0, -1.0, 0.0])
    down = geo.unit(down) if np.linalg.norm(down) > 1e-6 else np.array([0.0, -1.0, 0.0])
    forward = np.array([0.0, 0.0, -1.0])
    rotation = np.stack([np.cross(down, forward), down, forward], 1)
    middle = rotation @ ((points @ rotation).min(0) + (points @ rotation).max(0)) / 2
    middle[2] = float(points[:, 2].min()) + _ABOVE_M
    pose = geo.make_pose(rotation, middle)
    cam = geo.transform(geo.invert_pose(pose), points)
    tan = np.abs(cam[:, :2] / cam[:, 2:]).max(axis=0) + _MARGIN_M / _ABOVE_M
    return View(pose, width, height, 2 * float(np.arctan(max(tan[0], tan[1] * width / height))))


def placed(twin: Twin, share: float) -> list[Mesh]:
    """Each part's mesh in the world, all opened by a share of their range."""
    states = {p.id: p.joint.lower + share * (p.joint.upper - p.joint.lower) for p in twin.parts}
    return [p.mesh.transformed(twin.part_pose(p.id, states)) for p in twin.parts]


def _swept(twin: Twin, parts: Sequence[Part]) -> Array:
    """Corners of the boxes around 98 % of some parts' vertices, closed, half open and open."""
    ids = {p.id for p in parts}
    meshes = [
        m
        for share in (0.0, 0.5, 1.0)
        for p, m in zip(twin.parts, placed(twin, share), strict=True)
        if p.id in ids
    ]
    meshes = [m for m in meshes if len(m.vertices)] or [twin.static.mesh]
    points = [np.quantile(m.vertices, (0.01, 0.99), axis=0) for m in meshes if len(m.vertices)]
    if not points:
        return np.array([[-0.5, -0.5, 0.0], [0.5, 0.5, 1.0]])
    return np.concatenate(
        [[[b[i, 0], b[j, 1], b[k, 2]] for i in (0, 1) for j in (0, 1) for k in (0, 1)] for b in points]
    )


def _stand_point(twin: Twin, parts: Sequence[Part], target: Array) -> Array:
    """Where the camera was while some of several parts moved, else in the middle; without cameras a point in
    front of the first contact, or just some place."""
    if twin.cameras is not None:
        frames, centres = twin.cameras.frames, twin.cameras.T_world_cam[:, :3, 3]
        spans = [s for p in parts for s in p.motion.intervals] if len(parts) < len(twin.parts) else []
        during = np.logical_or.reduce([(frames >= a) & (frames <= b) for a, b in spans] or [frames < 0])
        return np.array(np.median(centres[during] if during.any() else centres, axis=0))
    contacts = [p.contact for p in parts if p.contact is not None]
    outward = contacts[0].rotation[:, 2] if contacts else np.array([-0.6, -0.7, 0.4])
    return target + 1.5 * outward + np.array([0.0, 0.0, 0.2])
