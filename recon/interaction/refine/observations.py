"""What refinement observes: distances of surfels to depth images, and of tracked points to planes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from recon.dense.depth import depth_normals, look_up, mean_depth
from recon.dense.noise import DepthNoise
from recon.dense.voxels import distinct
from recon.interaction.motion.movers import Movers
from recon.interaction.parts.moving_part import MovingPart
from recon.interaction.refine.terms import Terms
from recon.recording import Intrinsics, Recording
from recon.tracking.tracks import PIXEL_SIGMA
from twin import geometry as geo
from twin.geometry import Array
from twin.runs.threads import each
from twin.scene import Joint, Trajectory

# Gauss-Newton steps a round; the next round associates anew. Chosen by us.
STEPS = 2
# m by which what covers a point is before it, more than depth scatters. Chosen by us.
BEFORE = 0.03
# m; greatest distance of what is taken for the same surface, one round each. Chosen by us.
GATES = (0.03, 0.015, 0.015, 0.01, 0.01, 0.01)
# px; width to which depth is shrunk. Chosen by us.
_WIDTH = 320
# m; surfels are means over voxels of this side. Chosen by us.
VOXEL = 0.010
# Most surfels of a part, for speed. Chosen by us.
_MAX_SURFELS = 2500
# Least cosine between a surfel's normal and the ray that sees it. Chosen by us.
_GRAZING = 0.25
# Fewest frames that see a surfel. Chosen by us.
_MIN_VIEWS = 2


@dataclass(frozen=True)
class Drift:
    """Slow error of the cameras at the part, one standard deviation in each direction: shift m, angle rad.

    The defaults hold where the recording itself shows no larger drift (`recon.dense.noise`); 0.17 mm and
    0.014 degrees were measured on the recordings of benchmarks/reconstruct.md.
    """

    shift: float = 2e-4
    angle: float = float(np.radians(0.015))

    def at_least(self, measured: float) -> Drift:
        """With a shift measured (m) in place of a smaller one, and the angle as much larger."""
        if not 0.0 < self.shift < measured:
            return self
        return Drift(measured, min(self.angle * measured / self.shift, np.pi))


@dataclass(frozen=True, eq=False)
class Views:
    """Shrunken depth images of all posed frames."""

    camera: Intrinsics
    depth: NDArray[np.float32]  # (N, h, w) m
    T_world_cam: Array  # (N, 4, 4)
    row: dict[int, int]  # recording frame -> row


def load_views(recording: Recording, cameras: Trajectory) -> Views:
    """Read every posed frame's depth once, at the working width."""
    width = min(_WIDTH, recording.intrinsics.width)
    size = (width, max(1, round(recording.intrinsics.height * width / recording.intrinsics.width)))
    depth = np.stack(list(each(lambda f: mean_depth(recording.depth(int(f)), size), cameras.frames)))
    rows = {int(f): k for k, f in enumerate(cameras.frames)}
    return Views(recording.intrinsics.scaled(*size), depth, cameras.T_world_cam, rows)


def _part_points(views: Views, joint: Joint, state: Array, rows: NDArray[np.int64]) -> Array:
    """T_part_cam (n, 4, 4) of the part's frames."""
    return geo.invert_pose(joint.poses(state)) @ views.T_world_cam[rows]


@dataclass(frozen=True, eq=False)
class Patches:
    """A part in each labelled frame's camera: rows of its motion, points and normals (n, 3)."""

    index: list[int]
    points: list[Array]
    normals: list[Array]


def part_patches(
    views: Views, labels: Mapping[int, NDArray[np.uint8]], part: MovingPart, also: int | None = None
) -> Patches:
    """What labelled frames show of a part, and of label `also`, off its outline; joint doesn't matter."""
    h, w = views.depth.shape[1:]
    v, u = np.mgrid[0:h, 0:w]
    pixels = np.stack([u, v], axis=-1).astype(float)
    index = {int(f): k for k, f in enumerate(part.motion.frames)}
    frames = [f for f in labels if f in index]

    def patch(frame: int) -> tuple[Array, Array]:
        wanted = np.isin(labels[frame], [part.id, part.id if also is None else also])
        mask = cv2.resize(wanted.astype(np.uint8), (w, h), interpolation=cv2.INTER_NEAREST)
        mask = cv2.erode(mask, np.ones((3, 3), np.uint8))
        depth = views.depth[views.row[frame]]
        n = depth_normals(cv2.GaussianBlur(depth, (5, 5), 1.2), views.camera, 6.0)
        ok = (mask > 0) & (depth > 0) & np.isfinite(n).all(axis=-1)
        return views.camera.backproject(pixels[ok], depth[ok].astype(float)), n[ok]

    found = list(each(patch, frames))
    return Patches([index[f] for f in frames], [p for p, _ in found], [n for _, n in found])


def build_surfels(
    views: Views,
    patches: Patches,
    rows: NDArray[np.int64],
    joint: Joint,
    state: Array,
    voxel: float = VOXEL,
) -> tuple[Array, Array]:
    """Mean points and normals (K, 3) (part frame) per voxel and normal direction, in several frames."""
    keys, points, normals, seen_in = [], [], [], []
    for k, at, facing in zip(patches.index, patches.points, patches.normals, strict=True):
        T = geo.invert_pose(joint.pose(float(state[k]))) @ views.T_world_cam[rows[k]]
        x = geo.transform(T, at)
        m = facing @ T[:3, :3].T
        cell = np.floor(x / voxel).astype(np.int64) + 2**19
        main = np.abs(m).argmax(axis=1)
        octant = (main * 2 + (np.take_along_axis(m, main[:, None], 1)[:, 0] > 0)).astype(np.int64)
        keys.append(((cell[:, 0] * 2**20 + cell[:, 1]) * 2**20 + cell[:, 2]) * 6 + octant)
        points.append(x)
        normals.append(m)
        seen_in.append(np.full(len(x), k))
    if not keys:
        return np.zeros((0, 3)), np.zeros((0, 3))
    key, where = distinct(np.concatenate(keys))
    # whoever sees a voxel, once
    seen_by, _ = distinct(where.astype(np.int64) * len(views.depth) + np.concatenate(seen_in))
    views_of = np.bincount(seen_by // len(views.depth), minlength=len(key))
    count = np.bincount(where, minlength=len(key))
    mean = np.stack([np.bincount(where, c, len(key)) / count for c in np.concatenate(points).T], axis=-1)
    normal = np.stack([np.bincount(where, c, len(key)) / count for c in np.concatenate(normals).T], axis=-1)
    length = np.linalg.norm(normal, axis=1)
    keep = np.flatnonzero((views_of >= _MIN_VIEWS) & (length > 0.8))
    if len(keep) > _MAX_SURFELS:
        keep = keep[np.linspace(0, len(keep) - 1, _MAX_SURFELS).astype(int)]
    return mean[keep], normal[keep] / length[keep][:, None]


def in_part(
    views: Views, patches: Patches, rows: NDArray[np.int64], joint: Joint, state: Array
) -> list[tuple[int, Array, Array]]:
    """Each patch as row of the motion, points (n, 3) in the part's frame and in the world's."""
    out = []
    for k, at in zip(patches.index, patches.points, strict=True):
        world = geo.transform(views.T_world_cam[rows[k]], at)
        out.append((k, geo.transform(geo.invert_pose(joint.pose(float(state[k]))), world), world))
    return out


def surfel_terms(
    views: Views,
    surfels: tuple[Array, Array],
    rows: NDArray[np.int64],
    joint: Joint,
    state: Array,
    gate: float,
    noise: DepthNoise,
) -> Terms:
    """Look every surfel up in every frame's depth."""
    points, normals = surfels
    T_part_cam = _part_points(views, joint, state, rows)
    T_cam_part = geo.invert_pose(T_part_cam)

    def look(i: int) -> tuple[NDArray[np.int64], NDArray[np.int64], Array, Array]:
        row = rows[i]
        x = geo.transform(T_cam_part[i], points)
        n = normals @ T_cam_part[i, :3, :3].T
        cosine = -(x * n).sum(axis=1) / np.linalg.norm(x, axis=1)
        inside, u, v, z = look_up(views.depth[row], views.camera, x)
        seen = views.camera.backproject(np.stack([u, v], axis=1), z)
        distance = (n * (seen - x)).sum(axis=1)
        k = np.flatnonzero(inside & (cosine > _GRAZING) & (z > 0) & (np.abs(distance) < gate))
        # a plane seen at an angle: axial noise counts by its cosine, half a pixel of offset by the sine
        half = 0.5 * z[k] / views.camera.fx
        sigma = np.sqrt((noise.sigma(z[k]) * cosine[k]) ** 2 + half**2 * (1 - cosine[k] ** 2))
        return k, np.full(len(k), i), geo.transform(views.T_world_cam[row], seen[k]), sigma

    found = zip(*each(look, range(len(rows))), strict=True)
    term, frame, q, sigma = (np.concatenate(column) for column in found)
    return Terms(term, frame, q, sigma, normals)


def pixels_on(
    views: Views,
    rows: NDArray[np.int64],
    joint: Joint,
    state: Array,
    frame: int,
    points: Array,
    normal: Array,
) -> tuple[NDArray[np.bool_], NDArray[np.bool_], float]:
    """Whether points (n, 3) of the part are inside the picture of one of the part's frames, whether something
    is before them, and how long (m) a pixel there is on a plane through them with a `normal` (3,), in the
    middle of them all."""
    T_cam_part = geo.invert_pose(views.T_world_cam[rows[frame]]) @ joint.pose(float(state[frame]))
    x = geo.transform(T_cam_part, points)
    cosine = np.abs(x @ (T_cam_part[:3, :3] @ normal)) / np.linalg.norm(x, axis=1)
    footprint = x[:, 2] / views.camera.fx / np.maximum(cosine, 1e-3)
    inside, _, _, seen = look_up(views.depth[rows[frame]], views.camera, x)
    return inside, inside & (seen > 0) & (seen < x[:, 2] - BEFORE), float(np.median(footprint))


def track_terms(
    views: Views,
    movers: Movers,
    members: NDArray[np.bool_],
    part: MovingPart,
    rows: NDArray[np.int64],
    joint: Joint,
    state: Array,
    focal: float,
    noise: DepthNoise,
) -> Terms:
    """Three scalar terms per track, along directions square and parallel to its mean viewing ray."""
    ids = np.flatnonzero(members)
    frames = np.asarray(part.motion.frames)
    seen = movers.visible[frames][:, ids]
    i, k = np.nonzero(seen)
    q = movers.points_world[frames[i], ids[k]]
    T_part_world = geo.invert_pose(joint.poses(state))
    ray = q - views.T_world_cam[rows[i], :3, 3]
    depth = np.linalg.norm(ray, axis=1)
    ray_part = np.einsum("nij,nj->ni", T_part_world[i][:, :3, :3], ray / depth[:, None])
    mean_ray = np.stack([np.bincount(k, c, len(ids)) for c in ray_part.T], axis=-1)
    mean_ray[np.linalg.norm(mean_ray, axis=1) < 1e-9] = [0.0, 0.0, 1.0]
    basis = np.stack([geo.orthogonal_basis(d) for d in mean_ray]) if len(ids) else np.zeros((0, 3, 3))
    normals = np.swapaxes(basis, 1, 2).reshape(-1, 3)
    term = (3 * k[:, None] + np.arange(3)).ravel()
    cosine2 = (normals[term].reshape(-1, 3, 3) @ ray_part[:, :, None])[..., 0] ** 2
    lateral = PIXEL_SIGMA * depth / focal
    sigma = np.sqrt(cosine2 * noise.sigma(depth)[:, None] ** 2 + (1 - cosine2) * lateral[:, None] ** 2)
    return Terms(term, np.repeat(i, 3), np.repeat(q, 3, axis=0), sigma.ravel(), normals)
