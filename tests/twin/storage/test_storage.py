"""A saved twin is the same twin; bytes repeat; bad files are named."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.scenes.boards import boards_mesh, cabinet_twin, door_boards
from twin.errors import InputError
from twin.files.ply import ply_bytes, read_ply
from twin.scene import JointSigma, Mesh, Motion, Part, Twin
from twin.storage import digest, load, save


def full_twin() -> Twin:
    """Every optional field filled, hulls as boxes and as meshes."""
    twin = cabinet_twin(nested=True, lid=True)
    door = twin.part("door")
    joint = replace(
        door.joint, sigma=JointSigma(0.0012, 0.003, 0.01), covariance=np.diag([1e-6, 2e-6, 3e-6, 4e-6])
    )
    hull = boards_mesh(door_boards()[:1], cut=0)
    assert door.inertial is not None
    box = door.inertial.com + np.array([[-0.01, -0.02, -0.03], [0.01, 0.02, 0.04]])
    inertial = replace(
        door.inertial, inertia_source="geometry: test", inertia_interval=(0.7, 1.4), com_interval=box
    )
    door = replace(
        door, joint=joint, inertial=inertial, collision=(*door.collision, Mesh(hull.vertices, hull.faces))
    )
    return replace(twin, parts=(door, *twin.parts[1:]))


def same_part(a: Part, b: Part) -> None:
    assert np.array_equal(a.mesh.vertices, b.mesh.vertices)
    assert np.array_equal(a.mesh.faces, b.mesh.faces)
    assert np.array_equal(a.mesh.colors, b.mesh.colors)
    assert type(a.joint) is type(b.joint)
    assert np.array_equal(a.joint.axis, b.joint.axis)
    assert np.array_equal(a.joint.pose(0.7), b.joint.pose(0.7))
    assert (a.joint.lower, a.joint.upper, a.parent, a.id) == (b.joint.lower, b.joint.upper, b.parent, b.id)
    assert np.array_equal(a.motion.state, b.motion.state)
    assert a.motion.intervals == b.motion.intervals
    assert np.array_equal(a.inertial.inertia, b.inertial.inertia)
    assert a.inertial.inertia_source == b.inertial.inertia_source
    assert a.inertial.inertia_interval == b.inertial.inertia_interval
    assert np.array_equal(a.inertial.com_interval, b.inertial.com_interval)
    assert (a.inertial.mass, a.physics) == (b.inertial.mass, b.physics)
    assert (a.limits_source, a.closed_source, a.type_source) == (
        b.limits_source,
        b.closed_source,
        b.type_source,
    )
    assert len(a.collision) == len(b.collision)
    assert (a.contact is None) == (b.contact is None)
    if a.contact:
        assert np.array_equal(a.contact.rotation, b.contact.rotation)
        assert (a.contact.width, a.contact.frames) == (b.contact.width, b.contact.frames)


def test_a_saved_twin_is_the_same_twin(tmp_path: Path) -> None:
    twin = full_twin()
    save(twin, tmp_path / "run" / "twin")
    for folder in (tmp_path / "run", tmp_path / "run" / "twin"):
        back = load(folder)
        assert (back.name, back.static.name, back.provenance) == (
            twin.name,
            twin.static.name,
            twin.provenance,
        )
        for a, b in zip(twin.parts, back.parts, strict=True):
            same_part(a, b)
        assert np.array_equal(back.cameras.frames, twin.cameras.frames)
        assert np.array_equal(back.cameras.times, twin.cameras.times)
        assert np.allclose(back.cameras.T_world_cam, twin.cameras.T_world_cam, atol=1e-12)
        assert sorted(back.labels) == [0, 30]
        assert np.array_equal(back.labels[30], twin.labels[30])
    assert digest(back) == digest(twin)
    door = back.part("door").joint
    assert np.array_equal(door.covariance, twin.part("door").joint.covariance)
    assert door.sigma.axis == pytest.approx(0.0012, rel=1e-11)


def test_a_twin_without_anything_optional_is_kept_too(tmp_path: Path) -> None:
    full = cabinet_twin()
    part = replace(
        full.parts[0], motion=Motion([], [], []), inertial=None, physics=None, contact=None, collision=()
    )  # fmt: skip
    static = replace(full.static, collision=())
    save(Twin("bare", static, (part,)), tmp_path / "t")
    back = load(tmp_path / "t")
    got = back.parts[0]
    assert (back.cameras, back.recorded, dict(back.provenance), dict(back.labels)) == (None, None, {}, {})
    assert (got.inertial, got.physics, got.contact, got.collision, got.motion.intervals) == (
        None,
        None,
        None,
        (),
        (),
    )
    assert len(got.motion.state) == 0


def test_equal_twins_give_equal_bytes_and_a_second_save_replaces_the_first(tmp_path: Path) -> None:
    for name in ("a", "b", "b"):
        save(full_twin(), tmp_path / name)
    files = sorted(p.relative_to(tmp_path / "a") for p in (tmp_path / "a").rglob("*") if p.is_file())
    assert len(files) >= 10
    for f in files:
        assert (tmp_path / "a" / f).read_bytes() == (tmp_path / "b" / f).read_bytes(), f
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a", "b"], "no temporary folder stays behind"
    assert str(tmp_path) not in (tmp_path / "a" / "twin.json").read_text()


def test_saving_a_loaded_twin_over_itself_keeps_it(tmp_path: Path) -> None:
    save(full_twin(), tmp_path / "t")
    first = (tmp_path / "t" / "twin.json").read_bytes()
    save(load(tmp_path / "t"), tmp_path / "t")
    assert (tmp_path / "t" / "twin.json").read_bytes() == first
    assert np.array_equal(load(tmp_path / "t").labels[30], full_twin().labels[30])


def test_a_folder_with_other_things_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("mine")
    with pytest.raises(InputError, match="does not hold a twin"):
        save(cabinet_twin(), tmp_path)
    assert (tmp_path / "notes.txt").read_text() == "mine"


@pytest.mark.parametrize(
    ("path", "value", "message"),
    [
        (("format",), "funtwin/9", "funtwin/1"),
        (("parts", 0, "joint", "axis"), [0, 0, 2.0], r"parts\[0\].*length 1"),
        (("parts", 0, "joint", "axis"), [0, 0], r"parts\[0\].joint.axis must have shape"),
        (("parts", 1, "joint", "type"), "screw", "'screw'"),
        (("parts", 0, "joint", "upper"), "wide", r"parts\[0\].joint.upper must be a number, is 'wide'"),
        (("parts", 0, "inertial", "mass"), -1.0, r"parts\[0\].inertial.mass must be positive, is -1.0 kg"),
        (("parts", 0, "inertial", "mass"), 0.0, r"parts\[0\].inertial.mass must be positive, is 0.0 kg"),
        (
            ("parts", 0, "inertial", "mass"),
            float("nan"),
            r"parts\[0\].inertial.mass must be a number within .*, is nan",
        ),
        (("parts", 0, "joint", "lower"), 9.0, r"parts\[0\].joint.*lower <= upper, got 9"),
        (("parts", 0, "parent"), 2, "its own ancestor"),
        (("parts", 0, "name"), "Tür 1", "not legal in URDF, MJCF and USD"),
        (("parts", 0, "mesh"), "../secret.ply", "inside the twin's folder"),
        (("parts", 0, "mesh"), "meshes/none.ply", "none.ply can't be read"),
        (("parts", 0, "id"), 1, "part id must be in"),
        (("parts", 0, "parent"), 77, "no part 77"),
        (("cameras", "frames"), [0, 1], "counts 2 frames"),
    ],
)
def test_errors_name_file_field_and_value(tmp_path: Path, path: tuple, value: object, message: str) -> None:
    save(cabinet_twin(), tmp_path / "t")
    file = tmp_path / "t" / "twin.json"
    document = json.loads(file.read_text())
    node = document
    for key in path[:-1]:
        node = node[key]
    node[path[-1]] = value
    file.write_text(json.dumps(document))
    with pytest.raises(InputError, match=message) as caught:
        load(tmp_path / "t")
    assert str(tmp_path) in str(caught.value)


def test_a_missing_field_and_a_missing_twin_are_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"holds no twin.json"):
        load(tmp_path)
    save(cabinet_twin(), tmp_path / "t")
    file = tmp_path / "t" / "twin.json"
    document = json.loads(file.read_text())
    del document["parts"][1]["joint"]["lower"]
    file.write_text(json.dumps(document))
    with pytest.raises(InputError, match=r"parts\[1\].joint.lower is missing"):
        load(tmp_path / "t")


def test_numbers_that_json_lacks_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="nan"):
        save(replace(cabinet_twin(), provenance={"config": {"x": float("nan")}}), tmp_path / "t")
    assert not any(tmp_path.iterdir())


def test_ply_reads_float_files_of_others_and_refuses_cut_ones(tmp_path: Path) -> None:
    import trimesh

    mesh = boards_mesh(door_boards())
    trimesh.Trimesh(mesh.vertices, mesh.faces, process=False).export(tmp_path / "float.ply")
    assert np.allclose(read_ply(tmp_path / "float.ply").vertices, mesh.vertices, atol=1e-6)
    (tmp_path / "cut.ply").write_bytes(ply_bytes(mesh)[:-5])
    with pytest.raises(InputError, match="cut short"):
        read_ply(tmp_path / "cut.ply")
    ours = tmp_path / "ours.ply"
    ours.write_bytes(ply_bytes(mesh))
    theirs = trimesh.load(ours, process=False)
    assert np.array_equal(theirs.vertices, mesh.vertices)
    assert np.array_equal(theirs.visual.vertex_colors[:, :3], mesh.colors)


def test_twins_saved_before_sources_began_with_a_word_are_read(tmp_path: Path) -> None:
    save(cabinet_twin(), tmp_path)
    document = json.loads((tmp_path / "twin.json").read_text())
    door = document["parts"][0]
    for key in ("inertia_source", "inertia_interval", "com_interval"):
        del door["inertial"][key]
    door["inertial"]["source"] = "surface area x thickness x density of furniture_board"
    door["physics"]["friction"]["source"] = "chosen by us"
    door["physics"]["damping"]["source"] = "a colleague"
    (tmp_path / "twin.json").write_text(json.dumps(document))
    part = load(tmp_path).part("door")
    assert part.inertial.mass.origin == "geometry"
    assert part.inertial.inertia_source == part.inertial.mass.source
    assert part.inertial.inertia_interval is None
    assert part.inertial.com_interval is None
    assert part.physics.friction.source == "default: chosen by us"
    assert part.physics.damping.source == "a colleague"
    assert part.physics.damping.origin == "other"


def test_cameras_that_were_read_keep_their_file_and_bytes(tmp_path: Path) -> None:
    """Quaternions that were read differ in sign or in the last digit; another pose is written."""
    twin = cabinet_twin()
    save(twin, tmp_path)
    before = (tmp_path / "cameras.txt").read_bytes()
    save(load(tmp_path), tmp_path)
    assert (tmp_path / "cameras.txt").read_bytes() == before
    assert twin.cameras is not None
    poses = twin.cameras.T_world_cam.copy()
    poses[3, 0, 3] += 1e-9
    save(replace(twin, cameras=replace(twin.cameras, T_world_cam=poses)), tmp_path)
    assert (tmp_path / "cameras.txt").read_bytes() != before
