"""Pictures side by side in one image: the texture of meshes of different pictures, or vertex colours."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from twin.geometry import Array
from twin.mesh import GREY, joined
from twin.scene import Mesh, Texture

# Texels around a picture that go with it: what mip levels and cubic sampling read beside it.
BORDER = 4
# Texels of an image's side. Chosen by us: every graphics card since OpenGL 4.1 takes four times that, and an
# image of that size is written as PNG in about two seconds.
MOST_TEXELS = 4096
# Texels of the side of an image of face cells. Every renderer takes this.
_MOST_CELLS = 2048

I64 = NDArray[np.int64]
U8 = NDArray[np.uint8]


def joined_textures(meshes: Sequence[Mesh]) -> tuple[Mesh, float]:
    """All meshes as one with one texture, if any has one, and the factor by which its pictures shrank.

    A picture that several meshes wear is kept once. Faces without one get texels of their vertex colours.
    """
    whole = joined(meshes)
    shown = [m for m in meshes if len(m.faces)]
    key = {id(m): _digest(m.texture.image) for m in shown if m.texture is not None}
    worn = {key[id(m)]: m.texture for m in shown if m.texture is not None}
    if not worn:
        return whole, 1.0
    pictures = list(worn.values())
    plain = np.repeat([m.texture is None for m in shown], [len(m.faces) for m in shown])
    if plain.any():
        pictures.append(_of_colors(whole, plain))
    image, seen, places, factor = _side_by_side(pictures)
    place = dict(zip(worn, places, strict=False))
    uv = np.zeros((len(whole.faces), 3, 2), np.float32)
    first = 0
    for m in shown:
        if m.texture is not None:
            uv[first : first + len(m.faces)] = _placed(m.texture.uv, place[key[id(m)]])
        first += len(m.faces)
    if plain.any():
        uv[plain] = _placed(pictures[-1].uv, places[-1])
    return Mesh(whole.vertices, whole.faces, whole.colors, Texture(uv, image, seen)), factor


def _digest(image: U8) -> tuple[tuple[int, ...], bytes]:
    """What tells one picture from another."""
    return image.shape, hashlib.sha256(image.tobytes()).digest()


def _placed(uv: NDArray[np.float32], place: Array) -> Array:
    """Coordinates in the image of their picture at `place` (4,): left, bottom, width, height in 0..1."""
    return np.clip(place[:2] + uv.astype(np.float64) * place[2:], 0.0, 1.0)


def _of_colors(mesh: Mesh, faces: NDArray[np.bool_]) -> Texture:
    """Texture of faces (F,) of a mesh in its vertex colours; faces of the same three colours share texels.

    A face of one colour lies in one point, where no mip level of its neighbours is read.
    """
    colors = np.full((len(mesh.vertices), 3), GREY, np.uint8) if mesh.colors is None else mesh.colors
    corners = colors[mesh.faces[faces]].reshape(-1, 9)
    different, which = np.unique(corners, axis=0, return_inverse=True)
    image, uv = color_cells(different.reshape(-1, 3, 3))
    even = np.all(different.reshape(-1, 3, 3) == different[:, None, :3], axis=(1, 2))
    uv[even] = uv[even].mean(axis=1, keepdims=True)
    return Texture(uv[which.reshape(-1)].astype(np.float32), image, np.ones(image.shape[:2], bool))


def _side_by_side(pictures: Sequence[Texture]) -> tuple[U8, NDArray[np.bool_], list[Array], float]:
    """An image with its mask of the pictures, the place (4,) of each, and the factor that shrank them."""
    border = BORDER if len(pictures) > 1 else 0
    full = np.array([p.image.shape[1::-1] for p in pictures])
    factor = 1.0
    while True:
        size = np.maximum(np.round(full * factor).astype(np.int64), 1)
        at, whole = shelves(size + 2 * border)
        if max(whole) <= MOST_TEXELS:
            break
        factor *= min(0.98, MOST_TEXELS / max(whole))
    wide, high = (at + size + 2 * border).max(axis=0)
    image, seen = np.zeros((high, wide, 3), np.uint8), np.zeros((high, wide), bool)
    places = []
    for picture, (w, h), (x, y) in zip(pictures, size, at, strict=True):
        frame = np.s_[y : y + h + 2 * border, x : x + w + 2 * border]
        around = (border, border)
        image[frame] = np.pad(shrunk(picture.image, w, h), (around, around, (0, 0)), mode="edge")
        seen[frame] = np.pad(shrunk(picture.seen.astype(np.uint8), w, h) > 0, (around, around), mode="edge")
        places.append(np.array([(x + border) / wide, 1 - (y + border + h) / high, w / wide, h / high]))
    return image, seen, places, factor


def shrunk(image: U8, width: int, height: int) -> U8:
    """An image at another size, each texel the mean of those that it covers."""
    if image.shape[:2] == (height, width):
        return image
    import cv2

    size = (int(width), int(height))
    return np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), np.uint8)


def shelves(size: I64) -> tuple[I64, tuple[int, int]]:
    """Places (C, 2) for frames of `size` (C, 2) in rows, the highest first; width and height of all."""
    wide = int(max(size[:, 0].max(), np.ceil(np.sqrt((size[:, 0] * size[:, 1]).sum()))))
    place = np.zeros_like(size)
    x = y = row = 0
    for k in np.lexsort((np.arange(len(size)), -size[:, 1])):
        w, h = size[k]
        if x + w > wide:
            x, y, row = 0, y + row, 0
        place[k] = (x, y)
        x, row = x + int(w), max(row, int(h))
    return place, (wide, y + row)


def color_cells(corner_colors: U8) -> tuple[U8, Array]:
    """Image (side, side, 3), top row first, and coordinates (F, 3, 2), v up, of corner colours (F, 3, 3)."""
    return face_cells(corner_colors, lambda colors: np.round(colors).astype(np.uint8), 8)


def face_cells(corners: NDArray[np.generic], color: Callable[[Array], U8], most: int) -> tuple[U8, Array]:
    """Image (side, side, 3), top row first, with texels for each face, and coordinates (F, 3, 2), v up.

    Two faces share a square cell of s x s texels, s at most `most`: corner texels (0,0) (s-2,0) (0,s-2) and,
    turned, (s-1,s-1) (1,s-1) (s-1,1). `color` gives the colours (..., 3) of values (..., K) that are linear
    between those of the `corners` (F, 3, K).
    """
    n = len(corners)
    grid = int(np.ceil(np.sqrt((n + 1) // 2)))
    s = int(np.clip(_MOST_CELLS // grid, 4, most))
    i, j = np.meshgrid(np.arange(s), np.arange(s), indexing="xy")
    first = i + j < s
    u = np.where(first, i, s - 1 - i) / (s - 2)
    v = np.where(first, j, s - 1 - j) / (s - 2)
    weights = np.clip(np.stack([1 - u - v, u, v], axis=-1), 0.0, 1.0)
    weights /= weights.sum(axis=-1, keepdims=True)
    padded = np.concatenate([corners, np.repeat(corners[-1:], 2 * grid * grid - n, axis=0)])
    pairs = padded.reshape(grid, grid, 2, 3, 1, -1).astype(np.float64)
    cells = np.empty((grid, grid, s, s, pairs.shape[-1]))
    for half, texels in enumerate((first, ~first)):
        a, b, c = weights[texels].T[:, :, None]
        corner = pairs[:, :, half]
        cells[:, :, texels] = a * corner[:, :, 0] + b * corner[:, :, 1] + c * corner[:, :, 2]
    image = color(cells.transpose(0, 2, 1, 3, 4).reshape(grid * s, grid * s, -1))
    place = np.array([[[0, 0], [s - 2, 0], [0, s - 2]], [[s - 1, s - 1], [1, s - 1], [s - 1, 1]]]) + 0.5
    k = np.arange(n)
    origin = np.stack([(k // 2) % grid, (k // 2) // grid], axis=1) * s
    return image[::-1], (origin[:, None] + place[k % 2]) / (grid * s)
