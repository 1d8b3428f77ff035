"""Which protrusion before a front is its handle: what the hand held, else a bar, else, since a contact may be
wrong, what is like a knob."""

from __future__ import annotations

import numpy as np
import pytest

from tests.makers.twin import scans
from twin import geometry as geo
from twin.completion.cloud import Cloud
from twin.completion.handle import find_handles
from twin.completion.leaf import Leaf
from twin.geometry import Array

T = geo.make_pose(np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]]))  # side x, up z, out -y
LEAF = Leaf(np.array([[0.0, 0.0], [0.6, 0.4]]), 0.018, "assumed", "test")
FACE = ((0.0, 0.0, 0.0), (0.6, 0.018, 0.4), "-y")
KNOB = ((0.285, -0.038, 0.185), (0.315, -0.014, 0.215), "-x +x -z +z -y")
BAR = ((0.2, -0.04, 0.3), (0.4, -0.025, 0.315), "-z +z -y")
LUMP = ((0.02, -0.016, 0.1), (0.055, -0.013, 0.135), "-x +x -z +z -y")
FAR = np.array([0.58, 0.03, 0.0])  # a contact that is nowhere near


def held(contact: Array | None, *pieces: scans.Piece) -> list[tuple[float, float]]:
    """Middles (side, up) of the handles that are found."""
    cloud = Cloud.of(scans.surface([FACE, *pieces]), T)
    found = find_handles(cloud, LEAF, 0.0005, contact)
    return [tuple(np.round((h.boards[0].low + h.boards[0].high)[:2] / 2, 2).tolist()) for h in found]


def test_a_knob_is_found_where_the_hand_was_and_where_a_wrong_contact_is_not() -> None:
    assert held(np.array([0.3, 0.2, 0.03]), KNOB) == held(FAR, KNOB) == [(0.3, 0.2)]


def test_without_a_hand_a_knob_may_be_anything() -> None:
    assert held(None, KNOB) == []


def test_what_a_hand_held_and_bars_come_before_other_knobs() -> None:
    assert held(FAR, KNOB, BAR) == [(0.3, 0.31)]
    assert held(np.array([0.3, 0.2, 0.03]), KNOB, BAR) == [(0.3, 0.2), (0.3, 0.31)]


@pytest.mark.parametrize(
    "piece",
    [
        LUMP,
        ((0.3, -0.038, 0.1), (0.38, -0.02, 0.18), "-x +x -z +z -y"),
        ((0.0, -0.038, 0.2), (0.03, -0.02, 0.23), "-x +x -z +z -y"),
    ],
    ids=["too flat", "too wide", "at the front's border"],
)
def test_other_lumps_are_no_knobs(piece: scans.Piece) -> None:
    assert held(FAR, piece) == []
