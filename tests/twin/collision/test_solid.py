"""What a surface encloses: closed forms, overlap counted once, winding and openness."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.scenes.boards import Board, boards_mesh, world_from_cabinet
from twin import geometry as geo
from twin.collision.fit import fit_of
from twin.collision.pieces import pieces_of
from twin.collision.solid import Solid
from twin.geometry import Array
from twin.scene import Box, Mesh

T = world_from_cabinet()
CUBE = Board((0.0, 0.0, 0.0), (0.2, 0.2, 0.2))


def box(size: tuple[float, float, float], at: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Box:
    return Box(T @ geo.make_pose(translation=at), np.array(size))


def joined(*meshes: Mesh) -> Mesh:
    start = np.cumsum([0, *(len(m.vertices) for m in meshes)])
    faces = [m.faces + n for m, n in zip(meshes, start, strict=False)]
    return Mesh(np.concatenate([m.vertices for m in meshes]), np.concatenate(faces))


def inside_out(mesh: Mesh) -> Mesh:
    return Mesh(mesh.vertices, mesh.faces[:, ::-1].copy())


@pytest.mark.parametrize("size", [(0.5, 0.3, 0.006), (0.4, 0.4, 0.065), (0.02, 0.02, 0.3)])
def test_the_volume_of_a_box_is_exact_also_when_it_is_thinner_than_a_voxel(size: tuple) -> None:
    assert Solid.of_shapes([box(size)]).volume() == pytest.approx(np.prod(size), rel=0.005)


def test_overlap_counts_once_and_winding_not_at_all() -> None:
    a, b = Board((0, 0, 0), (0.2, 0.1, 0.1)), Board((0.15, 0, 0), (0.35, 0.1, 0.1))
    mesh = joined(boards_mesh([a], T), inside_out(boards_mesh([b], T)))
    solid = Solid.of_mesh(mesh)
    assert len(solid.closed) == 2
    assert solid.volume() == pytest.approx(0.35 * 0.1 * 0.1, rel=0.005)
    middle = geo.transform(T, np.array([[0.25, 0.05, 0.05], [0.25, 0.05, 0.16], [0.05, 0.03, 0.05]]))
    assert solid.signed_distance(middle) == pytest.approx([-0.05, 0.06, -0.03], abs=1e-5)
    surface = geo.transform(geo.invert_pose(T), solid.surface(4000))
    assert not np.any(
        (surface[:, 0] > 0.1501) & (surface[:, 0] < 0.1999) & (np.abs(surface[:, 1:] - 0.05) < 0.0499).all(1)
    ), "what lies within the union is none of its surface"


def test_faces_where_boards_touch_are_not_outside() -> None:
    solid = Solid.of_mesh(
        boards_mesh([Board((0, 0, 0), (0.1, 0.1, 0.1)), Board((0.1, 0, 0), (0.2, 0.1, 0.1))], T)
    )
    x = geo.transform(geo.invert_pose(T), solid.surface(4000))
    assert not np.any((np.abs(x[:, 0] - 0.1) < 1e-6) & (np.abs(x[:, 1:] - 0.05) < 0.049).all(1))
    assert solid.volume() == pytest.approx(0.002, rel=0.005)


def test_an_open_surface_encloses_nothing_but_counts_as_surface() -> None:
    whole = boards_mesh([CUBE], T)
    lidless = Mesh(whole.vertices, whole.faces[4:])
    assert [closed for _, closed in pieces_of(whole)] == [True]
    assert [closed for _, closed in pieces_of(lidless)] == [False]
    solid = Solid.of_mesh(lidless)
    assert solid.volume() == 0.0
    assert solid.signed_distance(geo.transform(T, np.full((1, 3), 0.1))) == pytest.approx([0.1], abs=1e-5)
    assert Solid.of_mesh(Mesh(np.zeros((0, 3)), np.zeros((0, 3), np.int32))).surface(10).shape == (0, 3)


def test_the_perfect_shape_fits_perfectly_wherever_the_scene_stands() -> None:
    for pose in (np.eye(4), T):
        mesh = boards_mesh([CUBE], pose)
        fit = fit_of([CUBE.box(pose)], Solid.of_mesh(mesh))
        assert fit.ratio == pytest.approx(1.0, abs=1e-6)
        assert max(fit.surface, fit.outside, fit.buried, fit.missed) < 1e-6


def grown(by: float) -> Array:
    return CUBE.size + 2 * by


def test_a_larger_shape_stands_out_and_a_smaller_one_is_buried() -> None:
    center = T @ geo.make_pose(translation=CUBE.center)
    solid = Solid.of_mesh(boards_mesh([CUBE], T))
    large, small = (fit_of([Box(center, grown(d))], solid) for d in (0.01, -0.01))
    assert large.ratio == pytest.approx((0.22 / 0.2) ** 3, rel=0.005)
    assert large.outside == pytest.approx(0.0125, abs=0.0025)
    assert large.buried == large.missed == 0.0
    assert (small.outside, small.buried) == (0.0, pytest.approx(0.01, abs=1e-4))
    assert small.missed == pytest.approx(0.0125, abs=0.0025)
    none = fit_of([], solid)
    assert (none.shapes, none.ratio, none.missed) == (0, 0.0, np.inf)


def test_behind_the_face_of_an_open_surface_nothing_stands_out() -> None:
    whole = boards_mesh([Board((0, 0, 0), (0.4, 0.018, 0.5))], T, cut=3)
    corners = whole.vertices[whole.faces]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) @ T[:3, 1]
    front = Mesh(whole.vertices, whole.faces[normal < -1e-9])
    behind, before = (
        fit_of([Board((0, a, 0), (0.4, b, 0.5)).box(T)], Solid.of_mesh(front))
        for a, b in ((0, 0.03), (-0.03, 0))
    )
    assert behind.outside < 0.001
    assert before.outside == pytest.approx(0.03, abs=1e-3)
    assert behind.ratio is None
    assert behind.buried is None
