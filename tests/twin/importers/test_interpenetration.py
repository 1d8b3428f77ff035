"""How much deeper surfaces are in each other than at rest, known by construction, for any kind of mesh."""

from __future__ import annotations

import numpy as np
import pytest

from twin import geometry as geo
from twin.importers.interpenetration import deeper
from twin.importers.shapes import box
from twin.importers.source import surface_of
from twin.mesh import joined
from twin.scene import Box, Mesh, Prismatic, Revolute

WIDTH, DEPTH, HEIGHT, BOARD, BACK = 0.6, 0.5, 0.3, 0.018, 0.003
IN = Prismatic([0, 1, 0])


def _board(low: tuple[float, ...], high: tuple[float, ...]) -> Mesh:
    a, b = np.array(low), np.array(high)
    return surface_of(Box(geo.make_pose(translation=(a + b) / 2), b - a))


def _carcass(sheet: bool = False) -> Mesh:
    """Four boards and a back, 3 mm thick or a single sheet; its opening lies in y = 0."""
    t, w, d, h = BOARD, WIDTH, DEPTH, HEIGHT
    boards = [
        _board((0, 0, 0), (t, d, h)),
        _board((w - t, 0, 0), (w, d, h)),
        _board((t, 0, 0), (w - t, d, t)),
        _board((t, 0, h - t), (w - t, d, h)),
    ]
    y = d - BACK
    corners = np.array([[t, y, t], [w - t, y, t], [w - t, y, h - t], [t, y, h - t]])
    flat = Mesh(corners, np.array([[0, 1, 2], [0, 2, 3]], np.int32))
    return joined([*boards, flat if sheet else _board((t, y, t), (w - t, d, h - t))])


def _drawer(gap: float, clear: float = 0.0, overlay: bool = False) -> Mesh:
    """A box drawer whose back stands `gap` before the carcass' back, `clear` beside its boards."""
    t = BOARD + clear
    x, top, y = WIDTH - t, HEIGHT - t, DEPTH - BACK - gap
    front = _board((0, -0.018, 0), (WIDTH, 0, HEIGHT)) if overlay else _board((t, 0, t), (x, 0.018, top))
    sides = [_board((a, 0, t), (a + 0.012, y, top - 0.05)) for a in (t, x - 0.012)]
    return joined(
        [front, *sides, _board((t, 0, t), (x, y, t + 0.012)), _board((t, y - 0.012, t), (x, y, 0.2))]
    )


@pytest.mark.parametrize("sheet", [False, True])
@pytest.mark.parametrize(("gap", "way"), [(0.002, 0.005), (0.008, 0.005), (0.008, 0.010), (0.0, 0.002)])
def test_a_drawer_is_as_deep_in_the_back_as_it_moves_beyond_its_gap(
    gap: float, way: float, sheet: bool
) -> None:
    got = deeper(_drawer(gap), _carcass(sheet), IN, way)
    assert got == pytest.approx(max(way - gap, 0.0), abs=1e-5)


@pytest.mark.parametrize("clear", [0.002, 0.0, -1e-5, -4e-4])
def test_boards_that_slide_along_each_other_are_not_deep(clear: float) -> None:
    """Flush, and overlapping by less than a millimetre as other people's models do."""
    assert deeper(_drawer(0.05, clear), _carcass(), IN, 0.01) < 1e-3


def test_a_front_that_lies_on_the_carcass_is_as_deep_as_it_is_pushed() -> None:
    assert deeper(_drawer(0.05, overlay=True), _carcass(), IN, 0.005) == pytest.approx(0.005, abs=1e-5)
    assert deeper(_drawer(0.05, overlay=True), _carcass(), IN, -0.005) == 0.0


def test_a_drawer_in_a_solid_block_goes_deeper_by_its_front() -> None:
    block = box((WIDTH, DEPTH, HEIGHT)).transformed(geo.make_pose(translation=[0.3, 0.25, 0.15]))
    assert deeper(_drawer(0.05, clear=0.01), block, IN, 0.005) == pytest.approx(0.005, abs=1e-5)


@pytest.mark.parametrize("ajar", [0.0, 0.1, 0.2])
@pytest.mark.parametrize("flipped", [False, True])
def test_a_door_closes_until_its_frame_and_not_beyond(ajar: float, flipped: bool) -> None:
    """One that lies on the carcass, and one inset, which swings through; inside-out meshes count alike."""
    outside, inset = _board((0, -0.018, 0), (0.6, 0, 0.3)), _board((0.018, 0, 0.018), (0.582, 0.018, 0.282))
    carcass = _carcass()
    if flipped:
        carcass = Mesh(carcass.vertices, carcass.faces[:, ::-1])
    for door, pivot in ((outside, (0.009, -0.009, 0.0)), (inset, (0.027, 0.009, 0.0))):
        hinge = Revolute(np.array([0, 0, -1.0]), pivot=np.array(pivot))
        part = door.transformed(hinge.pose(ajar))
        assert deeper(part, carcass, hinge, -ajar) < 1e-3
    hinge = Revolute(np.array([0, 0, -1.0]), pivot=np.array([0.009, -0.009, 0.0]))
    assert deeper(outside.transformed(hinge.pose(ajar)), carcass, hinge, -ajar - 0.02) > 5e-3


def test_nothing_is_deep_in_nothing() -> None:
    empty = joined([])
    assert deeper(_drawer(0.0), empty, IN, 0.01) == 0.0
    assert deeper(empty, _carcass(), IN, 0.01) == 0.0
    assert deeper(_drawer(0.0), _carcass(), IN, 0.0) == 0.0
