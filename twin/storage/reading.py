"""Reads twin.json: every error names the file, the field and its value."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from twin import geometry as geo
from twin.errors import InputError
from twin.files.ply import read_ply
from twin.geometry import Array
from twin.inferred import BASES, Completion, Inferred, Interior
from twin.scene import (
    Box,
    Collision,
    ContactPath,
    HandleSection,
    Joint,
    JointSigma,
    Mesh,
    Motion,
    Part,
    Prismatic,
    Recorded,
    Revolute,
    StaticPart,
    Texture,
    Trajectory,
    Twin,
)
from twin.storage.completion import with_textured_pieces
from twin.storage.document import FORMAT, extra_of, part_document, read_document, twin_document
from twin.storage.labels import LabelFolder
from twin.storage.node import Node
from twin.storage.physics import read_inertial, read_physics
from twin.storage.texture import read_texture, with_coordinates
from twin.verdict import Verdict, verdict_from


def read_twin(folder: Path) -> Twin:
    """The twin in `folder`, which holds twin.json."""
    file = folder / "twin.json"
    root = Node(file, "", read_document(file))
    if root.text("format") != FORMAT:
        raise root.error(f"is {root.text('format')!r}, this program reads {FORMAT!r}", "format")
    static = root.child("static")
    parts = tuple(_part(n, folder) for n in root.children("parts"))
    scene = _textured(static, folder)
    with root.building():
        twin = Twin(
            name=root.text("name"),
            static=StaticPart(
                static.text("name"),
                scene,
                _collision(static, folder),
                static.maybe("completion", lambda n: _completion(n, folder, scene)),
            ),
            parts=parts,
            cameras=root.maybe("cameras", lambda n: _cameras(n, folder)),
            recorded=root.maybe(
                "recording", lambda n: Recorded(n.text("source"), n.integer("frames"), n.text("fingerprint"))
            ),
            provenance=root.maybe("provenance", lambda n: n.value) or {},
            labels=LabelFolder(folder / "labels"),
            verdict=root.maybe("verdict", _verdict),
            filtered_pairs=_pairs(root),
        )
    known = twin_document(twin, {})
    own = {key: value for key, value in root.value.items() if key != "parts"}
    return replace(twin, extra=extra_of(own, known))


def _pairs(root: Node) -> tuple[tuple[str, str], ...]:
    """Pairs of names of bodies that don't collide; none where the document is silent."""
    rows = root.list("filtered_pairs") if root.value.get("filtered_pairs") is not None else []
    for k, row in enumerate(rows):
        if not (isinstance(row, list) and len(row) == 2 and all(isinstance(name, str) for name in row)):
            raise root.error(f"must be two names, is {row!r:.60}", f"filtered_pairs[{k}]")
    return tuple((row[0], row[1]) for row in rows)


def _part(n: Node, folder: Path) -> Part:
    joint, mesh = n.child("joint"), _textured(n, folder)
    with n.building():
        part = Part(
            id=n.integer("id"),
            name=n.text("name"),
            mesh=mesh,
            joint=_joint(joint),
            motion=_motion(n.child("motion")),
            inertial=n.maybe("inertial", read_inertial),
            physics=n.maybe("physics", read_physics),
            contact=n.maybe("contact", _contact),
            handle=n.maybe("handle", _handle),
            collision=_collision(n, folder),
            parent=None if n.raw("parent") is None else n.integer("parent"),
            limits_source=joint.text("limits_source"),
            closed_source=joint.text("closed_source"),
            type_source=joint.text("type_source"),
            verdict=n.maybe("verdict", _verdict),
            completion=n.maybe("completion", lambda c: _completion(c, folder, mesh)),
        )
    return replace(part, extra=extra_of(n.value, part_document(part)))


def _verdict(n: Node) -> Verdict:
    with n.building():
        return verdict_from(n.value)


def _joint(n: Node) -> Joint:
    kind = n.text("type")
    if kind not in ("revolute", "prismatic"):
        raise n.error(f"must be revolute or prismatic, is {kind!r}", "type")
    dof = 4 if kind == "revolute" else 2
    covariance = None if n.value.get("covariance") is None else n.array("covariance", (dof, dof))
    args = (n.array("axis", (3,)), n.number("lower"), n.number("upper"), covariance, n.maybe("sigma", _sigma))
    with n.building():
        return Revolute(*args, pivot=n.array("pivot", (3,))) if kind == "revolute" else Prismatic(*args)


def _sigma(n: Node) -> JointSigma:
    pivot = None if n.value.get("pivot_m") is None else n.number("pivot_m")
    return JointSigma(float(np.deg2rad(n.number("axis_deg"))), pivot, n.number("state"))


def _motion(n: Node) -> Motion:
    intervals = n.array("intervals", (None, 2), whole=True)
    with n.building():
        return Motion(
            n.array("frames", (None,), whole=True),
            n.array("times", (None,)),
            n.array("state", (None,)),
            tuple((int(a), int(b)) for a, b in intervals),
            n.number("residual"),
            n.number("inliers"),
        )


def _handle(n: Node) -> HandleSection:
    with n.building():
        return HandleSection(n.array("middle", (3,)), n.number("width"), n.integer("photographs"))


def _contact(n: Node) -> ContactPath:
    with n.building():
        return ContactPath(
            n.array("point", (3,)),
            n.array("rotation", (3, 3)),
            n.number("width"),
            tuple(int(f) for f in n.array("frames", (None,), whole=True)),
            n.text("source"),
        )


def _textured(n: Node, folder: Path) -> Mesh:
    """The mesh of the static scene or of a part, with its texture."""
    mesh = _mesh(n, "mesh", folder)

    def read(t: Node) -> Texture:
        image, uv = (_inside(t, key, t.text(key), folder) for key in ("image", "uv"))
        return read_texture(image, uv, len(mesh.faces))

    return replace(mesh, texture=n.maybe("texture", read))


def _mesh(n: Node, key: str, folder: Path) -> Mesh:
    return _mesh_file(n, key, n.text(key), folder)


def _mesh_file(n: Node, key: str, name: str, folder: Path) -> Mesh:
    return read_ply(_inside(n, key, name, folder))


def _inside(n: Node, key: str, name: str, folder: Path) -> Path:
    """The file that the document names."""
    path = folder / name
    try:
        path.is_file()  # raises where no file system could have it: a name too long, a zero byte
        inside = not Path(name).is_absolute() and path.resolve().is_relative_to(folder.resolve())
    except (OSError, ValueError):
        inside = False
    if not inside:
        raise n.error(f"must be a path inside the twin's folder, is {name!r:.60}", key)
    return path


def _collision(n: Node, folder: Path, key: str = "collision") -> tuple[Collision, ...]:
    pieces: list[Collision] = []
    for k, value in enumerate(n.list(key)):
        if isinstance(value, str):
            pieces.append(_mesh_file(n, f"{key}[{k}]", value, folder))
        else:
            pieces.append(_box(Node(n.file, f"{n.path}.{key}[{k}]", value)))
    return tuple(pieces)


def _box(n: Node) -> Box:
    pose: Array = geo.make_pose(n.array("rotation", (3, 3)), n.array("center", (3,)))
    with n.building():
        return Box(pose, n.array("size", (3,)))


def _completion(n: Node, folder: Path, seen: Mesh) -> Completion:
    def mesh(key: str) -> Mesh:
        """A mesh of the layer, with its place in the picture of the body's seen mesh."""
        found, uv = _mesh(n, key, folder), f"{key}_uv"
        if n.value.get(uv) is None or seen.texture is None:
            return found
        return with_coordinates(found, seen.texture, _inside(n, uv, n.text(uv), folder))

    interiors = tuple(Interior(i.text("name"), _box(i)) for i in n.children("interiors"))
    with n.building():
        layer = Completion(
            shown=mesh("shown"),
            pieces=tuple(_piece(p, folder) for p in n.children("pieces")),
            collision=_collision(n, folder),
            interiors=interiors,
            room=None if n.value.get("room") is None else mesh("room"),
            room_collision=_collision(n, folder, "room_collision"),
            version=n.integer("version"),
            kind=n.text("kind") if n.value.get("kind") else "",
            limits=None if n.value.get("limits") is None else _limits(n),
        )
    if n.value.get("pieces_image") is None or not layer.pieces:
        return layer
    image, uv = (_inside(n, key, n.text(key), folder) for key in ("pieces_image", "pieces_uv"))
    return with_textured_pieces(layer, read_texture(image, uv, sum(len(p.mesh.faces) for p in layer.pieces)))


def _limits(n: Node) -> tuple[float, float]:
    lower, upper = n.array("limits", (2,)).tolist()
    return lower, upper


def _piece(n: Node, folder: Path) -> Inferred:
    basis, color = n.text("basis"), n.array("color", (3,), whole=True)
    known = next((b for b in BASES if b == basis), None)
    if known is None:
        raise n.error(f"must be {' or '.join(BASES)}, is {basis!r:.60}", "basis")
    if np.any((color < 0) | (color > 255)):
        raise n.error(f"must hold 0 to 255, is {color.tolist()}", "color")
    with n.building():
        return Inferred(
            name=n.text("name"),
            role=n.text("role"),
            mesh=_mesh(n, "mesh", folder),
            basis=known,
            reason=n.text("reason"),
            shapes=_collision(n, folder),
            color=color.astype(np.uint8),
        )


def _cameras(n: Node, folder: Path) -> Trajectory:
    path = _inside(n, "file", n.text("file"), folder)
    try:
        rows = [r.split() for r in path.read_text(encoding="ascii").splitlines() if r and r[0] != "#"]
        values = np.array(rows, dtype=np.float64).reshape(-1, 8)
    except (OSError, ValueError) as e:
        raise InputError(
            f"{path} does not hold lines 't tx ty tz qx qy qz qw': {e}", "save the twin again"
        ) from e
    frames = n.array("frames", (None,), whole=True)
    if len(frames) != len(values):
        raise n.error(f"counts {len(frames)} frames but {path.name} has {len(values)} lines", "frames")
    turns = values[:, [7, 4, 5, 6]]
    if np.any(short := np.linalg.norm(turns, axis=1) < 1e-9):
        raise InputError(
            f"{path}: line {int(np.argmax(short)) + 1} holds no rotation, its quaternion is 0",
            "repair or drop the line",
        )
    poses = np.tile(np.eye(4), (len(values), 1, 1))
    poses[:, :3, :3] = geo.matrix_from_quat_wxyz(turns)
    poses[:, :3, 3] = values[:, 1:4]
    with n.building():
        return Trajectory(frames, values[:, 0], poses)
