"""Fronts beside those of the parts: apart where one saw in between, closed by the sides of the parts'
cabinets, and as deep as these."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.makers.twin import scans
from tests.makers.twin.layers import corners, pieces
from twin import geometry as geo
from twin.completion.board import Board
from twin.completion.cloud import SIDE, UP, Cloud
from twin.completion.grooves import split_at_grooves
from twin.completion.infer import infer
from twin.completion.opening import wall_behind
from twin.completion.part import front_of
from twin.completion.room import Bound
from twin.completion.sides import continued
from twin.completion.squared import Sight
from twin.scene import Mesh

T = geo.make_pose(np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]]))  # side x, up z, out -y
SLIT = (0.30, 0.324)
FRONT = Board("panel_1", "panel", np.array([0.0, 0.1, -0.012]), np.array([0.7, 0.8, 0.0]), "evidence", "seen")


def fronts(axis: int, *deeper: scans.Piece) -> Cloud:
    """Two fronts with a slit across an axis (0 x, 2 z) between them, and what was seen deeper."""
    low, mid, high = np.array([0.0, 0.0, 0.1]), np.array([0.7, 0.02, 0.8]), np.array([0.0, 0.0, 0.1])
    mid[axis], high[axis] = SLIT
    both = [(tuple(low), tuple(mid), "-y"), (tuple(high), (0.7, 0.02, 0.8), "-y")]
    return Cloud.of(scans.surface([*both, *deeper]), T)  # type: ignore[list-item]


@pytest.mark.parametrize("axis", [0, 2])
def test_fronts_are_apart_where_a_board_was_seen_between_them(axis: int) -> None:
    bottom = ((0.0, 0.02, 0.1), (0.7, 0.03, 0.8), "-y")
    found = split_at_grooves(FRONT, fronts(axis, bottom))
    across = SIDE if axis == 0 else UP
    assert [b.name for b in found] == ["panel_1", "panel_1_2"]
    assert abs(found[0].high[across] - SLIT[0]) < 2 * scans.BENT
    assert abs(found[1].low[across] - SLIT[1]) < 2 * scans.BENT
    assert np.array_equal(found[0].low, FRONT.low)
    assert np.array_equal(found[1].high, FRONT.high)


def test_fronts_apart_both_ways_have_names_of_their_own() -> None:
    low, high = (0.0, SLIT[0]), (SLIT[1], 0.7)
    four = [
        ((x[0], 0.0, 0.1 + z[0]), (x[1], 0.02, 0.1 + z[1]), "-y") for x in (low, high) for z in (low, high)
    ]
    bottom = ((0.0, 0.02, 0.1), (0.7, 0.03, 0.8), "-y")
    found = split_at_grooves(FRONT, Cloud.of(scans.surface([*four, bottom]), T))
    assert [b.name for b in found] == ["panel_1", "panel_1_2", "panel_1_3", "panel_1_4"]
    assert [np.round((b.high - b.low)[:2], 1).tolist() for b in found] == [
        [0.3, 0.3],
        [0.3, 0.4],
        [0.4, 0.3],
        [0.4, 0.4],
    ]


def test_what_was_not_seen_parts_no_front() -> None:
    assert split_at_grooves(FRONT, fronts(0)) == [FRONT], (
        "nothing was seen in the slit: something may have hidden the front"
    )
    short = ((0.0, 0.02, 0.1), (0.7, 0.03, 0.3), "-y")
    assert split_at_grooves(FRONT, fronts(0, short)) == [FRONT], "a groove runs along the whole front"
    narrow = replace(FRONT, low=np.array([0.25, 0.1, -0.012]))
    bottom = ((0.0, 0.02, 0.1), (0.7, 0.03, 0.8), "-y")
    assert split_at_grooves(narrow, fronts(0, bottom)) == [narrow], "what would be left beside it is no front"


def solid(name: str, low: scans.Corner, high: scans.Corner, role: str = "neighbour") -> Board:
    return Board(name, role, np.array(low), np.array(high), "assumed", "test: made")


def looking_at(*static: scans.Piece) -> Sight:
    mesh = scans.surface(static) if static else Mesh(np.eye(3) - 50.0, np.array([[0, 1, 2]], np.int32))
    return Sight(mesh, np.array([[-0.3, -2.0, 0.8]]))


def test_a_side_goes_on_beside_the_drawers_below_it() -> None:
    side = Board(
        "part_2_cabinet_left",
        "side",
        np.array([-0.02, 0.6, -0.5]),
        np.array([0.0, 0.8, -0.02]),
        "evidence",
        "cabinet left: seen",
    )
    middle, lowest = (
        solid("a", (0.012, 0.35, -0.5), (0.4, 0.595, 0.0)),
        solid("b", (0.01, 0.1, -0.5), (0.4, 0.34, 0.0)),
    )
    elsewhere = solid("c", (0.6, 0.1, -0.5), (0.9, 0.5, 0.0))
    boards = [middle, lowest, elsewhere]
    found = {b.name: b for b in continued([(side, -1)], boards, looking_at(), T)}
    below = found["part_2_cabinet_left_below"]
    assert np.allclose(below.low, [-0.02, 0.1, -0.5])
    assert np.allclose(below.high, [0.0, 0.6, -0.02])
    assert below.basis == "assumed"
    assert below.reason == "cabinet left: goes on beside what is below it"
    assert found["a"].low[SIDE] == found["b"].low[SIDE] == 0.0, "they reach it"
    assert found["c"] is elsewhere
    assert "part_2_cabinet_left_above" not in found

    behind = ((-2.0, 1.0, -1.0), (2.0, 1.1, 2.0), "-y")
    assert continued([(side, -1)], boards, looking_at(behind), T) == boards, (
        "a camera saw the wall where it would be"
    )
    sliver = solid("d", (-0.015, 0.15, -0.06), (-0.005, 0.5, -0.025), "panel")
    seen = {b.name for b in continued([(side, -1)], [*boards, sliver], looking_at(behind), T)}
    assert seen == {"a", "b", "c", "part_2_cabinet_left_below"}, "a piece of it was seen, and is part of it"
    beside = solid("e", (-0.4, 0.1, -0.5), (0.0, 0.5, 0.0))
    assert continued([(side, -1)], [*boards, beside], looking_at(), T) == [*boards, beside], (
        "another one stands there"
    )


def test_neighbours_are_as_deep_as_the_cabinet_s_back() -> None:
    found = pieces(infer(scans.twin_of(scans.drawer())))
    rear = corners(found["part_2_cabinet_back"])[1, 1]
    deep = [corners(p)[1, 1] for p in found.values() if p.role == "neighbour"]
    assert deep
    assert max(abs(d - rear) for d in deep) < 0.002


def test_furniture_stands_at_the_wall_behind_tiles() -> None:
    part = scans.drawer()
    front = front_of(part, np.array([0.0, -1.2, 1.4]))
    assert front is not None
    towards = np.array([0.0, -1.0, 0.0])
    wall, tiles, shelf = (Bound(towards, -y) for y in (0.57, 0.56, 0.40))
    at_wall = wall_behind(front, [wall])
    assert at_wall is not None
    assert wall_behind(front, [tiles, wall]) == at_wall
    assert wall_behind(front, [shelf, wall]) == pytest.approx(at_wall + 0.17), (
        "a nearer wall is one of its own"
    )
