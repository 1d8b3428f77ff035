"""Mesh files and the files a description names."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np

from twin.errors import InputError
from twin.lint.model import FileMesh
from twin.lint.xml import read_xml
from twin.scene import Mesh
from twin.soundness import crossing

_SCHEME = re.compile(r"[A-Za-z][A-Za-z0-9+.-]+:")  # two letters at least: C: is a drive


def locate(written: str, folder: Path) -> Path | None:
    """Where a file name that is written in a description in `folder` points to.

    package://NAME/REST is looked for in the nearest folder above the description that is the package NAME by
    its package.xml or by its own name, in a folder NAME beside those, and at last as REST in `folder`. None
    for other addresses and for packages that are not there.
    """
    if written.startswith(("package://", "model://")):
        name, _, rest = written.split("://", 1)[1].partition("/")
        for up in (folder, *folder.resolve().parents):
            for candidate in (
                up / rest if up.name == name or _is_package(up, name) else None,
                up / name / rest,
            ):
                if candidate is not None and candidate.is_file():
                    return candidate
        return folder / rest if (folder / rest).is_file() else None
    if written.startswith("file://"):
        return Path(written[7:])
    if _SCHEME.match(written):
        return None
    return folder / written


def _is_package(folder: Path, name: str) -> bool:
    manifest = folder / "package.xml"
    if not manifest.is_file():
        return False
    try:
        return read_xml(manifest)[0].findtext("name") == name
    except InputError:
        return False


def is_absolute(written: str) -> bool:
    """True when a path holds only on the machine it was written on."""
    return written.startswith(("/", "\\", "~", "file:/")) or bool(re.match(r"[A-Za-z]:[\\/]", written))


def load_surface(path: Path) -> tuple[FileMesh | None, str]:
    """The mesh in a file, or why it can't be read. Scenes are joined into one mesh in their common frame;
    COLLADA's unit is followed, its `up_axis` is not."""
    import trimesh

    if not path.is_file():
        return None, ""  # another rule's matter
    try:
        scene: Any = trimesh.load_scene(str(path), process=False)
        unit = trimesh.units.unit_conversion(scene.units, "meters") if path.suffix.lower() == ".dae" else 1.0
        loaded: Any = scene.to_mesh()
    except Exception as e:  # whatever the parser of an unknown file raises
        return None, f"{type(e).__name__}: {e}".splitlines()[0][:200]
    faces = np.asarray(loaded.faces, dtype=np.int64).reshape(-1, 3)
    return FileMesh(unit * np.asarray(loaded.vertices, dtype=np.float64).reshape(-1, 3), faces), ""


def counts_y_up(path: Path) -> bool:
    """Whether a mesh file says that y points up: glTF always, COLLADA where it says nothing else."""
    if path.suffix.lower() in (".glb", ".gltf"):
        return True
    if path.suffix.lower() != ".dae":
        return False
    try:
        axes = [e.text or "" for e in read_xml(path)[0].iter() if e.tag.rpartition("}")[2] == "up_axis"]
    except InputError:
        return False  # the mesh's reader says what is wrong with it
    return not axes or axes[0].strip() == "Y_UP"


def surface_problem(surface: FileMesh) -> str:
    """What makes a mesh useless for collision: no face, no extent, infinite numbers, unknown vertices."""
    v, f = surface.vertices, surface.faces
    if not len(f):
        return "it has no faces"
    if f.min() < 0 or f.max() >= len(v):
        return f"a face names vertex {int(f.max())} of {len(v)}"
    if not np.isfinite(v).all():
        return "a vertex is not finite"
    if float(np.ptp(v[f.ravel()], axis=0).max()) == 0.0:
        return "all its vertices are in one place"
    return ""


def open_edges(surface: FileMesh) -> int:
    """Number of edges that don't join exactly two faces, vertices at the same place counted as one."""
    _, place = np.unique(np.round(surface.vertices, 9), axis=0, return_inverse=True)
    f = place.reshape(-1)[surface.faces]
    f = f[(f[:, 0] != f[:, 1]) & (f[:, 1] != f[:, 2]) & (f[:, 2] != f[:, 0])]
    edges = np.sort(np.concatenate([f[:, [0, 1]], f[:, [1, 2]], f[:, [2, 0]]]), axis=1)
    _, counts = np.unique(edges, axis=0, return_counts=True)
    return int((counts != 2).sum())


_MOST_FACES = 5000  # Open3D compares every pair of triangles: about a second at this count
# of the area, chosen by us: a tenth of what is told of our own parts (twin.soundness), whose noise is known
_SHARE = 0.01


def crosses_itself(surface: FileMesh) -> bool:
    """True when the mesh passes through itself (twin.soundness.crossing). Over 5000 faces: not judged."""
    if len(surface.faces) > _MOST_FACES:
        return False
    return crossing(Mesh(surface.vertices, surface.faces.astype(np.int32)))[0] > _SHARE
