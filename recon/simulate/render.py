"""The renderer: Open3D's ray casting (Embree, no GL) for depth, ids and shadows; own kernels for colour."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recon.simulate import shading
from recon.simulate.ray_caster import NO_HIT, Caster
from recon.simulate.surfaces import Surface
from recon.simulate.textures import SIZE, mipmaps
from twin.geometry import Array, invert_pose

AMBIENT_REACH = 0.6  # metres; chosen by us: corners of cupboards darken, whole rooms do not
F32 = NDArray[np.float32]


@dataclass(frozen=True)
class Camera:
    """Pinhole camera, pixel centres at integers."""

    width: int
    height: int
    focal: float

    @staticmethod
    def of(width: int, height: int, hfov_deg: float) -> Camera:
        """Camera of a horizontal field of view in degrees, principal point in the middle."""
        return Camera(width, height, 0.5 * width / math.tan(math.radians(hfov_deg) / 2.0))

    @property
    def centre(self) -> tuple[float, float]:
        """Principal point (cx, cy) in pixels."""
        return (self.width - 1) / 2.0, (self.height - 1) / 2.0

    def project(self, points_cam: Array) -> Array:
        """Pixels (..., 2) of camera points (..., 3); points behind the camera give NaN."""
        z = np.where(points_cam[..., 2:] > 1e-6, points_cam[..., 2:], np.nan)
        return points_cam[..., :2] / z * self.focal + np.array(self.centre)


@dataclass(frozen=True)
class Lights:
    """Rectangular lights: `shapes` (L, 3, 3) = centre and two half edges, `powers` (L, 3), `sky` (3,) ambient."""

    shapes: F32
    powers: F32
    sky: F32


@dataclass(frozen=True)
class Body:
    """Surfaces that move together; `label` is the value they get in the label image."""

    surfaces: tuple[Surface, ...]
    label: int


@dataclass(frozen=True)
class Hits:
    """What rays met: depth along z (inf for nothing), body index (-1), global face index, barycentric (u, v)."""

    depth: F32
    body: NDArray[np.int32]
    face: NDArray[np.int64]
    uv: F32


@dataclass(frozen=True)
class View:
    """One rendered frame: linear `colour` (H, W, 3), exact `depth` (H, W) m (0 for nothing), `labels` (H, W),
    `normals` (H, W, 3) in the world, `gloss` and `tone` (H, W): shininess and brightness of what is seen.
    """

    colour: F32
    depth: F32
    labels: NDArray[np.uint8]
    normals: F32
    gloss: F32
    tone: F32


class Renderer:
    """Renders bodies at poses. Textures and corner normals are prepared once per body."""

    def __init__(
        self, camera: Camera, lights: Lights, samples: int, light_samples: int, ambient_samples: int
    ):
        self.camera = camera
        self.lights = lights
        steps = (np.arange(samples) + 0.5) / samples - 0.5
        self._offsets = np.array([(x, y) for y in steps for x in steps], dtype=np.float32)
        self._light_samples, self._ambient_samples = light_samples, ambient_samples
        self._atlas: list[F32] = []
        self._atlas_size = 0
        self._images: dict[int, NDArray[np.int64]] = {}
        self._prepared: dict[int, _Prepared] = {}

    def render(
        self, bodies: list[Body], poses: list[Array], T_world_camera: Array, rng: np.random.Generator
    ) -> View:
        """Render `bodies` at `poses` T_world_body from a camera at `T_world_camera` (OpenCV axes)."""
        frame = _Frame(self, bodies, poses)
        height, width = self.camera.height, self.camera.width
        pose = T_world_camera.astype(np.float32)
        cx, cy = self.camera.centre
        centre_only = np.zeros((1, 2), np.float32)
        centre_rays = shading.primary_rays(height, width, self.camera.focal, cx, cy, centre_only, pose)
        centre_rays = centre_rays.reshape(-1, 6)
        centre = frame.cast(centre_rays)
        normals = shading.pixel_normals(
            centre_rays, centre.body, centre.face, centre.uv, frame.corners, frame.poses
        )
        depth = np.where(np.isfinite(centre.depth), centre.depth, 0.0).astype(np.float32)
        light = self._light(frame, centre_rays, depth, normals, centre.body, rng)
        rays = shading.primary_rays(height, width, self.camera.focal, cx, cy, self._offsets, pose)
        hits = frame.cast(rays.reshape(-1, 6))
        shape = rays.shape[:3]
        colour = shading.shade(
            rays,
            hits.depth.reshape(shape),
            hits.body.reshape(shape),
            hits.face.reshape(shape),
            hits.uv.reshape(*shape, 2),
            frame.corners,
            frame.face_surface,
            frame.poses,
            frame.textures,
            frame.tile,
            frame.gloss,
            frame.starts,
            frame.atlas,
            SIZE,
            self.lights.shapes,
            self.lights.powers,
            self.lights.sky,
            light,
            depth.reshape(height, width),
            centre.body.reshape(height, width),
            1.0 / self.camera.focal / math.sqrt(len(self._offsets)),
        )
        surface = np.where(centre.body >= 0, frame.face_surface[centre.face], 0)
        labels = np.array([*(b.label for b in bodies), 0], dtype=np.uint8)[centre.body]
        return View(
            colour,
            depth.reshape(height, width),
            labels.reshape(height, width),
            normals.reshape(height, width, 3),
            frame.gloss[surface].reshape(height, width),
            frame.tone[surface].reshape(height, width),
        )

    def _light(
        self,
        frame: _Frame,
        rays: F32,
        depth: F32,
        normals: F32,
        body: NDArray[np.int32],
        rng: np.random.Generator,
    ) -> F32:
        """Visibility of each light and ambient openness (H, W, L + 1), smoothed along surfaces."""
        n, lights = len(rays), self.lights.shapes
        out = np.zeros((n, len(lights) + 1), np.float32)
        for j, shape in enumerate(lights):
            for _ in range(self._light_samples):
                random = rng.random((n, 2), dtype=np.float32)
                out[:, j] += frame.free(shading.light_rays(rays, depth, normals, shape, random))
            out[:, j] /= self._light_samples
        for _ in range(self._ambient_samples):
            random = rng.random((n, 2), dtype=np.float32)
            out[:, -1] += frame.free(shading.ambient_rays(rays, depth, normals, AMBIENT_REACH, random))
        out[:, -1] /= self._ambient_samples
        height, width = self.camera.height, self.camera.width
        light = out.reshape(height, width, -1)
        for step in (1, 2, 4):
            light = shading.smooth_light(
                light,
                depth.reshape(height, width),
                normals.reshape(height, width, 3),
                body.reshape(height, width),
                step,
            )
        return light

    def prepared(self, body: Body) -> _Prepared:
        """Arrays of a body, made on first use. Bodies are known by identity: reuse them between frames."""
        if id(body) not in self._prepared:
            self._prepared[id(body)] = _Prepared(body, [self._starts(s) for s in body.surfaces])
        return self._prepared[id(body)]

    def atlas(self) -> F32:
        """All texture images and their mip levels in one flat array."""
        if len(self._atlas) > 1:
            self._atlas = [np.concatenate(self._atlas)]
        return self._atlas[0]

    def _starts(self, surface: Surface) -> NDArray[np.int64]:
        key = id(surface.material.image)
        if key not in self._images:
            starts = []
            for level in mipmaps(surface.material.image):
                starts.append(self._atlas_size)
                self._atlas.append(np.ascontiguousarray(level, dtype=np.float32).reshape(-1))
                self._atlas_size += level.size
            self._images[key] = np.array(starts, dtype=np.int64)
        return self._images[key]


class _Prepared:
    """Concatenated arrays of one body."""

    def __init__(self, body: Body, starts: list[NDArray[np.int64]]):
        self.body = body  # kept so that its id stays its own
        counts = [len(s.vertices) for s in body.surfaces]
        base = np.concatenate([[0], np.cumsum(counts)[:-1]])
        self.vertices = np.concatenate([s.vertices for s in body.surfaces]).astype(np.float32)
        self.faces = np.concatenate([s.faces + b for s, b in zip(body.surfaces, base, strict=True)]).astype(
            np.uint32
        )
        self.corners = np.concatenate([s.with_normals() for s in body.surfaces]).astype(np.float32)
        self.surface = np.repeat(np.arange(len(body.surfaces)), [len(s.faces) for s in body.surfaces])
        self.to_texture = np.stack([s.T_texture_object for s in body.surfaces])
        self.tile = np.array([s.material.tile for s in body.surfaces], np.float32)
        self.gloss = np.array([s.material.gloss for s in body.surfaces], np.float32)
        self.tone = np.array([float(s.material.image.mean()) for s in body.surfaces], np.float32)
        self.starts = np.stack(starts)


class _Frame:
    """The bodies of one frame in the world: an Embree scene and the tables that the kernels read."""

    def __init__(self, renderer: Renderer, bodies: list[Body], poses: list[Array]):
        parts = [renderer.prepared(b) for b in bodies]
        self.atlas = renderer.atlas()
        self._caster = Caster()
        self._face_base = np.concatenate([[0], np.cumsum([len(p.faces) for p in parts])[:-1]]).astype(
            np.int64
        )
        surface_base = np.concatenate([[0], np.cumsum([len(p.tile) for p in parts])[:-1]])
        textures = []
        for part, pose in zip(parts, poses, strict=True):
            world = part.vertices.astype(np.float64) @ pose[:3, :3].T + pose[:3, 3]
            self._caster.add(world, part.faces)
            textures.append(part.to_texture @ invert_pose(pose))
        self.poses = np.stack(poses).astype(np.float32)
        self.corners = np.concatenate([p.corners for p in parts])
        self.face_surface = np.concatenate([p.surface + b for p, b in zip(parts, surface_base, strict=True)])
        self.textures = np.concatenate(textures).astype(np.float32)
        self.tile = np.concatenate([p.tile for p in parts])
        self.starts = np.concatenate([p.starts for p in parts])
        self.gloss = np.concatenate([p.gloss for p in parts])
        self.tone = np.concatenate([p.tone for p in parts])

    def cast(self, rays: F32) -> Hits:
        """First hits of rays (n, 6)."""
        found = self._caster.first(rays)
        hit = found.mesh != NO_HIT
        body = np.where(hit, found.mesh, 0).astype(np.int32)
        face = np.where(hit, found.face + self._face_base[body], 0).astype(np.int64)
        body[~hit] = -1
        return Hits(found.t, body, face, found.uv)

    def free(self, segments: F32) -> F32:
        """1 where a segment start + (0, 1] * vector (n, 6) meets nothing, else 0."""
        return (~self._caster.blocked(segments)).astype(np.float32)
