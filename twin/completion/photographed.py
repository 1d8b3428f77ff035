"""One face of a board as a picture: the photographs of what was seen on it, and what fills the rest."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from twin import geometry as geo
from twin.completion.shown import LOOKS, ON_FACE
from twin.geometry import Array
from twin.scene import Mesh, Texture

# m that a texel is wide: photo textures have 1.3 to 2.0 mm (benchmarks/look.md).
TEXEL = 0.0015
# m from the border of what was seen on a face within which colours are another surface's. Chosen by us: twice
# what a fused surface bends away from its plane before its edge (twin.completion.leaf.BENT).
_BENT = 0.010
# Share of a narrow face's width that its border may take on each side. Chosen by us: its middle half stays.
_NARROW = 0.25
# Texels between those looked up first. Chosen by us: 6 mm, less than what a face holds at least.
_STEP = 4
# Texels that tell a colour. Chosen by us: 2 cm^2.
FEW = 90
# Texels of a tile's shorter side at least, 3 cm. Chosen by us: the grain of wood shows.
_TILE = 20
# Share of a cell that was seen, and cells along a face, to find the largest rectangle. Chosen by us.
_SEEN = 0.98
_CELLS = 80
# Texels of the blur that parts a tile's grain from its light. Chosen by us: 4 cm.
_LIGHT = 27.0
# Texels over which a photograph fades into what fills the rest. Chosen by us: 1 cm.
_SOFT = 7.0
# Share of what lies around a texel that must have been seen to tell its light. Chosen by us.
_TOLD = 0.2
# Of the view of a surface from its side: no camera saw it from less, and what seems to be there is the skirt
# that a fused surface has around what hides it. Chosen by us: 75 deg.
ASKEW = float(np.cos(np.radians(75.0)))

F32 = NDArray[np.float32]
U8 = NDArray[np.uint8]
Mask = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Face:
    """A rectangle in the world: corner (3,), sides across and up (3,) m, outward normal (3,) and picture.

    color: (H, W, 3) sRGB of 0..255, the row at the corner first. seen: (H, W), where photographs show it.
    """

    corner: Array
    across: Array
    up: Array
    normal: Array
    color: F32
    seen: Mask

    def touched(self, corners: Array) -> bool:
        """Whether any triangle (n, 3, 3) m, by the box around it, lies on the face."""
        axes = np.stack([self.across, self.up, self.normal])
        sizes = np.array([np.linalg.norm(self.across), np.linalg.norm(self.up), 1.0])
        local = (corners - self.corner) @ (axes / sizes[:, None]).T
        far = np.array([sizes[0], sizes[1], 0.0]) + ON_FACE
        return bool(geo.every((local.min(axis=1) < far) & (local.max(axis=1) > -ON_FACE)).any())

    @property
    def area(self) -> float:
        """m^2 that was seen."""
        size = float(np.linalg.norm(self.across) * np.linalg.norm(self.up))
        return size * float(self.seen.mean())

    def where(self, holds: Callable[[Array], Mask], more: bool = False) -> Mask:
        """Texels (H, W) that `holds` at their middles (n, 3), tried every few; more: around these as well."""
        points = self.points(_STEP)
        coarse = holds(points.reshape(-1, 3)).reshape(points.shape[:2])
        coarse = _grown(coarse) if more else coarse
        return np.repeat(np.repeat(coarse, _STEP, 0), _STEP, 1)[: self.seen.shape[0], : self.seen.shape[1]]

    def points(self, step: int = 1) -> Array:
        """Middles (H, W, 3) m of its texels, or of every so many."""
        high, wide = self.seen.shape
        u, v = ((np.arange(0, n, step) + 0.5) / n for n in (wide, high))
        return np.asarray(self.corner + u[None, :, None] * self.across + v[:, None, None] * self.up)


def blank(corner: Array, across: Array, up: Array, normal: Array, texel: float) -> Face:
    """A face of which nothing was seen yet."""
    wide, high = (max(1, round(float(np.linalg.norm(side)) / texel)) for side in (across, up))
    return Face(
        corner, across, up, normal, np.zeros((high, wide, 3), np.float32), np.zeros((high, wide), bool)
    )


class Seen:
    """A seen surface with photographs, to be asked for its colours."""

    def __init__(self, mesh: Mesh, eyes: Array) -> None:
        import open3d as o3d

        self._scene = o3d.t.geometry.RaycastingScene()
        tensor = o3d.core.Tensor.from_numpy
        self._scene.add_triangles(
            tensor(mesh.vertices.astype(np.float32)), tensor(mesh.faces.astype(np.uint32))
        )
        self._corners = mesh.vertices[mesh.faces]
        self._normals = geo.triangle_normals(self._corners)[0]
        self._faced = faced(mesh, eyes)
        assert mesh.texture is not None
        self._texture: Texture = mesh.texture

    def on(self, face: Face, hidden: Callable[[Array], Mask]) -> Face:
        """The face with the photographs of the surface that lies on it and looks its way.

        hidden: whether points (n, 3) lie where nothing of the face can be seen.
        """

        def near(points: Array) -> Mask:
            there = self._nearest(points, face.normal)[0]
            return there & ~hidden(points) if there.any() else there

        if not face.touched(self._corners[self._faced & (self._normals @ face.normal > LOOKS)]):
            return face
        fine = face.where(near, more=True)
        if not fine.any():
            return face
        points = face.points()[fine]
        there, uv = self._nearest(points, face.normal)
        color, seen = face.color.copy(), face.seen.copy()
        shows = there & self._shown(uv) & ~hidden(points)
        rows = np.argwhere(fine)[shows]
        color[rows[:, 0], rows[:, 1]] = self._texture.at(uv[shows])
        seen[rows[:, 0], rows[:, 1]] = True
        found = _settled(replace(face, color=color, seen=seen))
        return found if found.seen.sum() > FEW else face

    def _nearest(self, points: Array, normal: Array) -> tuple[Mask, Array]:
        """Whether the surface nearest to points (n, 3) lies on a face of that normal, and its uv (n, 2)."""
        import open3d as o3d

        at = o3d.core.Tensor.from_numpy(np.ascontiguousarray(points, np.float32))
        found = self._scene.compute_closest_points(at)
        triangle = found["primitive_ids"].numpy().astype(np.int64)
        far = np.linalg.norm(found["points"].numpy() - points, axis=1)
        inner = found["primitive_uvs"].numpy()
        weights = np.column_stack([1 - inner.sum(axis=1), inner])
        uv = np.einsum("nk,nkc->nc", weights, self._texture.uv[triangle])
        on_it = (far < ON_FACE) & (self._normals[triangle] @ normal > LOOKS) & self._faced[triangle]
        return on_it, np.clip(uv, 0.0, 1.0)

    def _shown(self, uv: Array) -> Mask:
        """Whether a photograph shows the texels at coordinates (n, 2)."""
        rows, columns = self._texture.seen.shape
        x = np.clip((uv[:, 0] * columns).astype(np.int64), 0, columns - 1)
        y = np.clip(((1.0 - uv[:, 1]) * rows).astype(np.int64), 0, rows - 1)
        return np.asarray(self._texture.seen[y, x])


def faced(mesh: Mesh, eyes: Array) -> Mask:
    """Which triangles (F,) look towards a camera at eyes (n, 3) (world), no more oblique than ASKEW."""
    corners = mesh.vertices[mesh.faces]
    normals, middles = geo.triangle_normals(corners)[0], corners.mean(axis=1)
    best = np.full(len(middles), -1.0)
    for eye in eyes:
        way = eye - middles
        best = np.maximum(best, np.einsum("fi,fi->f", normals, way) / np.linalg.norm(way, axis=1))
    return np.asarray(best > ASKEW)


def _grown(mask: Mask) -> Mask:
    import cv2

    return np.asarray(cv2.dilate(mask.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0)


def _settled(face: Face) -> Face:
    """The face without the border of what was seen, at its edges and holes; texels between are kept."""
    import cv2

    rows, columns = face.seen.shape
    texel = float(np.linalg.norm(face.up)) / rows, float(np.linalg.norm(face.across)) / columns
    border = [int(min(_BENT / t, _NARROW * n)) for t, n in zip(texel, face.seen.shape, strict=True)]
    between = np.ones([2 * (n // 2) + 1 for n in border], np.uint8)
    around = np.ones([2 * n + 1 for n in border], np.uint8)
    closed = cv2.morphologyEx(
        face.seen.astype(np.uint8), cv2.MORPH_CLOSE, between, borderType=cv2.BORDER_CONSTANT, borderValue=0
    )
    inner = cv2.erode(closed, around, borderType=cv2.BORDER_CONSTANT, borderValue=0) > 0
    weight = face.seen.astype(np.float32)
    near = (
        _blurred(face.color * weight[..., None], 2.0, 0)
        / np.maximum(_blurred(weight, 2.0, 0), 1e-6)[..., None]
    )
    color = np.where((inner & ~face.seen)[..., None], near, face.color)
    return replace(face, color=color.astype(np.float32), seen=np.asarray(inner))


def tile_of(face: Face) -> F32 | None:
    """The picture of the largest rectangle of the face that was seen; None if narrower than _TILE."""
    cell = max(_STEP, -(-max(face.seen.shape) // _CELLS))
    rows, columns = (n // cell for n in face.seen.shape)
    cut = face.seen[: rows * cell, : columns * cell].reshape(rows, cell, columns, cell)
    top, bottom, left, right = (cell * n for n in _largest(cut.mean(axis=(1, 3)) >= _SEEN))
    if min(bottom - top, right - left) < _TILE:
        return None
    whole = np.where(face.seen[..., None], face.color, light_of(face))
    return np.asarray(whole[top:bottom, left:right], np.float32)


def _largest(cells: Mask) -> tuple[int, int, int, int]:
    """Rows from and to, columns from and to, of the largest rectangle of cells (H, W) that hold."""
    best, found = 0, (0, 0, 0, 0)
    for top in range(len(cells)):
        open_ = np.ones(cells.shape[1], bool)
        for bottom in range(top + 1, len(cells) + 1):
            open_ &= cells[bottom - 1]
            ends = np.flatnonzero(np.diff(open_, prepend=False, append=False))
            if not len(ends):
                break
            k = int(np.argmax(ends[1::2] - ends[::2]))
            left, right = int(ends[2 * k]), int(ends[2 * k + 1])
            if (right - left) * (bottom - top) > best:
                best, found = (right - left) * (bottom - top), (top, bottom, left, right)
    return found


def filled(face: Face, tile: F32 | None, color: Array | None, plain: Array) -> U8:
    """The picture (H, W, 3) of a face: photographs where they show it, else a tile, mirrored over and over.

    tile: of the face itself or of its like. Its light is that around it on the face, of an unseen face that
    of `color` (3,), or the tile's own if None. plain: colour (3,) where there is no tile.
    """
    high, wide = face.seen.shape
    if face.seen.all():
        return np.round(face.color).astype(np.uint8)
    grain: Array = np.ones((high, wide, 3))
    light: Array = np.broadcast_to(np.asarray(plain, np.float64), (high, wide, 3))
    if tile is not None:
        rows, columns = _mirrored(high, len(tile)), _mirrored(wide, tile.shape[1])
        even = _blurred(tile, _LIGHT)
        grain = (tile / np.maximum(even, 1.0))[rows][:, columns].astype(np.float64)
        light = even[rows][:, columns] * (
            1.0 if color is None else color / np.maximum(even.mean(axis=(0, 1)), 1.0)
        )
    picture = light * grain
    if face.seen.any():
        share = _feathered(face.seen)[..., None]
        picture = share * face.color + (1 - share) * light_of(face).astype(np.float64) * grain
    return np.round(np.clip(picture, 0, 255)).astype(np.uint8)


def _feathered(seen: Mask) -> Array:
    """Share (H, W) of a photograph: 0 where none shows a texel, rising to 1 over _SOFT texels inside."""
    import cv2

    apart = cv2.distanceTransform(seen.astype(np.uint8), cv2.DIST_L2, 3)
    return np.asarray(np.clip(apart / _SOFT, 0.0, 1.0), np.float64)


def _mirrored(count: int, length: int) -> NDArray[np.int64]:
    at = np.arange(count) % (2 * length)
    return np.asarray(np.minimum(at, 2 * length - 1 - at), np.int64)


def _blurred(picture: F32, sigma: float, outside: int | None = None) -> F32:
    """A picture blurred by `sigma` texels; beside it lies its mirror image, or `outside`."""
    import cv2

    small = max(1, int(sigma / 4))
    size = tuple(-(-n // small) for n in picture.shape[1::-1])
    less = cv2.resize(picture, size, interpolation=cv2.INTER_AREA) if small > 1 else picture
    border = cv2.BORDER_REFLECT if outside is None else cv2.BORDER_CONSTANT
    soft = cv2.GaussianBlur(less, (0, 0), sigma / small, borderType=border)
    return np.asarray(cv2.resize(soft, picture.shape[1::-1], interpolation=cv2.INTER_LINEAR), np.float32)


def light_of(face: Face) -> F32:
    """The light (H, W, 3) of a partly seen face: means around texels, ever narrower where much was seen."""
    weight = face.seen.astype(np.float32)
    value = face.color * weight[..., None]
    light = np.broadcast_to(value.sum(axis=(0, 1)) / weight.sum(), value.shape)
    for sigma in (64 * _LIGHT / 4, 16 * _LIGHT / 4, _LIGHT, _LIGHT / 4):
        near = _blurred(weight, sigma, 0)
        own = _blurred(value.astype(np.float32), sigma, 0) / np.maximum(near, 1e-6)[..., None]
        told = np.clip(near / _TOLD, 0.0, 1.0)[..., None]
        light = told * own + (1 - told) * light
    return np.asarray(light, np.float32)
