"""Twins on disk: `twin.json` ("funtwin/1"), `cameras.txt`, `meshes/*.ply`, `textures/*`, `labels/*.png`.

Numbers are written with as many digits as it takes to read back the same double, so a saved and loaded twin
is the same twin (camera rotations, stored as quaternions, to 1e-12). docs/twin_format.md describes the
format. What else lies in the folder is its owner's: no function here changes or removes it.
"""

from __future__ import annotations

import hashlib
import json
import os
import shutil
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from twin.errors import InputError
from twin.files.atomic import contents, put, staging, tidy, write_file
from twin.files.paths import AnyPath
from twin.files.ply import ply_bytes
from twin.scene import Mesh, Twin
from twin.storage.completion import looks_files
from twin.storage.document import (
    json_text,
    read_document,
    shape_files,
    twin_document,
    with_changes,
    with_files_named,
)
from twin.storage.earlier import Earlier, free_name, same_mesh
from twin.storage.labels import LABEL
from twin.storage.reading import read_twin
from twin.storage.texture import same_texture, same_textures, texture_bytes, texture_files, texture_of
from twin.storage.tum import tum_lines

# What `twin export` and `twin physics` fill in or change: not what a reconstruction found.
_FILLED = ("collision", "inertial", "physics", "completion")
# What is made of a recording and tells nothing new of the scene: with and without it a twin is the same.
_LOOKS = ("texture",)


def save(twin: Twin, folder: AnyPath) -> None:
    """Write the twin into `folder` (usually RUN/twin): all of it appears at once, or nothing changes.

    A twin that is there already is replaced; meshes and cameras that stay the same keep their files and
    names, and everything in the folder that is not of that twin stays.

    Raises InputError when the folder can't be written or holds something that is not a twin.
    """
    folder = Path(folder)
    tidy(folder.resolve())
    old = _earlier(folder)
    folder = folder.resolve()
    with _writing(folder):
        ours = set() if old is None else _files_of(folder, old)
        present = set(contents(folder)) if folder.exists() else set()
        with staging(folder) as staged:
            _write(twin, staged, Earlier(folder, old or {}, present - ours))
            put(staged, folder, ours)


def require_place(folder: Path) -> None:
    """Raises InputError unless a twin may be written there: a new or empty folder, or one with a twin."""
    if folder.exists() and (
        not folder.is_dir() or (any(folder.iterdir()) and not (folder / "twin.json").exists())
    ):
        raise InputError(
            f"{folder} exists and does not hold a twin", "give a new or empty folder, e.g. RUN/twin"
        )


def load(folder: AnyPath) -> Twin:
    """Read a twin from RUN/twin, or from RUN itself. Labels are read when they are looked at.

    Raises InputError that names the file, the field and its value.
    """
    return read_twin(twin_folder(folder))


def twin_folder(folder: AnyPath) -> Path:
    """The folder that holds twin.json: RUN/twin, given itself or RUN. InputError if there is none."""
    folder = Path(folder)
    here = folder if (folder / "twin.json").is_file() else folder / "twin"
    if not (here / "twin.json").is_file():
        raise InputError(f"{folder} holds no twin.json", "give a run folder or its folder twin/")
    return here


def update(old: Twin, new: Twin, folder: AnyPath) -> None:
    """Write what differs between `old` in a folder and `new`: numbers and collision shapes, nothing else.

    Every other value of twin.json stays as it stands there, and every file. New shapes get files of their
    own; twin.json, replaced last and at once, is what makes them count. Equal twins change nothing.

    Raises InputError if a mesh of the twin is missing, a mesh or texture differs, or nothing can be written.
    """
    here = twin_folder(folder).resolve()
    known: dict[str, Mesh] = {}
    meshes: dict[str, Mesh] = {}
    before, after = twin_document(old, known), twin_document(new, meshes)
    raw = read_document(here / "twin.json")
    absent = [path for _, path in shape_files(raw) if not (here / path).is_file()]
    if absent:
        raise InputError(f"{here / absent[0]} does not exist", "save the whole twin with twin.save")
    fresh = {path: ply_bytes(m) for path, m in meshes.items() if not same_mesh(m, known.get(path))}
    layered = dict(looks_files(before))
    for role, path in looks_files(after):
        if role not in layered or not same_texture(texture_of(old, role), texture_of(new, role)):
            fresh[path] = texture_bytes(texture_of(new, role), role[1])
    other = [path for (_, shape), path in shape_files(after) if shape is None and path in fresh]
    if not same_textures(old, new):
        other.append("a texture")
    if other:
        raise InputError(f"{other[0]} is not what {here} holds", "save the whole twin with twin.save")
    with _writing(here):
        names = {}
        for path, data in fresh.items():
            names[path] = free_name(path, partial(_says_else, here, data))
            write_file(here / names[path], data)
        changed = with_changes(raw, before, with_files_named(after, lambda p: names.get(p, p)))
        if changed != raw:
            write_file(here / "twin.json", (json_text(changed) + "\n").encode())


def digest(twin: Twin) -> str:
    """SHA-256 of what a reconstruction found, the same for a twin and for what was loaded after it was saved:
    no provenance, nothing that others added or that is filled in later."""
    meshes: dict[str, Mesh] = {}
    bare = replace(twin, extra={}, parts=tuple(replace(p, extra={}) for p in twin.parts))
    document = twin_document(bare, meshes)
    for owner in (document, document["static"], *document["parts"]):
        if owner.get("verdict") is None:  # as in twins that were made before there were verdicts
            owner.pop("verdict", None)
        for key in (*_FILLED, *_LOOKS):
            owner.pop(key, None)
    document.pop("provenance")
    h = hashlib.sha256(json.dumps(document, sort_keys=True).encode())
    for path in sorted(p for p in meshes if p.count(".") == 1):  # no shapes, no inferred layer
        h.update(ply_bytes(meshes[path]))
    # not the rotations: those that were stored as quaternions differ in the last digit
    if twin.cameras is not None:
        h.update(twin.cameras.T_world_cam[:, :3, 3].tobytes())
    for frame in sorted(twin.labels):
        h.update(f"{frame}".encode() + np.ascontiguousarray(twin.labels[frame]).tobytes())
    return h.hexdigest()


def keep_aside(folder: Path) -> Path:
    """Keep a copy of a twin's folder beside it, under its name with `_before_` and a number; its path.

    Files are linked, not copied: replacing one in either folder leaves the other's. Raises OSError.
    """
    aside = aside_name(folder)
    with staging(aside) as staged:
        shutil.copytree(folder, staged, symlinks=True, copy_function=os.link, dirs_exist_ok=True)
        staged.rename(aside)
    return aside


def aside_name(folder: Path) -> Path:
    """A name beside a folder that is not taken: its own with `_before_` and a number."""
    k = 1
    while (aside := folder.with_name(f"{folder.name}_before_{k}")).exists():
        k += 1
    return aside


def _earlier(folder: Path) -> dict[str, Any] | None:
    """The document of the twin that `folder` holds, None for a folder that is empty or not there."""
    require_place(folder)
    if not (folder / "twin.json").exists():
        return None
    document = read_document(folder / "twin.json")
    try:
        list(shape_files(document)), list(texture_files(document))
    except (KeyError, TypeError, AttributeError) as e:
        raise InputError(
            f"{folder / 'twin.json'} is not a twin (no {e})", "move it away or give another folder"
        ) from e
    return document


def _files_of(folder: Path, document: Mapping[str, Any]) -> set[str]:
    """Paths in `folder` that are of the twin `document`."""
    cameras = (document.get("cameras") or {}).get("file")
    labels = {f"labels/{p.name}" for p in (folder / "labels").glob("*.png") if LABEL.fullmatch(p.name)}
    own = {
        "twin.json",
        *(path for _, path in shape_files(document)),
        *(path for _, path in texture_files(document)),
        *labels,
        *([cameras] if cameras else []),
    }
    return {os.path.normpath(path) for path in own}


def _write(twin: Twin, folder: Path, earlier: Earlier) -> None:
    meshes: dict[str, Mesh] = {}
    document = twin_document(twin, meshes)
    names: dict[str, str] = {}
    for role, path in shape_files(document):
        names[path], same = earlier.name(role, path, meshes[path])
        target = folder / names[path]
        target.parent.mkdir(parents=True, exist_ok=True)
        if same:
            os.link(earlier.folder / names[path], target)
        else:
            target.write_bytes(ply_bytes(meshes[path]))
    names |= _write_textures(twin, document, folder, earlier)
    document = with_files_named(document, lambda path: names[path])
    if twin.cameras is not None:
        text = tum_lines(twin.cameras)
        document["cameras"]["file"], text = earlier.cameras(text)
        (folder / document["cameras"]["file"]).write_text(text, encoding="ascii", newline="\n")
    _write_labels(twin.labels, folder / "labels")
    write_file(folder / "twin.json", (json_text(document) + "\n").encode())


def _write_textures(
    twin: Twin, document: Mapping[str, Any], folder: Path, earlier: Earlier
) -> dict[str, str]:
    """Path in the document -> name of the file that was written."""
    names = {}
    for role, path in texture_files(document):
        data = texture_bytes(texture_of(twin, role), role[1])
        names[path] = earlier.texture(role, path, data)
        target = folder / names[path]
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_bytes(data)
    return names


def _write_labels(labels: Mapping[int, NDArray[np.uint8]], folder: Path) -> None:
    import cv2

    for frame in sorted(labels):
        folder.mkdir(exist_ok=True)
        ok, png = cv2.imencode(".png", labels[frame])
        if not ok:
            raise InputError(
                f"label image of frame {frame} can't be written as PNG", "labels are (H, W) uint8"
            )
        (folder / f"{frame:06d}.png").write_bytes(png.tobytes())


def _says_else(folder: Path, data: bytes, name: str) -> bool:
    """Whether a file of this name says something else; equal bytes are an interrupted call's."""
    path = folder / name
    return path.exists() and not (path.is_file() and path.read_bytes() == data)


@contextmanager
def _writing(folder: Path) -> Iterator[None]:
    """Say which folder can't be written, and why."""
    try:
        yield
    except OSError as e:
        where = f" ({e.filename})" if e.filename else ""
        raise InputError(
            f"{folder} can't be written: {e.strerror or e}{where}", "check space and permissions"
        ) from e
