"""What no camera saw of the furniture, as a stage: the layer that exports choose from (docs/assets.md)."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from twin.completion import with_completion
from twin.inferred import VERSION, Completion
from twin.runs.keys import Stage
from twin.scene import Mesh, Texture, Twin
from twin.storage.completion import pieces_texture, with_textured_pieces

COMPLETION = Stage("completion", VERSION, ())


@dataclass(frozen=True, eq=False)
class Layer:
    """The inferred layer of one body, without pictures, and where they lie.

    pieces: the one picture of all pieces; None without. shown, room: coordinates (F, 3, 2) of those meshes in
    the picture of the body's seen mesh; None where it has none.
    """

    bare: Completion
    pieces: Texture | None
    shown: NDArray[np.float32] | None
    room: NDArray[np.float32] | None


@dataclass(frozen=True, eq=False)
class Layers:
    """The inferred layers of the static scene and, by id, of the parts; none where nothing is inferred."""

    static: Layer | None
    parts: dict[int, Layer]


def inferred_layers(twin: Twin) -> Layers:
    """The layers of a twin with labels, cameras, meshes, contacts and photographs."""
    whole = with_completion(twin)
    parts = {p.id: _stored(p.completion) for p in whole.parts if p.completion is not None}
    static = whole.static.completion
    return Layers(None if static is None else _stored(static), parts)


def with_layers(twin: Twin, layers: Layers) -> Twin:
    """The twin with its inferred layers."""
    if layers.static is None:
        return twin
    static = replace(twin.static, completion=_dressed(layers.static, twin.static.mesh))
    parts = [replace(p, completion=_dressed(layers.parts[p.id], p.mesh)) for p in twin.parts]
    return replace(twin, static=static, parts=tuple(parts))


def _stored(layer: Completion) -> Layer:
    pieces = tuple(replace(p, mesh=replace(p.mesh, texture=None)) for p in layer.pieces)
    room = None if layer.room is None else replace(layer.room, texture=None)
    bare = replace(layer, shown=replace(layer.shown, texture=None), pieces=pieces, room=room)
    return Layer(bare, pieces_texture(layer), _uv(layer.shown), _uv(layer.room))


def _uv(mesh: Mesh | None) -> NDArray[np.float32] | None:
    return None if mesh is None or mesh.texture is None else mesh.texture.uv


def _dressed(layer: Layer, seen: Mesh) -> Completion:
    """The inverse of `_stored`, with the body's seen mesh."""
    bare = layer.bare
    shown = _in_picture(bare.shown, layer.shown, seen)
    room = None if bare.room is None else _in_picture(bare.room, layer.room, seen)
    whole = replace(bare, shown=shown, room=room)
    return whole if layer.pieces is None else with_textured_pieces(whole, layer.pieces)


def _in_picture(mesh: Mesh, uv: NDArray[np.float32] | None, seen: Mesh) -> Mesh:
    return mesh if uv is None or seen.texture is None else replace(mesh, texture=replace(seen.texture, uv=uv))
