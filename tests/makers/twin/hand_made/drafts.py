"""Twin folders as a person or another program writes them: plain dictionaries and bytes, nothing of ours in
between."""

from __future__ import annotations

import json
import struct
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Points = Sequence[float] | Array
_CORNERS = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], float)
_QUADS = np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]])
_FACES = np.concatenate([_QUADS[:, [0, 1, 2]], _QUADS[:, [0, 2, 3]]])
_FORMATS = {"float": "f", "double": "d", "uchar": "B", "int": "i", "uint": "I", "float32": "f", "int32": "i"}


@dataclass(frozen=True)
class Shape:
    """Triangles: vertices (V, 3) m and faces (F, 3)."""

    vertices: Array
    faces: NDArray[np.int64]

    def __add__(self, other: Shape) -> Shape:
        faces = np.concatenate([self.faces, other.faces + len(self.vertices)])
        return Shape(np.concatenate([self.vertices, other.vertices]), faces)

    def moved(self, by: Points = (0, 0, 0), rotation: Array | None = None) -> Shape:
        """Turned about the origin, then moved."""
        turned = self.vertices if rotation is None else self.vertices @ rotation.T
        return Shape(turned + np.array(by, float), self.faces)

    def finer(self, times: int) -> Shape:
        """Every triangle in four, `times` times; vertices are not shared."""
        t = self.vertices[self.faces]
        for _ in range(times):
            a, b, c = t[:, 0], t[:, 1], t[:, 2]
            ab, bc, ca = (a + b) / 2, (b + c) / 2, (c + a) / 2
            t = np.concatenate(
                [np.stack(k, 1) for k in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))]
            )
        vertices, index = np.unique(t.reshape(-1, 3), axis=0, return_inverse=True)
        return Shape(vertices, index.reshape(-1, 3))


def board(low: Points, high: Points) -> Shape:
    """A closed box between two corners."""
    a, b = np.array(low, float), np.array(high, float)
    return Shape(a + _CORNERS * (b - a), _FACES.copy())


def sheet(low: Points, high: Points) -> Shape:
    """Two triangles across a box that is flat along one axis."""
    a, b = np.array(low, float), np.array(high, float)
    u, v = (k for k in range(3) if a[k] != b[k])
    corners = np.array([a, a, b, b])
    corners[1, u], corners[3, u] = b[u], a[u]
    corners[1, v], corners[3, v] = a[v], b[v]
    return Shape(corners, np.array([[0, 1, 2], [0, 2, 3]]))


def ply(
    shape: Shape,
    scalar: str = "double",
    index: str = "int",
    colors: Points | None = None,
    more: Sequence[tuple[str, str]] = (),
    comments: Sequence[str] = (),
    name: str = "vertex_indices",
    count: str = "uchar",
) -> bytes:
    """A binary PLY as other programs write it: `more` properties of vertices (type, name), which are 0."""
    rgb = [("uchar", c) for c in ("red", "green", "blue")] if colors is not None else []
    fields = [*((scalar, c) for c in "xyz"), *rgb, *more]
    head = ["ply", "format binary_little_endian 1.0", *(f"comment {c}" for c in comments)]
    head += [f"element vertex {len(shape.vertices)}", *(f"property {t} {n}" for t, n in fields)]
    head += [f"element face {len(shape.faces)}", f"property list {count} {index} {name}", "end_header\n"]
    row = struct.Struct("<" + "".join(_FORMATS[t] for t, _ in fields))
    face = struct.Struct(f"<{_FORMATS[count]}3{_FORMATS[index]}")
    tail = [*((int(c) for c in colors) if colors is not None else ()), *(0 for _ in more)]
    body = b"".join(row.pack(*v, *tail) for v in shape.vertices.tolist())
    return "\n".join(head).encode() + body + b"".join(face.pack(3, *f) for f in shape.faces.tolist())


def box(low: Points, high: Points, rotation: Any = ((1, 0, 0), (0, 1, 0), (0, 0, 1))) -> dict[str, Any]:
    """A box of a `collision` list between two corners (before it is turned about its centre)."""
    a, b = np.array(low, float), np.array(high, float)
    return {
        "center": ((a + b) / 2).tolist(),
        "rotation": np.array(rotation).tolist(),
        "size": (b - a).tolist(),
    }


def solid(mass: float, low: Points, high: Points) -> dict[str, Any]:
    """`inertial` of a homogeneous box."""
    a, b = np.array(low, float), np.array(high, float)
    x, y, z = ((b - a) ** 2).tolist()
    tensor = [mass / 12 * (y + z), mass / 12 * (x + z), mass / 12 * (x + y), 0.0, 0.0, 0.0]
    span = [0.9 * mass, 1.1 * mass]
    return {"mass": mass, "com": ((a + b) / 2).tolist(), "inertia": tensor, "source": "measured: kitchen scale", "mass_interval": span}  # fmt: skip


def quantity(value: float, source: str = "user: by hand") -> dict[str, Any]:
    return {"value": value, "source": source, "interval": [0.5 * value, 2 * value]}


def physics(friction: float = 0.4, damping: float = 0.3, frictionloss: float = 0.2) -> dict[str, Any]:
    return {
        "friction": quantity(friction),
        "damping": quantity(damping),
        "frictionloss": quantity(frictionloss),
        "density": quantity(700.0),
    }


def revolute(axis: Any, pivot: Any, upper: float = 1.5, lower: float = 0.0) -> dict[str, Any]:
    return {
        "type": "revolute", "axis": list(axis), "pivot": list(pivot), "lower": lower, "upper": upper,
        "limits_source": "tape measure", "closed_source": "seen", "type_source": "seen", "sigma": None, "covariance": None,
    }  # fmt: skip


def prismatic(axis: Any, upper: float = 0.3, lower: float = 0.0) -> dict[str, Any]:
    return {**revolute(axis, (), upper, lower), "type": "prismatic", "pivot": None}


def still() -> dict[str, Any]:
    """`motion` of a part that nobody filmed."""
    return {"frames": [], "times": [], "state": [], "intervals": [], "residual": 0.0, "inliers": 1.0}


@dataclass
class Draft:
    """A run folder before it is written: twin.json as `document` (or `text`, where it is not such JSON), and
    files by their path in RUN."""

    document: dict[str, Any]
    files: dict[str, bytes] = field(default_factory=dict)
    links: dict[str, str] = field(default_factory=dict)
    text: Callable[[str], bytes] = str.encode
    indent: int | None = 1

    @property
    def parts(self) -> list[dict[str, Any]]:
        return self.document["parts"]  # type: ignore[no-any-return]

    @property
    def door(self) -> dict[str, Any]:
        """The first part."""
        return self.parts[0]

    def part(
        self,
        number: int,
        name: str,
        joint: dict[str, Any],
        shape: Shape,
        parent: int | None = None,
        **stated: Any,
    ) -> dict[str, Any]:
        """Add a part and its mesh; what is not stated is left out as null or empty."""
        low, high = shape.vertices.min(0), shape.vertices.max(0)
        path = f"meshes/{name}.ply"
        self.files[f"twin/{path}"] = ply(shape)
        out = {
            "id": number, "name": name, "parent": parent, "mesh": path, "collision": [box(low, high)], "joint": joint,
            "motion": still(), "inertial": None, "physics": None, "contact": None, **stated,
        }  # fmt: skip
        self.parts.append(out)
        return out

    def shape(self, path: str, data: Shape | bytes) -> str:
        """Write a mesh into twin/; returns its path."""
        self.files[f"twin/{path}"] = data if isinstance(data, bytes) else ply(data)
        return path

    def write(self, run: Path) -> None:
        """The folder on disk."""
        text = json.dumps(self.document, indent=self.indent, ensure_ascii=False)
        for path, data in {**self.files, "twin/twin.json": self.text(text)}.items():
            (run / path).parent.mkdir(parents=True, exist_ok=True)
            (run / path).write_bytes(data)
        for path, target in self.links.items():
            (run / path).parent.mkdir(parents=True, exist_ok=True)
            (run / path).symlink_to(target)


def frame_boards() -> Shape:
    """A carcass without front: two sides, floor, top and back; 0.6 m wide, 0.4 m deep, 0.8 m high, its front
    at y = 0."""
    return (
        board((-0.3, 0, 0), (-0.28, 0.4, 0.8))
        + board((0.28, 0, 0), (0.3, 0.4, 0.8))
        + board((-0.28, 0, 0), (0.28, 0.38, 0.02))
        + board((-0.28, 0, 0.78), (0.28, 0.38, 0.8))
        + board((-0.28, 0.38, 0), (0.28, 0.4, 0.8))
    )


FRAME = [
    box((-0.3, 0, 0), (-0.28, 0.4, 0.8)),
    box((0.28, 0, 0), (0.3, 0.4, 0.8)),
    box((-0.28, 0, 0), (0.28, 0.38, 0.02)),
    box((-0.28, 0, 0.78), (0.28, 0.38, 0.8)),
    box((-0.28, 0.38, 0), (0.28, 0.4, 0.8)),
]
DOOR = ((-0.3, -0.023, 0.005), (0.3, -0.003, 0.795))  # 3 mm in front of the carcass
HINGE = (-0.3, -0.023, 0.4)  # at the front's left edge
CONTACT = {
    "point": [0.25, -0.023, 0.4], "rotation": [[1, 0, 0], [0, 0, -1], [0, 1, 0]], "width": 0.02, "frames": [3, 4, 5],
    "source": "by hand",
}  # fmt: skip


def cupboard(name: str = "cupboard") -> Draft:
    """A carcass and its door, everything stated: what all cases start from."""
    document = {
        "format": "funtwin/1", "name": name, "recording": None, "provenance": {}, "cameras": None,
        "static": {"name": "frame", "mesh": "meshes/frame.ply", "collision": [dict(b) for b in FRAME]}, "parts": [],
    }  # fmt: skip
    draft = Draft(json.loads(json.dumps(document)), {"twin/meshes/frame.ply": ply(frame_boards())})
    joint = revolute((0.0, 0.0, -1.0), HINGE)
    stated = {"inertial": solid(4.0, *DOOR), "physics": physics(), "contact": json.loads(json.dumps(CONTACT))}
    draft.part(2, "door", joint, board(*DOOR), **stated)
    return draft


def empty_room(name: str = "room") -> Draft:
    """A ground plate far below, and no part yet."""
    draft = cupboard(name)
    draft.document["parts"] = []
    draft.document["static"] = {
        "name": "ground",
        "mesh": "meshes/ground.ply",
        "collision": [box((-1, -1, -3), (1, 1, -2.9))],
    }
    draft.files = {"twin/meshes/ground.ply": ply(board((-1, -1, -3), (1, 1, -2.9)))}
    return draft


def rotation(axis: Points, angle: float) -> Array:
    """(3, 3), right-handed about a unit axis."""
    x, y, z = np.array(axis, float) / np.linalg.norm(axis)
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.asarray(np.eye(3) + np.sin(angle) * k + (1 - np.cos(angle)) * k @ k)
