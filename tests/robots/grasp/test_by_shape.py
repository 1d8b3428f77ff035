"""Where nobody held a part, its shape says where to: bars on sliding doors, thin handles on large doors, and
why nothing fits."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.scenes import furniture
from robots.grasp.by_shape import NothingToHold, holds_by_shape
from robots.grasp.where_to_hold import holds_of
from robots.model.catalog import resolve
from twin.geometry import Array
from twin.scene import Joint, Mesh, Prismatic, Revolute, Twin

HEIGHT = 0.9  # m, of the middle of a front above the floor
SIDEWAYS = Prismatic(np.array([1.0, 0, 0]), 0.0, 0.3)


@pytest.fixture(scope="module")
def franka():
    return resolve("franka")


def bar_on(
    width: float, height: float, thick: float, section: tuple[float, float], joint: Joint = SIDEWAYS
) -> Twin:
    """A front with an upright bar of 318 mm on two posts, 51 mm clear of it. section: m across and out."""
    across, out = section
    boxes = [
        furniture.box([0, thick / 2, HEIGHT], [width, thick, height]),
        furniture.box([-0.1, -0.051 - out / 2, HEIGHT], [across, out, 0.318]),
        *(furniture.box([-0.1, -0.0255, HEIGHT + s], [0.02, 0.051, 0.02]) for s in (-0.14, 0.14)),
    ]
    static = [furniture.floor(), *furniture.shell(2 * width, 0.35, height, [width / 2, 0.2 + thick, HEIGHT])]
    return furniture.twin_of(boxes, joint, static, None)


def bow(length: float, clear: float, wire: float) -> Mesh:
    """A wire (m) bent to a bow along z that stands `clear` m off the plane y = 0 towards -y, about the
    origin."""
    turn, ring = np.linspace(0, np.pi, 24), np.linspace(0, 2 * np.pi, 12, endpoint=False)
    middle = np.stack([np.zeros(24), -clear * np.sqrt(np.sin(turn)), length / 2 * np.cos(turn)], axis=1)
    way = np.gradient(middle, axis=0)
    up = np.cross(way, [1.0, 0, 0])
    up /= np.linalg.norm(up, axis=1, keepdims=True)
    circle = np.cos(ring)[:, None, None] * np.array([1.0, 0, 0]) + np.sin(ring)[:, None, None] * up
    vertices = (middle + wire / 2 * circle).transpose(1, 0, 2).reshape(-1, 3)
    first, other = np.arange(23 * 12), np.arange(23 * 12) // 12 * 12 + (np.arange(23 * 12) + 1) % 12
    faces = np.concatenate(
        [np.stack([first, other, first + 12], axis=1), np.stack([other, other + 12, first + 12], axis=1)]
    )
    return Mesh(vertices, faces.astype(np.int32))


def bow_on(width: float, height: float, handle: Mesh, joint: Joint) -> tuple[Twin, Array]:
    """A front of 20 mm with a handle near its right edge, and where that is."""
    front = [furniture.box([0, 0.01, HEIGHT], [width, 0.02, height])]
    place = np.array([width / 2 - 0.05, 0, HEIGHT])
    twin = furniture.twin_of(front, joint, [furniture.floor()], None)
    board = twin.parts[0].mesh
    mesh = Mesh(
        np.concatenate([board.vertices, handle.vertices + place]),
        np.concatenate([board.faces, handle.faces + len(board.vertices)]),
    )
    return replace(twin, parts=(replace(twin.parts[0], mesh=mesh),)), place


@pytest.mark.parametrize("section", [(0.044, 0.044), (0.020, 0.044), (0.044, 0.012)])
@pytest.mark.parametrize(("width", "thick"), [(0.3, 0.02), (0.45, 0.04), (0.3, 0.12)])
def test_the_bar_of_a_sliding_door_is_found_however_thick_the_door(franka, width, thick, section):
    """The door's edges and the bar's sides face the motion, as a drawer's front does."""
    twin = bar_on(width, 0.4, thick, section)
    hold = holds_by_shape(twin, twin.parts[0], franka, 0)[0]
    assert hold.kind == "bar"
    assert hold.thickness == pytest.approx(section[0], abs=0.003)
    assert np.linalg.norm(hold.centre - [-0.1, -0.051 - section[1] / 2, HEIGHT]) < 0.02
    assert hold.rotation[:, 2] @ [0, -1, 0] > 0.99, "the hand comes from the front"


def test_a_users_point_on_the_bar_of_a_thick_sliding_door_takes_the_bar(franka):
    twin = bar_on(0.3, 0.4, 0.12, (0.044, 0.044))
    hold = holds_of(twin, twin.parts[0], franka, np.array([-0.1, -0.095, HEIGHT]), 0)[0]
    assert hold.kind == "bar"
    assert hold.rotation[:, 2] @ [0, -1, 0] > 0.99


@pytest.mark.parametrize(("length", "clear", "wire"), [(0.096, 0.025, 0.005), (0.128, 0.03, 0.008)])
@pytest.mark.parametrize("size", [(0.4, 0.6), (1.0, 2.0)])
@pytest.mark.parametrize("hinged", [True, False])
def test_a_thin_bow_is_found_on_a_large_front_as_on_a_small_one(franka, length, clear, wire, size, hinged):
    hinge = Revolute(np.array([0, 0, -1.0]), 0.0, 1.4, pivot=np.array([-size[0] / 2, 0.01, HEIGHT]))
    twin, place = bow_on(
        *size, bow(length, clear, wire), hinge if hinged else Prismatic(np.array([0, -1.0, 0]), 0.0, 0.3)
    )
    hold = holds_by_shape(twin, twin.parts[0], franka, 0)[0]
    assert hold.kind == "bar"
    assert hold.thickness == pytest.approx(wire, abs=0.001)
    assert np.linalg.norm(hold.centre - place - [0, -clear, 0]) < 0.01


def test_the_divider_of_a_drawer_without_handle_is_no_bar(franka):
    """It stands off the drawer's floor as a bar does, but under the cabinet's top, where no hand fits."""
    boxes = [
        furniture.box([0, 0.0, 0.25], [0.48, 0.018, 0.16]),
        furniture.box([0, 0.2, 0.17], [0.44, 0.38, 0.01]),
        furniture.box([0, 0.2, 0.215], [0.012, 0.30, 0.08]),
    ]
    drawer = Prismatic(np.array([0, -1.0, 0]), 0.0, 0.3)
    shell = furniture.shell(0.5, 0.5, 0.2, [0, 0.27, 0.25])
    shut = furniture.twin_of(boxes, drawer, [furniture.floor(), *shell], None)
    holds = holds_by_shape(shut, shut.parts[0], franka, 0)
    assert holds[0].kind == "edge"
    assert all(abs(h.centre[1]) < 0.03 for h in holds), "at the front"
    open_above = furniture.twin_of(boxes, drawer, [furniture.floor()], None)
    assert abs(holds_by_shape(open_above, open_above.parts[0], franka, 0)[0].centre[1] - 0.2) < 0.1


@pytest.mark.parametrize(
    ("section", "thick", "told"),
    [
        ((0.095, 0.03), 0.12, "a bar 9[0-9] mm thick, where 76 mm fit"),
        ((0.03, 0.09), 0.12, "more than 130 mm off"),
    ],
)
def test_why_nothing_can_be_held_names_the_sizes_that_failed(franka, section, thick, told):
    twin = bar_on(0.4, 0.4, thick, section)
    with pytest.raises(NothingToHold, match=f"no bar, knob or rim .*{told}") as caught:
        holds_by_shape(twin, twin.parts[0], franka, 0)
    assert "\n" not in str(caught.value)
