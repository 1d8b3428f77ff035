"""Small files with pictures whose colours tell places, and the colour of a mesh at a place."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from twin.geometry import Array
from twin.scene import Mesh

RED, GREEN, BLUE, YELLOW = (220, 30, 30), (30, 200, 30), (30, 30, 220), (230, 220, 40)
U8 = NDArray[np.uint8]


def quarters(texels: int = 64) -> U8:
    """Red and green above, blue and yellow below: no turned or mirrored picture is the same."""
    half = texels // 2
    above = np.concatenate([np.full((half, half, 3), c, np.uint8) for c in (RED, GREEN)], axis=1)
    below = np.concatenate([np.full((half, half, 3), c, np.uint8) for c in (BLUE, YELLOW)], axis=1)
    return np.concatenate([above, below])


def write_picture(path: Path, image: U8 | None = None, opacity: int | None = None) -> Path:
    import cv2

    channels = (quarters() if image is None else image)[..., ::-1]
    if opacity is not None:
        channels = np.dstack([channels, np.full(channels.shape[:2], opacity, np.uint8)])
    path.parent.mkdir(parents=True, exist_ok=True)
    assert cv2.imwrite(str(path), np.ascontiguousarray(channels))
    return path


def seen_at(mesh: Mesh, points: object) -> Array:
    """Colours (n, 3) that a mesh shows nearest to points (n, 3): of its texture, else of its vertices."""
    import open3d as o3d

    scene = o3d.t.geometry.RaycastingScene()
    scene.add_triangles(mesh.vertices.astype(np.float32), mesh.faces.astype(np.uint32))
    found = scene.compute_closest_points(np.atleast_2d(np.asarray(points, np.float32)))
    face, uv = found["primitive_ids"].numpy(), found["primitive_uvs"].numpy()
    weights = np.stack([1 - uv.sum(axis=1), uv[:, 0], uv[:, 1]], axis=1)
    if mesh.texture is None:
        assert mesh.colors is not None
        return np.asarray(np.einsum("nk,nkc->nc", weights, mesh.colors[mesh.faces[face]].astype(float)))
    place = np.einsum("nk,nkc->nc", weights, mesh.texture.uv[face].astype(float))
    return mesh.texture.at(place).astype(float)


# A board 0.8 m wide (x) and 0.6 m high (z), its picture upright on the front, which faces -y.
BOARD = (
    "v -0.4 0 -0.3\nv 0.4 0 -0.3\nv 0.4 0 0.3\nv -0.4 0 0.3\nv 0 0.2 0\n"
    "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nvt 0.5 0.5\n"
    "f 1/1 2/2 3/3\nf 1/1 3/3 4/4\nf 2/2 1/1 5/5\nf 1/1 4/4 5/5\nf 4/4 3/3 5/5\nf 3/3 2/2 5/5\n"
)
# Places on the front of the board, and the colours there.
CORNERS = {(-0.3, 0.0, 0.2): RED, (0.3, 0.0, 0.2): GREEN, (-0.3, 0.0, -0.2): BLUE, (0.3, 0.0, -0.2): YELLOW}


def write_board(folder: Path, picture: str = "picture.png") -> Path:
    """The board as OBJ with a material that names a picture."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "board.mtl").write_text(f"newmtl wood\nKd 1 1 1\nmap_Kd {picture}\n")
    path = folder / "board.obj"
    path.write_text(f"mtllib board.mtl\nusemtl wood\n{BOARD}")
    return path


def collada(up: str, picture: str = "picture.png") -> str:
    """The front of the board as COLLADA, its numbers as in BOARD whatever is said to point up."""
    rows = [line.split()[1:] for line in BOARD.splitlines() if line.startswith("v ")][:4]
    points = " ".join(" ".join(row) for row in rows)
    source = (
        '<source id="{0}"><float_array id="{0}-a" count="{1}">{2}</float_array><technique_common>'
        '<accessor source="#{0}-a" count="4" stride="{3}">{4}</accessor></technique_common></source>'
    )
    axes = {3: "XYZ", 2: "ST"}
    sources = "".join(
        source.format(name, 4 * n, numbers, n, "".join(f'<param name="{a}" type="float"/>' for a in axes[n]))
        for name, n, numbers in (("place", 3, points), ("uv", 2, "0 0 1 0 1 1 0 1"))
    )
    return (
        '<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">'
        f'<asset><unit name="meter" meter="1"/><up_axis>{up}</up_axis></asset>'
        f'<library_images><image id="i"><init_from>{picture}</init_from></image></library_images>'
        '<library_effects><effect id="e"><profile_COMMON>'
        '<newparam sid="s"><surface type="2D"><init_from>i</init_from></surface></newparam>'
        '<newparam sid="t"><sampler2D><source>s</source></sampler2D></newparam>'
        '<technique sid="c"><lambert><diffuse><texture texture="t" texcoord="UV"/></diffuse></lambert></technique>'
        "</profile_COMMON></effect></library_effects>"
        '<library_materials><material id="m"><instance_effect url="#e"/></material></library_materials>'
        f'<library_geometries><geometry id="g"><mesh>{sources}'
        '<vertices id="v"><input semantic="POSITION" source="#place"/></vertices>'
        '<triangles count="2" material="wood"><input semantic="VERTEX" source="#v" offset="0"/>'
        '<input semantic="TEXCOORD" source="#uv" offset="1" set="0"/><p>0 0 1 1 2 2 0 0 2 2 3 3</p></triangles>'
        '</mesh></geometry></library_geometries><library_visual_scenes><visual_scene id="x"><node>'
        '<instance_geometry url="#g"><bind_material><technique_common>'
        '<instance_material symbol="wood" target="#m"/></technique_common></bind_material></instance_geometry>'
        '</node></visual_scene></library_visual_scenes><scene><instance_visual_scene url="#x"/></scene></COLLADA>'
    )


_MASS = (
    '<inertial><mass value="1"/><inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial>'
)


def hinged(visual: str, before: str = "", collision: str = "") -> str:
    """A URDF whose door is one visual (and collision), on a hinge; `before`: what stands before its links."""
    return (
        f'<robot name="r">{before}<link name="frame"><visual><geometry><box size="1 0.02 0.02"/></geometry></visual>'
        f'</link><link name="door">{visual}{collision}{_MASS}</link>'
        '<joint name="j" type="revolute"><parent link="frame"/><child link="door"/><axis xyz="0 0 1"/>'
        '<limit lower="0" upper="1.5" effort="1" velocity="1"/></joint></robot>'
    )


def meshed(file: str, more: str = "", scale: str = "1 1 1") -> str:
    """A URDF visual that is a mesh."""
    return f'<visual><geometry><mesh filename="{file}" scale="{scale}"/></geometry>{more}</visual>'
