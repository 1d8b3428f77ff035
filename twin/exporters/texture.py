"""Photo textures for the writers: of a whole mesh, or of some faces with an image cut to these."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from twin import geometry as geo
from twin.atlas import BORDER, shelves
from twin.geometry import Array
from twin.scene import Mesh

I64 = NDArray[np.int64]


@dataclass(frozen=True)
class Baked:
    """Faces in texture order: `order` (F,) into the mesh's faces, `uv` (3 F, 2) of their corners (v up) and
    the texture `image` (side, side, 3), top row first; None without colours."""

    order: NDArray[np.int64]
    uv: Array
    image: NDArray[np.uint8] | None


def photo_atlas(mesh: Mesh, keep: NDArray[np.integer] | None = None) -> Baked:
    """The photo texture of the faces `keep` (n,) of a mesh with one, all where None, in their order.

    Texels are copied, never sampled again. The image is the mesh's own, the very array, unless a smaller one
    holds all charts of `keep`: so several writers, or the two halves of a mesh, can share one file. Raises
    ValueError for a mesh without texture.
    """
    if mesh.texture is None:
        raise ValueError("the mesh has no texture")
    texture = mesh.texture
    order = np.arange(len(mesh.faces)) if keep is None else np.asarray(keep, np.int64)
    uv = texture.uv[order].astype(np.float64)
    if keep is None or not len(order):
        return Baked(order, uv.reshape(-1, 2), texture.image)
    height, width = texture.image.shape[:2]
    texels = np.stack([uv[..., 0] * width, (1.0 - uv[..., 1]) * height], axis=-1)  # rows from the top
    chart = _charts(uv)
    low, size = _frames(texels, chart, (width, height))
    place, (wide, high) = shelves(size)
    if wide * high >= width * height:
        return Baked(order, uv.reshape(-1, 2), texture.image)
    image = np.zeros((high, wide, 3), np.uint8)
    for (x, y), (w, h), (i, j) in zip(low, size, place, strict=True):
        image[j : j + h, i : i + w] = texture.image[y : y + h, x : x + w]
    moved = texels + (place - low)[chart][:, None]
    out = np.stack([moved[..., 0] / wide, 1.0 - moved[..., 1] / high], axis=-1)
    return Baked(order, out.reshape(-1, 2), image)


def _charts(uv: NDArray[np.float64]) -> I64:
    """Chart (n,) of each face (n, 3, 2): faces that share a corner's place are on one."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    _, corner = geo.unique_rows(np.round(uv.reshape(-1, 2) * 2**22).astype(np.int64))
    ends = corner.reshape(-1, 3)
    pairs = ends[:, [0, 1, 1, 2]].reshape(-1, 2)
    count = int(corner.max()) + 1
    graph = coo_array((np.ones(len(pairs)), pairs.T), (count, count))
    _, piece = connected_components(graph, directed=False)
    return np.unique(piece[ends[:, 0]], return_inverse=True)[1].astype(np.int64)


def _frames(texels: NDArray[np.float64], chart: I64, most: tuple[int, int]) -> tuple[I64, I64]:
    """First texel (C, 2) and texels (C, 2), across and down, of charts with border, in an image of `most`."""
    count = int(chart.max()) + 1
    low, high = np.full((count, 2), np.inf), np.full((count, 2), -np.inf)
    np.minimum.at(low, chart, texels.min(axis=1))
    np.maximum.at(high, chart, texels.max(axis=1))
    first = np.clip(np.floor(low).astype(np.int64) - BORDER, 0, most)
    last = np.clip(np.ceil(high).astype(np.int64) + BORDER, 0, most)
    return first, np.maximum(last - first, 1)
