"""Keeps collision shapes: a file for each part and one for the twin after shapes gave way, or in memory."""

from __future__ import annotations

import hashlib
import io
import zipfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from twin.files.atomic import write_file
from twin.files.paths import AnyPath
from twin.scene import Box, Collision, Mesh, Twin

_VERSION = 7  # part of every key: raise it whenever the same input may give other shapes

Shapes = list[list[Collision]]

# Entries kept in memory. Chosen by us: the parts of a kitchen, and the whole.
_MOST = 32
_last: dict[str, tuple[Shapes, dict[str, float]]] = {}


class ShapeCache:
    """Shapes under keys of meshes and config in a folder; without one, those made last are in memory."""

    def __init__(self, folder: AnyPath | None, config: dict[str, object]) -> None:
        self._folder = None if folder is None else Path(folder)
        self._config = f"{_VERSION}{config}".encode()

    def key_of_mesh(self, mesh: Mesh) -> str:
        """Key of one part's own shapes: its mesh and the config."""
        h = hashlib.sha256(self._config)
        h.update(mesh.vertices.tobytes() + mesh.faces.tobytes())
        return f"part_{h.hexdigest()[:24]}"

    def key_of_twin(self, twin: Twin, stated: Sequence[Sequence[Collision]]) -> str:
        """Key of all shapes: meshes, joints, filtered pairs, stated shapes (static first) and the config."""
        h = hashlib.sha256(self._config)
        for mesh in (twin.static.mesh, *(p.mesh for p in twin.parts)):
            h.update(mesh.vertices.tobytes() + mesh.faces.tobytes())
        for p in twin.parts:
            h.update(p.joint.pose(p.joint.upper).tobytes() + p.joint.pose(1.0).tobytes())
            h.update(f"{p.id} {p.parent} {p.joint.lower!r} {p.joint.upper!r}".encode())
        for own in stated:
            h.update(f"{len(own)} stated".encode())
            for s in own:
                both = (s.T_world_box, s.size) if isinstance(s, Box) else (s.vertices, s.faces)
                h.update(b"".join(x.tobytes() + f"{x.shape}".encode() for x in both))
        if twin.filtered_pairs:
            h.update(f"{[o.name for o in twin.owners]} {twin.filtered_pairs}".encode())
        return f"twin_{h.hexdigest()[:24]}"

    def cached(self, key: str, make: Callable[[], Shapes]) -> Shapes:
        """The shapes under a key, made and kept if they are not there."""
        return self.cached_with(key, lambda: (make(), {}), ())[0]

    def cached_with(
        self, key: str, make: Callable[[], tuple[Shapes, dict[str, float]]], names: Sequence[str]
    ) -> tuple[Shapes, dict[str, float]]:
        """The shapes under a key with the named numbers beside them, made and kept if they are not there."""
        found = self.read(key)
        if found is None:
            shapes, numbers = make()
            found = shapes, {n: numbers[n] for n in names}
            self._write(key, *found)
        return found

    def read(self, key: str) -> tuple[Shapes, dict[str, float]] | None:
        """Shapes and numbers under a key; None when they are not there or the file is broken."""
        if self._folder is None:
            return _last.get(key)
        path = self._folder / f"{key}.npz"
        if not path.is_file():
            return None
        try:
            with np.load(path, allow_pickle=False) as data:
                numbers = {k.removeprefix("told_"): float(data[k]) for k in data if k.startswith("told_")}
                counts = [int(n) for n in data["count"]]
                return [[_shape(data, f"{i}_{k}") for k in range(n)] for i, n in enumerate(counts)], numbers
        except (OSError, KeyError, ValueError, zipfile.BadZipFile):
            return None  # made anew: a cache holds nothing that can't be

    def _write(self, key: str, shapes: Shapes, numbers: dict[str, float]) -> None:
        if self._folder is None:
            _last[key] = shapes, numbers
            while len(_last) > _MOST:
                _last.pop(next(iter(_last)))
            return
        arrays: dict[str, NDArray[np.generic]] = {"count": np.array([len(s) for s in shapes])}
        arrays |= {f"told_{k}": np.array(v) for k, v in numbers.items()}
        for i, owner in enumerate(shapes):
            for k, piece in enumerate(owner):
                if isinstance(piece, Box):
                    arrays[f"{i}_{k}_pose"], arrays[f"{i}_{k}_size"] = piece.T_world_box, piece.size
                else:
                    arrays[f"{i}_{k}_vertices"], arrays[f"{i}_{k}_faces"] = piece.vertices, piece.faces
        data = io.BytesIO()
        np.savez(data, **arrays)  # type: ignore[arg-type]
        write_file(self._folder / f"{key}.npz", data.getvalue())


def _shape(data: Any, name: str) -> Collision:
    if f"{name}_pose" in data:
        return Box(data[f"{name}_pose"], data[f"{name}_size"])
    return Mesh(data[f"{name}_vertices"], data[f"{name}_faces"])
