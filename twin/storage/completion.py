"""The inferred layer in twin.json, and collision shapes as it holds them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from twin.inferred import Completion
from twin.scene import Collision, Mesh, Texture

_LISTS = ("collision", "room_collision")
_UV = ("shown_uv", "room_uv")
_PIECES = ("pieces_image", "pieces_uv")


def shapes_document(stem: str, shapes: Iterable[Collision], meshes: dict[str, Mesh]) -> list[Any]:
    """Collision shapes as twin.json lists them: boxes by numbers, hulls as files (added to `meshes`)."""
    out: list[Any] = []
    for k, piece in enumerate(shapes):
        if isinstance(piece, Mesh):
            path = f"meshes/{stem}.{k:03d}.ply"  # a dot: no part's name holds one
            meshes[path] = piece
            out.append(path)
        else:
            t = piece.T_world_box
            out.append(
                {
                    "center": t[:3, 3].tolist(),
                    "rotation": t[:3, :3].tolist(),
                    "size": piece.size.tolist(),
                }
            )
    return out


def completion_document(owner: str, completion: Completion | None, meshes: dict[str, Mesh]) -> dict[str, Any]:
    """{"completion": the inferred layer}, empty where there is none; its meshes are added to `meshes`."""
    if completion is None:
        return {}
    stem = f"{owner}.completion"
    shown = f"meshes/{stem}.shown.ply"
    meshes[shown] = completion.shown
    room = None
    if completion.room is not None:
        room = f"meshes/{stem}.room.ply"
        meshes[room] = completion.room
    pieces = []
    for p in completion.pieces:
        path = f"meshes/{stem}.{p.name}.piece.ply"
        meshes[path] = p.mesh
        pieces.append(
            {
                "name": p.name,
                "role": p.role,
                "basis": p.basis,
                "reason": p.reason,
                "color": p.color.tolist(),
                "mesh": path,
                "collision": shapes_document(f"{stem}.{p.name}.collision", p.shapes, meshes),
            }
        )
    shapes = {key: shapes_document(f"{stem}.{key}", getattr(completion, key), meshes) for key in _LISTS}
    boxes = [i.box for i in completion.interiors]
    interiors = [
        {"name": i.name, **box}
        for i, box in zip(completion.interiors, shapes_document("", boxes, meshes), strict=True)
    ]
    looks = {
        f"{key}_uv": f"textures/{stem}.{key}.uv.npy"
        for key, mesh in (("shown", completion.shown), ("room", completion.room))
        if mesh is not None and mesh.texture is not None
    }
    if pieces_texture(completion) is not None:
        looks |= {"pieces_image": f"textures/{stem}.png", "pieces_uv": f"textures/{stem}.uv.npy"}
    return {
        "completion": {
            "version": completion.version,
            "kind": completion.kind,
            "limits": None if completion.limits is None else list(completion.limits),
            "shown": shown,
            "room": room,
            "pieces": pieces,
            "interiors": interiors,
            **shapes,
            **looks,
        }
    }


def pieces_texture(layer: Completion) -> Texture | None:
    """The texture of all inferred pieces of a body in order: they share its image; None without."""
    worn = [p.mesh.texture for p in layer.pieces if p.mesh.texture is not None]
    if not worn or len(worn) < len(layer.pieces):
        return None
    return replace(worn[0], uv=np.concatenate([t.uv for t in worn]))


def with_textured_pieces(layer: Completion, texture: Texture) -> Completion:
    """The inverse of `pieces_texture`."""
    ends = np.cumsum([len(p.mesh.faces) for p in layer.pieces])
    parts = np.split(texture.uv, ends[:-1])
    return replace(
        layer,
        pieces=tuple(
            replace(p, mesh=replace(p.mesh, texture=replace(texture, uv=uv)))
            for p, uv in zip(layer.pieces, parts, strict=True)
        ),
    )


def looks_files(document: Mapping[str, Any]) -> Iterator[tuple[tuple[int | None, str], str]]:
    """Files of the looks of the inferred layers: ((part id or None for the static scene, key), path).
    "shown_uv" and "room_uv" are coordinates in the body's image, "pieces_image" and "pieces_uv" the picture
    of its pieces and theirs in it."""
    for owner in (document["static"], *document["parts"]):
        layer = owner.get("completion") or {}
        for key in (*_UV, *_PIECES):
            if layer.get(key) is not None:
                yield (owner.get("id"), key), layer[key]


def completion_files(completion: Mapping[str, Any] | None) -> Iterator[tuple[str, str]]:
    """(where in the inferred layer, path) of every mesh file it names."""
    if completion is None:
        return
    for key in ("shown", "room"):
        if completion[key] is not None:
            yield key, completion[key]
    for piece in completion["pieces"]:
        yield f"{piece['name']} piece", piece["mesh"]
        for k, shape in enumerate(piece["collision"]):
            if isinstance(shape, str):
                yield f"{piece['name']} {k}", shape
    for key in _LISTS:
        for k, shape in enumerate(completion[key]):
            if isinstance(shape, str):
                yield f"{key} {k}", shape


def with_completion_named(completion: Mapping[str, Any], name: Callable[[str], str]) -> dict[str, Any]:
    """The inferred layer with every mesh file called `name(path)`."""

    def named(shapes: Iterable[Any]) -> list[Any]:
        return [name(s) if isinstance(s, str) else s for s in shapes]

    pieces = [
        {**p, "mesh": name(p["mesh"]), "collision": named(p["collision"])} for p in completion["pieces"]
    ]
    room = None if completion["room"] is None else name(completion["room"])
    lists: dict[str, Any] = {key: named(completion[key]) for key in _LISTS}
    lists |= {k: name(completion[k]) for k in (*_UV, *_PIECES) if completion.get(k) is not None}
    return {**completion, "shown": name(completion["shown"]), "room": room, "pieces": pieces, **lists}
