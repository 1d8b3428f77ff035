"""Illegal twins: mesh files that aren't there, aren't meshes, or aren't bodies."""

from __future__ import annotations

import numpy as np

from tests.makers.twin.hand_made.cases import Cases
from tests.makers.twin.hand_made.drafts import DOOR, Draft, Shape, board, ply, sheet

CASES = Cases("illegal")
_DOOR = "meshes/door.ply"


def _file(name: str, data: bytes, *words: str) -> None:
    @CASES.add(name, refused=("door.ply", *words))
    def change(d: Draft) -> None:
        d.shape(_DOOR, data)


def _path(name: str, path: str, *words: str) -> None:
    @CASES.add(name, refused=words)
    def change(d: Draft) -> None:
        d.files["secret.ply"] = ply(board(*DOOR))
        d.door["mesh"] = path


_good = board(*DOOR)
_data = ply(_good)
_file("a mesh of no bytes", b"", "PLY")
_file("a mesh cut short", _data[:-40], "cut short")
_file("a mesh cut in its header", _data[:60], "PLY")
_file("a mesh in ASCII PLY", _data.replace(b"binary_little_endian", b"ascii"), "binary little-endian")
_file("a mesh in big-endian PLY", _data.replace(b"little", b"big"), "binary little-endian")
_file("an OBJ called PLY", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "PLY")
_file("a picture called PLY", b"\x89PNG\r\n\x1a\n" + bytes(200), "PLY")
_file(
    "faces that name vertices which are not there",
    ply(Shape(_good.vertices, _good.faces + 5)),
    "faces",
    "of 8",
)
_file("faces that name vertex -1", ply(Shape(_good.vertices, _good.faces - 1)), "faces", "-1")
_file("a PLY without z", _data.replace(b"property double z", b"property double w"), "header")
_file(
    "a PLY with a scalar type that there is none of",
    _data.replace(b"property double z", b"property half z"),
    "header",
    "half",
)
_file(
    "a PLY of a negative count",
    _data.replace(b"element vertex 8", b"element vertex -8"),
    "header",
    "-8 vertices",
)
_file(
    "a PLY of a count that is no number",
    _data.replace(b"element vertex 8", b"element vertex many"),
    "header",
    "many",
)
_file(
    "a PLY of far more faces than bytes",
    _data.replace(b"element face 12", b"element face 999999999999"),
    "cut short",
)
_path("a mesh that is not there", "meshes/none.ply", "none.ply")
_path("a mesh in the folder above", "../secret.ply", "parts[0].mesh", "'../secret.ply'")
_path("a mesh by an absolute path", "/etc/hostname", "parts[0].mesh", "'/etc/hostname'")
_path("a mesh that is a folder", "meshes", "meshes")
_path("a mesh path that is empty", "", "mesh")
_path("a mesh path with a zero byte", "meshes/a\0b.ply", "mesh")
_path("a mesh path of 5000 characters", "m" * 5000, "mesh")


def _with(value: float) -> bytes:
    vertices = _good.vertices.copy()
    vertices[3, 1] = value
    return ply(Shape(vertices, _good.faces))


_file("a vertex that is not a number", _with(float("nan")), "finite")
_file("a vertex at infinity", _with(float("inf")), "finite")


@CASES.add("a vertex at 1e300", refused=("door.ply", "mesh vertices", "1e+300"))
def _huge(d: Draft) -> None:
    d.shape(_DOOR, _with(1e300))


@CASES.add("a mesh of quads", refused=("door.ply", "4 corners", "triangulate"))
def _quads(d: Draft) -> None:
    head, _, _ = _data.partition(b"end_header\n")
    body = b"".join(np.array(v, "<f8").tobytes() for v in _good.vertices)
    quads = b"".join(b"\4" + np.array(q, "<i4").tobytes() for q in ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1)))
    d.shape(_DOOR, head.replace(b"face 12", b"face 3") + b"end_header\n" + body + quads)


@CASES.add("a mesh that a link leads out of the folder to", refused=("parts[0].mesh", "inside"))
def _link(d: Draft) -> None:
    d.files["secret.ply"] = ply(board(*DOOR))
    del d.files[f"twin/{_DOOR}"]
    d.links[f"twin/{_DOOR}"] = "../../secret.ply"


@CASES.add("a part whose mesh has no area", refused=("'door'", "empty"))
def _line(d: Draft) -> None:
    d.shape(_DOOR, Shape(np.array([[0.0, 0, 0], [0.5, 0, 0], [1, 0, 0]]), np.array([[0, 1, 2]])))


@CASES.add("a part whose mesh has no face", refused=("'door'", "empty"))
def _points(d: Draft) -> None:
    d.shape(_DOOR, Shape(_good.vertices, np.zeros((0, 3), np.int64)))


_text = _data.replace(b"property double z\n", b"property double z\nproperty float red\n")
_file("a PLY of red without green", _text, "header", "green")
_file(
    "a PLY whose vertices hold lists",
    _data.replace(b"double z\n", b"double z\nproperty list uchar float w\n"),
    "header",
    "list w",
)


@CASES.add("a concave mesh as a convex shape", refused=("collision[1]", "'door'", "not convex"))
def _concave(d: Draft) -> None:
    low, high = DOOR
    corner = board(low, high) + board((low[0], -0.4, low[2]), (low[0] + 0.02, low[1], high[2]))
    d.door["collision"].append(d.shape("meshes/corner.ply", corner))


@CASES.add("a collision mesh that is not there", refused=("hull_7.ply",))
def _absent(d: Draft) -> None:
    d.door["collision"] = ["meshes/hull_7.ply"]


@CASES.add("a flat collision mesh", refused=("collision[0]", "'door'"))
def _flat(d: Draft) -> None:
    d.door["collision"] = [d.shape("meshes/hull.ply", sheet((0, 0, 0), (0.5, 0, 0.5)))]


@CASES.add("a collision mesh without faces", refused=("collision[0]", "'door'"))
def _faceless(d: Draft) -> None:
    d.door["collision"] = [d.shape("meshes/hull.ply", Shape(np.zeros((0, 3)), np.zeros((0, 3), np.int64)))]


@CASES.add("a collision shape that is a number", refused=("parts[0].collision[0]", "7"))
def _number(d: Draft) -> None:
    d.door["collision"] = [7]


@CASES.add("a collision mesh outside of the folder", refused=("parts[0].collision[0]", "'../hull.ply'"))
def _outside(d: Draft) -> None:
    d.files["hull.ply"] = ply(board(*DOOR))
    d.door["collision"] = ["../hull.ply"]


@CASES.add("the frame's mesh cut short", refused=("frame.ply", "cut short"))
def _frame(d: Draft) -> None:
    d.files["twin/meshes/frame.ply"] = d.files["twin/meshes/frame.ply"][:-1]
