"""The twin that a folder holds before it is saved again: what of it stays under its name."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from twin.errors import InputError
from twin.files.ply import read_ply
from twin.scene import Mesh
from twin.storage.document import (
    CAMERAS,
    shape_files,
)
from twin.storage.texture import texture_files

_QUATERNION = 1e-12  # what a rotation loses when it is written as a quaternion and read again


class Earlier:
    """The twin in a folder before it is saved again: its document ({} for none), and files not its own."""

    def __init__(self, folder: Path, document: Mapping[str, Any], strange: Collection[str]) -> None:
        self.folder, self._strange = folder, strange
        self._shapes = dict(shape_files(document)) if document else {}
        self._textures = dict(texture_files(document)) if document else {}
        cameras = document.get("cameras") or {}
        self._cameras: str | None = cameras.get("file")

    def name(self, role: tuple[int | None, int | str | None], path: str, mesh: Mesh) -> tuple[str, bool]:
        """Where to write a mesh, and whether the file that plays this role now holds the same."""
        known = self._shapes.get(role)
        if known is not None and known not in self._strange and self._holds(known, mesh):
            return known, True
        return free_name(path, lambda p: p in self._strange), False

    def texture(self, role: tuple[int | None, str], path: str, data: bytes) -> str:
        """The name for a texture's file: that of the earlier one if it holds the same."""
        known = self._textures.get(role)
        if known is not None and known not in self._strange:
            there = self.folder / known
            if there.is_file() and there.read_bytes() == data:
                return known
        return free_name(path, lambda p: p in self._strange)

    def cameras(self, text: str) -> tuple[str, str]:
        """The name for the cameras' file and its text: those of the earlier one if it says the same, but for
        what rotations lose as quaternions."""
        known = self._cameras
        if known is not None and known not in self._strange:
            path = self.folder / known
            before = path.read_text(encoding="ascii", errors="replace") if path.is_file() else ""
            if before == text or _same_poses(before, text):
                return known, before
        return free_name(CAMERAS, lambda p: p in self._strange), text

    def _holds(self, path: str, mesh: Mesh) -> bool:
        try:
            there = read_ply(self.folder / path)
        except InputError:
            return False
        return same_mesh(there, mesh)


def _same_poses(a: str, b: str) -> bool:
    """Whether two texts of TUM lines say the same, rotations to `_QUATERNION`; q and -q are one rotation."""
    try:
        left, right = (
            np.array([[float(v) for v in line.split()] for line in t.splitlines()]) for t in (a, b)
        )
    except ValueError:
        return False
    if left.shape != right.shape or left.ndim != 2 or not np.array_equal(left[:, :4], right[:, :4]):
        return False
    p, q = left[:, 4:], right[:, 4:]
    return bool(np.minimum(np.abs(p - q).max(axis=1), np.abs(p + q).max(axis=1)).max() <= _QUATERNION)


def same_mesh(a: Mesh, b: Mesh | None) -> bool:
    if b is None or (a.colors is None) != (b.colors is None):
        return False
    pairs = [(a.vertices, b.vertices), (a.faces, b.faces), (a.colors, b.colors)]
    return a is b or all(x is y or np.array_equal(x, y) for x, y in pairs)  # type: ignore[arg-type]


def free_name(path: str, taken: Callable[[str], bool]) -> str:
    """The path, with a number before its ending where it is taken: no name of a part holds a dot."""
    stem, dot, ending = path.rpartition(".")
    name, k = path, 2
    while taken(name):
        name, k = f"{stem}.{k}{dot}{ending}", k + 1
    return name
