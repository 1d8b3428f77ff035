"""Laws of triangle meshes: closed forms of area and volume, even samples, pieces, edges, what is left out."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from scipy.stats import chi2

from tests.laws import random_pose
from twin import geometry as geo
from twin.mesh import (
    compact,
    decimated,
    edges,
    joined,
    on_triangles,
    sample_surface,
    signed_volume,
    used_vertices,
    vertex_pieces,
)
from twin.scene import Mesh, Texture


def mesh_of(shape: trimesh.Trimesh) -> Mesh:
    return Mesh(np.asarray(shape.vertices), np.asarray(shape.faces, np.int32))


BOX = mesh_of(trimesh.creation.box(extents=(0.6, 0.4, 0.018)))
DISC = mesh_of(trimesh.creation.cylinder(radius=0.3, height=0.2, sections=64))


def disc_area() -> float:
    """Of the prism over a regular polygon of 64 corners: its two faces and its sides."""
    face = 32 * 0.3**2 * np.sin(2 * np.pi / 64)
    return float(2 * face + 64 * 2 * 0.3 * np.sin(np.pi / 64) * 0.2)


@pytest.mark.parametrize(
    ("mesh", "area"),
    [(BOX, 2 * (0.24 + 0.6 * 0.018 + 0.4 * 0.018)), (DISC, disc_area())],
    ids=["box", "disc"],
)
def test_areas_are_those_of_the_closed_form_in_any_place(mesh: Mesh, area: float) -> None:
    rng = np.random.default_rng(1)
    assert mesh.area == pytest.approx(area, rel=1e-12)
    for _ in range(5):
        assert geo.triangle_areas(
            mesh.transformed(random_pose(rng)).vertices[mesh.faces]
        ).sum() == pytest.approx(area)
    assert geo.triangle_areas(3.0 * mesh.vertices[mesh.faces]).sum() == pytest.approx(9.0 * area)


def test_normals_are_square_to_their_triangle_and_point_out_of_a_body() -> None:
    corners = DISC.vertices[DISC.faces]
    normals, area = geo.triangle_normals(corners)
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1.0)
    sides = corners - np.roll(corners, 1, axis=1)
    assert np.abs(np.einsum("fki,fi->fk", sides, normals)).max() < 1e-12
    assert (np.einsum("fi,fi->f", normals, corners.mean(axis=1)) > 0).all()
    np.testing.assert_allclose(normals * area[:, None], geo.vector_areas(corners), atol=1e-15)
    assert np.abs(geo.vector_areas(corners).sum(axis=0)).max() < 1e-12  # of a closed surface
    flat, none = geo.triangle_normals(np.zeros((2, 3, 3)))
    assert not flat.any()
    assert not none.any()


def test_vector_areas_turn_with_the_corners_order() -> None:
    corner = np.array([[[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]])
    np.testing.assert_array_equal(geo.vector_areas(corner), [[0, 0, 0.5]])
    np.testing.assert_array_equal(geo.vector_areas(corner[:, ::-1]), [[0, 0, -0.5]])


def test_samples_are_even_over_the_faces_and_within_a_face() -> None:
    rng, count = np.random.default_rng(5), 40_000
    mesh = joined([DISC, Mesh(BOX.vertices + [2.0, 0, 0], BOX.faces)])
    points, normals = sample_surface(mesh, count, rng)
    true, _ = geo.triangle_normals(mesh.vertices[mesh.faces])
    centre = mesh.vertices[mesh.faces].mean(axis=1)
    # which face a point is on is told by its normal and its place
    away = np.abs(np.einsum("nfi,fi->nf", points[:2000, None] - centre, true))
    alike = normals[:2000] @ true.T > 1 - 1e-9
    assert (np.where(alike, away, np.inf).min(axis=1) < 1e-12).all()
    upper = points[:, 0] > 1.0
    share = BOX.area / mesh.area
    assert upper.mean() == pytest.approx(share, abs=4 * np.sqrt(share * (1 - share) / count))
    face = points[upper & (normals[:, 2] > 0.9)] - [2.0, 0, 0]
    cells, _, _ = np.histogram2d(face[:, 0], face[:, 1], bins=(6, 4), range=[[-0.3, 0.3], [-0.2, 0.2]])
    statistic = ((cells - cells.mean()) ** 2 / cells.mean()).sum()
    assert chi2.ppf(0.001, 23) < statistic < chi2.ppf(0.999, 23)


def test_samples_are_those_of_their_seed() -> None:
    first = sample_surface(DISC, 100, np.random.default_rng(3))
    again = sample_surface(DISC, 100, np.random.default_rng(3))
    other = sample_surface(DISC, 100, np.random.default_rng(4))
    np.testing.assert_array_equal(first[0], again[0])
    assert not np.array_equal(first[0], other[0])
    none = sample_surface(Mesh(np.zeros((3, 3)), np.array([[0, 1, 2]])), 100, np.random.default_rng(0))
    assert none[0].shape == none[1].shape == (0, 3)


def test_the_unit_square_goes_onto_a_triangle_evenly() -> None:
    corner = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
    u, v = (g.ravel() for g in np.meshgrid((np.arange(300) + 0.5) / 300, (np.arange(300) + 0.5) / 300))
    points = on_triangles(np.broadcast_to(corner, (len(u), 3, 3)), u, v)
    assert points.min() >= 0
    assert points.sum(axis=1).max() <= 1 + 1e-12
    np.testing.assert_allclose(points.mean(axis=0), [1 / 3, 1 / 3, 0], atol=1e-4)
    np.testing.assert_allclose((points[:, 0] ** 2).mean(), 1 / 6, atol=1e-4)  # second moment of the triangle


def test_pieces_are_counted_by_shared_vertices() -> None:
    both = joined([BOX, DISC])
    label = vertex_pieces(both.faces, len(both.vertices) + 1)
    assert len(np.unique(label[: len(BOX.vertices)])) == 1
    assert len(np.unique(label[len(BOX.vertices) : -1])) == 1
    assert len(np.unique(label)) == 3  # the vertex that no face uses is alone
    assert len(vertex_pieces(np.zeros((0, 3), np.int32), 0)) == 0


def test_vertices_that_no_face_uses_go_and_the_shape_stays() -> None:
    faces = BOX.faces[[3, 7]]
    used, left = compact(faces)
    assert set(used) == set(faces.ravel())
    np.testing.assert_array_equal(BOX.vertices[used][left], BOX.vertices[faces])
    np.testing.assert_array_equal(used_vertices(Mesh(BOX.vertices, faces)), BOX.vertices[used])
    assert compact(np.zeros((0, 3), np.int32))[1].shape == (0, 3)


def test_every_edge_of_a_closed_surface_is_met_twice() -> None:
    ends, counts = np.unique(edges(DISC.faces), axis=0, return_counts=True)
    assert (counts == 2).all()
    assert (ends[:, 0] < ends[:, 1]).all()
    assert len(DISC.vertices) - len(ends) + len(DISC.faces) == 2  # Euler
    np.testing.assert_array_equal(np.sort(DISC.faces[5][[0, 1]]), edges(DISC.faces)[15])


def test_volume_is_that_of_the_closed_form_and_falls_with_the_winding() -> None:
    rng = np.random.default_rng(2)
    true = 0.6 * 0.4 * 0.018
    for _ in range(5):
        corners = BOX.transformed(random_pose(rng)).vertices[BOX.faces]
        assert signed_volume(corners) == pytest.approx(true, rel=1e-9)
        assert signed_volume(corners[:, ::-1]) == pytest.approx(-true, rel=1e-9)
    assert signed_volume(DISC.vertices[DISC.faces]) == pytest.approx(32 * 0.09 * np.sin(2 * np.pi / 64) * 0.2)


@pytest.mark.parametrize("precision", [np.float32, np.float64])
def test_fewer_faces_of_a_ball_still_lie_on_it(precision: type) -> None:
    ball = mesh_of(trimesh.creation.icosphere(subdivisions=4))
    vertices, faces = decimated(ball.vertices.astype(precision), ball.faces, 500)
    assert 400 < len(faces) <= 500
    assert vertices.dtype == np.float64
    assert np.abs(np.linalg.norm(vertices, axis=1) - 1.0).max() < 0.02
    assert Mesh(vertices, faces).area == pytest.approx(ball.area, rel=0.02)


def test_joined_meshes_keep_colours_and_a_picture_that_they_share() -> None:
    image = np.arange(48, dtype=np.uint8).reshape(4, 4, 3)
    picture = Texture(np.full((len(BOX.faces), 3, 2), 0.5, np.float32), image, np.ones((4, 4), bool))
    red = np.tile(np.array([200, 0, 0], np.uint8), (len(BOX.vertices), 1))
    colored = Mesh(BOX.vertices, BOX.faces, red, picture)
    empty = Mesh(np.zeros((0, 3)), np.zeros((0, 3), np.int32))
    both = joined([colored, empty, colored])
    assert both.texture is not None
    assert len(both.texture.uv) == len(both.faces) == 2 * len(BOX.faces)
    assert both.area == pytest.approx(2 * BOX.area)
    mixed = joined([colored, BOX])
    assert mixed.texture is None, "one of them has no place in the picture"
    assert mixed.colors is not None
    assert {tuple(c) for c in mixed.colors.tolist()} == {(200, 0, 0), (180, 180, 180)}
    assert joined([BOX, BOX]).colors is None
    assert len(joined([]).faces) == 0
