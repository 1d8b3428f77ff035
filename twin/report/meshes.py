"""Pictures of the twin by ray casting: no graphics card, no window."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from twin import geometry as geo
from twin.geometry import Array
from twin.inferred import Basis, Completion
from twin.report.frames import AXIS_COLOR, Image, axis_line, draw_polyline, part_color
from twin.scene import Mesh, Twin

Color = tuple[int, int, int]
Shown = tuple[Mesh, Color, float]  # a mesh, a colour, and how strongly that tints the mesh's own (0..1)
BACKGROUND = np.array([246.0, 247.0, 249.0])
STATIC_COLOR = (205, 208, 212)
# of inferred pieces: blue and orange
SHADES: dict[Basis, Color] = {"evidence": (120, 160, 205), "assumed": (224, 160, 96)}
_SUPERSAMPLING = 2


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


def part_view(twin: Twin, width: int, height: int) -> View:
    """From where the person stood, close enough to see the parts in all their states."""
    swept = _swept(twin)
    target = (swept.min(0) + swept.max(0)) / 2
    return look_at(_stand_point(twin, target), target, swept, width, height)


def overview(twin: Twin, width: int, height: int) -> View:
    """From behind and above the camera path, holding the path and the parts."""
    swept = _swept(twin)
    path = twin.cameras.T_world_cam[:, :3, 3] if twin.cameras is not None else swept
    points = np.concatenate([swept, path])
    target = (points.min(0) + points.max(0)) / 2
    centre = (swept.min(0) + swept.max(0)) / 2
    back = _stand_point(twin, centre) - centre
    back[2] = 0.0
    back = geo.unit(back) if np.linalg.norm(back) > 1e-6 else np.array([0.0, -1.0, 0.0])
    side = np.array([-back[1], back[0], 0.0])
    reach = max(0.6, float(np.linalg.norm(np.ptp(points, axis=0))))
    eye = target + reach * 1.5 * (0.55 * back + 0.7 * side + np.array([0.0, 0.0, 0.55]))
    view = look_at(eye, target, points, width, height)
    depths = geo.transform(geo.invert_pose(view.T_world_cam), points)[:, 2]
    # what stands before the scene would hide it
    return replace(view, near=max(0.0, float(depths.min()) - 0.4))


def opening(twin: Twin, steps: int, width: int = 560, height: int = 420) -> list[Image]:
    """Pictures of the twin from closed to open, every part at the same share of its range."""
    view = part_view(twin, width, height).scaled(_SUPERSAMPLING)
    rays = view.rays()
    static = _Caster(_layers(twin.static.mesh, twin.static.completion, STATIC_COLOR, 0.0)).cast(rays)
    pictures = []
    for share in np.linspace(0.0, 1.0, steps):
        moving = _Caster(_placed_layers(twin, float(share))).cast(rays)
        pictures.append(_shrink(_compose(static, moving)))
    return pictures


def dollhouse(twin: Twin, width: int = 720, height: int = 480) -> Image:
    """The scene from outside, without back faces, with camera path, first and last camera, and axes."""
    view = overview(twin, width, height).scaled(_SUPERSAMPLING)
    rays = view.rays()
    static = _Caster([(twin.static.mesh, STATIC_COLOR, 0.0)]).cast(rays, cull=True)
    image = _compose(static, _Caster(_placed_parts(twin, 0.0)).cast(rays))
    T_cam_world = geo.invert_pose(view.T_world_cam)
    width_px = max(3, view.width // 450)
    if twin.cameras is not None:
        poses = twin.cameras.T_world_cam
        shades = np.linspace(0.0, 1.0, max(2, len(poses)))
        for k in range(len(poses) - 1):
            color = _mix((20, 160, 220), (120, 40, 200), float(shades[k]))
            draw_polyline(image, poses[k : k + 2, :3, 3], T_cam_world, view.matrix, color, width=width_px)
        for pose, color in ((poses[0], (20, 160, 220)), (poses[-1], (120, 40, 200))):
            draw_polyline(image, _frustum(pose), T_cam_world, view.matrix, color, width=width_px)
    for part in twin.parts:
        draw_polyline(
            image, axis_line(part), T_cam_world, view.matrix, AXIS_COLOR, arrow=True, width=2 * width_px
        )
    return _shrink(image)


def draw_meshes(meshes: Sequence[Mesh], view: View) -> Image:
    """Picture of coloured meshes; surfaces seen from behind are left out."""
    rays = view.scaled(_SUPERSAMPLING).rays()
    layer = _Caster([(m, STATIC_COLOR, 0.0) for m in meshes]).cast(rays, cull=True)
    return _shrink(_compose(layer, layer))


@dataclass(frozen=True, eq=False)
class _Layer:
    """Distance (H, W), infinite where nothing is hit, and shaded colour (H, W, 3)."""

    distance: NDArray[np.float32]
    color: NDArray[np.float32]


class _Caster:
    """Casts rays at meshes, each with a colour and how strongly that colour tints the mesh's own (0..1)."""

    def __init__(self, meshes: Sequence[Shown]) -> None:
        import open3d as o3d

        self._scene = o3d.t.geometry.RaycastingScene()
        self._shown = [m for m in meshes if len(m[0].faces)]
        for mesh, _, _ in self._shown:
            vertices, faces = mesh.vertices.astype(np.float32), mesh.faces.astype(np.uint32)
            self._scene.add_triangles(o3d.core.Tensor.from_numpy(vertices), o3d.core.Tensor.from_numpy(faces))

    def cast(self, rays: NDArray[np.float32], *, cull: bool = False) -> _Layer:
        """Picture of the meshes along `rays` (H, W, 6); with `cull`, back faces are seen through."""
        import open3d as o3d

        shape = rays.shape[:2]
        distance = np.full(shape, np.inf, dtype=np.float32)
        color = np.zeros((*shape, 3), dtype=np.float32)
        if not self._shown:
            return _Layer(distance, color)
        flat = rays.reshape(-1, 6)
        left, travelled = np.arange(len(flat)), np.zeros(len(flat), dtype=np.float32)
        for _ in range(5 if cull else 1):  # walls of a room: a ray leaves the outside of at most a few
            answer = self._scene.cast_rays(o3d.core.Tensor.from_numpy(np.ascontiguousarray(flat)))
            t = answer["t_hit"].numpy()
            hit = np.flatnonzero(np.isfinite(t))
            facing = np.einsum("ij,ij->i", answer["primitive_normals"].numpy()[hit], flat[hit, 3:])
            seen = facing < 0 if cull else np.ones(len(hit), dtype=bool)
            at = hit[seen]
            distance.reshape(-1)[left[at]] = travelled[at] + t[at]
            shade = 0.45 + 0.55 * np.abs(facing[seen])  # a lamp at the eye
            color.reshape(-1, 3)[left[at]] = self._colors(answer, at) * shade[:, None]
            behind = hit[~seen]
            if not len(behind):
                break
            step = t[behind] + 1e-3
            left, travelled, flat = left[behind], travelled[behind] + step, flat[behind].copy()
            flat[:, :3] += step[:, None] * flat[:, 3:]
        return _Layer(distance, color)

    def _colors(self, answer: Any, at: NDArray[np.int64]) -> NDArray[np.float32]:
        """Colours (n, 3) where the rays `at` hit: by texture, else vertices, else the mesh; tinted."""
        uv, hit = answer["primitive_uvs"].numpy()[at], answer["geometry_ids"].numpy()[at]
        weights = np.column_stack([1 - uv.sum(axis=1), uv])
        face = answer["primitive_ids"].numpy()[at].astype(np.int64)
        colors = np.zeros((len(at), 3), dtype=np.float32)
        for k, (mesh, color, tint) in enumerate(self._shown):
            here = hit == k
            if mesh.texture is not None:
                own = mesh.texture.at(np.einsum("nk,nkc->nc", weights[here], mesh.texture.uv[face[here]]))
            elif mesh.colors is not None:
                own = np.einsum("nk,nkc->nc", weights[here], mesh.colors[mesh.faces[face[here]]])
            else:
                own = np.array(color)
            colors[here] = (1 - tint) * own + tint * np.array(color)
        return colors


def _placed_parts(twin: Twin, share: float) -> list[Shown]:
    states = {p.id: p.joint.lower + share * (p.joint.upper - p.joint.lower) for p in twin.parts}
    return [(p.mesh.transformed(twin.part_pose(p.id, states)), part_color(p), 0.3) for p in twin.parts]


def _placed_layers(twin: Twin, share: float) -> list[Shown]:
    """What was seen and what is inferred of every part, opened by a share of its range."""
    states = {p.id: p.joint.lower + share * (p.joint.upper - p.joint.lower) for p in twin.parts}
    return [
        (mesh.transformed(twin.part_pose(p.id, states)), color, tint)
        for p in twin.parts
        for mesh, color, tint in _layers(p.mesh, p.completion, part_color(p), 0.3)
    ]


def _layers(mesh: Mesh, completion: Completion | None, color: Color, tint: float) -> list[Shown]:
    """A seen mesh, or what an inferred layer shows of it with the room; pieces in their basis' shade."""
    if completion is None:
        return [(mesh, color, tint)]
    seen = [completion.shown, *([] if completion.room is None else [completion.room])]
    return [*((m, color, tint) for m in seen), *((p.mesh, SHADES[p.basis], 1.0) for p in completion.pieces)]


def _swept(twin: Twin) -> Array:
    """Corners of the boxes around 98 % of each part's vertices, closed, half open and open."""
    meshes = [m for share in (0.0, 0.5, 1.0) for m, _, _ in _placed_parts(twin, share)]
    meshes = [m for m in meshes if len(m.vertices)] or [twin.static.mesh]
    points = [np.quantile(m.vertices, (0.01, 0.99), axis=0) for m in meshes if len(m.vertices)]
    if not points:
        return np.array([[-0.5, -0.5, 0.0], [0.5, 0.5, 1.0]])
    return np.concatenate(
        [[[b[i, 0], b[j, 1], b[k, 2]] for i in (0, 1) for j in (0, 1) for k in (0, 1)] for b in points]
    )


def _stand_point(twin: Twin, target: Array) -> Array:
    """Where the camera was in the middle, or a point in front of the first contact, or just some place."""
    if twin.cameras is not None:
        return np.array(np.median(twin.cameras.T_world_cam[:, :3, 3], axis=0))
    contacts = [p.contact for p in twin.parts if p.contact is not None]
    outward = contacts[0].rotation[:, 2] if contacts else np.array([-0.6, -0.7, 0.4])
    return target + 1.5 * outward + np.array([0.0, 0.0, 0.2])


def _compose(a: _Layer, b: _Layer) -> Image:
    """The nearer of two layers at each pixel, over the background."""
    color = np.where((a.distance <= b.distance)[..., None], a.color, b.color)
    color[~(np.isfinite(a.distance) | np.isfinite(b.distance))] = BACKGROUND
    return np.ascontiguousarray(color.astype(np.uint8))


def _shrink(image: Image) -> Image:
    import cv2

    size = (image.shape[1] // _SUPERSAMPLING, image.shape[0] // _SUPERSAMPLING)
    return np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), dtype=np.uint8)


def _frustum(T_world_cam: Array, size: float = 0.12) -> Array:
    """A camera as one line (n, 3): pyramid from its centre."""
    x, y, z = 0.8 * size, 0.6 * size, size
    c = [(-x, -y, z), (x, -y, z), (x, y, z), (-x, y, z)]
    o = (0, 0, 0)
    return geo.transform(T_world_cam, np.array([o, c[0], c[1], o, c[2], c[3], o, c[0], c[3], c[2], c[1]]))


def _mix(a: tuple[int, int, int], b: tuple[int, int, int], share: float) -> tuple[int, int, int]:
    r, g, bl = (round(x + (y - x) * share) for x, y in zip(a, b, strict=True))
    return r, g, bl
