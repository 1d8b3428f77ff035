"""Shapes of bodies: triangle meshes and boxes. Numpy only; every type checks its laws when built."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from twin import geometry as geo
from twin.errors import SceneError
from twin.geometry import Array
from twin.quantities import Described
from twin.quantities import frozen_array as _frozen
from twin.quantities import set_field as _set

if TYPE_CHECKING:
    import trimesh


@dataclass(frozen=True, eq=False, repr=False)
class Texture(Described):
    """Picture of a mesh's surface.

    uv: (F, 3, 2) float32, where each corner of each face lies in the image, 0..1, v up. image: (H, W, 3)
    uint8 sRGB, top row first. seen: (H, W) bool, texels of pictures; others are in-painted or off every face.
    """

    uv: NDArray[np.float32]
    image: NDArray[np.uint8]
    seen: NDArray[np.bool_]

    def __post_init__(self) -> None:
        _set(self, "uv", _frozen(self.uv, (None, 3, 2), "texture coordinates", np.float32))
        _set(self, "image", _frozen(self.image, (None, None, 3), "texture image", np.uint8))
        _set(self, "seen", _frozen(self.seen, self.image.shape[:2], "texture mask", np.bool_))
        if not self.image.size:
            raise SceneError(f"a texture needs an image, got one of {self.image.shape[:2]} texels")
        if len(self.uv) and not (self.uv.min() >= 0 and self.uv.max() <= 1):
            raise SceneError(
                f"texture coordinates must be in 0..1, got {self.uv.min():g} to {self.uv.max():g}"
            )

    def of(self, faces: NDArray[Any]) -> Texture:
        """The texture of some faces, by mask or number; the image stays whole."""
        return Texture(self.uv[faces], self.image, self.seen)

    def at(self, uv: Array) -> NDArray[np.uint8]:
        """Colours (..., 3) of the texels at coordinates (..., 2) in 0..1, v up."""
        rows, columns = self.image.shape[:2]
        x = np.clip((uv[..., 0] * columns).astype(np.int64), 0, columns - 1)
        y = np.clip(((1.0 - uv[..., 1]) * rows).astype(np.int64), 0, rows - 1)
        return self.image[y, x]


@dataclass(frozen=True, eq=False, repr=False)
class Mesh(Described):
    """Triangle mesh: vertices (V, 3) m, faces (F, 3) int32; optional colours (V, 3) uint8 sRGB, texture."""

    vertices: Array
    faces: NDArray[np.int32]
    colors: NDArray[np.uint8] | None = None
    texture: Texture | None = None

    def __post_init__(self) -> None:
        _set(self, "vertices", _frozen(self.vertices, (None, 3), "mesh vertices"))
        _set(self, "faces", _frozen(self.faces, (None, 3), "mesh faces", np.int32))
        if len(self.faces) and (self.faces.min() < 0 or self.faces.max() >= len(self.vertices)):
            raise SceneError(
                f"mesh faces index vertices {self.faces.min()}..{self.faces.max()} of {len(self.vertices)}"
            )
        if self.colors is not None:
            _set(self, "colors", _frozen(self.colors, (len(self.vertices), 3), "mesh colors", np.uint8))
        if self.texture is not None and len(self.texture.uv) != len(self.faces):
            raise SceneError(
                f"a texture for {len(self.texture.uv)} faces does not fit a mesh of {len(self.faces)}"
            )

    @cached_property
    def surface_digest(self) -> bytes:
        """A digest of vertices and faces: meshes with the same one have the same surface."""
        h = hashlib.blake2b(str(self.vertices.shape).encode(), digest_size=16)
        h.update(np.ascontiguousarray(self.vertices).data)
        h.update(np.ascontiguousarray(self.faces).data)
        return h.digest()

    def transformed(self, T_new_old: Array) -> Mesh:
        """The mesh in another frame."""
        return Mesh(geo.transform(T_new_old, self.vertices), self.faces, self.colors, self.texture)

    def of(self, keep: NDArray[np.bool_], vertices: Array | None = None) -> Mesh:
        """Some faces (F,) with their vertices, which may be moved (V, 3) m; colours and texture follow."""
        used = np.unique(self.faces[keep])
        number = np.zeros(len(self.vertices), np.int32)
        number[used] = np.arange(len(used))
        return Mesh(
            (self.vertices if vertices is None else vertices)[used],
            number[self.faces[keep]],
            None if self.colors is None else self.colors[used],
            None if self.texture is None else self.texture.of(keep),
        )

    def to_trimesh(self) -> trimesh.Trimesh:
        """A copy as a `trimesh.Trimesh`, with photographs or else vertex colours; no vertex merged or lost.

        A texture gives every face vertices of its own, as trimesh has one texture coordinate a vertex.
        """
        import trimesh

        if self.texture is None:
            vertices, faces, colors = self.vertices, self.faces, self.colors
            return trimesh.Trimesh(vertices.copy(), faces.copy(), vertex_colors=colors, process=False)
        import PIL.Image

        uv = self.texture.uv.reshape(-1, 2)
        visual = trimesh.visual.TextureVisuals(uv=uv, image=PIL.Image.fromarray(self.texture.image))
        corners = self.vertices[self.faces].reshape(-1, 3)
        return trimesh.Trimesh(corners, np.arange(len(corners)).reshape(-1, 3), visual=visual, process=False)

    @property
    def area(self) -> float:
        """Surface area in m^2."""
        return float(geo.triangle_areas(self.vertices[self.faces]).sum())

    @property
    def area_centroid(self) -> Array:
        """Centroid (3,) of the surface, each face weighing its area; the vertex mean without area."""
        w = geo.triangle_areas(self.vertices[self.faces])
        if w.sum() < 1e-15:
            return np.asarray(self.vertices.mean(axis=0))
        return np.asarray((self.vertices[self.faces].mean(axis=1) * w[:, None]).sum(0) / w.sum())


@dataclass(frozen=True, eq=False, repr=False)
class Box(Described):
    """Solid box: pose T_world_box (4, 4) of its centre, full `size` (3,) in metres along its axes."""

    T_world_box: Array
    size: Array

    def __post_init__(self) -> None:
        _set(self, "T_world_box", _frozen(self.T_world_box, (4, 4), "box pose"))
        _set(self, "size", _frozen(self.size, (3,), "box size"))
        if np.any(self.size <= 0):
            raise SceneError(f"box size must be positive, got {self.size.tolist()}")
        if not geo.is_rotation(self.T_world_box[:3, :3]):
            raise SceneError("a box needs a pose with right-handed axes of length 1")

    @property
    def corners(self) -> Array:
        """The eight corners (8, 3) in the world frame."""
        signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
        return geo.transform(self.T_world_box, signs * self.size / 2)

    def transformed(self, T_new_old: Array) -> Box:
        """The same box in a new world frame, by a pose (4, 4)."""
        return Box(orthonormal(T_new_old @ self.T_world_box), self.size)


def orthonormal(pose: Array) -> Array:
    """The pose (4, 4) with its rotation orthonormal to the last digit, as products are not."""
    u, _, v = np.linalg.svd(pose[:3, :3])
    return geo.make_pose(u @ v, pose[:3, 3])


Collision = Mesh | Box
