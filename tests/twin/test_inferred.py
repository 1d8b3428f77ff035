"""The inferred layer stands apart from the seen one: its types refuse what they can't hold, and it comes back
from the disk as it was."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.scenes.boards import cabinet_twin
from twin import geometry as geo
from twin.errors import InputError, SceneError
from twin.inferred import Completion, Inferred, Interior, box_mesh
from twin.scene import Box, Mesh, Twin
from twin.storage import digest, load, save, update

POSE = geo.make_pose(geo.exp_so3([0.1, 0.2, 0.3]), [0.5, 0.1, 0.4])
SIZE = np.array([0.3, 0.2, 0.01])


def piece(name: str = "floor", basis: str = "evidence") -> Inferred:
    board = box_mesh(POSE, SIZE)
    shapes = (Box(POSE, SIZE), board)
    return Inferred(name, "floor", board, basis, "floor: seen from 5 cm on", shapes, np.array([1, 2, 3]))  # type: ignore[arg-type]


def completed() -> Twin:
    """A cabinet with an inferred layer on its scene and on its first part, hulls and boxes among the
    shapes."""
    twin = cabinet_twin(nested=True)
    static, part = twin.static, twin.parts[0]
    of_part = Completion(
        part.mesh,
        (piece(), piece("rear", "assumed")),
        (box_mesh(POSE, SIZE),),
        (Interior("inside", Box(POSE, SIZE)),),
    )
    of_static = Completion(
        static.mesh, (piece(),), room=static.mesh, room_collision=(Box(POSE, SIZE), box_mesh(POSE, SIZE))
    )
    parts = (replace(part, completion=of_part), *twin.parts[1:])
    return replace(twin, static=replace(static, completion=of_static), parts=parts)


def same(a: Completion, b: Completion) -> bool:
    def boxes(c: Completion) -> list[list[float]]:
        shapes = [*c.shapes, *c.room_collision, *(i.box for i in c.interiors)]
        return [(s.vertices if isinstance(s, Mesh) else s.corners).ravel().tolist() for s in shapes]

    told = [
        [(p.name, p.role, p.basis, p.reason, p.color.tolist(), p.mesh.vertices.tolist()) for p in c.pieces]
        for c in (a, b)
    ]
    rooms = [None if c.room is None else c.room.vertices.tolist() for c in (a, b)]
    names = [[i.name for i in c.interiors] for c in (a, b)]
    return told[0] == told[1] and rooms[0] == rooms[1] and names[0] == names[1] and boxes(a) == boxes(b)


def check_same(found: Twin, twin: Twin) -> None:
    for a, b in zip((found.static, *found.parts), (twin.static, *twin.parts), strict=True):
        assert (a.completion is None) == (b.completion is None)
        if a.completion is not None and b.completion is not None:
            assert same(a.completion, b.completion)


def test_the_layer_comes_back_from_the_disk(tmp_path: Path) -> None:
    twin = completed()
    save(twin, tmp_path / "twin")
    found = load(tmp_path / "twin")
    check_same(found, twin)
    assert not found.extra
    assert found.static.completion is not None
    save(found, tmp_path / "again")
    names = {p.relative_to(tmp_path / "twin") for p in (tmp_path / "twin").rglob("*") if p.is_file()}
    assert names == {
        p.relative_to(tmp_path / "again") for p in (tmp_path / "again").rglob("*") if p.is_file()
    }
    names = {n for n in names if n.name != "cameras.txt"}  # rotations are stored as quaternions
    assert all((tmp_path / "twin" / n).read_bytes() == (tmp_path / "again" / n).read_bytes() for n in names)


def test_it_is_added_to_a_twin_on_disk_and_makes_it_no_other_twin(tmp_path: Path) -> None:
    bare, twin = cabinet_twin(nested=True), completed()
    save(bare, tmp_path / "twin")
    seen = {p: p.read_bytes() for p in (tmp_path / "twin" / "meshes").iterdir()}
    update(bare, twin, tmp_path / "twin")
    check_same(load(tmp_path / "twin"), twin)
    assert all(p.read_bytes() == content for p, content in seen.items())
    assert digest(twin) == digest(bare)


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("basis", "guessed"),
        ("color", [1, 2, 300]),
        ("mesh", "../out.ply"),
        ("role", "two words"),
        ("reason", ""),
    ],
)
def test_what_the_file_says_wrong_is_named(tmp_path: Path, key: str, value: object) -> None:
    save(completed(), tmp_path / "twin")
    file = tmp_path / "twin" / "twin.json"
    document = json.loads(file.read_text())
    document["static"]["completion"]["pieces"][0][key] = value
    file.write_text(json.dumps(document))
    with pytest.raises(InputError, match=r"static\.completion\.pieces\[0\]"):
        load(tmp_path / "twin")


def test_pieces_say_what_they_rest_on() -> None:
    with pytest.raises(SceneError, match="evidence or assumed"):
        piece(basis="seen")
    with pytest.raises(SceneError, match="different names"):
        Completion(Mesh(np.zeros((0, 3)), np.zeros((0, 3))), (piece(), piece("FLOOR")))


def test_a_box_is_a_closed_mesh_that_faces_outwards() -> None:
    mesh = box_mesh(POSE, SIZE)
    corners = mesh.vertices[mesh.faces] - POSE[:3, 3]
    assert np.isclose(np.linalg.det(corners).sum() / 6, SIZE.prod())
    edges = mesh.faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    assert {tuple(e) for e in edges} == {tuple(e[::-1]) for e in edges}
    assert len({tuple(e) for e in edges}) == 36
