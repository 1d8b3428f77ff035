"""The .glb as trimesh sees it, which shares no code with its writer, and by the specification's words."""

from __future__ import annotations

import json
import struct
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

from benchmarks.scenes.boards import cabinet_twin
from tests.makers.twin import scans
from twin.cli.main import run
from twin.completion import with_completion
from twin.completion.asset import AssetView
from twin.exporters import export
from twin.exporters.asset import AssetInfo
from twin.exporters.glb import glb
from twin.exporters.glb_mesh import linear
from twin.exporters.tree import Tree, build_tree
from twin.geometry import Array, make_pose, transform
from twin.scene import Mesh, Motion, Texture, Twin
from twin.storage import save

# the twin's world, z up, in glTF's
T_GLTF_WORLD = np.array([[1.0, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]])
PLAIN = AssetView("seen", "keep", "camera")


def written(twin: Twin, folder: Path, view: AssetView | None = PLAIN) -> Path:
    return export(twin, folder, "glb", view=view)["glb"]


def document(path: Path) -> tuple[dict[str, Any], bytes]:
    """JSON and binary chunk, by chapter 4 of the specification."""
    data = path.read_bytes()
    magic, version, length = struct.unpack_from("<4sII", data)
    assert (magic, version, length) == (b"glTF", 2, len(data))
    size, kind = struct.unpack_from("<I4s", data, 12)
    assert kind == b"JSON"
    rest = 20 + size
    inside, kind = struct.unpack_from("<I4s", data, rest)
    assert kind == b"BIN\0"
    return json.loads(data[20:rest]), data[rest + 8 : rest + 8 + inside]


def values(told: dict[str, Any], binary: bytes, number: int) -> Array:
    a = told["accessors"][number]
    width = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}[a["type"]]
    assert a["componentType"] == 5126
    start = told["bufferViews"][a["bufferView"]]["byteOffset"]
    return np.frombuffer(binary, "<f4", a["count"] * width, start).reshape(-1, width).astype(np.float64)


def keys(path: Path, animation: str, link: str) -> tuple[str, Array, Array]:
    """Property, times (n,) and values (n, k) of a link's node in an animation."""
    told, binary = document(path)
    (found,) = [a for a in told["animations"] if a["name"] == animation]
    (channel,) = [c for c in found["channels"] if told["nodes"][c["target"]["node"]]["name"] == link]
    sampler = found["samplers"][channel["sampler"]]
    return (
        channel["target"]["path"],
        values(told, binary, sampler["input"])[:, 0],
        values(told, binary, sampler["output"]),
    )


def placed(tree: Tree, link: str, path: str, value: Array) -> Array:
    """T_world_link (4, 4) where the animation puts it; quaternions by trimesh."""
    (k,) = [x for x in tree.links if x.name == link]
    if path == "translation":
        return make_pose(translation=value)
    turn = trimesh.transformations.quaternion_matrix(np.roll(value, 1))
    return np.asarray(make_pose(translation=k.offset) @ turn)


@pytest.fixture(scope="module")
def cabinet() -> Twin:
    twin = cabinet_twin()
    states = {
        p.name: p.joint.lower + np.linspace(0, 1, 9) * (p.joint.upper - p.joint.lower) for p in twin.parts
    }
    moved = [
        replace(p, motion=Motion(np.arange(9), 3.0 + np.arange(9) / 4, states[p.name], ((0, 8),)))
        for p in twin.parts
    ]
    return replace(twin, parts=tuple(moved), cameras=None)


@pytest.fixture(scope="module")
def file(cabinet: Twin, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return written(cabinet, tmp_path_factory.mktemp("glb"))


def test_every_visual_stands_where_the_tree_has_it_y_up(cabinet: Twin, file: Path) -> None:
    scene = trimesh.load_scene(file)
    for link in build_tree(cabinet).links:
        T_world_link = np.eye(4)
        if link.joint is not None:
            T_world_link = make_pose(translation=link.offset)
        for v in link.visuals:
            T_gltf_node, name = scene.graph[v.name]
            shape = scene.geometry[name]
            expected = transform(T_GLTF_WORLD @ T_world_link, v.mesh.vertices)
            got = transform(T_gltf_node, np.asarray(shape.vertices))
            assert np.allclose(np.ptp(got, axis=0), np.ptp(expected, axis=0), atol=1e-5)
            assert np.allclose(got.min(axis=0), expected.min(axis=0), atol=1e-5)
            assert np.isclose(shape.area, v.mesh.area, rtol=1e-4)
            assert len(shape.faces) == len(v.mesh.faces)


def test_a_light_file_has_one_normal_a_vertex_and_the_same_faces(
    cabinet: Twin, file: Path, tmp_path: Path
) -> None:
    tree = build_tree(cabinet)
    path = tmp_path / "light.glb"
    path.write_bytes(glb(tree, AssetInfo(), light=True))
    light, whole = (dict(trimesh.load_scene(p, process=False).geometry.items()) for p in (path, file))
    for visual in (v for link in tree.links for v in link.visuals):
        few, many = light[visual.name], whole[visual.name]
        assert len(few.faces) == len(many.faces)
        assert np.allclose(few.triangles, many.triangles, atol=1e-6)
        assert len(few.vertices) < len(many.vertices), "a box has three normals at each corner"
        normals = np.asarray(few.vertex_normals)
        assert np.allclose(np.linalg.norm(normals, axis=1), 1.0, atol=1e-5)
        facing = np.einsum("fj,fkj->fk", few.face_normals, normals[few.faces])
        assert facing.min() > 0.0, "each corner's normal is on its face's side"


def test_the_opening_puts_each_part_where_its_joint_does(cabinet: Twin, file: Path) -> None:
    tree = build_tree(cabinet)
    for part in cabinet.parts:
        path, times, poses = keys(file, "open", part.name)
        assert path == {"revolute": "rotation", "prismatic": "translation"}[part.joint.kind]
        assert times[0] == 0
        assert np.all(np.diff(times) > 0)
        origin = next(k for k in tree.links if k.name == part.name).offset
        middle = len(times) // 2
        for k, state in ((0, part.joint.lower), (middle, part.joint.upper), (-1, part.joint.lower)):
            moved = placed(tree, part.name, path, poses[k]) @ make_pose(translation=-origin)
            want = transform(part.joint.pose(state), part.mesh.vertices)
            assert np.allclose(transform(moved, part.mesh.vertices), want, atol=1e-6)
        if path == "rotation":  # between keys a reader takes the shorter way around
            assert np.all(np.abs((poses[1:] * poses[:-1]).sum(axis=1)) > np.cos(0.5) - 1e-6)


def test_the_recorded_animation_is_the_motion(cabinet: Twin, file: Path) -> None:
    tree = build_tree(cabinet)
    for part in cabinet.parts:
        path, times, poses = keys(file, "recorded", part.name)
        assert np.allclose(times, part.motion.times - 3.0)
        origin = next(k for k in tree.links if k.name == part.name).offset
        for value, state in zip(poses, part.motion.state, strict=True):
            moved = placed(tree, part.name, path, value) @ make_pose(translation=-origin)
            assert np.allclose(moved, part.joint.pose(state), atol=1e-6)


def test_a_twin_that_never_moved_has_no_recorded_animation(tmp_path: Path) -> None:
    twin = cabinet_twin()
    still = Motion(np.arange(0), np.zeros(0), np.zeros(0))
    told, _ = document(
        written(replace(twin, parts=tuple(replace(p, motion=still) for p in twin.parts)), tmp_path)
    )
    assert [a["name"] for a in told["animations"]] == ["open"]


def test_joints_stand_in_the_extras_with_their_unit(cabinet: Twin, file: Path) -> None:
    told, _ = document(file)
    found = {n["name"]: n["extras"]["joint"] for n in told["nodes"] if "joint" in n.get("extras", {})}
    assert set(found) == {p.name for p in cabinet.parts}
    for part in cabinet.parts:
        joint = found[part.name]
        assert joint["type"] == part.joint.kind
        assert joint["unit"] == {"revolute": "rad", "prismatic": "m"}[part.joint.kind]
        assert np.allclose(joint["axis"], part.joint.axis)
        assert (joint["lower"], joint["upper"]) == (part.joint.lower, part.joint.upper)


def test_pieces_of_the_inferred_layer_say_what_they_rest_on(tmp_path: Path) -> None:
    twin = with_completion(scans.twin_of(scans.drawer()))
    told, _ = document(written(twin, tmp_path, AssetView("complete", "keep", "furniture")))
    found = {n["name"]: n["extras"]["basis"] for n in told["nodes"] if "basis" in n.get("extras", {})}
    known = {
        f"{o.name}_inferred_{p.name}": p.basis
        for o in twin.owners
        for p in (o.completion.pieces if o.completion else ())
    }
    assert known.items() <= found.items()
    assert {"evidence", "assumed"} <= set(known.values())
    assert (tmp_path / "glb" / "asset.json").is_file()


def test_photographs_lie_where_they_lay(tmp_path: Path) -> None:
    """Each quarter of a square shows its colour, by trimesh's own sampling of the file's picture."""
    image = np.zeros((64, 64, 3), np.uint8)
    colors = {(0, 0): (220, 30, 30), (0, 1): (30, 200, 40), (1, 0): (40, 60, 210), (1, 1): (230, 220, 40)}
    for (row, column), rgb in colors.items():  # row 0 at the top, where v is 1
        image[32 * row : 32 * row + 32, 32 * column : 32 * column + 32] = rgb
    corners = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], float)
    faces = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
    square = np.column_stack([corners[:, 0], np.zeros(4), corners[:, 1]])
    photo = Texture(corners[faces].astype(np.float32), image, np.ones((64, 64), np.bool_))
    twin = cabinet_twin()
    twin = replace(twin, static=replace(twin.static, mesh=Mesh(square, faces, None, photo)))
    scene = trimesh.load_scene(written(twin, tmp_path))
    shape = scene.geometry[scene.graph[f"{twin.static.name}_visual"][1]]
    for (row, column), rgb in colors.items():
        point = np.array([0.25 + 0.5 * column, 0.0, 0.75 - 0.5 * row])
        near = np.argsort(np.linalg.norm(shape.triangles_center - point, axis=1))
        inside = trimesh.triangles.points_to_barycentric(shape.triangles[near[:2]], np.tile(point, (2, 1)))
        k = int(np.flatnonzero(inside.min(axis=1) > -1e-6)[0])
        uv = inside[k] @ shape.visual.uv[shape.faces[near[k]]]
        seen = trimesh.visual.color.uv_to_color(uv[None], shape.visual.material.baseColorTexture)[0, :3]
        assert np.abs(seen.astype(int) - rgb).max() < 12, (row, column, seen)


def test_colours_are_linear(cabinet: Twin, tmp_path: Path) -> None:
    """18 % grey is 0.4613 in sRGB (IEC 61966-2-1), and both ends stay."""
    assert np.allclose(linear(np.array([0.0, 0.46135612950044164, 1.0])), [0, 0.18, 1], atol=1e-9)
    mesh = cabinet.static.mesh
    dark = Mesh(mesh.vertices, mesh.faces, np.full((len(mesh.vertices), 3), 100, np.uint8))
    told, binary = document(written(replace(cabinet, static=replace(cabinet.static, mesh=dark)), tmp_path))
    (shape,) = [m for m in told["meshes"] if m["name"] == f"{cabinet.static.name}_visual"]
    a = told["accessors"][shape["primitives"][0]["attributes"]["COLOR_0"]]
    assert a["normalized"]
    start = told["bufferViews"][a["bufferView"]]["byteOffset"]
    got = np.frombuffer(binary, "<u2", 4, start) / 65535
    assert np.allclose(got, [*[((100 / 255 + 0.055) / 1.055) ** 2.4] * 3, 1.0], atol=1e-5)


def test_the_same_twin_is_the_same_bytes(cabinet: Twin, file: Path, tmp_path: Path) -> None:
    assert written(cabinet, tmp_path).read_bytes() == file.read_bytes()


def test_the_command_line_writes_it_where_it_is_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    save(cabinet_twin(), tmp_path / "run" / "twin")
    assert run(["export", str(tmp_path / "run"), "--format", "glb"]) == 0
    assert "cabinet.glb" in capsys.readouterr().out.replace("\n", "")
    folder = tmp_path / "run" / "export"
    assert [p.name for p in folder.iterdir()] == ["glb"]
    told = (folder / "glb" / "README.md").read_text(encoding="utf-8")
    assert "door_joint" in told
    assert "nothing in it is simulated" in told
    assert run(["check", str(tmp_path / "run"), "--format", "urdf"]) == 1  # it was never written
    assert "twin export" in capsys.readouterr().err
