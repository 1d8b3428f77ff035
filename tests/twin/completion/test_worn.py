"""Inferred pieces wear the photographs of what was seen on them, and of their like where nothing was; which
is marked."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest

import twin
from tests.makers.twin import scans
from tests.makers.twin.colours import seen_at
from tests.makers.twin.layers import layer, pieces
from twin import geometry as geo
from twin.atlas import face_cells
from twin.completion import with_completion
from twin.completion.asset import AssetView
from twin.completion.photographed import Face, filled, light_of, tile_of
from twin.completion.trimmed import trimmed
from twin.geometry import Array
from twin.scene import Box, Mesh, Texture, Twin
from twin.storage.completion import pieces_texture
from twin.storage.texture import same_texture

# Of 255: a texel of 1.5 mm beside that of the scan, on bands whose colour changes by 6 a millimetre at most.
NEAR = 16


def banded(points: Array) -> np.ndarray:
    """Colours (..., 3) of wood with level bands, 8 cm from one to the next."""
    shade = 1.0 + 0.4 * np.sin(2 * np.pi * points[..., 2:] / 0.08)
    return np.round(np.array(scans.WOOD) * shade).astype(np.uint8)


def photographed(mesh: Mesh) -> Mesh:
    """A scan with a photo texture that tells heights."""
    image, uv = face_cells(mesh.vertices[mesh.faces], banded, 16)
    return replace(mesh, texture=Texture(uv.astype(np.float32), image, np.ones(image.shape[:2], bool)))


def scan() -> Twin:
    made = scans.twin_of(scans.drawer())
    (part,) = made.parts
    static = replace(made.static, mesh=photographed(made.static.mesh))
    return replace(made, static=static, parts=(replace(part, mesh=photographed(part.mesh)),))


@pytest.fixture(scope="module")
def complete() -> Twin:
    return with_completion(scan())


def grid(low: tuple[float, float, float], high: tuple[float, float, float]) -> Array:
    axes = [np.linspace(a, b, 9) if b > a else np.array([a]) for a, b in zip(low, high, strict=True)]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)


def mask_at(mesh: Mesh, points: Array) -> np.ndarray:
    """Whether a photograph shows a mesh at points (n, 3)."""
    texture = mesh.texture
    assert texture is not None
    as_image = np.repeat(texture.seen[..., None].astype(np.uint8) * 255, 3, axis=2)
    shown = replace(mesh, texture=Texture(texture.uv, as_image, texture.seen))
    return np.asarray(seen_at(shown, points)[:, 0] > 128)


def test_boards_wear_the_photographs_of_what_was_seen_on_them(complete: Twin) -> None:
    front = pieces(complete.parts[0])["front"].mesh
    points = grid((-0.22, 0.0, 0.63), (-0.11, 0.0, 0.74))
    assert mask_at(front, points).all()
    assert np.abs(seen_at(front, points) - banded(points)).max() <= NEAR
    floor = pieces(complete.parts[0])["floor"].mesh
    points = grid((-0.15, 0.1, 0.63), (0.15, 0.4, 0.63))
    assert mask_at(floor, points).all()
    assert np.abs(seen_at(floor, points) - banded(points)).max() <= NEAR


def test_what_no_photograph_shows_wears_its_like_and_is_marked(complete: Twin) -> None:
    """A neighbour's outer side, which no camera saw, has the bands of its front; what lies behind the handle
    is filled."""
    found = pieces(complete)
    neighbour = next(p for p in found.values() if p.role == "neighbour")
    ends = neighbour.mesh.vertices[:, 0].max()
    hidden = grid((ends, 0.1, 0.2), (ends, 0.5, 0.7))
    assert not mask_at(neighbour.mesh, hidden).any()
    shown, front = seen_at(neighbour.mesh, hidden), banded(grid((0.5, 0.0, 0.2), (0.5, 0.0, 0.7)))
    assert np.abs(np.median(shown, axis=0) - np.median(front, axis=0)).max() < 25
    assert shown[:, 0].std() > 0.4 * front[:, 0].astype(float).std()
    assert "wears the picture" not in neighbour.reason
    unseen = next(p for p in found.values() if "wears the picture" in p.reason)
    assert unseen.mesh.texture is not None
    behind = grid((-0.05, 0.0, 0.683), (0.05, 0.0, 0.689))
    drawer = pieces(complete.parts[0])["front"].mesh
    assert not mask_at(drawer, behind).any()
    assert np.abs(np.median(seen_at(drawer, behind), axis=0) - scans.WOOD).max() < 60


def test_pieces_with_photographs_stand_before_the_scan_and_plain_ones_behind(complete: Twin) -> None:
    plain = pieces(with_completion(scans.twin_of(scans.drawer())).parts[0])["front"]
    worn = pieces(complete.parts[0])["front"]
    assert plain.mesh.texture is None
    assert 0.0005 < plain.mesh.vertices[:, 1].min() - worn.mesh.vertices[:, 1].min() < 0.0007
    assert [s.size.tolist() for s in plain.shapes if isinstance(s, Box)] == [
        s.size.tolist() for s in worn.shapes if isinstance(s, Box)
    ]


def test_an_assumed_face_that_nobody_saw_is_drawn_inside_its_board(complete: Twin) -> None:
    """No scan lies there that the face would have to hide."""
    inferred = complete.static.completion
    assert inferred is not None
    (back,) = (p for p in inferred.pieces if p.role == "back")
    assert back.basis == "assumed"
    (shape,) = back.shapes
    assert isinstance(shape, Box)
    local = geo.transform(geo.invert_pose(shape.T_world_box), back.mesh.vertices)
    assert np.all(np.abs(local).max(axis=0) < shape.size / 2)


def test_looks_come_back_from_the_disk(complete: Twin, tmp_path: Path) -> None:
    bare = scan()
    twin.save(bare, tmp_path / "bare")
    from twin.storage import update

    update(twin.load(tmp_path / "bare"), complete, tmp_path / "bare")
    twin.save(complete, tmp_path / "whole")
    for folder in ("bare", "whole"):
        back = twin.load(tmp_path / folder)
        for was, now in ((complete, back), (complete.parts[0], back.parts[0])):
            assert same_texture(pieces_texture(layer(was)), pieces_texture(layer(now)))


def test_every_format_has_the_pieces_pictures(complete: Twin, tmp_path: Path) -> None:
    files = twin.export(complete, tmp_path, view=AssetView("complete", "keep", "camera"))
    model = mujoco.MjModel.from_xml_path(str(files["mjcf"]))
    inferred = [g for g in range(model.ngeom) if "_inferred_" in str(model.geom(g).name)]
    assert len(inferred) > 8
    for g in inferred:
        t = int(model.mat_texid[model.geom_matid[g], int(mujoco.mjtTextureRole.mjTEXROLE_RGB)])
        assert t >= 0
        assert int(model.mesh_texcoordnum[model.geom_dataid[g]]) > 0
    front = next(g for g in inferred if str(model.geom(g).name).endswith("inferred_front"))
    t = int(model.mat_texid[model.geom_matid[front], int(mujoco.mjtTextureRole.mjTEXROLE_RGB)])
    size = int(model.tex_height[t]) * int(model.tex_width[t])
    assert size < 0.5 * pieces_texture(layer(complete.parts[0])).image[..., 0].size  # type: ignore[union-attr]
    assert (tmp_path / "urdf" / "meshes" / "part_2_inferred_front.png").is_file()
    assert list((tmp_path / "usd").rglob("part_2_inferred_front.png"))


def rectangle(x: tuple[float, float], z: tuple[float, float], y: float = 0.0) -> Mesh:
    """A rectangle that looks to -y."""
    corners = np.array([[x[0], y, z[0]], [x[1], y, z[0]], [x[1], y, z[1]], [x[0], y, z[1]]])
    return Mesh(corners, np.array([[0, 1, 2], [0, 2, 3]], np.int32))


def test_a_scan_that_hangs_over_the_gap_between_two_boards_is_cut_back() -> None:
    boards = [
        Box(geo.make_pose(translation=[x, 0.009, 0.0]), np.array([0.2, 0.018, 0.3])) for x in (-0.102, 0.102)
    ]
    eyes = np.array([[0.0, -1.0, 0.3]])
    own = [rectangle((-0.2, -0.002), (-0.1, 0.1)), rectangle((0.002, 0.2), (-0.1, 0.1))]
    bridge = rectangle((-0.002, 0.002), (-0.1, 0.1))
    aside = Mesh(
        own[0].vertices[:, [1, 0, 2]] - [0.4, 0.3, 0.0], own[0].faces[:, ::-1]
    )  # beside the boards, looks to -x
    ahead = rectangle((-0.6, -0.4), (-0.1, 0.1), -0.3)
    kept = trimmed(scans.joined([*own, bridge, aside, ahead]), boards, eyes)
    want = scans.joined([*own, ahead])
    assert kept.area == pytest.approx(want.area)
    middles = np.sort(kept.vertices[kept.faces].mean(axis=1), axis=0)
    assert np.allclose(middles, np.sort(want.vertices[want.faces].mean(axis=1), axis=0))


def test_a_face_of_which_a_part_was_seen_goes_on_in_its_light() -> None:
    """A ramp of light over bands: what fills a hole differs from what would be there by no more than the
    bands do."""
    x, y = np.meshgrid(np.arange(200), np.arange(120))
    true = np.repeat((90 + 0.4 * x + 12 * np.sin(y / 4))[..., None], 3, axis=2).astype(np.float32)
    seen = np.ones(x.shape, bool)
    seen[:, 120:160] = False
    face = Face(
        np.zeros(3),
        np.array([0.3, 0, 0]),
        np.array([0, 0, 0.18]),
        np.array([0, -1.0, 0]),
        true * seen[..., None],
        seen,
    )
    tile = tile_of(face)
    assert tile is not None
    assert tile.shape == (120, 120, 3)
    made = filled(face, tile, None, np.zeros(3)).astype(float)
    assert np.abs(made - true).max() < 2 * 12 + 16
    assert np.abs(made[:, :110] - true[:, :110]).max() <= 1
    assert np.abs(light_of(face)[:, 120:160].mean(axis=(0, 2)) - true[:, 120:160].mean(axis=(0, 2))).max() < 8
    assert filled(replace(face, seen=~np.ones_like(seen)), None, None, np.array([9.0, 8, 7])).tolist()[0][
        0
    ] == [9, 8, 7]
