"""Completion of furniture: carcasses and neighbours as large as was seen, colliders, frames and views of a
finished twin."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.makers.twin import scans
from tests.makers.twin.layers import NEAR, corners, layer, pieces
from twin.completion import with_completion
from twin.completion.asset import AS_SEEN, AssetView, asset_pose, usual_view
from twin.completion.board import Board, distinct
from twin.completion.infer import infer
from twin.completion.shapes import FURNITURE_SHAPES, with_shapes
from twin.completion.squared import Sight, squared
from twin.completion.sweep import held_points
from twin.errors import InputError
from twin.inferred import VERSION
from twin.scene import ContactPath, Mesh, Revolute, Twin


@pytest.fixture(scope="module")
def drawer() -> Twin:
    return infer(scans.twin_of(scans.drawer()))


@pytest.mark.parametrize("wall_seen", [False, True])
def test_a_neighbour_that_the_picture_cut_off_is_as_wide_as_what_is_below_it(wall_seen: bool) -> None:
    """Unless a camera saw the wall where it would stand."""
    sides = tuple(k for k in scans.CABINET if k[0] != (0.272, 0.0, 0.1))
    rows = (
        ((0.272, 0.0, 0.1), (0.90, 0.55, 0.45), "-y"),
        ((0.272, 0.0, 0.45), (0.70, 0.55, 0.8), "-y"),
    )
    wall = ((-2.0, 0.57, 0.0), (2.0 if wall_seen else 0.2, 0.6, 2.0), "-y")
    floor = ((-2.0, -1.5, -0.02), (0.2, 0.57, 0.0), "+z")
    found = infer(scans.twin_of(scans.drawer(), (*sides, *rows, wall, floor)))
    neighbours = {n: p for n, p in pieces(found).items() if p.role == "neighbour"}
    upper = max((p for p in neighbours.values() if corners(p)[1, 2] > 0.7), key=lambda p: corners(p)[1, 0])
    assert abs(corners(upper)[1, 0] - (0.70 if wall_seen else 0.90)) < 0.015
    assert ("as wide as" in upper.reason) is not wall_seen


def test_a_strip_that_would_hang_between_others_is_none_of_a_cabinet() -> None:
    """A neighbour from 0.1 to 0.8 m, beside which fronts stand below and above: what is free between them is
    not its."""

    def board(low: scans.Corner, high: scans.Corner, name: str) -> Board:
        return Board(name, "neighbour", np.array(low), np.array(high), "assumed", "front seen")

    tall = board((0.0, 0.1, -0.5), (0.4, 0.8, 0.0), "tall")
    lower = board((0.4, 0.1, -0.5), (0.8, 0.4, 0.0), "lower")
    upper = board((0.4, 0.6, -0.5), (0.8, 0.8, 0.0), "upper")
    wide = board((-0.5, 0.9, -0.5), (0.8, 1.0, 0.0), "wide")
    wall = scans.surface([((-9.0, -9.0, -0.6), (-8.9, -8.9, -0.6), "+z")])
    sight = Sight(wall, np.array([[0.0, 0.5, 2.0]]))
    between = squared([tall, lower, upper, wide], (), sight, np.eye(4))
    assert "tall_right" not in {b.name for b in between}
    beside = {b.name: b for b in squared([tall, lower, wide], (), sight, np.eye(4))}
    assert np.allclose(beside["tall_right"].high, [0.8, 0.8, 0.0])


@pytest.mark.parametrize("content", [False, True])
def test_a_board_over_which_the_front_hangs_is_where_it_was_seen(content: bool) -> None:
    """A door that ends 5 cm below its cabinet's bottom, which is seen from below; what is small and lies deep
    inside is no bottom."""
    below = ((-0.268, 0.022, 0.42), (0.268, 0.55, 0.438), "-z")
    box = ((-0.05, 0.30, 0.42), (0.05, 0.45, 0.5), "-z")
    static = (*scans.CABINET[:2], box if content else below, *scans.ROOM)
    found = pieces(infer(scans.twin_of(scans.door(), static)))["part_2_cabinet_bottom"]
    assert found.basis == ("assumed" if content else "evidence")
    assert abs(corners(found)[0, 2] - (0.361 if content else 0.42)) < 0.012


def test_a_cabinet_that_was_not_seen_up_to_the_wall_is_assumed_to_reach_it() -> None:
    """Its top ends there, or farther before; hung on the wall it may well end before it."""
    told = []
    for end in (0.57, 0.30):
        top = ((-0.268, 0.022, 0.782), (0.268, end, 0.80), "+z")
        found = pieces(infer(scans.twin_of(scans.drawer(), (*scans.CABINET[:2], top, *scans.ROOM))))
        told.append((found["part_2_cabinet_back"], found["part_2_cabinet_left"]))
    (seen, side), (unseen, other) = told
    assert (seen.basis, unseen.basis) == ("evidence", "assumed")
    assert abs(corners(seen)[1, 1] - 0.57) < 0.003
    assert "depth assumed" in other.reason
    assert "depth assumed" not in side.reason


def test_shapes_stand_clear_of_one_another_and_belong_to_their_pieces(drawer: Twin) -> None:
    twin = with_completion(scans.twin_of(scans.drawer()))
    part = pieces(twin.parts[0])
    assert all(len(p.shapes) == 1 for p in part.values())
    assert len(layer(twin.parts[0]).shapes) <= 24
    assert len(layer(twin).shapes) <= FURNITURE_SHAPES
    assert layer(twin).room_collision
    assert with_completion(twin) is twin
    older = replace(twin, static=replace(twin.static, completion=replace(layer(twin), version=0)))
    assert layer(with_completion(older)).version == VERSION  # another program's is inferred anew


def test_where_the_hand_held_the_closed_part_the_furniture_is_free() -> None:
    """A flap held by its upper edge, behind which the cabinet's top, that nobody saw, would be."""
    joint = Revolute(np.array([1.0, 0.0, 0.0]), 0.0, 1.2, pivot=np.array([0.0, 0.009, 0.37]))
    flap = scans.part_of(scans.surface([((-0.25, 0.0, 0.37), (0.25, 0.018, 0.77), "-y +y +z")], 2), joint)
    edge = np.array([0.0, 0.009, 0.765])
    grip = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]).T
    held = replace(flap, contact=ContactPath(edge, grip, 0.02, (10,), "stated: test"))
    sides = tuple(k for k in scans.CABINET[:2])
    tops = []
    for part in (flap, held):
        twin = infer(scans.twin_of(part, (*sides, *scans.ROOM)))
        tops.append(corners(pieces(twin)["part_2_cabinet_top"]))
        points = held_points(part)
        for piece in layer(twin).pieces:
            low, high = corners(piece)
            assert not np.any(np.all((points > low + NEAR) & (points < high - NEAR), axis=1)), piece.name
    assert tops[1][0, 1] - tops[0][0, 1] > 0.01  # it begins farther back
    assert not len(held_points(flap))


def test_slivers_of_clutter_that_gives_way_are_left_out_beyond_the_most_shapes() -> None:
    """Crumpled sheets all along a drawer's way fall to pieces; those that stay are nearly all of their
    volume."""
    rng = np.random.default_rng(4)
    sheets = []
    for k in range(9):
        x, y, z = -0.2 + 0.05 * k, -0.12, 0.585  # under and before the front
        grid = np.stack(
            np.meshgrid(np.linspace(-0.015, 0.015, 5), np.linspace(-0.11, 0.11, 9), indexing="ij"), -1
        )
        points = np.concatenate([grid.reshape(-1, 2), rng.normal(0, 0.03, (45, 1))], axis=1) + [x, y, z]
        i, j = (m.ravel() for m in np.meshgrid(np.arange(4), np.arange(8), indexing="ij"))
        a = i * 9 + j
        faces = np.concatenate([np.stack([a, a + 9, a + 10], 1), np.stack([a, a + 10, a + 1], 1)])
        sheets.append(Mesh(points, faces.astype(np.int32)))
    plain = scans.twin_of(scans.drawer())
    cluttered = scans.joined([plain.static.mesh, *sheets])
    twin = infer(replace(plain, static=replace(plain.static, mesh=cluttered)))
    assert len(layer(with_shapes(twin)).shapes) <= FURNITURE_SHAPES


def test_a_stated_twin_is_whole_as_it_is() -> None:
    twin = replace(scans.twin_of(scans.drawer()), verdict=None)
    assert with_completion(twin) is twin
    assert usual_view(twin) == AS_SEEN


def test_views_show_one_layer_or_both(drawer: Twin) -> None:
    seen = AS_SEEN.of(drawer)
    assert seen.static.completion is None
    assert seen.parts[0].mesh.vertices is drawer.parts[0].mesh.vertices
    bounded = AssetView("bounded", "drop", "camera").of(drawer)
    assert {p.basis for p in (*layer(bounded).pieces, *layer(bounded.parts[0]).pieces)} == {"evidence"}
    assert layer(bounded).room is None
    # in place of the handle that is assumed, the seen one: its triangles are those of the scan
    whole, left = layer(drawer.parts[0]).shown, layer(bounded.parts[0]).shown
    before = [
        t[t.mean(axis=1)[:, 1] < -0.012]
        for t in (m.vertices[m.faces] for m in (whole, left, drawer.parts[0].mesh))
    ]
    assert len(before[0]) == 0
    assert 0.9 < len(before[1]) / len(before[2]) <= 1
    furniture = AssetView("seen", "drop", "camera").of(drawer)
    assert 0 < len(furniture.static.mesh.faces) < len(drawer.static.mesh.faces)
    assert furniture.static.mesh.vertices[:, 0].max() < 0.75
    with pytest.raises(InputError, match="not known"):
        AssetView().but({"geometry": "all"})


def test_the_furniture_s_frame_stands_on_the_floor_under_the_front(drawer: Twin) -> None:
    twin = scans.moved(drawer, 0.7, [1.5, -0.4, -0.9])
    asset = AssetView(origin="furniture").of(twin)
    part = asset.parts[0]
    front = corners(pieces(part)["front"])
    assert np.allclose(part.joint.axis, [0.0, -1.0, 0.0], atol=0.01)
    assert abs(front[0, 1]) < 0.003
    assert abs(front[:, 0].mean()) < 0.02
    assert abs(corners(pieces(part)["floor"])[0, 2] - 0.62) < 0.006  # the floor is z = 0
    T = asset_pose(twin)
    again = asset_pose(asset)
    assert np.allclose(again, np.eye(4), atol=2e-3)
    assert np.allclose(T[2, :3], [0, 0, 1])


def test_boards_that_equal_one_before_them_are_left_out() -> None:
    """Both faces of a pole, made square, end as the same board."""
    pole = Board("panel_1", "panel", np.zeros(3), np.array([0.02, 0.02, 1.6]), "assumed", "a face")
    twice = replace(pole, name="panel_2", high=pole.high + 4e-4)
    beside = replace(pole, name="panel_3", low=pole.low + [0.02, 0, 0], high=pole.high + [0.02, 0, 0])
    assert [b.name for b in distinct([pole, twice, beside])] == ["panel_1", "panel_3"]
