"""Photo textures beside twin.json: textures/NAME.png, alpha for what was seen, and textures/NAME.uv.npy."""

from __future__ import annotations

import io
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from twin.errors import InputError, SceneError
from twin.files.png import png_bytes, read_png
from twin.scene import Mesh, Texture, Twin
from twin.storage.completion import looks_files, pieces_texture

_FILES = ("image", "uv")
Owner = int | None


def texture_document(owner: str, texture: Texture | None) -> dict[str, Any]:
    """{"texture": its two files}, empty where there is none."""
    if texture is None:
        return {}
    return {"texture": {"image": f"textures/{owner}.png", "uv": f"textures/{owner}.uv.npy"}}


def texture_files(document: Mapping[str, Any]) -> Iterator[tuple[tuple[Owner, str], str]]:
    """Files of a document's textures, ((part id or None, "image" or "uv"), path), and its inferred looks."""
    for owner in (document["static"], *document["parts"]):
        for key in _FILES if owner.get("texture") is not None else ():
            yield (owner.get("id"), key), owner["texture"][key]
    yield from looks_files(document)


def with_texture_named(owner: Mapping[str, Any], name: Callable[[str], str]) -> dict[str, Any]:
    """{"texture": its files called `name(path)`} of the static scene or a part, empty where there is none."""
    texture = owner.get("texture")
    return {} if texture is None else {"texture": {**texture, **{k: name(texture[k]) for k in _FILES}}}


def textures_of(twin: Twin) -> dict[Owner, Texture | None]:
    """Part id, None for the static scene -> texture."""
    return {None: twin.static.mesh.texture, **{p.id: p.mesh.texture for p in twin.parts}}


def texture_of(twin: Twin, role: tuple[Owner, str]) -> Texture:
    """The texture that a file of `texture_files` is of."""
    owner, key = role
    body = twin.static if owner is None else twin.part(owner)
    layer = body.completion
    if layer is not None and key.startswith("pieces"):
        texture = pieces_texture(layer)
        assert texture is not None
        return texture
    of_layer = {"shown_uv": layer.shown, "room_uv": layer.room} if layer is not None else {}
    mesh = of_layer.get(key, body.mesh)
    assert mesh is not None
    assert mesh.texture is not None
    return mesh.texture


def same_textures(a: Twin, b: Twin) -> bool:
    """Whether both twins have the same textures."""
    ours, theirs = textures_of(a), textures_of(b)
    return ours.keys() == theirs.keys() and all(same_texture(ours[k], theirs[k]) for k in ours)


def same_texture(a: Texture | None, b: Texture | None) -> bool:
    if a is None or b is None or a is b:
        return a is b
    pairs = ((a.uv, b.uv), (a.image, b.image), (a.seen, b.seen))
    return all(np.array_equal(x, y) for x, y in pairs)


def texture_bytes(texture: Texture, key: str) -> bytes:
    """Content of its file: an image, or one of coordinates."""
    if key.endswith("image"):
        return png_bytes(texture.image, texture.seen)
    buffer = io.BytesIO()
    np.lib.format.write_array(buffer, np.ascontiguousarray(texture.uv), version=(1, 0), allow_pickle=False)
    return buffer.getvalue()


def with_coordinates(mesh: Mesh, texture: Texture, uv: Path) -> Mesh:
    """A mesh with its own coordinates in the image of a texture. Raises InputError that names the file."""
    try:
        return replace(mesh, texture=Texture(_read_uv(uv, len(mesh.faces)), texture.image, texture.seen))
    except SceneError as e:
        raise InputError(f"{uv}: {e.problem}", e.remedy) from e


def read_texture(image: Path, uv: Path, faces: int) -> Texture:
    """The texture of a mesh with so many faces. Raises InputError that names the file."""
    picture, seen = read_png(image)
    try:
        return Texture(_read_uv(uv, faces), picture, seen)
    except SceneError as e:
        raise InputError(f"{uv}: {e.problem}", e.remedy) from e


def _read_uv(path: Path, faces: int) -> NDArray[np.float32]:
    """(faces, 3, 2). The array's head is held to what is wanted before anything is made of its size."""
    remedy = f"texture coordinates are a NumPy array of float32, here ({faces}, 3, 2): make the twin again"
    try:
        stream = io.BytesIO(path.read_bytes())
        if np.lib.format.read_magic(stream) != (1, 0):
            raise ValueError("version is not 1.0")
        shape, fortran, kind = np.lib.format.read_array_header_1_0(stream)
    except OSError as e:
        raise InputError(f"{path} can't be read: {e.strerror}", remedy) from e
    except (ValueError, SyntaxError, TypeError, EOFError) as e:
        raise InputError(f"{path} is no NumPy array", remedy) from e
    data = stream.read()
    if shape != (faces, 3, 2) or fortran or kind != np.dtype("<f4"):
        raise InputError(f"{path} holds {kind} of shape {shape!s:.60}", remedy)
    if len(data) != faces * 24:
        raise InputError(f"{path} holds {len(data)} bytes of numbers in place of {faces * 24}", remedy)
    return np.frombuffer(data, "<f4").reshape(faces, 3, 2)
