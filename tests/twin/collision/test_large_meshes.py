"""Scans of many faces are exported: on fewer triangles where that gives the same answer, with the visual mesh
as given."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from benchmarks.scenes.boards import boards_mesh, cabinet_twin, door_boards
from benchmarks.scenes.large_meshes import (
    KINDS,
    fan,
    fine_boards,
    fine_scene,
    millimetres,
    round_body,
    shreds,
    soup,
    t_junctions,
)
from twin import geometry as geo
from twin.collision import PART_FACES, CollisionConfig, make_part, static_shapes
from twin.collision.convex import hull_of
from twin.collision.decimation import decimated
from twin.collision.fit import fit_of
from twin.collision.pieces import pieces_of
from twin.collision.solid import Solid
from twin.collision.union import united
from twin.exporters import export
from twin.exporters.obj import corner_normals
from twin.geometry import Array
from twin.physics import read_materials, shell_inertial
from twin.scene import Box, Mesh, Twin


@pytest.mark.parametrize("height", [0.0001, 0.0005, 0.0014, 0.002])
def test_a_plane_within_fewer_than_three_bins_is_covered(height: float) -> None:
    """A strip too narrow for a board was looked for at heights where nothing lies: a division by zero."""
    corners = np.array([[0, 0, height], [1, 0, height], [1, 0.01, height], [0, 0.01, height]])
    (shape,) = make_part(Mesh(corners, np.array([[0, 1, 2], [0, 2, 3]])), CollisionConfig()).shapes
    points = shape.corners if isinstance(shape, Box) else shape.vertices
    np.testing.assert_allclose(np.sort(np.ptp(points, axis=0))[1:], [0.01, 1.0], atol=0.002)


@pytest.mark.parametrize("make", [fine_boards, soup])
def test_shapes_of_a_mesh_of_10k_faces_are_those_of_its_boards(make: Callable[[int], Mesh]) -> None:
    mesh = make(12_500)
    exact = boards_mesh(door_boards())
    assert len(mesh.faces) > 10_000
    fit = fit_of(make_part(mesh, CollisionConfig()).shapes, Solid.of_mesh(exact))
    assert fit.shapes <= 32
    assert fit.outside < 0.004
    assert fit.missed < 0.004


@pytest.mark.slow
@pytest.mark.parametrize("make", [fine_boards, soup])
def test_mass_of_a_mesh_of_50k_faces_is_that_of_its_boards(make: Callable[[int], Mesh]) -> None:
    mesh, exact = make(50_000), boards_mesh(door_boards())
    assert len(mesh.faces) > 40_000
    table = read_materials()
    material = table.material(table.default)
    got, want = shell_inertial(mesh, material).mass.value, shell_inertial(exact, material).mass.value
    assert got == pytest.approx(want, rel=0.1)


def test_the_union_of_a_large_mesh_is_that_of_its_bodies_with_fewer_faces() -> None:
    """Every fold of the noise was a cut between bodies: 75 s and more at 800,000 faces, twice in each
    export."""
    whole = united(fine_boards(50_000))
    assert whole is not None
    assert len(whole.mesh.faces) < 50_000
    assert whole.share < 0.001


def test_a_fine_ball_is_one_hull_of_few_faces() -> None:
    (shape,) = make_part(round_body(20_000), CollisionConfig()).shapes
    assert isinstance(shape, Mesh)
    assert len(shape.faces) <= PART_FACES
    hull = hull_of(shape.vertices)
    assert hull is not None
    assert hull.volume == pytest.approx(4 / 3 * np.pi * 0.15**3, rel=0.01)


@pytest.mark.parametrize("scale", [0.001, 10.0])
def test_decimation_keeps_bodies_whatever_their_size(scale: float) -> None:
    mesh = fine_boards(50_000)
    far = Mesh(scale * mesh.vertices + 100.0 * scale, mesh.faces)
    small = decimated(far, 6000)
    assert len(small.faces) <= 6100
    boards = sorted(pieces_of(small), key=lambda row: -row[0].area)[:4]
    assert all(closed for _, closed in boards)
    assert sum(m.area for m, _ in boards) == pytest.approx(small.area, rel=0.02)
    np.testing.assert_allclose(
        np.ptp(small.vertices, axis=0), np.ptp(far.vertices, axis=0), atol=0.004 * scale
    )


def test_a_part_of_a_millimetre_has_a_shape() -> None:
    mesh = boards_mesh(door_boards())
    tiny = Mesh(0.001 * mesh.vertices, mesh.faces[: len(mesh.faces) // 2])
    assert make_part(tiny, CollisionConfig()).shapes


@pytest.mark.parametrize("make", [t_junctions, shreds, fan])
def test_a_mesh_whose_edges_cannot_be_collapsed_becomes_small_all_the_same(
    make: Callable[[int], Mesh],
) -> None:
    """Edge collapse keeps borders, of which T-junctions are full, and left 12,000 of 54,000 faces (200,000 of
    500,000)."""
    mesh = make(20_000)
    small = decimated(mesh, 2000)
    assert len(small.faces) <= 2 * 2000
    got, want = (np.ptp(m.vertices[m.faces.ravel()], axis=0) for m in (small, mesh))
    np.testing.assert_allclose(got, want, atol=0.03)
    assert small.area > 0.85 * decimated(fine_boards(20_000), 2000).area if make is not fan else True


def test_a_door_cut_by_t_junctions_keeps_panel_and_handle() -> None:
    fit = fit_of(
        make_part(t_junctions(20_000), CollisionConfig()).shapes, Solid.of_mesh(boards_mesh(door_boards()))
    )
    assert fit.shapes <= 8
    assert fit.outside < 0.004
    assert fit.missed < 0.004


def test_a_part_in_millimetres_fills_no_memory() -> None:
    """A grid of 6 mm over 600 m took 24 GB."""
    front = millimetres(200).vertices[:, :3]
    low, high = front.min(axis=0), front.max(axis=0)
    corners = np.array(
        [[low[0], 0, low[2]], [high[0], 0, low[2]], [high[0], 0, high[2]], [low[0], 0, high[2]]]
    )
    assert make_part(Mesh(corners, np.array([[0, 1, 2], [0, 2, 3]])), CollisionConfig()).shapes


def test_a_fan_of_slivers_has_the_normals_of_its_planes() -> None:
    """Every face at a vertex was compared with every other: 10 billion pairs at 200,000 faces."""
    mesh = fan(20_000)
    normals, index = corner_normals(mesh.vertices, mesh.faces)
    first, second, third = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    facing = np.cross(second - first, third - first)
    facing /= np.linalg.norm(facing, axis=1)[:, None]
    flat = np.abs(facing[:, 2]) > 0.9
    np.testing.assert_allclose(
        normals[index[flat]], np.broadcast_to(facing[flat, None], (flat.sum(), 3, 3)), atol=1e-3
    )


@pytest.mark.slow
def test_a_fan_of_slivers_has_the_mass_of_one_of_few() -> None:
    table = read_materials()
    material = table.material(table.default)
    few, many = (shell_inertial(fan(n), material).mass.value for n in (400, 20_000))
    assert many == pytest.approx(few, rel=0.02)


@pytest.mark.parametrize("size", [(0.5, 0.4, 0.3), (2.0, 0.02, 1.0), (0.01, 0.01, 0.01)])
def test_a_single_box_as_static_scene_has_shapes(size: tuple[float, float, float]) -> None:
    """A plane was looked for where nothing lies: the mean over no face."""
    box = Box(np.eye(4), np.array(size))
    shapes = static_shapes(Mesh(box.corners, _hull(box.corners)), np.zeros((0, 3)), CollisionConfig())
    assert shapes
    points = np.concatenate([s.corners if isinstance(s, Box) else s.vertices for s in shapes])
    np.testing.assert_allclose(np.ptp(points, axis=0), size, atol=0.012)


def _hull(corners: Array) -> NDArray[np.int32]:
    hull = hull_of(corners)
    assert hull is not None
    near = np.linalg.norm(corners[None] - hull.vertices[:, None], axis=2).argmin(axis=1)
    return np.asarray(near[hull.faces], dtype=np.int32)


def test_equal_rows_are_found_as_numpy_finds_them() -> None:
    rng = np.random.default_rng(0)
    for rows in (rng.integers(-9, 9, (500, 3)), rng.integers(-(2**60), 2**60, (50, 2)).repeat(2, axis=0)):
        first, which = geo.unique_rows(rows)
        _, want, inverse = np.unique(rows, axis=0, return_index=True, return_inverse=True)
        np.testing.assert_array_equal(first, want)
        np.testing.assert_array_equal(which, inverse.ravel())
    assert [len(x) for x in geo.unique_rows(np.zeros((0, 3), int))] == [0, 0]


def _large(faces: int, which: str) -> Twin:
    twin = cabinet_twin()
    pose = twin.static.mesh.vertices.mean(axis=0)
    scene = fine_scene(faces) if which == "static" else twin.static.mesh
    if which == "static":
        scene = scene.transformed(geo.make_pose(translation=pose - scene.vertices.mean(axis=0)))
    parts = []
    for part in twin.parts:
        mesh = part.mesh
        if which == "part" and part.name == "door":
            mesh = fine_boards(faces)
            mesh = mesh.transformed(
                geo.make_pose(translation=part.mesh.vertices.mean(axis=0) - mesh.vertices.mean(axis=0))
            )
        parts.append(replace(part, mesh=mesh, collision=(), inertial=None, physics=None))
    return replace(twin, static=replace(twin.static, mesh=scene, collision=()), parts=tuple(parts))


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_a_mesh_of_200k_faces_of_any_kind_has_shapes(kind: str) -> None:
    mesh = KINDS[kind](200_000)
    started = time.process_time()
    assert make_part(mesh, CollisionConfig()).shapes
    assert static_shapes(mesh, np.zeros((0, 3)), CollisionConfig())
    assert time.process_time() - started < 60.0


@pytest.mark.slow
@pytest.mark.parametrize("which", ["part", "static"])
@pytest.mark.parametrize("faces", [200_000, 1_000_000])
def test_a_mesh_of_200k_and_a_million_faces_is_exported(faces: int, which: str, tmp_path: Path) -> None:
    twin = _large(faces, which)
    largest = max((twin.static.mesh, *(p.mesh for p in twin.parts)), key=lambda m: len(m.faces))
    assert len(largest.faces) > faces / 2
    files = export(twin, tmp_path)
    name = "door" if which == "part" else twin.static.name
    lines = next(files["mjcf"].parent.rglob(f"{name}_visual.obj")).read_text().splitlines()
    assert sum(x.startswith("f ") for x in lines) == len(largest.faces), "the visual mesh is as given"
    assert not [w for w in files.warnings if "has no collision shapes" in w]
