"""Fusion: one coloured mesh of the static scene and one of each part, from labelled depth.

Each body has its own signed distance field. A part is fused in its own frame, so that every frame shows
another side of it; whatever other bodies show behind a voxel proves the voxel empty.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from tempfile import TemporaryFile
from typing import IO

import numpy as np
from numpy.typing import NDArray

from recon.dense.depth import F32, look_up
from recon.dense.noise import GOOD_SENSOR, DepthNoise
from recon.fusion.mesh_cleaning import keep_large_pieces, reduce_faces, smooth
from recon.fusion.observation import Observation, own_points
from recon.fusion.tsdf import allocate, integrate, ray_cosine, surface
from recon.interaction.parts.moving_part import MovingPart
from recon.recording import Recording
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
# Of the pixels, every so many one across and down tells where a body is.
_STRIDE = 2
# Of depth, a millimetre each.
_BINS = 5000
# Points of a body without which it has no surface. Chosen by us.
_FEWEST = 100


@dataclass(frozen=True, eq=False)
class FusedScene:
    """Coloured meshes in the world. parts: id -> mesh at state 0; ids without any surface are missing."""

    static: Mesh
    parts: dict[int, Mesh]


class _Frames:
    """The labelled frames, of which memory holds the label images alone: depth is read again when a body
    needs it, and the cosines of rays and normals, which take longest, wait in a file without a name."""

    def __init__(
        self,
        recording: Recording,
        cameras: Trajectory,
        labels: Mapping[int, NDArray[np.uint8]],
        frames: Sequence[int],
        noise: DepthNoise,
        file: IO[bytes],
    ) -> None:
        self.recording, self.camera, self.frames = recording, recording.intrinsics, frames
        self.poses = dict(zip(cameras.frames.tolist(), cameras.T_world_cam, strict=True))
        self._labels, self._noise, self._file = labels, noise, file
        self._shape = self.camera.height, self.camera.width

    def prepare(self, k: int) -> None:
        """Find the cosines of frame `frames[k]`."""
        z = self._depth(self.frames[k])
        step = max(2, round(4 * z.shape[1] / 640))
        cosine = ray_cosine(z, self.camera.vector, step, self._noise.curve).astype(np.float32)
        os.pwrite(self._file.fileno(), np.ascontiguousarray(cosine).data, k * cosine.nbytes)

    def observation(self, k: int, key: int, pose: Array) -> Observation:
        """Frame `frames[k]` for the body with label `key` at a pose (4, 4) in the world."""
        cosine = np.empty(self._shape, np.float32)
        os.preadv(self._file.fileno(), [cosine.data.cast("B")], k * cosine.nbytes)
        frame = self.frames[k]
        own = (self._labels[frame] == key) & (cosine > 0)
        to_camera = geo.invert_pose(self.poses[frame]) @ pose
        return Observation(self._depth(frame), own, cosine, self.camera, to_camera)

    def _depth(self, frame: int) -> F32:
        depth = self.recording.depth(frame)
        return np.where(depth <= MAX_DEPTH, depth, 0).astype(np.float32)


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
    frames = [f for f in sorted(labels) if cameras.pose(f) is not None]
    if not frames:
        raise ReconstructionError(
            "no labelled frame has a camera pose", "label frames which the cameras cover"
        )
    wrap, meshes = progress or untold, {}
    with TemporaryFile() as file:
        seen = _Frames(recording, cameras, labels, frames, noise, file)
        prepared = each(seen.prepare, range(len(frames)))
        for _ in wrap(frames, "depth"):
            next(prepared)
        bodies: dict[int, MovingPart | None] = {STATIC_LABEL: None, **{p.id: p for p in parts}}
        for key, part in wrap(list(bodies.items()), "meshes"):
            mesh = _fuse_body(seen, key, part, config, noise)
            if mesh is not None:
                meshes[key] = mesh
    if STATIC_LABEL not in meshes:
        raise ReconstructionError("the labelled frames show no static surface", "check depth and labels")
    return FusedScene(meshes.pop(STATIC_LABEL), meshes)


@dataclass(frozen=True, eq=False)
class _Extent:
    """What one frame shows of a body: box low, high (3,) m of its points, how many these are, and how many of
    its pixels have a depth in each bin."""

    low: Array
    high: Array
    points: int
    counts: NDArray[np.int64]

    @classmethod
    def of(cls, seen: Observation) -> _Extent:
        points = own_points(seen, _STRIDE)
        empty = np.full((1, 3), np.inf)
        low, high = np.concatenate([points, empty]).min(axis=0), np.concatenate([points, -empty]).max(axis=0)
        return cls(low, high, len(points), np.bincount(_bin(seen.depth[seen.own]), minlength=_BINS))


def _bin(depth: F32) -> NDArray[np.int64]:
    """Which of `_BINS` bins depths (n,) m lie in."""
    return np.minimum((depth * np.float32(_BINS / MAX_DEPTH)).astype(np.int64), _BINS - 1)


def _median(counts: NDArray[np.int64], within: Callable[[int, int], F32]) -> float:
    """The median of depths, as NumPy has it, of which so many lie in each bin.

    within: the depths of two bins.
    """
    total = np.cumsum(counts)
    ranks = np.array([(total[-1] - 1) // 2, total[-1] // 2])
    low, high = (int(k) for k in np.searchsorted(total, ranks, side="right"))
    values = np.sort(within(low, high))  # no bin between the two holds any
    return float(np.mean(values[ranks - (total[low] - counts[low])]))


def _fuse_body(
    seen: _Frames, key: int, part: MovingPart | None, config: FusionConfig, noise: DepthNoise
) -> Mesh | None:
    """Mesh of one body in the world at state 0; None when no labelled pixel shows it."""
    voxel = config.static_voxel if part is None else config.part_voxel
    poses = [np.eye(4) if part is None else part.pose(f) for f in seen.frames]
    used = [k for k, pose in enumerate(poses) if pose is not None]

    def observation(k: int) -> Observation:
        pose = poses[k]
        assert pose is not None
        return seen.observation(k, key, pose)

    extents = list(each(lambda k: _Extent.of(observation(k)), used))
    shown = [k for k, e in zip(used, extents, strict=True) if e.points]
    if sum(e.points for e in extents) < _FEWEST:
        return None

    def within(low: int, high: int) -> F32:
        def of(k: int) -> F32:
            o = observation(k)
            depth, place = o.depth[o.own], _bin(o.depth[o.own])
            return depth[(place == low) | (place == high)]

        holding = [k for k, e in zip(used, extents, strict=True) if e.counts[low] or e.counts[high]]
        return np.concatenate(list(each(of, holding)))

    typical = _median(np.sum([e.counts for e in extents], axis=0), within)
    sigma = float(noise.sigma(typical))
    truncation = max(3.0 * voxel, min(2.5 * sigma, 4.0 * voxel))
    low, high = np.min([e.low for e in extents], axis=0), np.max([e.high for e in extents], axis=0)
    clouds = each(lambda k: own_points(observation(k), _STRIDE), shown)
    field = allocate(low, high, clouds, voxel, truncation)
    integrate(field, each(observation, used), truncation, 0.5, noise.curve)
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

    def color(k: int) -> NDArray[np.uint8]:
        return seen.recording.color(seen.frames[k])

    return Mesh(vertices, faces, _vertex_colors(vertices, observation, color, used, truncation))


def _vertex_colors(
    vertices: Array,
    observation: Callable[[int], Observation],
    color: Callable[[int], NDArray[np.uint8]],
    used: Sequence[int],
    reach: float,
) -> NDArray[np.uint8]:
    """Mean colour (v, 3) of the own pixels that see each vertex, seen straight and near counting more.

    Vertices which nothing sees take the mean colour of the body.
    """

    def look(k: int) -> tuple[NDArray[np.int64], Array, Array]:
        o = observation(k)
        p = geo.transform(o.T_cam_body, vertices)
        inside, a, b, z = look_up(o.depth, o.camera, p, near=0.05)
        at = np.flatnonzero(inside & o.own[b, a] & (np.abs(z - p[:, 2]) * o.cosine[b, a] < reach))
        a, b = a[at], b[at]
        gain = o.cosine[b, a] ** 2 / p[at, 2] ** 2
        return at, gain, gain[:, None] * color(k)[b, a]

    total, weight = np.zeros((len(vertices), 3)), np.zeros(len(vertices))
    for at, gain, shown in each(look, used):
        total[at] += shown
        weight[at] += gain
    lit = weight > 0
    colors = np.full((len(vertices), 3), 127.0)
    colors[lit] = total[lit] / weight[lit, None]
    if lit.any():
        colors[~lit] = colors[lit].mean(axis=0)
    return np.asarray(np.clip(np.round(colors), 0, 255), dtype=np.uint8)
