"""Completion of parts: the boards of a scanned drawer and door are those they were scanned from, and say what
they rest on."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from tests.makers.twin import scans
from tests.makers.twin.layers import NEAR, corners, layer, pieces
from twin import geometry as geo
from twin.completion.board import INSET
from twin.completion.carcass import BOARD
from twin.completion.handle import BAR, POST
from twin.completion.infer import infer
from twin.completion.leaf import FRONT_THICKNESS
from twin.completion.shown import up_to
from twin.completion.sweep import swept_points
from twin.completion.tray import FLOOR, WALL
from twin.mesh import edges
from twin.scene import Mesh, Part, Prismatic, Revolute, Twin


@pytest.fixture(scope="module")
def drawer() -> Twin:
    return infer(scans.twin_of(scans.drawer()))


@pytest.fixture(scope="module")
def door() -> Twin:
    return infer(scans.twin_of(scans.door()))


@pytest.mark.parametrize(
    ("name", "true"),
    [
        ("front", scans.FRONT),
        ("floor", scans.FLOOR),
        ("left_side", scans.LEFT),
        ("right_side", scans.RIGHT),
        ("back", scans.BACK),
        ("handle", scans.BAR),
    ],
)
def test_a_drawer_s_boards_are_those_that_it_was_scanned_from(
    drawer: Twin, name: str, true: tuple[scans.Corner, scans.Corner]
) -> None:
    piece = pieces(drawer.parts[0])[name]
    assert piece.basis == ("assumed" if name == "handle" else "evidence")
    off = np.abs(corners(piece) - np.array(true))
    assert off.max() < scans.STEP
    assert np.median(off) < NEAR


def test_a_door_has_its_back_and_edges(door: Twin) -> None:
    (panel,) = pieces(door.parts[0]).values()
    assert panel.basis == "evidence"
    assert np.abs(corners(panel) - [[-0.25, 0.0, 0.37], [0.25, 0.018, 0.77]]).max() < 0.006
    assert "18 mm" in panel.reason


def door_of(thickness: float, faces: str, *beside: scans.Piece) -> Part:
    """A scanned door of a stated thickness."""
    joint = Revolute(np.array([0.0, 0.0, -1.0]), 0.0, 1.4, pivot=np.array([-0.25, 0.009, 0.4]))
    board = ((-0.25, 0.0, 0.37), (0.25, thickness, 0.77), faces)
    return scans.part_of(scans.surface([board, *beside], 2), joint)


@pytest.mark.parametrize(
    ("thickness", "taken"), [(0.018, 0.018), (0.022, 0.020), (0.014, 0.016), (0.04, 0.04)]
)
def test_a_back_that_was_seen_tells_the_thickness_of_what_is_no_usual_board(
    thickness: float, taken: float
) -> None:
    """A fused board may be thicker or thinner by some millimetres: there the usual one counts as much."""
    (panel,) = pieces(infer(scans.twin_of(door_of(thickness, "-y +y"))).parts[0]).values()
    assert abs(np.ptp(corners(panel)[:, 1]) - taken) < 0.002
    assert "back seen" in panel.reason


@pytest.mark.parametrize(("rim", "assumed"), [(0.020, False), (0.045, True)])
def test_a_rim_deeper_than_boards_are_tells_nothing(rim: float, assumed: bool) -> None:
    (panel,) = pieces(infer(scans.twin_of(door_of(rim, "-y +x +z"))).parts[0]).values()
    assert ("thickness assumed" in panel.reason) is assumed
    assert abs(np.ptp(corners(panel)[:, 1]) - FRONT_THICKNESS) < (0.001 if assumed else 0.003)
    assert panel.basis == "evidence"


def test_what_lies_beside_a_door_and_behind_it_is_none_of_it() -> None:
    """A strip of the furniture around it, which labels took for it; before its face, as a handle that stands
    out beside, is its own."""
    below = ((-0.2, 0.016, 0.30), (0.2, 0.03, 0.37), "-y")
    before = ((0.23, -0.012, 0.5), (0.32, -0.002, 0.6), "-y")
    shown = layer(infer(scans.twin_of(door_of(0.018, "-y +y", below, before))).parts[0]).shown
    assert shown.vertices[:, 2].min() > 0.355
    assert shown.vertices[:, 0].max() > 0.3


def test_pieces_are_drawn_as_large_as_they_touch(drawer: Twin) -> None:
    """To a third of a millimetre a face, by which the seen surface lies before them."""
    for piece in pieces(drawer.parts[0]).values():
        (box,) = piece.shapes
        away = box.corners.max(axis=0) - box.corners.min(axis=0) - np.ptp(corners(piece), axis=0)
        assert np.abs(away - 2 * INSET).max() < 1e-9
        assert INSET < 5e-4


def test_the_cabinet_is_closed_by_what_was_seen_of_it(door: Twin) -> None:
    found = pieces(door)
    left, right = (corners(found[f"part_2_cabinet_{s}"]) for s in ("left", "right"))
    assert abs(left[1, 0] + 0.25) < NEAR
    assert abs(right[0, 0] - 0.25) < NEAR
    assert found["part_2_cabinet_left"].basis == "evidence"
    back = found["part_2_cabinet_back"]
    assert abs(corners(back)[1, 1] - 0.57) < 0.003  # the wall
    assert found["part_2_cabinet_bottom"].basis == "assumed"
    neighbour = corners(found["panel_1"])
    assert np.abs(neighbour[:, 0] - [0.272, 0.70]).max() < 0.012
    assert neighbour[1, 1] > 0.5
    assert found["panel_1"].basis == "assumed"
    (inside,) = layer(door).interiors
    assert np.all(inside.box.size > [0.4, 0.3, 0.3])


def test_every_piece_is_closed_and_faces_outwards(drawer: Twin, door: Twin) -> None:
    for thing in (drawer, drawer.parts[0], door, door.parts[0]):
        for piece in layer(thing).pieces:
            ends, count = np.unique(edges(piece.mesh.faces), axis=0, return_counts=True)
            assert set(count) == {2}, piece.name
            middle = piece.mesh.vertices.mean(axis=0)
            assert np.linalg.det(piece.mesh.vertices[piece.mesh.faces] - middle).sum() > 0
            assert len(ends) == 18


def test_parts_pass_what_is_inferred_of_the_furniture(drawer: Twin, door: Twin) -> None:
    for twin in (drawer, door):
        passed = swept_points(twin.parts[0], layer(twin.parts[0]))
        for piece in layer(twin).pieces:
            low, high = corners(piece)
            inside = np.all((passed > low + 0.006) & (passed < high - 0.006), axis=1)
            assert not inside.any(), piece.name


def test_the_seen_meshes_stay_and_what_is_shown_of_them_ends_with_the_boards(drawer: Twin) -> None:
    before, part = scans.drawer(), drawer.parts[0]
    assert np.array_equal(part.mesh.vertices, before.mesh.vertices)
    shown = layer(part).shown
    assert 0.5 * before.mesh.area < shown.area <= before.mesh.area * 1.02
    front = shown.vertices[np.abs(shown.vertices[:, 1]) < 3e-4]
    assert len(front) > 700  # the front is flat: the scan's noise is half a millimetre
    assert np.ptp(front[:, 1]) < 1e-4
    assert not np.any(shown.vertices[:, 1] < -0.01)  # the bar stands in for its blurred surface


def test_the_room_is_apart(drawer: Twin) -> None:
    room, shown = layer(drawer).room, layer(drawer).shown
    assert room is not None
    assert np.abs(room.vertices[:, 2]).min() < 0.01
    assert room.vertices[:, 0].max() > 1.9
    assert shown.vertices[:, 0].max() < 0.75
    assert len(room.faces) + len(shown.faces) <= len(drawer.static.mesh.faces)


@pytest.mark.parametrize("make", [scans.drawer, scans.door])
def test_the_frame_of_the_world_does_not_matter(make: Callable[[], Part]) -> None:
    twin = scans.twin_of(make())
    T = geo.make_pose(geo.exp_so3([0.0, 0.0, 0.7]), [1.5, -0.4, -0.9])
    here, there = infer(twin), infer(scans.moved(twin, 0.7, [1.5, -0.4, -0.9]))
    for a, b in ((here, there), (here.parts[0], there.parts[0])):
        one, other = pieces(a), pieces(b)
        assert {n: p.basis for n, p in one.items()} == {n: p.basis for n, p in other.items()}
        for name, piece in one.items():
            away = np.linalg.norm(geo.transform(T, piece.mesh.vertices) - other[name].mesh.vertices, axis=1)
            assert away.max() < 0.012, name


def test_what_nobody_saw_is_assumed_and_says_so() -> None:
    front_alone = scans.drawer(((*scans.FRONT, "-y"), (*scans.BLURRED, "-y +z")))
    found = pieces(infer(scans.twin_of(front_alone)).parts[0])
    for name in ("floor_rear", "left_side_rear", "right_side_rear", "back"):
        assert found[name].basis == "assumed"
    assert found["front"].basis == "assumed"  # nobody saw how thick it is
    assert "thickness assumed" in found["front"].reason


def test_a_thickness_that_nobody_measured_is_called_assumed(drawer: Twin, door: Twin) -> None:
    """Also of a board that what was seen bounds otherwise."""
    usual = [BOARD, WALL, FLOOR, BAR, POST, FRONT_THICKNESS]
    for piece in (p for t in (drawer, door) for k in (t, t.parts[0]) for p in layer(k).pieces):
        size = np.ptp(corners(piece), axis=0) + 2 * INSET
        as_usual = np.abs(np.min(size) - usual).min() < 1e-6
        assert not as_usual or piece.basis == "assumed" or "thickness assumed" in piece.reason, piece.name


def test_the_rim_of_a_side_is_no_floor() -> None:
    rim_alone = scans.drawer(((*scans.FRONT, "-y +z"), (*scans.RIGHT, "-x +z")))
    found = pieces(infer(scans.twin_of(rim_alone)).parts[0])
    assert found["floor"].basis == "assumed"
    assert corners(found["floor"])[1, 2] < 0.65  # not at the side's top, which is 72 cm high
    assert found["right_side"].basis == "evidence"


def test_a_side_seen_from_outside_tells_where_the_drawer_ends_below() -> None:
    outside = scans.drawer(((*scans.FRONT, "-y +z"), (*scans.RIGHT, "+x +z"), (*scans.LEFT, "+z")))
    found = pieces(infer(scans.twin_of(outside)).parts[0])
    assert "outer face seen" in found["right_side"].reason
    assert np.abs(corners(found["right_side"])[:, 0] - [0.208, 0.22]).max() < 0.004
    assert found["floor"].basis == "assumed"  # the rims of two sides are none
    assert abs(corners(found["floor"])[1, 2] - 0.64) < 0.012


def test_a_side_that_was_seen_tells_the_other_which_stays_assumed() -> None:
    one_side = tuple(k for k in scans.DRAWER if k[0] != scans.RIGHT[0])
    found = pieces(infer(scans.twin_of(scans.drawer(one_side))).parts[0])
    assert found["left_side"].basis == "evidence"
    assert found["right_side"].basis == "assumed"
    assert abs(corners(found["right_side"])[0, 0] - 0.208) < 0.006


def test_nothing_is_inferred_of_what_has_no_flat_front() -> None:
    angles = np.linspace(0, np.pi, 40)
    ring = np.stack([0.2 * np.cos(angles), -0.2 * np.sin(angles)], axis=1)
    points = np.concatenate([np.column_stack([ring, np.full(40, z)]) for z in np.linspace(0.3, 0.8, 50)])
    k = (np.arange(49)[:, None] * 40 + np.arange(39)).ravel()
    faces = np.concatenate([np.stack([k, k + 1, k + 41], 1), np.stack([k, k + 41, k + 40], 1)])
    part = scans.part_of(
        Mesh(points, faces.astype(np.int32)), Prismatic(np.array([0.0, -1.0, 0.0]), 0.0, 0.2)
    )
    twin = infer(scans.twin_of(part))
    assert layer(twin.parts[0]).pieces == ()
    assert layer(twin).pieces == ()
    assert len(layer(twin.parts[0]).shown.faces) == len(faces)


def test_the_cabinet_of_an_open_drawer_is_none_of_its_tray(drawer: Twin) -> None:
    """Labels took the cabinet's front edge, above the sides, and its bottom, behind them, for the drawer."""
    edge = ((-0.24, 0.25, 0.725), (0.24, 0.27, 0.76), "-y")
    bottom = ((-0.22, 0.50, 0.60), (0.22, 0.58, 0.61), "+z")
    surface = (*scans.DRAWER[:4], scans.DRAWER[5], edge, bottom)
    open_drawer = infer(scans.twin_of(scans.drawer(surface))).parts[0]
    found = pieces(open_drawer)
    true = pieces(drawer.parts[0])
    assert abs(corners(found["floor"])[1, 2] - corners(true["floor"])[1, 2]) < NEAR
    assert corners(found["floor"])[1, 1] > 0.42
    assert corners(found["back"])[0, 1] > 0.42
    assert found["back"].basis == "assumed"
    assert layer(open_drawer).shown.vertices[:, 1].max() < corners(found["back"])[1, 1] + 0.01


def test_a_drawer_ends_at_its_back() -> None:
    long = scans.surface([((-0.2, 0.0, 0.6), (0.2, 0.9, 0.61), "+z")])
    outwards = geo.make_pose(np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0.0]]))  # out is -y
    cut = up_to(long, -0.5, outwards)
    assert 0.48 < cut.vertices[:, 1].max() < 0.52
    assert np.array_equal(up_to(long, -2.0, outwards).vertices, long.vertices)


def test_a_surface_inside_a_board_says_that_there_is_none() -> None:
    """A shelf where the drawer's back would be assumed: what was seen wins."""
    full = infer(scans.twin_of(scans.drawer()))
    across = ((-0.2, 0.20, 0.64), (0.2, 0.21, 0.76), "-y +y")
    filled = infer(scans.twin_of(scans.drawer((*scans.DRAWER, across))))
    assert set(pieces(filled.parts[0])) <= set(pieces(full.parts[0]))
