"""What a shape of a file looks like: pictures on meshes, with coordinates of any size, and cube maps."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from twin.atlas import MOST_TEXELS, face_cells, shrunk
from twin.errors import InputError
from twin.geometry import Array
from twin.importers.unwrap import CUBE, cube_colors, on_sides, sides_of
from twin.scene import Mesh, Texture

U8 = NDArray[np.uint8]
Tell = Callable[[str], None]
# Share of a picture by which a coordinate may miss it. Chosen by us: half a texel of MOST_TEXELS.
_AT_BORDER = 1e-4
# Half sides of a cube map that a face may reach from the middle of the one it wears. Chosen by us: the side
# of a cylinder, which is cut at 45 deg, takes 1.4.
_BEYOND = 3.0
# Texels a metre of a cube map drawn anew. Chosen by us: more than a 1920 px picture shows from 1 m.
_FINE = 2000.0
# Scale of a picture above which its loss is not told. Chosen by us: rounding to whole texels.
_WHOLE = 0.99


@dataclass(frozen=True)
class Lost:
    """What of a file's looks is not carried: text -> the shapes that lose it."""

    owners: dict[str, list[str]] = field(default_factory=dict)

    def by(self, owner: str) -> Tell:
        """Where the losses of a shape are told."""
        return lambda what: self.owners.setdefault(what, []).append(owner)

    def notes(self) -> list[str]:
        """A line for each loss."""
        return [f"{', '.join(dict.fromkeys(owners))}: {what}" for what, owners in self.owners.items()]


def tell_shrunk(name: str, scale: float, tell: Tell) -> None:
    """Tell that a picture is smaller than in the file, if it is."""
    if scale < _WHOLE:
        tell(f"the picture {name!r} is shrunk to {100 * scale:.0f} %, so that its repeats fit")


def painted(mesh: Mesh, rgb: Sequence[float] | Array | None) -> Mesh:
    """The mesh in one colour (r, g, b) of 0..1; as it is for None."""
    if rgb is None:
        return mesh
    color = np.round(255 * np.clip(np.asarray(rgb, dtype=np.float64)[:3], 0.0, 1.0)).astype(np.uint8)
    return Mesh(mesh.vertices, mesh.faces, np.tile(color, (len(mesh.vertices), 1)))


def welded(vertices: Array, faces: NDArray[Any], colors: U8 | None, texture: Texture | None = None) -> Mesh:
    """A mesh in which corners at one place (and of one colour if untextured) are one: files repeat them."""
    key = np.round(vertices, 9) + 0.0
    if colors is not None and texture is None:
        key = np.concatenate([key, colors], axis=1)
    _, first, index = np.unique(key, axis=0, return_index=True, return_inverse=True)
    faces = index.reshape(-1)[faces]
    whole = (faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])
    return Mesh(
        vertices[first],
        faces[whole].astype(np.int32),
        None if colors is None else colors[first],
        None if texture is None else texture.of(whole),
    )


def pictured(
    vertices: Array, faces: NDArray[Any], uv: Array, picture: U8, tint: Array | None = None
) -> tuple[Mesh, float]:
    """A mesh with a picture (H, W, 3), top row first, times colour `tint` (3,) of 0..1; picture's scale.

    uv (F, 3, 2), v up, of any size: the picture repeats. Where a face shows it more than once, the texture is
    as many pictures side by side, each smaller where they would not fit into MOST_TEXELS. Raises InputError
    for coordinates that are not finite.
    """
    if not np.isfinite(uv).all():
        raise InputError("texture coordinates are not finite", "correct the numbers")
    near = np.rint(uv)
    uv = np.where(np.abs(uv - near) < _AT_BORDER, near, uv)
    uv = uv - np.floor(uv.min(axis=1, keepdims=True))
    times = np.maximum(np.ceil(uv.max(axis=(0, 1))), 1).astype(np.int64) if len(uv) else np.ones(2, np.int64)
    if tint is not None and np.any(tint[:3] < 1.0):
        picture = np.round(picture * np.clip(tint[:3], 0.0, 1.0)).astype(np.uint8)
    image = _repeated(picture, *times)
    uv = uv / times
    texture = Texture(uv.astype(np.float32), image, np.ones(image.shape[:2], bool))
    apart = np.arange(faces.size).reshape(-1, 3)
    mesh = welded(vertices[faces].reshape(-1, 3), apart, texture.at(uv).reshape(-1, 3), texture)
    return mesh, float(
        min(image.shape[0] / picture.shape[0] / times[1], image.shape[1] / picture.shape[1] / times[0])
    )


def _repeated(picture: U8, across: int, up: int) -> U8:
    """A picture so many times side by side, each smaller where the whole would be larger than MOST_TEXELS."""
    if (across, up) == (1, 1):
        return picture
    high, wide = picture.shape[:2]
    size = np.clip(MOST_TEXELS // np.array([across, up]), 1, [wide, high])
    times = np.minimum([across, up], MOST_TEXELS)
    return np.tile(shrunk(picture, *size), (times[1], times[0], 1))


def cube_mapped(
    vertices: Array, faces: NDArray[Any], directions: Array, strip: U8, tint: Array
) -> tuple[Mesh, float]:
    """As `pictured`, for a cube map: `strip` (6 n, n, 3), or (n, n, 3) for all along directions (F, 3, 3).

    Each face wears the side that its middle meets. The sides are as much larger as it takes to hold the faces
    that reach over their edges; where that is more than _BEYOND, each face gets texels of its own.
    """
    sides = sides_of(directions.mean(axis=1))
    place = on_sides(directions, sides[:, None])
    reach = float(np.abs(place).max(initial=1.0))
    reach = 1.0 if reach < 1 + 1e-6 else reach
    texels = strip.shape[1]
    if reach > 1:
        texels = min(
            int(np.ceil(texels * min(reach, _BEYOND))),
            int(np.ceil(_FINE * np.ptp(vertices, axis=0).max())) + 1,
        )
    if reach > _BEYOND:
        image, uv = face_cells(directions, lambda d: cube_colors(strip, d), texels)
        return pictured(vertices, faces, uv, image, tint)
    step = (2 * (np.arange(texels) + 0.5) / texels - 1) * reach
    flat = np.stack([*np.meshgrid(step, step), np.ones((texels, texels))], axis=-1)
    shown = [cube_colors(strip, flat @ CUBE[k]) for k in range(6)]
    image = np.concatenate([np.concatenate(shown[k::2], axis=1) for k in (0, 1)])
    # half a texel inside its side: beside it in the image lies another
    uv = np.clip((place / reach + 1) / 2, 0.5 / texels, 1 - 0.5 / texels)
    across, down = (sides // 2)[:, None], (sides % 2)[:, None]
    uv = np.stack([(uv[..., 0] + across) / 3, 1 - (uv[..., 1] + down) / 2], axis=-1)
    return pictured(vertices, faces, uv, image, tint)


def read_picture(path: Path, owner: str) -> tuple[U8, bool]:
    """A picture (H, W, 3), top row first; is any of it transparent? Raises InputError that names `owner`."""
    import cv2

    try:
        data = np.frombuffer(path.read_bytes(), np.uint8)
        found = cv2.imdecode(data, cv2.IMREAD_UNCHANGED) if len(data) else None
    except (OSError, cv2.error):
        found = None
    if found is None or found.dtype not in (np.uint8, np.uint16):
        raise InputError(
            f"{owner} names the picture {path}, which can't be read", "put a PNG or JPEG file there"
        )
    deep = found.dtype == np.uint16
    picture = np.atleast_3d((found // 256 if deep else found).astype(np.uint8))
    clear = picture.shape[2] in (2, 4) and bool(np.any(picture[..., -1] < 255))
    color = picture[..., :3] if picture.shape[2] >= 3 else np.repeat(picture[..., :1], 3, axis=2)
    return np.ascontiguousarray(color[..., ::-1]), clear
