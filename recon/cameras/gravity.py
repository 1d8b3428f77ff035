"""Which way is up: as the user says, else the device, else walls, floors, counters and how one holds it.

The last is a first guess, which `recon.contact.up` decides anew once surfaces and parts are known.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recon.dense.depth import depth_normals, mean_depth
from recon.recording import Recording
from recon.recording.said import Up, up_direction
from twin import geometry as geo
from twin.geometry import Array
from twin.runs.keys import Stage
from twin.scene import Trajectory

GRAVITY = Stage("gravity", 3, ())
# Planes so near to a direction that the user calls up refine it: it is meant as it is said, give or take what
# a person sees. Chosen by us.
_NEAR_DIRECTION = float(np.radians(10.0))
# The same for an axis of the camera: the nearest axis is at most 54.7 degrees off, and 45 where the head is
# level. Chosen by us.
_NEAR_AXIS = float(np.radians(45.0))
_FEWEST_NORMALS = 100  # less depth shows no plane
# The Manhattan fit to surface normals (Straub 2014 in spirit); all chosen by us.
# Frames whose normals are used, evenly spread
_KEYFRAMES = 10
# Width (pixels) to which depth is shrunk first
_WIDTH = 160
# Pairs of normals tried as walls and floor
_HYPOTHESES = 400
# Noise (rad) of normals at this width
_NORMAL_SIGMA = np.radians(4.0)
# Depth (m) beyond is left out: noise of structured light and time of flight grows with depth squared
_MAX_DEPTH = 5.0


@dataclass(frozen=True)
class Gravity:
    """Rotation R_world_start (3, 3) that turns the start world's z up, and its source."""

    R_world_start: Array
    source: str
    warnings: tuple[str, ...] = ()


def upright(
    recording: Recording,
    cameras: Trajectory,
    said: Up | None = None,
) -> Trajectory:
    """The cameras in a world whose z axis points up. said: the user's word on it."""
    gravity = find_gravity(recording, cameras, said)
    for note in gravity.warnings:
        warnings.warn(note, stacklevel=2)
    return cameras.transformed(geo.make_pose(gravity.R_world_start))


def find_gravity(
    recording: Recording,
    cameras: Trajectory,
    said: Up | None = None,
) -> Gravity:
    """Gravity as the user says, by the metadata, else by a Manhattan fit to normals of spread frames."""
    if said is not None:
        return _as_said(said, surface_normals(recording, cameras), cameras)
    if recording.gravity_camera0 is not None and cameras.pose(0) is not None:
        up = -geo.rotate(cameras.T_world_cam[0], recording.gravity_camera0)
        return Gravity(geo.rotation_between(up, [0, 0, 1]), "metadata")
    normals = surface_normals(recording, cameras)
    camera_up = geo.unit(-cameras.T_world_cam[:, :3, 1].mean(axis=0))
    camera_right = geo.unit(cameras.T_world_cam[:, :3, 0].mean(axis=0))
    if len(normals) < _FEWEST_NORMALS:
        message = "too little depth to see floors or walls: the mean camera-up direction is taken as up"
        return Gravity(geo.rotation_between(camera_up, [0, 0, 1]), "camera", (message,))
    up = _pick_up(manhattan_axes(normals), camera_up, camera_right)
    return Gravity(geo.rotation_between(up, [0, 0, 1]), "planes")


def _as_said(said: Up, normals: Array, cameras: Trajectory) -> Gravity:
    """Up as the user says, turned onto the planes' axis next to it if near and shown by normals (n, 3)."""
    up = geo.rotate(cameras.T_world_cam[0], up_direction(said))
    axes, known = shown_axes(normals)
    column = int(np.argmax(np.abs(axes.T @ up)))
    nearest = axes[:, column] * np.sign(axes[:, column] @ up)
    told = known[column] or known.sum() == 2  # two walls tell the third direction
    limit = _NEAR_AXIS if isinstance(said, str) else _NEAR_DIRECTION
    if told and geo.angle_between(nearest, up) <= limit:
        return Gravity(geo.rotation_between(nearest, [0, 0, 1]), "said, refined by planes")
    return Gravity(geo.rotation_between(up, [0, 0, 1]), "said")


def _pick_up(axes: Array, camera_up: Array, camera_right: Array) -> Array:
    """Up axis among +-columns of `axes`: heads are held level, so it is square to the camera's right."""
    candidates = np.concatenate([axes.T, -axes.T])
    score = candidates @ camera_up - np.abs(candidates @ camera_right)
    return np.asarray(candidates[np.argsort(-score)[0]])


def shown_axes(normals: Array) -> tuple[Array, NDArray[np.bool_]]:
    """The Manhattan axes (3, 3) of normals (n, 3), and which columns enough show; none of few."""
    if len(normals) < _FEWEST_NORMALS:
        return np.eye(3), np.zeros(3, dtype=bool)
    axes = manhattan_axes(normals)
    return axes, (np.abs(normals @ axes) > np.cos(3 * _NORMAL_SIGMA)).sum(axis=0) >= _FEWEST_NORMALS


def manhattan_axes(normals: Array) -> Array:
    """Rotation (3, 3) whose columns are the three orthogonal directions of most normals (n, 3)."""
    rng = np.random.default_rng(0)
    first = normals[rng.integers(0, len(normals), _HYPOTHESES)]
    second = normals[rng.integers(0, len(normals), _HYPOTHESES)]
    cross = np.cross(first, second)
    good = np.linalg.norm(cross, axis=1) > 0.9
    if not good.any():  # one plane only: its normal is all there is to know
        return geo.orthogonal_basis(np.median(normals, axis=0))
    z = geo.unit(cross[good])
    x = first[good]
    frames = np.stack([x, np.cross(z, x), z], axis=-1)
    sample = normals[rng.integers(0, len(normals), 2000)]
    angle2 = 2.0 * (1.0 - np.abs(np.einsum("nk,hka->hna", sample, frames)).max(axis=-1))
    best = frames[int(np.argmax(np.exp(-angle2 / (2 * (2 * _NORMAL_SIGMA) ** 2)).sum(axis=1)))]
    for _ in range(20):
        dots = normals @ best
        nearest = np.abs(dots).argmax(axis=1)
        picked = np.take_along_axis(dots, nearest[:, None], 1)[:, 0]
        weight = np.exp(-(1.0 - np.abs(picked)) / _NORMAL_SIGMA**2)
        target = np.eye(3)[nearest] * np.sign(picked)[:, None]
        u, _, vt = np.linalg.svd((normals * weight[:, None]).T @ target)
        best = u @ np.diag([1.0, 1.0, np.linalg.det(u @ vt)]) @ vt
    return np.asarray(best)


def surface_normals(recording: Recording, cameras: Trajectory) -> Array:
    """Surface normals (n, 3) in the world of the cameras, from depth smoothed to the working width."""
    return np.concatenate(normals_of_frames(recording, cameras))


def normals_of_frames(recording: Recording, cameras: Trajectory) -> list[Array]:
    """The same by frame, of some in their order."""
    scale = _WIDTH / recording.intrinsics.width
    size = (_WIDTH, max(1, round(recording.intrinsics.height * scale)))
    camera = recording.intrinsics.scaled(*size)
    picks = np.unique(np.linspace(0, len(cameras.frames) - 1, _KEYFRAMES).astype(int))
    out = []
    for k in picks:
        depth = recording.depth(int(cameras.frames[k]))
        normals = depth_normals(mean_depth(depth, size), camera, _MAX_DEPTH)
        out.append(normals[np.isfinite(normals).all(axis=-1)] @ cameras.T_world_cam[k, :3, :3].T)
    return out
