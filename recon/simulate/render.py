"""The renderer: Open3D's ray casting (Embree, no GL) for depth, ids and shadows; own kernels for colour."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from recon.simulate import shading
from recon.simulate.bodies import Body as Body  # callers know it from here
from recon.simulate.bodies import BodyCache
from recon.simulate.lighting import LightRays, Seen, received
from recon.simulate.painters import SIZE
from recon.simulate.ray_caster import NO_HIT, Caster
from twin.geometry import Array, invert_pose

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
    """Lights: `shapes` (L, 3, 3) = centre and two half edges, `powers` (L, 3), `sky` (3,) ambient."""

    shapes: F32
    powers: F32
    sky: F32


@dataclass(frozen=True)
class Hits:
    """What rays met: depth along z (inf for nothing), body index (-1), global face index, barycentric (u, v)
    and the `flat` normal (n, 3) of the face.
    """

    depth: F32
    body: NDArray[np.int32]
    face: NDArray[np.int64]
    uv: F32
    flat: F32


@dataclass(frozen=True)
class View:
    """One rendered frame: linear `colour` (H, W, 3), exact `depth` (H, W) m (0 for nothing), `labels` (H, W),
    `normals` (H, W, 3) in the world, `gloss` and `tone` (H, W): shininess and brightness of what is seen
    (0 for nothing), `body` (H, W): index of the body that is seen, -1 for nothing.
    """

    colour: F32
    depth: F32
    labels: NDArray[np.uint8]
    normals: F32
    gloss: F32
    tone: F32
    body: NDArray[np.int32]

    def dark(self) -> View:
        """The same with something on the lens: nothing is seen."""
        seen = {k: np.zeros_like(v) for k, v in vars(self).items()}
        return View(**seen | {"body": np.full_like(self.body, -1)})


class Renderer:
    """Renders bodies at poses. Textures and corner normals are prepared once per body.

    Args of the constructor:
        camera: where pixels look.
        lights: lamps and ambient.
        samples: sub-pixel samples on each side.
        light_samples: shadow rays for each lamp and place.
        ambient_samples: ambient rays for each place.
        light_pitch: pixels between those places. 2 was chosen by us: smoothing along surfaces spans 15 pixels
            anyway.
    """

    def __init__(
        self,
        camera: Camera,
        lights: Lights,
        samples: int,
        light_samples: int,
        ambient_samples: int,
        light_pitch: int = 2,
    ):
        self.camera = camera
        self.lights = lights
        steps = (np.arange(samples) + 0.5) / samples - 0.5
        self._offsets = np.array([(x, y) for y in steps for x in steps], dtype=np.float32)
        self._light_rays = LightRays(light_samples, ambient_samples, light_pitch)
        self._cache = BodyCache()

    def render(
        self, bodies: list[Body], poses: list[Array], T_world_camera: Array, rng: np.random.Generator
    ) -> View:
        """Render `bodies` at `poses` T_world_body from a camera at `T_world_camera` (OpenCV axes).

        The light needs every second pixel only, and sub-pixel samples are cast only where a pixel touches
        more than one face; inside a face they are where their rays meet its plane. What is thinner than a
        pixel and passes between the centres of nine that all see one face is not in the picture.
        """
        return self.prepared(bodies, poses, T_world_camera, rng)()

    def prepared(
        self, bodies: list[Body], poses: list[Array], T_world_camera: Array, rng: np.random.Generator
    ) -> Callable[[], View]:
        """The same for later: the result renders in any thread, beside other frames; this, one thread."""
        return partial(self._rendered, _Frame(self._cache, bodies, poses), T_world_camera, rng)

    def _rendered(self, frame: _Frame, T_world_camera: Array, rng: np.random.Generator) -> View:
        shape = (self.camera.height, self.camera.width)
        pose = T_world_camera.astype(np.float32)
        rays = self._rays(np.arange(shape[0] * shape[1]), np.zeros((1, 2), np.float32), pose)[:, 0]
        centre = frame.cast(rays)
        normals = shading.pixel_normals(rays, centre.body, centre.face, centre.uv, frame.corners, frame.poses)
        depth = np.where(np.isfinite(centre.depth), centre.depth, 0.0).astype(np.float32)
        seen = Seen(rays, depth.reshape(shape), normals.reshape(*shape, 3), centre.body.reshape(shape))
        light = received(seen, self.lights.shapes, self._light_rays, frame.free, rng)
        colour = self._colour(frame, seen, centre, light, pose)
        hit, surface = centre.body >= 0, frame.face_surface[centre.face]
        labels = frame.labels[centre.body]
        return View(
            colour,
            seen.depth,
            labels.reshape(shape),
            seen.normals,
            np.where(hit, frame.gloss[surface], np.float32(0.0)).reshape(shape),
            np.where(hit, frame.tone[surface], np.float32(0.0)).reshape(shape),
            seen.body,
        )

    def _rays(self, pixels: NDArray[np.int64], offsets: F32, pose: F32) -> F32:
        """Rays (m, n, 6) through `pixels` (m,) plus `offsets` (n, 2)."""
        rays: F32 = shading.primary_rays(
            pixels, self.camera.width, self.camera.focal, *self.camera.centre, offsets, pose
        )
        return rays

    def _colour(self, frame: _Frame, seen: Seen, centre: Hits, light: F32, pose: F32) -> F32:
        """Linear colour (H, W, 3)."""
        shape, n = seen.depth.shape, len(self._offsets)
        out = np.zeros((shape[0] * shape[1], 3), np.float32)
        surfaces = (
            *(frame.face_surface, frame.textures, frame.tile, frame.gloss, frame.starts),
            *(frame.texels, SIZE),
        )
        lamps = (self.lights.shapes, self.lights.powers, self.lights.sky)
        pixel_size = 1.0 / self.camera.focal / math.sqrt(n)
        apart = np.zeros(shape, bool) if n == 1 else shading.crossed(seen.body, centre.face.reshape(shape))
        inside = np.flatnonzero(~apart.reshape(-1) & (centre.body >= 0))
        shading.shade_insides(
            inside,
            seen.rays,
            (seen.depth.reshape(-1), centre.face, centre.flat),
            seen.normals.reshape(-1, 3),
            light.reshape(len(out), -1),
            surfaces,
            (self._offsets @ pose[:3, :2].T / np.float32(self.camera.focal)).astype(np.float32),
            pixel_size,
            lamps,
            out,
        )
        edge = np.flatnonzero(apart)
        rays = self._rays(edge, self._offsets, pose)
        hits = frame.cast(rays.reshape(-1, 6))
        shading.shade_samples(
            edge,
            rays,
            (
                hits.depth.reshape(-1, n),
                hits.body.reshape(-1, n),
                hits.face.reshape(-1, n),
                hits.uv.reshape(-1, n, 2),
            ),
            (frame.corners, frame.poses),
            (seen.depth, seen.body, light),
            surfaces,
            pixel_size,
            lamps,
            out,
        )
        return out.reshape(*shape, 3)


class _Frame:
    """The bodies of one frame in the world: an Embree scene and the tables that the kernels read."""

    def __init__(self, cache: BodyCache, bodies: list[Body], poses: list[Array]):
        parts = cache.prepared(bodies)
        self.texels = cache.texels
        self.labels = np.array([*(b.label for b in bodies), 0], dtype=np.uint8)  # the last is for -1: nothing
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
        return Hits(found.t, body, face, found.uv, found.flat)

    def free(self, segments: F32) -> F32:
        """1 where a segment start + (0, 1] * vector (n, 6) meets nothing, else 0."""
        return (~self._caster.blocked(segments)).astype(np.float32)
