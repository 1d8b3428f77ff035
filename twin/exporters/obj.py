"""Wavefront OBJ meshes with their vertex colours baked into a small texture, which simulators read."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from twin import geometry as geo
from twin.atlas import color_cells
from twin.exporters.texture import Baked, photo_atlas
from twin.geometry import Array
from twin.mesh import GREY
from twin.scene import Mesh

_CREASE = np.cos(np.deg2rad(40.0))  # chosen by us: faces that meet at more keep their edge sharp
# faces around one vertex, chosen by us: where they are more, those that face alike are taken together
_CROWDED = 200
_WAYS = 16  # steps of a unit normal's components within which faces face alike: 4 degrees, chosen by us
_AT_ONCE = 1 << 21  # pairs of faces at a time: some hundred megabytes


@dataclass(frozen=True)
class Textured:
    """A mesh as files: name -> content; which are .obj and texture; mean colour (r, g, b) in 0..1."""

    files: Mapping[str, bytes]
    obj: str
    png: str | None
    color: tuple[float, float, float]


def hull(mesh: Mesh) -> bytes:
    """An .obj of bare geometry: vertices to 1e-9 m and faces."""
    return _text(_rows("v %.9f %.9f %.9f", mesh.vertices + 0.0) + _rows("f %d %d %d", mesh.faces + 1))


def textured(mesh: Mesh, name: str, plain: tuple[float, float, float] | None = None) -> Textured:
    """The mesh as name.obj, name.mtl and, if coloured, name.png; plain: colour (r, g, b), 0..1, if not."""
    dressed = textured_mesh(mesh)
    baked, normals, normal_index = dressed.baked, dressed.normals, dressed.corners
    faces = mesh.faces[baked.order]
    png = None if baked.image is None else f"{name}.png"
    lines = [f"mtllib {name}.mtl", f"usemtl {name}"]
    lines += _rows("v %.7f %.7f %.7f", mesh.vertices + 0.0)
    lines += _rows("vt %.6f %.6f", baked.uv)
    lines += _rows("vn %.4f %.4f %.4f", normals + 0.0)
    vertex, normal = faces + 1, normal_index + 1
    if png:
        texture = np.arange(3 * len(faces)).reshape(-1, 3) + 1
        corners = np.stack([vertex, texture, normal], axis=2).reshape(len(faces), 9)
        lines += _rows("f %d/%d/%d %d/%d/%d %d/%d/%d", corners)
    else:
        lines += _rows("f %d//%d %d//%d %d//%d", np.stack([vertex, normal], axis=2).reshape(len(faces), 6))
    color = mean_color(mesh) if plain is None else plain
    kd = (1.0, 1.0, 1.0) if png else color
    mtl = [f"newmtl {name}", "Ka 0 0 0", "Kd {:.4f} {:.4f} {:.4f}".format(*kd), "Ks 0.1 0.1 0.1", "Ns 20"]
    mtl += [f"map_Kd {png}"] if png else []
    files = {f"{name}.obj": _text(lines), f"{name}.mtl": _text(mtl)}
    if png and baked.image is not None:
        files[png] = encoded(baked.image)
    return Textured(files, f"{name}.obj", png, color)


def _text(lines: list[str]) -> bytes:
    return ("\n".join(lines) + "\n").encode("ascii")


@dataclass(frozen=True, eq=False)
class TexturedMesh:
    """Texture of a mesh, and normals (M, 3) with each corner's index (F, 3), faces in texture order."""

    baked: Baked
    normals: Array
    corners: NDArray[np.int64]


# formats write the same meshes one after another
_TEXTURED: WeakKeyDictionary[Mesh, TexturedMesh] = WeakKeyDictionary()


def textured_mesh(mesh: Mesh) -> TexturedMesh:
    """Texture and normals of a mesh, made once."""
    if mesh not in _TEXTURED:
        baked = bake(mesh)
        _TEXTURED[mesh] = TexturedMesh(baked, *corner_normals(mesh.vertices, mesh.faces[baked.order]))
    return _TEXTURED[mesh]


def bake(mesh: Mesh) -> Baked:
    """The photo texture of a mesh that has one, cut to what its faces use; else baked vertex colours."""
    if mesh.texture is not None and len(mesh.faces):
        return photo_atlas(mesh, np.arange(len(mesh.faces)))
    order = _spatial_order(mesh)
    if mesh.colors is None or not len(order):
        return Baked(order, np.zeros((0, 2)), None)
    image, uv = color_cells(mesh.colors[mesh.faces[order]])
    return Baked(order, uv.reshape(-1, 2), image)


def encoded(image: NDArray[np.uint8]) -> bytes:
    """An RGB image as PNG."""
    import cv2

    ok, data = cv2.imencode(".png", np.ascontiguousarray(image[..., ::-1]))
    if not ok:
        raise OSError(f"an image of {image.shape} can't be encoded")
    return data.tobytes()


def _rows(template: str, values: NDArray[Any]) -> list[str]:
    """A line of each row (n, k) in printf's template of k numbers; all at once is twice as fast."""
    if not len(values):
        return []
    return ("\n".join([template] * len(values)) % tuple(values.ravel().tolist())).split("\n")


def mean_color(mesh: Mesh) -> tuple[float, float, float]:
    """Mean vertex colour (r, g, b) in 0..1, grey without colours."""
    rgb = np.full(3, GREY) if mesh.colors is None or not len(mesh.colors) else mesh.colors.mean(axis=0)
    r, g, b = (round(float(c) / 255, 4) for c in rgb)
    return r, g, b


def _spatial_order(mesh: Mesh) -> NDArray[np.int64]:
    """Faces along a Morton curve: neighbours on the surface are neighbours in the texture (for mipmaps)."""
    if not len(mesh.faces):
        return np.zeros(0, np.int64)
    c = mesh.vertices[mesh.faces].mean(axis=1)
    low = c.min(axis=0)
    cell = ((c - low) / max(float((c - low).max()), 1e-9) * 1023).astype(np.int64)
    code = np.zeros(len(c), np.int64)
    for bit in range(10):
        for axis in range(3):
            code |= ((cell[:, axis] >> bit) & 1) << (3 * bit + axis)
    return np.argsort(code, kind="stable")


def corner_normals(vertices: Array, faces: NDArray[np.int32]) -> tuple[Array, NDArray[np.int64]]:
    """Normals (M, 3) and the index (F, 3) of each corner: smooth over the surface, sharp at creases."""
    n = len(faces)
    if n == 0:
        return np.zeros((0, 3)), np.zeros((0, 3), np.int64)
    unit, _ = geo.triangle_normals(vertices[faces])
    total = _facing_alike(faces.ravel(), geo.vector_areas(vertices[faces]), unit)
    length = np.linalg.norm(total, axis=1)
    smooth = np.where(
        length[:, None] > 1e-15, total / np.maximum(length, 1e-300)[:, None], np.repeat(unit, 3, axis=0)
    )
    smooth[np.linalg.norm(smooth, axis=1) < 0.5] = (0.0, 0.0, 1.0)  # faces without area
    steps = np.round(smooth * 1e4).astype(np.int64)
    first, index = geo.unique_rows(steps)
    return steps[first] / 1e4, index.reshape(-1, 3)


def _facing_alike(corner: NDArray[np.int32], directed: Array, unit: Array) -> Array:
    """For each face corner (3 F,), given by its vertex, the sum (3 F, 3) of vector areas (F, 3) over the
    faces around that vertex which face (`unit`) within a crease of its own."""
    owner = np.arange(len(corner)) // 3
    crowded = np.bincount(corner)[corner] > _CROWDED
    way = np.where(crowded[:, None], np.round(unit[owner] * _WAYS), 0.0).astype(np.int64)
    apart = np.where(crowded, 0, owner + 1)  # elsewhere each face is a group of its own
    first, group = geo.unique_rows(np.column_stack([corner, apart, way]))
    held = np.stack([np.bincount(group, weights=column[owner]) for column in directed.T], axis=1)
    facing = held / np.maximum(np.linalg.norm(held, axis=1), 1e-300)[:, None]
    facing = np.where(crowded[first, None], facing, unit[owner[first]])
    beside = np.bincount(corner[first])[corner[first]]  # groups come vertex by vertex
    start = np.searchsorted(corner[first], corner[first])
    total = np.zeros_like(held)
    for some in np.split(np.arange(len(first)), np.flatnonzero(np.diff(np.cumsum(beside) // _AT_ONCE)) + 1):
        count = beside[some]
        row = np.repeat(np.arange(len(some)), count)
        other = np.repeat(start[some] - (np.cumsum(count) - count), count) + np.arange(len(row))
        near = np.einsum("ij,ij->i", facing[some][row], facing[other]) > _CREASE
        row, other = row[near], other[near]
        for k in range(3):
            total[some, k] = np.bincount(row, weights=held[other, k], minlength=len(some))
    return np.asarray(total[group])
