"""What hangs on the cabinets of the parts is furniture; what lies beside it, alone, is the room's."""

from __future__ import annotations

import numpy as np
import pytest

from tests.makers.twin import scans
from twin import geometry as geo
from twin.completion.asset import AssetView
from twin.completion.board import Board
from twin.completion.hanging import hanging, without_floaters
from twin.completion.infer import infer
from twin.geometry import Array
from twin.inferred import box_mesh
from twin.scene import Mesh

Corner = tuple[float, float, float]
CABINET = ((-0.25, 0.0, 0.0), (0.25, 0.5, 0.5))


def board(name: str, low: Corner, high: Corner) -> Board:
    return Board(name, "panel", np.array(low), np.array(high), "evidence", "seen")


def block(low: Corner, high: Corner) -> Mesh:
    size = np.subtract(high, low)
    return box_mesh(geo.make_pose(translation=np.add(low, high) / 2), size)


def test_a_board_hangs_on_a_board_that_hangs_on_the_cabinet_and_one_apart_is_loose() -> None:
    cabinet = board("cabinet", *CABINET)
    near = board("near", (0.28, 0.0, 0.0), (0.30, 0.5, 0.5))
    by_near = board("by_near", (0.33, 0.0, 0.0), (0.35, 0.5, 0.5))
    apart = board("apart", (0.80, 0.0, 0.0), (0.90, 0.5, 0.02))
    seen = scans.joined([block(tuple(b.low), tuple(b.high)) for b in (near, by_near, apart)])  # type: ignore[arg-type]
    found = hanging(
        seen.of(np.zeros(len(seen.faces), bool)), [by_near, apart, near], [cabinet], seen, np.eye(4)
    )
    assert [b.name for b in found.boards] == ["by_near", "near"]
    middles: Array = seen.vertices[seen.faces].mean(axis=1)
    assert np.array_equal(found.loose, middles[:, 0] > 0.7)


def test_drawn_surface_stays_with_what_it_reaches_and_its_triangles_are_told() -> None:
    cabinet = board("cabinet", *CABINET)
    on_top = block((0.0, 0.1, 0.51), (0.1, 0.2, 0.6))
    beside = block((0.5, 0.1, 0.0), (0.6, 0.2, 0.1))
    seen = scans.joined([on_top, beside])
    found = hanging(seen, [], [cabinet], seen, np.eye(4))
    assert found.shown.area == pytest.approx(on_top.area)
    assert np.array_equal(found.loose, np.arange(len(seen.faces)) >= len(on_top.faces))


def test_a_piece_of_a_part_that_touches_no_board_of_it_is_left_out() -> None:
    panel = board("panel", (0.0, 0.0, 0.0), (0.4, 0.4, 0.02))
    own, floats = block((0.1, 0.1, 0.02), (0.2, 0.2, 0.05)), block((0.1, 0.1, 0.06), (0.2, 0.2, 0.09))
    left = without_floaters(scans.joined([own, floats]), [panel], np.eye(4))
    assert left.area == pytest.approx(own.area)


def test_a_thing_beside_the_furniture_to_which_a_strip_of_scan_leads_is_the_rooms() -> None:
    """A scan's cells join what stands 3 cm apart; after the bridge is cut, the thing is alone."""
    thing = ((-0.60, 0.05, 0.62), (-0.42, 0.25, 0.70), "all")
    bridge = [((-0.31 - 0.04 * k, 0.10, 0.66), (-0.27 - 0.04 * k, 0.14, 0.66), "+z") for k in range(4)]
    sides = tuple((low, high, "all") for low, high, _ in scans.CABINET[:2])
    whole = infer(scans.twin_of(scans.drawer(), (*sides, *scans.CABINET[2:], *bridge, thing)))
    completion = whole.static.completion
    assert completion is not None
    assert completion.room is not None
    assert min(p.mesh.vertices[:, 0].min() for p in completion.pieces) > -0.30
    assert completion.shown.vertices[:, 0].min() > -0.40
    assert completion.room.vertices[:, 0].min() < -0.59
    # the seen layer without its room has lost the same triangles
    bare = AssetView("seen", "drop", "camera").of(whole).static.mesh
    assert bare.vertices[np.unique(bare.faces), 0].min() > -0.40
