"""Binary PLY triangle meshes with vertex colours: exact (double coordinates) and the same bytes every time."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from twin.errors import InputError, SceneError
from twin.scene import Mesh

_SCALARS = {
    "char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1", "short": "<i2", "int16": "<i2", "ushort": "<u2",
    "uint16": "<u2", "int": "<i4", "int32": "<i4", "uint": "<u4", "uint32": "<u4", "float": "<f4", "float32": "<f4",
    "double": "<f8", "float64": "<f8",
}  # fmt: skip


def ply_bytes(mesh: Mesh) -> bytes:
    """Encode a mesh as binary little-endian PLY: x y z double, red green blue uchar when coloured, int32 faces."""
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
    counts, vertex_fields, face_fields = _elements(head, path)
    vertex = np.dtype(vertex_fields)
    start = end + len(b"end_header\n")
    split = start + vertex.itemsize * counts["vertex"]
    face = np.dtype(face_fields)
    if len(data) < split + face.itemsize * counts["face"]:
        raise InputError(
            f"mesh {path} is cut short: {len(data)} bytes for {counts['vertex']} vertices and {counts['face']} faces",
            "save the twin again",
        )
    v = np.frombuffer(data, vertex, counts["vertex"], start)
    f = np.frombuffer(data, face, counts["face"], split)
    if len(f) and np.any(f["n"] != 3):
        raise InputError(f"mesh {path} has a face of {int(f['n'].max())} corners", "triangulate it")
    colors = np.stack([v[c] for c in ("red", "green", "blue")], 1) if "red" in vertex.names else None  # type: ignore[operator]
    try:
        return Mesh(np.stack([v["x"], v["y"], v["z"]], 1), f["v"], colors)
    except SceneError as e:
        raise InputError(f"mesh {path}: {e.problem}", e.remedy) from e


def _elements(head: list[str], path: Path) -> tuple[dict[str, int], list[tuple[str, str]], list[tuple]]:  # type: ignore[type-arg]
    counts: dict[str, int] = {}
    vertex: list[tuple[str, str]] = []
    face: list[tuple] = []  # type: ignore[type-arg]
    try:
        for line in head:
            word = line.split()
            if word[0] == "element":
                counts[word[1]] = int(word[2])
            elif word[:2] == ["property", "list"]:
                face = [("n", _SCALARS[word[2]]), ("v", _SCALARS[word[3]], (3,))]
            elif word[0] == "property":
                vertex.append((word[2], _SCALARS[word[1]]))
        if (
            list(counts)[:2] != ["vertex", "face"]
            or not face
            or not {"x", "y", "z"} <= {n for n, _ in vertex}
        ):
            raise KeyError("vertex and face elements")
    except (IndexError, KeyError, ValueError) as e:
        raise InputError(
            f"mesh {path} has a PLY header that can't be used ({e})", "save the twin again"
        ) from e
    return counts, vertex, face
