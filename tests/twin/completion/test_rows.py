"""A row of kitchen cabinets in closed form, of which a scan shows strips: worktop, plinth and the front that
the picture cuts off."""

from __future__ import annotations

import re

import numpy as np
import pytest

from tests.makers.twin import scans
from twin.completion.infer import infer
from twin.geometry import Array
from twin.inferred import Inferred
from twin.scene import Twin

SIDES = scans.CABINET[:2]
CUT, END = (
    0.52,
    0.72,
)  # m to the right that the picture shows of fronts and worktop, and that the plinth reaches
BELOW = ((-0.268, 0.0, 0.1), (0.268, 0.55, 0.59), "-y")
NEIGHBOUR = ((0.272, 0.0, 0.1), (CUT, 0.55, 0.79), "-y")
TOP = ((-0.268, -0.03, 0.80), (CUT, 0.57, 0.838))
EDGE = (*TOP, "-y")
BEHIND = 0.05  # m that the plinth stands back, so that its upper half is hidden
PLINTH = ((-0.268, BEHIND, 0.0), (END, 0.57, 0.05), "-y")
HIDDEN = (0.10, 0.22)  # m along the worktop: something stands there
BREAD_BIN = ((HIDDEN[0], TOP[0][1], TOP[1][2]), (HIDDEN[1], TOP[1][1], 1.0), "-x +x -y +z")
NEAR = 0.015


def strips(low: float = TOP[0][0], high: float = TOP[1][0]) -> tuple[scans.Piece, ...]:
    """The worktop's upper face left and right of what hides it."""
    (_, front, bottom), (_, rear, top) = TOP
    return (
        ((low, front, bottom), (HIDDEN[0], rear, top), "+z"),
        ((HIDDEN[1], front, bottom), (high, rear, top), "+z"),
    )


def room(right: float) -> tuple[scans.Piece, ...]:
    """Floor and wall, which were seen up to `right` m."""
    return (
        ((-2.0, -1.5, -0.02), (right, 0.57, 0.0), "+z"),
        ((-2.0, 0.57, 0.0), (right, 0.6, 2.0), "-y"),
    )


def row(*static: scans.Piece) -> dict[str, Inferred]:
    found: Twin = infer(scans.twin_of(scans.drawer(), static))
    assert found.static.completion is not None
    return {p.name: p for p in found.static.completion.pieces}


def corners(piece: Inferred) -> Array:
    return np.stack([piece.mesh.vertices.min(axis=0), piece.mesh.vertices.max(axis=0)])


def tops(pieces: dict[str, Inferred]) -> list[Inferred]:
    """Pieces whose upper face is the worktop's."""
    return [p for p in pieces.values() if abs(corners(p)[1, 2] - TOP[1][2]) < 0.005]


@pytest.fixture(scope="module")
def kitchen() -> dict[str, Inferred]:
    return row(*SIDES, BELOW, NEIGHBOUR, *strips(), BREAD_BIN, EDGE, PLINTH, *room(0.54))


def test_a_worktop_in_strips_is_one_board_as_thick_as_its_edge(kitchen: dict[str, Inferred]) -> None:
    whole = max(tops(kitchen), key=lambda p: float(np.ptp(corners(p)[:, 0])))
    assert np.allclose(corners(whole), TOP, atol=NEAR)
    assert abs(corners(whole)[0, 2] - 0.80) < 0.008
    assert whole.basis == "evidence"
    assert re.search(r"3\d mm thick by its front edge", whole.reason)


def test_a_worktop_right_above_a_front_is_the_top_of_its_cabinet() -> None:
    level = 0.772
    sides = [((*low[:2], 0.1), (*high[:2], level), names) for low, high, names in (*SIDES, NEIGHBOUR)]
    low = ((-0.268, -0.03, level), (CUT, 0.57, 0.800), "+z -y")
    pieces = row(*sides, low, *room(2.0))
    (above,) = (
        p for p in pieces.values() if corners(p)[1, 2] > 0.79 and p.role != "side" and p.role != "back"
    )
    assert abs(corners(above)[0, 2] - level) < NEAR
    assert "part_2_cabinet_top" not in pieces


def test_what_the_picture_cuts_off_ends_where_the_plinth_does(kitchen: dict[str, Inferred]) -> None:
    wide = [p for p in kitchen.values() if p.role == "neighbour"]
    assert abs(max(corners(p)[1, 0] for p in wide) - END) < NEAR
    assert any("as wide as its plinth" in p.reason and p.basis == "assumed" for p in wide)
    right = max(tops(kitchen), key=lambda p: float(corners(p)[1, 0]))
    assert (
        abs(corners(right)[1, 0] - END - 0.03) < 2 * NEAR
    )  # as far beyond as it stands out before the front
    assert right.basis == "assumed"


def test_a_plinth_reaches_up_to_what_it_carries(kitchen: dict[str, Inferred]) -> None:
    (plinth,) = (p for p in kitchen.values() if p.role == "plinth")
    assert abs(corners(plinth)[1, 2] - 0.1) < NEAR
    assert abs(corners(plinth)[0, 1] - BEHIND) < NEAR
    assert corners(plinth)[1, 1] > 0.4
    assert plinth.basis == "assumed"


def test_strips_with_something_deeper_seen_between_them_stay_apart() -> None:
    """Two worktops with a gap, through which a camera saw the floor."""
    pieces = row(*SIDES, NEIGHBOUR, *strips(), *room(2.0), ((0.0, -0.2, 0.5), (0.4, 0.57, 0.6), "+z"))
    for p in tops(pieces):
        left, right = corners(p)[:, 0]
        assert right < HIDDEN[0] + NEAR or left > HIDDEN[1] - NEAR


def test_nothing_grows_where_a_camera_saw_the_wall() -> None:
    pieces = row(*SIDES, BELOW, NEIGHBOUR, *strips(), BREAD_BIN, EDGE, PLINTH, *room(2.0))
    assert max(corners(p)[1, 0] for p in pieces.values() if p.role == "neighbour") < CUT + 0.02
    assert max(corners(p)[1, 0] for p in tops(pieces)) < CUT + 0.02
