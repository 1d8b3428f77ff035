"""Fusion: one coloured mesh of the static scene and one of each part, from labelled depth.

Each body has its own signed distance field. A part is fused in its own frame, so that every frame shows
another side of it; whatever other bodies show behind a voxel proves the voxel empty.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recon.dense.depth import F32, look_up
from recon.dense.noise import GOOD_SENSOR, DepthNoise
from recon.fusion.mesh_cleaning import keep_large_pieces, reduce_faces, smooth
from recon.fusion.tsdf import Observation, allocate, integrate, own_points, ray_cosine, surface
from recon.interaction.parts.moving_part import MovingPart
from recon.recording import Intrinsics, Recording
from twin import geometry as geo
from twin.errors import ReconstructionError
from twin.geometry import Array
from twin.runs.keys import Stage
from twin.runs.loop import Loop, untold
from twin.runs.setting import Settings, setting
from twin.runs.threads import each
from twin.scene import STATIC_LABEL, Mesh, Trajectory

FUSION = Stage("fusion", 3, ("fusion",))


@dataclass(frozen=True)
class FusionConfig(Settings):
    """How meshes are made; chosen by us."""

    part_voxel: float = setting(0.005, "voxel of parts", unit="m", above=0)
    static_voxel: float = setting(0.01, "voxel of the static scene", unit="m", above=0)
    part_faces: int = setting(8_000, "most triangles of a part, for simulation", unit="triangles", at_least=4)
    static_faces: int = setting(60_000, "most triangles of the static scene", unit="triangles", at_least=4)


# m; depth beyond is left out. Chosen by us.
MAX_DEPTH = 5.0
# Connected pieces of a part with a smaller share of the largest one's triangles are noise. Chosen by us.
_MIN_SHARE = 0.05
# The same of the static scene, whose true pieces differ more in size. Chosen by us.
_STATIC_MIN_SHARE = 0.002
# m; pieces of a part farther from the rest of it are not its own. Chosen by us.
_MAX_GAP = 0.2
# Rounds of Taubin smoothing. Chosen by us.
_SMOOTHING = 3
# Evidence that a surface needs, in frames that see it straight on. Chosen by us.
_MIN_VIEWS = 0.25


@dataclass(frozen=True, eq=False)
class FusedScene:
    """Coloured meshes in the world. parts: id -> mesh at state 0; ids without any surface are missing."""

    static: Mesh
    parts: dict[int, Mesh]


@dataclass(frozen=True, eq=False)
class _Frame:
    color: NDArray[np.uint8]
    depth: F32
    labels: NDArray[np.uint8]
    cosine: F32
    T_world_cam: Array


def fuse(
    recording: Recording,
    cameras: Trajectory,
    labels: Mapping[int, NDArray[np.uint8]],
    parts: Sequence[MovingPart],
    config: FusionConfig = FusionConfig(),
    noise: DepthNoise = GOOD_SENSOR,
    *,
    progress: Loop | None = None,
) -> FusedScene:
    """Fuse the labelled frames into a mesh of the static scene and one of each part at state 0.

    Args:
        labels: frame -> (H, W) label image. Frames without a camera pose are left out.
        noise: of depth.

    Raises ReconstructionError when no labelled frame has a camera pose or none shows static scene.
    """
    camera = recording.intrinsics
    frames = [f for f in sorted(labels) if cameras.pose(f) is not None]
    if not frames:
        raise ReconstructionError(
            "no labelled frame has a camera pose", "label frames which the cameras cover"
        )
    wrap = progress or untold
    loaded = each(lambda f: _load(recording, cameras, labels[f], f, camera, noise), frames)
    seen = dict(zip(wrap(frames, "depth"), loaded, strict=True))
    bodies: dict[int, MovingPart | None] = {STATIC_LABEL: None, **{p.id: p for p in parts}}
    meshes = {}
    for key, part in wrap(list(bodies.items()), "meshes"):
        mesh = _fuse_body(seen, key, part, camera, config, noise)
        if mesh is not None:
            meshes[key] = mesh
    if STATIC_LABEL not in meshes:
        raise ReconstructionError("the labelled frames show no static surface", "check depth and labels")
    return FusedScene(meshes.pop(STATIC_LABEL), meshes)


def _load(
    recording: Recording,
    cameras: Trajectory,
    labels: NDArray[np.uint8],
    frame: int,
    camera: Intrinsics,
    noise: DepthNoise,
) -> _Frame:
    color, depth = recording.frame(frame)
    z = np.where(depth <= MAX_DEPTH, depth, 0).astype(np.float32)
    cosine = ray_cosine(z, camera.vector, max(2, round(4 * z.shape[1] / 640)), noise.curve)
    pose = cameras.pose(frame)
    assert pose is not None
    return _Frame(color, z, labels, cosine, pose)


def _fuse_body(
    seen: Mapping[int, _Frame],
    key: int,
    part: MovingPart | None,
    camera: Intrinsics,
    config: FusionConfig,
    noise: DepthNoise,
) -> Mesh | None:
    """Mesh of one body in the world at state 0; None when no labelled pixel shows it."""
    voxel = config.static_voxel if part is None else config.part_voxel
    observations, frames = [], []
    for number, f in seen.items():
        pose = np.eye(4) if part is None else part.pose(number)
        if pose is None:
            continue
        own = (f.labels == key) & (f.cosine > 0)
        to_camera = geo.invert_pose(f.T_world_cam) @ pose
        observations.append(Observation(f.depth, own, f.cosine, camera, to_camera))
        frames.append(f)
    if not observations:
        return None
    cloud = np.concatenate(list(each(lambda o: own_points(o, 2), observations)))
    if len(cloud) < 100:
        return None
    typical = float(np.median(np.concatenate([o.depth[o.own] for o in observations])))
    sigma = float(noise.sigma(typical))
    truncation = max(3.0 * voxel, min(2.5 * sigma, 4.0 * voxel))
    field = allocate(cloud, voxel, truncation)
    del cloud  # a hundred megabytes that nothing needs any more
    integrate(field, observations, truncation, 0.5, noise.curve)
    vertices, faces = surface(field, _MIN_VIEWS * 1e-5 / sigma**2)
    share = _STATIC_MIN_SHARE if part is None else _MIN_SHARE
    gap = np.inf if part is None else _MAX_GAP
    vertices, faces = keep_large_pieces(vertices, faces, share, gap)
    if not len(faces):
        return None
    vertices = smooth(vertices, faces, _SMOOTHING)
    vertices, faces = reduce_faces(
        vertices, faces, config.static_faces if part is None else config.part_faces
    )
    return Mesh(vertices, faces, _vertex_colors(vertices, observations, frames, truncation))


def _vertex_colors(
    vertices: Array, observations: list[Observation], frames: list[_Frame], reach: float
) -> NDArray[np.uint8]:
    """Mean colour (v, 3) of the own pixels that see each vertex, seen straight and near counting more.

    Vertices which nothing sees take the mean colour of the body.
    """

    def look(k: int) -> tuple[NDArray[np.int64], Array, Array]:
        o, f = observations[k], frames[k]
        p = geo.transform(o.T_cam_body, vertices)
        inside, a, b, z = look_up(o.depth, o.camera, p, near=0.05)
        at = np.flatnonzero(inside & o.own[b, a] & (np.abs(z - p[:, 2]) * o.cosine[b, a] < reach))
        a, b = a[at], b[at]
        gain = o.cosine[b, a] ** 2 / p[at, 2] ** 2
        return at, gain, gain[:, None] * f.color[b, a]

    total, weight = np.zeros((len(vertices), 3)), np.zeros(len(vertices))
    for at, gain, color in each(look, range(len(frames))):
        total[at] += color
        weight[at] += gain
    lit = weight > 0
    colors = np.full((len(vertices), 3), 127.0)
    colors[lit] = total[lit] / weight[lit, None]
    if lit.any():
        colors[~lit] = colors[lit].mean(axis=0)
    return np.asarray(np.clip(np.round(colors), 0, 255), dtype=np.uint8)
