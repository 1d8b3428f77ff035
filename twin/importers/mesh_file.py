"""Mesh files with their colours and pictures, and the orientation in which URDF tools read them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from twin.errors import InputError
from twin.geometry import Array
from twin.importers.look import U8, Tell, painted, pictured, tell_shrunk, welded
from twin.scene import Mesh, Texture

_PICTURES = (".bmp", ".gif", ".jpeg", ".jpg", ".png", ".tga", ".tif", ".tiff", ".webp")
_OTHER_TEXTURES = ("normalTexture", "metallicRoughnessTexture", "emissiveTexture", "occlusionTexture")
_Y_TO_Z = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
_NO_COORDINATES = "has a picture, but no texture coordinates for it: it is not carried"
Pieces = list[Any]


def mesh_file(
    path: Path, scale: Array, owner: str, tell: Tell, picture: U8 | None = None, upright: bool = False
) -> tuple[list[Mesh], bool]:
    """The meshes in a file, scaled (3,), and whether they have colours or pictures of their own.

    owner: for errors. tell: takes what look is lost. picture: what it wears in place of its own. upright:
    turned from y up to z up. Raises InputError that names `owner` when the file isn't there or can't be read.
    """
    pieces, factor = _loaded(path, owner, tell)
    turn = (_Y_TO_Z if upright else np.eye(3)).T * scale * factor
    meshes = [_colored(g, np.asarray(g.vertices, np.float64) @ turn, picture, tell) for g in pieces]
    if float(np.prod(scale)) < 0:  # a mirrored mesh is inside out
        meshes = [inside_out(m) for m in meshes]
    return meshes, any(m.colors is not None for m in meshes)


def inside_out(mesh: Mesh) -> Mesh:
    """The mesh with its faces turned around, each corner with its colour and its place in the picture."""
    texture = mesh.texture
    turned = None if texture is None else Texture(texture.uv[:, ::-1], texture.image, texture.seen)
    return Mesh(mesh.vertices, mesh.faces[:, ::-1], mesh.colors, turned)


def _loaded(path: Path, owner: str, tell: Tell) -> tuple[Pieces, float]:
    """Pieces of a mesh file as trimesh reads them, each in the file's frame; metres of a unit."""
    import trimesh

    class Beside(trimesh.resolvers.FilePathResolver):
        """Files beside the mesh, also in folders above it; what is not there or is no picture is told."""

        def get(self, name: str) -> Any:
            found = self.absolute(name)
            if not found.is_file():
                tell(f"{path.name} names {name!r}, which is not there")
                raise FileNotFoundError(name)
            data = found.read_bytes()
            if found.suffix.lower() in _PICTURES and not _is_picture(data):
                tell(f"{path.name} names {name!r}, which is no picture")
            return data

    if not path.is_file():
        raise InputError(f"{owner} names the mesh {path}, which is no file", "put the mesh there")
    try:
        beside = Beside(str(path), allow_anywhere=True)
        loaded: Any = trimesh.load_scene(str(path), process=False, resolver=beside)
        factor = (
            trimesh.units.unit_conversion(loaded.units, "meters") if path.suffix.lower() == ".dae" else 1.0
        )
        pieces = [g for g in loaded.dump() if hasattr(g, "faces") and len(g.faces)]
    except Exception as e:  # whatever the parser of an unknown file raises
        reason = " ".join(f"{type(e).__name__}: {e}".split())[:200]
        raise InputError(f"{owner}: the mesh {path} can't be read: {reason}", "check the mesh file") from e
    if path.suffix.lower() in (".glb", ".gltf") and b"KHR_texture_transform" in path.read_bytes():
        tell(f"{path.name} moves its pictures by KHR_texture_transform, which is not followed")
    if not pieces:
        raise InputError(f"{owner}: the mesh {path} has no faces", "check the mesh file")
    return pieces, float(factor)


def _is_picture(data: bytes) -> bool:
    import io

    from PIL import Image

    try:
        Image.open(io.BytesIO(data)).close()
    except OSError:
        return False
    return True


def _colored(piece: Any, vertices: Array, worn: U8 | None, tell: Tell) -> Mesh:
    """A loaded piece with the picture that it is given, else with its own colours, else with neither."""
    faces, visual = np.asarray(piece.faces, np.int64), piece.visual
    uv = _coordinates(visual)
    if worn is not None:
        if uv is not None:
            mesh, scale = pictured(vertices, faces, uv[faces], worn)
            tell_shrunk("of its material", scale, tell)
            return mesh
        tell(_NO_COORDINATES)
    if not visual.defined:
        return welded(vertices, faces, None)
    if visual.kind != "texture":
        colors = np.asarray(visual.vertex_colors, np.uint8)
        if np.any(colors[:, 3:] < 255):
            tell("is see-through and becomes opaque")
        return welded(vertices, faces, colors[:, :3])
    material = visual.material
    picture, tint, clear = _material(material)
    for name in _other_textures(material):
        tell(f"the texture {name!r} is not carried, a twin has that of the colour alone")
    if clear:
        tell("is see-through and becomes opaque")
    if picture is None or uv is None:
        if picture is not None:
            tell(_NO_COORDINATES)
        plain = np.asarray(material.main_color, np.float64)[:3] / 255
        return painted(welded(vertices, faces, None), plain)
    mesh, scale = pictured(vertices, faces, uv[faces], picture, tint)
    tell_shrunk(str(getattr(material, "name", None) or "picture"), scale, tell)
    return mesh


def _coordinates(visual: Any) -> Array | None:
    """Texture coordinates (V, 2), v up; None where a file has none or they are not finite."""
    uv = getattr(visual, "uv", None)
    if uv is None or not np.isfinite(uv).all():
        return None
    return np.asarray(uv, np.float64)[:, :2]


def _material(material: Any) -> tuple[U8 | None, Array, bool]:
    """Picture (H, W, 3), top row first, of a material, the colour (3,) of 0..1 that it is multiplied with,
    and whether it is see-through. glTF multiplies; of OBJ's Kd beside a picture most writers make no use, and
    it is left out."""
    image, tint = getattr(material, "baseColorTexture", None), np.ones(3)
    mode = str(getattr(material, "alphaMode", None) or "OPAQUE")
    if hasattr(material, "baseColorTexture"):
        factor = material.baseColorFactor
        if factor is not None:
            tint = np.asarray(factor, np.float64)[:3] / 255
        clear = mode != "OPAQUE"
    else:
        image = getattr(material, "image", None)
        clear = _opacity(getattr(material, "kwargs", {})) < 1
    if image is None:
        return None, tint, clear
    if mode == "OPAQUE" and not hasattr(material, "baseColorTexture") and "A" in image.getbands():
        clear = clear or int(np.asarray(image.getchannel("A")).min()) < 255
    return np.asarray(image.convert("RGB"), np.uint8), tint, clear


def _opacity(written: dict[str, Any]) -> float:
    """Opacity of an MTL material, by its `d` or `Tr`."""
    for key, turned in (("d", False), ("tr", True)):
        try:
            value = float(written[key][0])
        except (KeyError, IndexError, TypeError, ValueError):
            continue
        return 1 - value if turned else value
    return 1.0


def _other_textures(material: Any) -> list[str]:
    """Names of a material's textures that are not its colour."""
    found = [name for name in _OTHER_TEXTURES if getattr(material, name, None) is not None]
    written = getattr(material, "kwargs", {})
    return found + [k for k in written if k.startswith("map_") or k in ("bump", "disp", "norm", "refl")]
