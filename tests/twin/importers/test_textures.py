"""What a file looks like is what its twin looks like: pictures are carried, and what can't be is told by
name."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest
import trimesh

import twin
from benchmarks.scenes.boards import cabinet_twin
from tests.makers.twin.colours import (
    BLUE,
    BOARD,
    CORNERS,
    GREEN,
    RED,
    YELLOW,
    collada,
    hinged,
    meshed,
    quarters,
    seen_at,
    write_board,
    write_picture,
)  # fmt: skip
from twin.scene import Mesh, Texture, Twin
from twin.storage.texture import same_textures

NEAR = 3  # of 255: rounding of coordinates at 6 digits, never another colour of a picture
READ: dict[str, Callable[..., Twin]] = {"urdf": twin.from_urdf, "mjcf": twin.from_mjcf}


def told(read: Callable[[], Twin]) -> tuple[Twin, str]:
    """A twin and all that was told of it."""
    with warnings.catch_warnings(record=True) as found:
        warnings.simplefilter("always")
        made = read()
    return made, "\n".join(str(w.message) for w in found)


def require_board(mesh: Mesh, at: dict[tuple[float, float, float], tuple[int, int, int]] = CORNERS) -> None:
    assert np.abs(seen_at(mesh, list(at)) - np.array(list(at.values()))).max() <= NEAR


def photographed() -> Twin:
    """A cabinet whose scene and parts wear photographs: each face has a place of its own in a random
    picture."""
    made = cabinet_twin(nested=True)
    rng = np.random.default_rng(3)

    def worn(mesh: Mesh) -> Mesh:
        k, grid = np.arange(len(mesh.faces)), int(np.ceil(np.sqrt(len(mesh.faces))))
        low = np.stack([k % grid, k // grid], axis=1)[:, None] + 0.2
        uv = (low + np.array([[0.0, 0.0], [0.5, 0.0], [0.0, 0.5]])) / grid
        image = np.kron(rng.integers(0, 256, (grid, grid, 3)), np.ones((16, 16, 1))).astype(np.uint8)
        return replace(mesh, texture=Texture(uv.astype(np.float32), image, np.ones(image.shape[:2], bool)))

    parts = tuple(replace(p, mesh=worn(p.mesh)) for p in made.parts)
    return replace(made, static=replace(made.static, mesh=worn(made.static.mesh)), parts=parts)


def places(mesh: Mesh) -> np.ndarray:
    """A place (n, 3) in each face, not its middle, where no other face lies: boards that touch share
    places."""
    corners = mesh.vertices[mesh.faces]
    points = np.einsum("k,fkd->fd", [0.6, 0.25, 0.15], corners)
    a, b, c = (corners[:, k] - points[:, None] for k in range(3))
    parts = [np.linalg.norm(np.cross(x, y), axis=-1) for x, y in ((a, b), (b, c), (c, a))]
    whole = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    holds = sum(parts) < whole * (1 + 1e-4)  # the triangles over a point inside are as large as the face
    return points[holds.sum(axis=1) == 1]


@pytest.mark.parametrize("fmt", READ)
def test_our_own_export_keeps_its_photographs_when_imported(fmt: str, tmp_path: Path) -> None:
    made = photographed()
    back, _ = told(lambda: READ[fmt](twin.export(made, tmp_path, [fmt])[fmt]))
    for was, now in [(made.static, back.static), *((p, back.part(p.name)) for p in made.parts)]:
        assert now.mesh.texture is not None
        points = places(was.mesh)
        assert len(points) > 0.6 * len(was.mesh.faces)
        assert np.abs(seen_at(was.mesh, points) - seen_at(now.mesh, points)).max() <= NEAR
    again, _ = told(lambda: READ[fmt](twin.export(back, tmp_path / "again", [fmt])[fmt]))
    assert same_textures(again, back)


def test_a_twin_that_was_imported_is_stored_with_its_pictures(tmp_path: Path) -> None:
    write_picture(write_board(tmp_path).with_name("picture.png"))
    (tmp_path / "door.urdf").write_text(hinged(meshed("board.obj")))
    made = twin.from_urdf(tmp_path / "door.urdf")
    twin.save(made, tmp_path / "twin")
    assert same_textures(twin.load(tmp_path / "twin"), made)


def test_the_report_draws_the_pictures_of_what_was_imported(tmp_path: Path) -> None:
    """Not the colours of a board's five corners, which blend over it."""
    from twin.report.meshes import dollhouse

    write_picture(write_board(tmp_path).with_name("picture.png"))
    (tmp_path / "door.urdf").write_text(hinged(meshed("board.obj")).replace("revolute", "fixed"))
    drawn = dollhouse(twin.from_urdf(tmp_path / "door.urdf")).astype(float)
    hue = drawn / np.maximum(drawn.max(axis=2, keepdims=True), 1)
    for color in CORNERS.values():
        alike = np.abs(hue - np.array(color) / max(color)).max(axis=2) < 0.05
        assert alike.sum() > 500, color


MATERIALS = {
    "2d": 'texture="flat"',
    "2d repeated": 'texture="flat" texrepeat="2 3"',
    "2d uniform": 'texture="flat" texrepeat="3 4" texuniform="true" rgba="0.5 1 1 1"',
    "cube": 'texture="cube"',
    "cube uniform": 'texture="cube" texuniform="true"',
}
GEOMS = {
    "box": 'type="box" size=".3 .2 .4"',
    "ellipsoid": 'type="ellipsoid" size=".4 .3 .35"',
    "cylinder": 'type="cylinder" size=".3 .4"',
    "capsule": 'type="capsule" size=".2 .3"',
    "mesh": 'type="mesh" mesh="board"',
}
# Share of a geom's pixels in another colour, by edges alone: a pixel on each side of a line in the picture,
# and beyond the outline where facets of a round shape are ours.
EDGES = 0.08


def scene(geom: str, materials: dict[str, str]) -> str:
    """A row of geoms, each with a material of its own."""
    made = "".join(f'<material name="{name}" {m}/>' for name, m in materials.items())
    row = "".join(f'<geom {geom} material="{n}" pos="{k} 0 0"/>' for k, n in enumerate(materials))
    return (
        '<mujoco><visual><global offwidth="960"/></visual>'
        '<asset><texture name="flat" type="2d" file="picture.png"/>'
        '<texture name="cube" type="cube" file="strip.png" gridsize="6 1" gridlayout="RLUDFB"/>'
        f'<mesh name="board" file="board.obj"/>{made}</asset><worldbody>{row}</worldbody></mujoco>'
    )


def pictures(path: Path) -> np.ndarray:
    """A row of geoms from two sides, in its own colours."""
    model = mujoco.MjModel.from_xml_path(str(path))
    model.vis.headlight.ambient[:], model.vis.headlight.diffuse[:], model.vis.headlight.specular[:] = 1, 0, 0
    model.vis.global_.offwidth = 960
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    shots = []
    with mujoco.Renderer(model, 240, 960) as renderer:
        for azimuth, elevation in ((75, -30), (-75, 30)):
            camera = mujoco.MjvCamera()
            camera.lookat[:], camera.distance, camera.azimuth, camera.elevation = (
                (2, 0, 0),
                3.0,
                azimuth,
                elevation,
            )
            renderer.update_scene(data, camera)
            shots.append(renderer.render().copy())
    return np.stack(shots).astype(int)


@pytest.mark.parametrize("geom", GEOMS)
def test_textured_geoms_look_as_mujoco_draws_them(geom: str, tmp_path: Path) -> None:
    """Before import and after export, over all the ways that a material lays its picture."""
    write_picture(tmp_path / "picture.png")
    strip = np.concatenate([np.roll(quarters(), 11 * k, axis=2 if k % 2 else 0) for k in range(6)])
    write_picture(tmp_path / "strip.png", strip)
    (tmp_path / "board.obj").write_text(BOARD)
    # on a mesh with coordinates MuJoCo draws no cube map, see below
    worn = {n: m for n, m in MATERIALS.items() if geom != "mesh" or "cube" not in n}
    path = tmp_path / "row.xml"
    path.write_text(scene(GEOMS[geom], worn))
    made, said = told(lambda: twin.from_mjcf(path))
    assert not said
    was, now = pictures(path), pictures(twin.export(made, tmp_path / "out", ["mjcf"])["mjcf"])
    shown = (was.max(axis=-1) > 0).sum()
    assert shown > 20000
    assert (np.abs(was - now).max(axis=-1) > 40).sum() / shown < EDGES


def test_what_mujoco_gives_no_picture_is_told(tmp_path: Path) -> None:
    write_picture(tmp_path / "picture.png")
    write_picture(tmp_path / "strip.png", np.concatenate([quarters()] * 6))
    (tmp_path / "board.obj").write_text(BOARD)
    (tmp_path / "a.xml").write_text(scene('name="front" type="mesh" mesh="board"', {"m": 'texture="cube"'}))
    made, said = told(lambda: twin.from_mjcf(tmp_path / "a.xml"))
    assert made.static.mesh.texture is None
    assert "geom 'front': the cube map 'cube' on a mesh with texture coordinates is not carried" in said


@pytest.mark.parametrize("suffix", ["obj", "dae", "glb", "ply"])
def test_pictures_of_mesh_files_are_carried_the_right_way_up(suffix: str, tmp_path: Path) -> None:
    """From files of four kinds; PLY has colours of vertices, which stay colours."""
    from PIL import Image

    board = write_board(tmp_path)
    write_picture(tmp_path / "picture.png")
    loaded = trimesh.load_mesh(board, process=False)
    if suffix == "glb":  # its y points up
        loaded.apply_transform(trimesh.transformations.rotation_matrix(-np.pi / 2, [1, 0, 0]))
        material = trimesh.visual.material.PBRMaterial(
            baseColorTexture=Image.fromarray(quarters()), name="wood"
        )
        loaded.visual = trimesh.visual.TextureVisuals(uv=loaded.visual.uv, material=material)
    if suffix == "ply":
        loaded.visual = trimesh.visual.ColorVisuals(
            loaded, vertex_colors=[[*RED, 255]] * len(loaded.vertices)
        )
    if suffix == "dae":
        (tmp_path / "board.dae").write_text(collada("Z_UP"))
    elif suffix != "obj":
        loaded.export(tmp_path / f"board.{suffix}")
    solid = '<collision><geometry><box size="0.8 0.2 0.6"/></geometry></collision>'
    (tmp_path / "door.urdf").write_text(hinged(meshed(f"board.{suffix}"), collision=solid))
    made, said = told(lambda: twin.from_urdf(tmp_path / "door.urdf"))
    (door,) = made.parts
    assert not said
    if suffix == "ply":
        assert door.mesh.texture is None
        require_board(door.mesh, dict.fromkeys(CORNERS, RED))
    else:
        require_board(door.mesh)


def test_a_picture_in_a_folder_beside_the_meshes_is_found(tmp_path: Path) -> None:
    write_board(tmp_path / "meshes", "../images/picture.png")
    write_picture(tmp_path / "images" / "picture.png")
    (tmp_path / "door.urdf").write_text(hinged(meshed("meshes/board.obj")))
    made, said = told(lambda: twin.from_urdf(tmp_path / "door.urdf"))
    require_board(made.parts[0].mesh)
    assert not said


MATERIAL = '<material name="m"><texture filename="picture.png"/></material>'


@pytest.mark.parametrize("where", ["visual", "robot"])
def test_urdf_textures_are_carried_on_meshes_and_primitives(where: str, tmp_path: Path) -> None:
    write_picture(tmp_path / "picture.png")
    (tmp_path / "board.obj").write_text(BOARD)
    before, named = ("", MATERIAL) if where == "visual" else (MATERIAL, '<material name="m"/>')
    (tmp_path / "mesh.urdf").write_text(hinged(meshed("board.obj", named), before))
    require_board(twin.from_urdf(tmp_path / "mesh.urdf").parts[0].mesh)
    for shape, at in {
        '<box size="0.8 0.2 0.6"/>': {(x, -0.1, z): c for (x, _, z), c in CORNERS.items()},
        '<cylinder radius="0.3" length="0.6"/>': {
            (0.0, 0.3, 0.2): RED, (0.0, -0.3, 0.2): GREEN, (0.0, 0.3, -0.2): BLUE, (0.0, -0.3, -0.2): YELLOW,
        },
        '<sphere radius="0.3"/>': {
            (0.0, 0.2, 0.2): RED, (0.0, -0.2, 0.2): GREEN, (0.0, 0.2, -0.2): BLUE, (0.0, -0.2, -0.2): YELLOW,
        },
    }.items():  # fmt: skip
        visual = f"<visual><geometry>{shape}</geometry>{named}</visual>"
        (tmp_path / "shape.urdf").write_text(hinged(visual, before))
        require_board(twin.from_urdf(tmp_path / "shape.urdf").parts[0].mesh, at)


def test_what_of_a_look_cannot_be_carried_is_told_by_name(tmp_path: Path) -> None:
    visuals = {
        "board.obj names 'gone.png', which is not there": meshed("board.obj"),
        "has a picture, but no texture coordinates": meshed("bare.stl", MATERIAL),
        "which can't be read and is not carried": meshed("bare.stl", MATERIAL.replace("picture", "broken")),
        "is see-through and becomes opaque": meshed("bare.stl", '<material name="g"><color rgba="1 1 1 0.3"/></material>'),
        "the texture 'map_bump' is not carried": meshed("rough/board.obj"),
    }  # fmt: skip
    write_board(tmp_path, "gone.png")
    rough = write_board(tmp_path / "rough")
    write_picture(rough.with_name("picture.png"))
    write_picture(tmp_path / "picture.png")
    (tmp_path / "broken.png").write_bytes(b"no picture")
    with rough.with_suffix(".mtl").open("a") as file:
        file.write("map_Bump picture.png\n")
    trimesh.creation.box((0.8, 0.2, 0.6)).export(tmp_path / "bare.stl")
    for what, visual in visuals.items():
        (tmp_path / "door.urdf").write_text(hinged(visual))
        _, said = told(lambda: twin.from_urdf(tmp_path / "door.urdf"))
        assert f"door.urdf: visual 0 of link 'door': {what}" in said or what in said
        assert "visual 0 of link 'door'" in said


def test_geoms_that_are_see_through_are_told_in_one_line(tmp_path: Path) -> None:
    geoms = "".join(
        f'<geom name="pane_{k}" type="box" size=".1 .1 .1" pos="{k} 0 0" rgba="1 1 1 .3"/>' for k in range(3)
    )
    (tmp_path / "a.xml").write_text(f"<mujoco><worldbody>{geoms}</worldbody></mujoco>")
    _, said = told(lambda: twin.from_mjcf(tmp_path / "a.xml"))
    assert said == "a.xml: geom 'pane_0', geom 'pane_1', geom 'pane_2': is see-through and becomes opaque"


def test_a_picture_that_repeats_is_shrunk_where_it_must_be_and_that_is_told(tmp_path: Path) -> None:
    write_picture(tmp_path / "picture.png", quarters(512))
    (tmp_path / "board.obj").write_text(BOARD.replace("vt 1 0\nvt 1 1", "vt 16 0\nvt 16 1"))
    (tmp_path / "door.urdf").write_text(hinged(meshed("board.obj", MATERIAL)))
    door, said = told(lambda: twin.from_urdf(tmp_path / "door.urdf"))
    texture = door.parts[0].mesh.texture
    assert texture is not None
    assert texture.image.shape[1] == 4096
    assert "shrunk to 50 %" in said
