"""Pictures drawn before: kept beside the page, and drawn again only when what they show has changed.

Every verb writes the page anew; its pictures of the twin take seconds and seldom change.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, Literal

import numpy as np

from twin.exporters.bodies import named_shapes
from twin.files.text import read_json, write_json
from twin.inferred import Completion
from twin.scene import Mesh, Part, Twin

Pictures = dict[str, Any]
_DRAWING = 6  # raised when the same twin gives other pictures
Kept = Literal["pictures", "scene"]


def drawn_once(
    run: Path, twin: Twin, draw: Callable[[Twin], Pictures], kept_as: Kept = "pictures"
) -> Pictures:
    """`draw(twin)`, JSON types, or what it returned the last time in this run if that shows the same twin.

    The pictures don't show collision shapes, the scene does. Raises OSError when the run can't be written.
    """
    path, key = run / "report" / f"{kept_as}.json", _key(twin, kept_as)
    kept = read_json(path)
    if kept.get("key") == key and kept.get("sum") == _sum(kept.get("pictures")):
        return dict(kept["pictures"])
    pictures = draw(twin)
    path.parent.mkdir(parents=True, exist_ok=True)
    write_json(path, {"key": key, "sum": _sum(pictures), "pictures": pictures})
    return pictures


def _sum(pictures: object) -> str:
    """Tells pictures that were kept from a file that is garbled or edited."""
    return hashlib.sha256(json.dumps(pictures, sort_keys=True).encode()).hexdigest()


def _key(twin: Twin, kept_as: Kept) -> str:
    """SHA-256 of all that is shown."""
    digest = hashlib.sha256(f"{_DRAWING}".encode())
    for item in (*_shows(twin), *(_shapes(twin) if kept_as == "scene" else ())):
        if isinstance(item, np.ndarray):
            digest.update(f"{item.dtype}{item.shape}".encode() + np.ascontiguousarray(item).tobytes())
        else:
            digest.update(repr(item).encode())
    return digest.hexdigest()


def _shows(twin: Twin) -> Iterator[object]:
    yield from _surface(twin.static.mesh)
    yield from _layer(twin.static.completion)
    if twin.cameras is not None:
        yield twin.cameras.T_world_cam
    for part in twin.parts:
        yield from _surface(part.mesh)
        yield from _layer(part.completion)
        yield from _motion(part)


def _layer(completion: Completion | None) -> Iterator[object]:
    if completion is not None:
        yield from _surface(completion.shown)
        for piece in completion.pieces:
            yield from _surface(piece.mesh)
            yield from (piece.name, piece.basis, piece.reason, piece.color)


def _shapes(twin: Twin) -> Iterator[object]:
    for shape in (s for o in twin.owners for s in named_shapes(o, None).values()):
        yield from _surface(shape) if isinstance(shape, Mesh) else (shape.T_world_box, shape.size)


def _surface(mesh: Mesh) -> Iterator[object]:
    yield from (mesh.vertices, mesh.faces, mesh.colors)
    if mesh.texture is not None:
        yield from (mesh.texture.uv, mesh.texture.image)


def _motion(part: Part) -> Iterator[object]:
    joint, motion = part.joint, part.motion
    yield from (part.id, part.parent, joint.kind, joint.axis, getattr(joint, "pivot", None))
    yield from (float(joint.lower), float(joint.upper), motion.intervals)
    yield from (motion.frames, motion.times, motion.state)
    yield None if part.contact is None else part.contact.frames
