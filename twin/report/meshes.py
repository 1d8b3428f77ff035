"""Pictures of the twin by ray casting: no graphics card, no window."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from twin import geometry as geo
from twin.geometry import Array
from twin.inferred import Basis, Completion
from twin.report.frames import AXIS_COLOR, Image, axis_line, draw_polyline, part_color
from twin.report.views import View, above, overview, part_view, placed
from twin.scene import Mesh, Part, Twin

Color = tuple[int, int, int]
Shown = tuple[Mesh, Color, float]  # a mesh, a colour, and how strongly that tints the mesh's own (0..1)
BACKGROUND = np.array([246.0, 247.0, 249.0])
STATIC_COLOR = (205, 208, 212)
# of inferred pieces: blue and orange
SHADES: dict[Basis, Color] = {"evidence": (120, 160, 205), "assumed": (224, 160, 96)}
_SUPERSAMPLING = 2
# of names on the map: Hershey's plain font, and its scale
_FONT, _LETTERS = 0, 1.1


def opening(
    twin: Twin, steps: int, width: int = 560, height: int = 420, only: Part | None = None
) -> list[Image]:
    """Pictures of the twin from closed to open, every part at the same share of its range.

    only: the part that opens, seen from where the person stood then.
    """
    parts = twin.parts if only is None else (only,)
    view = part_view(twin, parts, width, height).scaled(_SUPERSAMPLING)
    rays = view.rays()
    static = _Caster(_layers(twin.static.mesh, twin.static.completion, STATIC_COLOR, 0.0)).cast(rays)
    pictures = []
    for share in np.linspace(0.0, 1.0, steps):
        moving = _Caster(_placed_layers(twin, {p.id: float(share) for p in parts})).cast(rays)
        pictures.append(_shrink(_compose(static, moving)))
    return pictures


def dollhouse(twin: Twin, width: int = 720, height: int = 480) -> Image:
    """The scene from outside, without back faces, with camera path, first and last camera, and axes."""
    view = overview(twin, width, height).scaled(_SUPERSAMPLING)
    rays = view.rays()
    static = _Caster([(twin.static.mesh, STATIC_COLOR, 0.0)]).cast(rays, cull=True)
    image = _compose(static, _Caster(_placed_parts(twin, 0.0)).cast(rays))
    _draw_path(image, twin, view)
    for part in twin.parts:
        draw_polyline(
            image,
            axis_line(part),
            geo.invert_pose(view.T_world_cam),
            view.matrix,
            AXIS_COLOR,
            arrow=True,
            width=2 * _line(view),
        )
    return _shrink(image)


def plan(twin: Twin, width: int = 720, height: int = 480) -> Image:
    """The scene from straight above, half open, with camera path and the parts' names; ceilings are seen
    through."""
    import cv2

    view = above(twin, width, height).scaled(_SUPERSAMPLING)
    rays = view.rays()
    static = _Caster([(twin.static.mesh, STATIC_COLOR, 0.0)]).cast(rays, cull=True)
    moving = _Caster([(m, color, 0.7) for m, color, _ in _placed_parts(twin, 0.5)]).cast(rays)
    image = _compose(static, moving)
    _draw_path(image, twin, view)
    T_cam_world = geo.invert_pose(view.T_world_cam)
    written: list[tuple[int, int, int]] = []  # base line and ends of each name
    seen = [(p, m) for p, m in zip(twin.parts, placed(twin, 0.5), strict=True) if len(m.vertices)]
    for part, mesh in seen:
        middle = 0.5 * (mesh.vertices.min(axis=0) + mesh.vertices.max(axis=0))
        x, y, z = view.matrix @ geo.transform(T_cam_world, middle[None])[0]
        (across, up), _ = cv2.getTextSize(part.name, _FONT, _LETTERS, 2)
        left = int(np.clip(x / z - across / 2, 4, view.width - across - 4))
        base = int(np.clip(y / z + up / 2, up + 4, view.height - 4))
        while any(abs(base - b) < 1.4 * up and left < r and x0 < left + across for b, x0, r in written):
            base += up // 4
        written.append((base, left, left + across))
        for dx, dy in (*product((-3, 0, 3), repeat=2), (0, 0)):  # white about the name, then the name
            color = part_color(part) if dx == dy == 0 else (255, 255, 255)
            cv2.putText(image, part.name, (left + dx, base + dy), _FONT, _LETTERS, color, 2, cv2.LINE_AA)
    return _shrink(image)


def _line(view: View) -> int:
    """Width of a line, px."""
    return max(3, view.width // 450)


def _draw_path(image: Image, twin: Twin, view: View) -> None:
    """The camera path from blue to violet, with its first and last camera."""
    if twin.cameras is None:
        return
    T_cam_world, poses = geo.invert_pose(view.T_world_cam), twin.cameras.T_world_cam
    shades = np.linspace(0.0, 1.0, max(2, len(poses)))
    for k in range(len(poses) - 1):
        color = _mix((20, 160, 220), (120, 40, 200), float(shades[k]))
        draw_polyline(image, poses[k : k + 2, :3, 3], T_cam_world, view.matrix, color, width=_line(view))
    for pose, color in ((poses[0], (20, 160, 220)), (poses[-1], (120, 40, 200))):
        draw_polyline(image, _frustum(pose), T_cam_world, view.matrix, color, width=_line(view))


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
    meshes = placed(twin, share)
    return [(m, part_color(p), 0.3) for p, m in zip(twin.parts, meshes, strict=True)]


def _placed_layers(twin: Twin, share: Mapping[int, float]) -> list[Shown]:
    """What was seen and what is inferred of every part, opened by the share of its range, closed without."""
    states = {
        p.id: p.joint.lower + share.get(p.id, 0.0) * (p.joint.upper - p.joint.lower) for p in twin.parts
    }
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
