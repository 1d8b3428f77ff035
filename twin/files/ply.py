"""Binary PLY triangle meshes with vertex colours: exact (double coordinates) and repeatable."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from twin.errors import InputError, SceneError
from twin.scene import Mesh

_SCALARS = {
    "char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1", "short": "<i2", "int16": "<i2", "ushort": "<u2",
    "uint16": "<u2", "int": "<i4", "int32": "<i4", "uint": "<u4", "uint32": "<u4", "float": "<f4", "float32": "<f4",
    "double": "<f8", "float64": "<f8",
}  # fmt: skip
_COLORS = ("red", "green", "blue")
_CORNERS = ("vertex_indices", "vertex_index")  # what programs call the list of a face's corners


def ply_bytes(mesh: Mesh) -> bytes:
    """A mesh as binary little-endian PLY: x y z double, red green blue uchar when coloured, int32 faces."""
    fields = [("x", "<f8"), ("y", "<f8"), ("z", "<f8")]
    colors = [("red", "u1"), ("green", "u1"), ("blue", "u1")] if mesh.colors is not None else []
    vertices = np.zeros(len(mesh.vertices), dtype=fields + colors)
    for k, (name, _) in enumerate(fields):
        vertices[name] = mesh.vertices[:, k]
    if mesh.colors is not None:
        for k, (name, _) in enumerate(colors):
            vertices[name] = mesh.colors[:, k]
    faces = np.zeros(len(mesh.faces), dtype=[("n", "u1"), ("v", "<i4", (3,))])
    faces["n"], faces["v"] = 3, mesh.faces
    header = ["ply", "format binary_little_endian 1.0", f"element vertex {len(vertices)}"]
    header += [f"property double {n}" for n, _ in fields] + [f"property uchar {n}" for n, _ in colors]
    header += [f"element face {len(faces)}", "property list uchar int vertex_indices", "end_header", ""]
    return "\n".join(header).encode() + vertices.tobytes() + faces.tobytes()


def read_ply(path: Path) -> Mesh:
    """Read a binary little-endian PLY of triangles whose first two elements are vertex and face.

    Raises InputError that names the file when it is missing, cut short or of another kind.
    """
    try:
        data = path.read_bytes()
    except OSError as e:
        raise InputError(f"mesh {path} can't be read: {e.strerror}", "save the twin again") from e
    end = data.find(b"end_header\n")
    head = data[: max(end, 0)].decode("ascii", "replace").splitlines()
    if end < 0 or head[:2] != ["ply", "format binary_little_endian 1.0"]:
        raise InputError(
            f"mesh {path} is not a binary little-endian PLY file", "convert it, e.g. with Open3D or trimesh"
        )
    counts, vertex, face = _elements(head, path)
    start = end + len(b"end_header\n")
    split = start + vertex.itemsize * counts["vertex"]
    if len(data) < split + face.itemsize * counts["face"]:
        raise InputError(
            f"mesh {path} is cut short: {len(data)} bytes for {counts['vertex']} vertices and {counts['face']} faces",
            "save the twin again",
        )
    v = np.frombuffer(data, vertex, counts["vertex"], start)
    f = np.frombuffer(data, face, counts["face"], split)
    if len(f) and np.any(f["n"] != 3):
        raise InputError(f"mesh {path} has a face of {int(f['n'][f['n'] != 3][0])} corners", "triangulate it")
    colors = np.stack([v[c] for c in _COLORS], 1) if "red" in (vertex.names or ()) else None
    try:
        return Mesh(np.stack([v["x"], v["y"], v["z"]], 1), f["v"], colors)
    except SceneError as e:
        raise InputError(f"mesh {path}: {e.problem}", e.remedy) from e


def _elements(head: list[str], path: Path) -> tuple[dict[str, int], np.dtype[Any], np.dtype[Any]]:
    """Counts of the elements, and what stands in a vertex and in a triangle."""
    counts: dict[str, int] = {}
    fields: dict[str, list[tuple[Any, ...]]] = {"vertex": [], "face": []}
    element = ""
    try:
        for word in map(str.split, head):
            if word[0] == "element":
                element = word[1]
                counts[element] = int(word[2])
            elif word[0] == "property" and element in fields:
                if word[1] != "list":
                    fields[element].append((word[2], _SCALARS[word[1]]))
                elif element == "face" and word[4] in _CORNERS:
                    fields[element] += [("n", _SCALARS[word[2]]), ("v", _SCALARS[word[3]], (3,))]
                else:
                    raise KeyError(f"the list {word[4]} of each {element}")
        vertex, face = (np.dtype(fields[e]) for e in ("vertex", "face"))
        if list(counts)[:2] != ["vertex", "face"] or not {"x", "y", "z"} <= set(vertex.names or ()):
            raise KeyError("vertex and face elements")
        if "v" not in (face.names or ()):
            raise KeyError("the corners of faces")
        if min(counts.values()) < 0:
            raise ValueError(f"{counts['vertex']} vertices, {counts['face']} faces")
        if any(vertex[c] != np.uint8 for c in _COLORS if {"red"} & set(vertex.names or ())):
            raise ValueError("colours that are not uchar")
    except (IndexError, KeyError, ValueError) as e:
        raise InputError(
            f"mesh {path} has a PLY header that can't be used: {e.args[0] if e.args else e}",
            "write x y z, red green blue as uchar, and one list of corners, e.g. with Open3D or trimesh",
        ) from e
    return counts, vertex, face
