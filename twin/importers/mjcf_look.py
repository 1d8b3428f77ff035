"""The look of a geom of a compiled MJCF model: its colour and picture as MuJoCo 4 lays it on the shape."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from twin.geometry import Array
from twin.importers.look import Lost, cube_mapped, painted, pictured, tell_shrunk
from twin.importers.shapes import box, capsule, cylinder, ellipsoid, rectangle
from twin.importers.unwrap import box_uv, capsule_uv, cylinder_uv, sphere_uv
from twin.scene import Mesh

_GEOM, _ROLE = mujoco.mjtGeom, mujoco.mjtTextureRole
_COLOR = (int(_ROLE.mjTEXROLE_RGB), int(_ROLE.mjTEXROLE_RGBA))
_UNSET = (0.5, 0.5, 0.5, 1.0)  # MuJoCo's colour of a geom that states none; its material's colour stands then


def rgba(model: Any, g: int) -> Array:
    """Colour (4,) of 0..1 that MuJoCo draws a geom or tints its picture in: its own before its material's."""
    own, material = np.asarray(model.geom_rgba[g], np.float64), int(model.geom_matid[g])
    if material < 0 or not np.allclose(own, _UNSET):
        return own
    return np.asarray(model.mat_rgba[material], np.float64)


def mean_color(model: Any, g: int) -> Array:
    """Colour (4,) of 0..1 of a geom; of a picture on it its mean."""
    color, picture = rgba(model, g), _picture(model, g)
    if picture is not None:
        color = color * [*(picture.image.reshape(-1, 3).mean(axis=0) / 255.0), 1.0]
    return np.clip(color, 0.0, 1.0)


def surface_of(model: Any, g: int, coarse: bool = False) -> Mesh | None:
    """A geom in its own frame, its round shapes with half as many corners around them where `coarse`; None of
    a kind that has no surface of a finite size."""
    kind, size = int(model.geom_type[g]), np.asarray(model.geom_size[g], np.float64)
    round_ = {"sections": 16} if coarse else {}
    if kind == _GEOM.mjGEOM_MESH:
        vertices, faces = mesh_arrays(model, int(model.geom_dataid[g]))
        return Mesh(vertices, faces.astype(np.int32))
    if kind == _GEOM.mjGEOM_BOX:
        return box(2 * size)
    if kind in (_GEOM.mjGEOM_SPHERE, _GEOM.mjGEOM_ELLIPSOID):
        half = size if kind == _GEOM.mjGEOM_ELLIPSOID else np.full(3, size[0])
        return ellipsoid(half, 2) if coarse else ellipsoid(half)
    if kind == _GEOM.mjGEOM_CYLINDER:
        return cylinder(size[0], 2 * size[1], **round_)
    if kind == _GEOM.mjGEOM_CAPSULE:
        return capsule(size[0], 2 * size[1], **round_)
    if kind == _GEOM.mjGEOM_PLANE and size[0] > 0 and size[1] > 0:
        return rectangle(size[:2])
    return None


@dataclass(frozen=True, eq=False)
class _Picture:
    """A colour texture of a material. image: (H, W, 3), top row first, of a cube map its sides one below the
    other. times (2,): how often it repeats, per half metre of a side where `uniform`."""

    name: str
    image: NDArray[np.uint8]
    flat: bool
    clear: bool
    times: Array
    uniform: bool


def looking(model: Any, g: int, surface: Mesh, lost: Lost) -> Mesh:
    """The surface of a geom, in its own frame in its colour or picture; `lost` gets what is not carried."""
    owner = f"geom {str(model.geom(g).name)!r}" if model.geom(g).name else f"geom {g}"
    tell, color, picture = lost.by(owner), rgba(model, g), _picture(model, g)
    mesh = int(model.geom_dataid[g]) if int(model.geom_type[g]) == _GEOM.mjGEOM_MESH else -1
    for role in _other_roles(model, g):
        tell(f"the layer {role!r} of the material is not carried")
    if color[3] < 1 or (picture is not None and picture.clear):
        tell("is see-through and becomes opaque")
    if picture is None:
        return painted(surface, color)
    vertices, faces = (surface.vertices, surface.faces) if mesh < 0 else mesh_arrays(model, mesh)
    if picture.flat:
        uv = _flat_uv(model, g, mesh, vertices[faces], picture)
        uv[..., 1] = 1.0 - uv[..., 1]
        made, scale = pictured(vertices, faces, uv, picture.image, color)
    elif mesh >= 0 and int(model.mesh_texcoordnum[mesh]):
        tell(f"the cube map {picture.name!r} on a mesh with texture coordinates is not carried")
        return painted(surface, color)
    else:
        along = _cube_directions(model, g, vertices[faces], picture)
        made, scale = cube_mapped(vertices, faces, along, picture.image, color)
    tell_shrunk(picture.name, scale, tell)
    return made


def mesh_arrays(model: Any, mesh: int) -> tuple[Array, NDArray[np.int64]]:
    """Vertices (V, 3) m and faces (F, 3) as MuJoCo keeps a mesh: centred, along its axes, in float32."""
    v0, f0 = int(model.mesh_vertadr[mesh]), int(model.mesh_faceadr[mesh])
    vertices = np.asarray(model.mesh_vert[v0 : v0 + int(model.mesh_vertnum[mesh])], np.float64)
    return vertices, np.asarray(model.mesh_face[f0 : f0 + int(model.mesh_facenum[mesh])], np.int64)


def _other_roles(model: Any, g: int) -> list[str]:
    """Roles of the textures of a geom's material that are no colour."""
    material = int(model.geom_matid[g])
    found = np.flatnonzero(np.asarray(model.mat_texid[material]) >= 0) if material >= 0 else np.zeros(0, int)
    names = [_ROLE(int(r)).name.removeprefix("mjTEXROLE_").lower() for r in found if r not in _COLOR]
    return [n for n in names if n != "user"]


def _picture(model: Any, g: int) -> _Picture | None:
    """The colour texture of a geom's material."""
    material = int(model.geom_matid[g])
    found = [int(model.mat_texid[material, r]) for r in _COLOR] if material >= 0 else []
    t = max(found, default=-1)
    if t < 0:
        return None
    shape = (int(model.tex_height[t]), int(model.tex_width[t]), int(model.tex_nchannel[t]))
    start = int(model.tex_adr[t])
    data = np.asarray(model.tex_data[start : start + int(np.prod(shape))]).reshape(shape)
    return _Picture(
        str(model.tex(t).name) or str(t),
        np.ascontiguousarray(data[..., :3] if shape[2] >= 3 else np.repeat(data[..., :1], 3, axis=2)),
        int(model.tex_type[t]) == int(mujoco.mjtTexture.mjTEXTURE_2D),
        shape[2] == 4 and bool(np.any(data[..., 3] < 255)),
        np.asarray(model.mat_texrepeat[material], np.float64),
        bool(model.mat_texuniform[material]),
    )


def _half_sizes(model: Any, g: int) -> Array:
    """Half sizes (3,) m by which MuJoCo scales a primitive of size 1, or those of the box around a mesh."""
    kind, size = int(model.geom_type[g]), np.asarray(model.geom_size[g], np.float64)
    if kind == _GEOM.mjGEOM_SPHERE:
        return np.full(3, size[0])
    if kind in (_GEOM.mjGEOM_CYLINDER, _GEOM.mjGEOM_CAPSULE):
        return size[[0, 0, 1]]
    return size


def _flat_uv(model: Any, g: int, mesh: int, corners: Array, picture: _Picture) -> Array:
    """Coordinates (F, 3, 2), u and v down, of a 2d texture."""
    kind, half = int(model.geom_type[g]), _half_sizes(model, g)
    scale = picture.times * (half[:2] if picture.uniform else 1.0)
    if kind == _GEOM.mjGEOM_MESH:
        if int(model.mesh_texcoordnum[mesh]):
            t0, f0 = int(model.mesh_texcoordadr[mesh]), int(model.mesh_faceadr[mesh])
            index = np.asarray(model.mesh_facetexcoord[f0 : f0 + len(corners)])
            return np.asarray(model.mesh_texcoord[t0:], np.float64)[index] * scale
        flat = corners[..., :2] / (1.0 if picture.uniform else half[:2]) * picture.times
        return np.asarray(flat * [0.5, -0.5] - 0.5)
    if kind == _GEOM.mjGEOM_BOX:
        base = box_uv(corners / half)
    elif kind == _GEOM.mjGEOM_PLANE:
        base = (corners[..., :2] / half[:2] * [1, -1] + 1) / 2
    elif kind == _GEOM.mjGEOM_CYLINDER:
        base = cylinder_uv(corners / half)
    elif kind == _GEOM.mjGEOM_CAPSULE:
        base = capsule_uv(corners / half[0], half[2] / half[0])
    else:
        base = sphere_uv(corners / half)
    return np.asarray(base * scale)


def _cube_directions(model: Any, g: int, corners: Array, picture: _Picture) -> Array:
    """Directions (F, 3, 3) in which a cube map is seen."""
    kind, half = int(model.geom_type[g]), _half_sizes(model, g)
    if kind == _GEOM.mjGEOM_MESH:
        unit = corners
    elif kind == _GEOM.mjGEOM_CAPSULE:
        beyond = np.abs(corners[..., 2].mean(axis=1)) > half[2]
        z = corners[..., 2]
        on_end = np.sign(z) + (z - np.sign(z) * half[2]) / half[0]
        unit = np.concatenate(
            [corners[..., :2] / half[0], np.where(beyond[:, None], on_end, z / half[2])[..., None]], -1
        )
    else:
        unit = corners / half
    return np.asarray(unit * half if picture.uniform else unit)
