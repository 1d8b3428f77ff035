"""Parts are called by what they are and, where there are several of a kind, by where they are in the
furniture."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import trimesh

from benchmarks.scenes.boards import Board, make_part, world_from_cabinet
from twin import geometry as geo
from twin.completion.part_names import part_names
from twin.geometry import Array
from twin.scene import Mesh, Part, Prismatic, Revolute

SIZE = np.array([0.4, 0.018, 0.2])  # of a front, whose outside faces -y
OUT, SIDEWAYS = np.array([0.0, -1.0, 0.0]), np.array([1.0, 0.0, 0.0])
EYE = np.array([0.2, -1.5, 1.4])  # before the fronts
TURNED = [np.eye(4), world_from_cabinet(), world_from_cabinet(yaw=2.6)]


def front(
    number: int, x: float, z: float, joint: Prismatic | Revolute | None = None, T: Array = TURNED[0]
) -> Part:
    """A board at this place, a drawer unless it has another joint."""
    low = np.array([x, 0.0, z])
    boards = [Board(tuple(low), tuple(low + SIZE))]
    return make_part(number, "part", boards, joint or Prismatic(OUT, 0.0, 0.3), T)


def hinge(x: float, z: float, axis: tuple[float, float, float]) -> Revolute:
    return Revolute(np.array(axis), 0.0, 1.4, pivot=np.array([x, 0.0, z]))


def names(*parts: Part, eye: Array | None = EYE, **more: object) -> list[str]:
    found = part_names(parts, eye, **more)  # type: ignore[arg-type]
    return [found[p.id] for p in parts]


@pytest.mark.parametrize(
    ("joint", "name"),
    [
        (Prismatic(OUT, 0.0, 0.3), "drawer"),
        (Prismatic(SIDEWAYS, 0.0, 0.3), "sliding_door"),
        (hinge(0.0, 0.0, (0, 0, -1)), "door"),
        (hinge(0.0, 0.2, (1, 0, 0)), "flap"),
    ],
)
def test_a_part_is_called_by_its_kind(joint: Prismatic | Revolute, name: str) -> None:
    """A sliding door is no drawer, and what is alone of its kind has no number."""
    assert names(front(7, 0.0, 0.5, joint)) == [name]


def test_a_low_drawer_is_no_sliding_door() -> None:
    """Its floor is four times as large as its front, and it slides along its floor."""
    boards = [Board((0.0, 0.0, 0.5), (0.6, 0.018, 0.56)), Board((0.0, 0.018, 0.5), (0.6, 0.5, 0.512))]
    assert names(make_part(2, "part", boards, Prismatic(OUT, 0.0, 0.3), np.eye(4))) == ["drawer"]


def test_a_lid_is_called_so() -> None:
    boards = [Board((0.0, 0.0, 0.5), (0.4, 0.3, 0.52))]
    lid = make_part(2, "part", boards, hinge(0.0, 0.5, (1, 0, 0)), np.eye(4))
    assert names(lid) == ["lid"]


@pytest.mark.parametrize("T", TURNED, ids=["ahead", "turned", "back"])
def test_of_several_the_place_is_told_as_the_viewer_sees_it(T: Array) -> None:
    places = {
        "drawer_upper_left": (0.0, 0.6), "drawer_upper_right": (0.5, 0.61),
        "drawer_middle": (0.25, 0.35), "drawer_lower_left": (0.02, 0.1), "drawer_lower_right": (0.5, 0.1),
    }  # fmt: skip
    parts = [front(k, x, z, T=T) for k, (x, z) in enumerate(places.values(), 2)]
    eye = geo.transform(T, EYE[None])[0]
    assert names(*parts, eye=eye) == list(places)
    assert names(*parts[::-1], eye=eye) == list(places)[::-1]


def test_place_is_told_within_a_kind_alone() -> None:
    above, below = front(2, 0.0, 0.6), front(3, 0.0, 0.3)
    door = front(4, 0.0, 0.0, hinge(0.0, 0.0, (0, 0, -1)))
    assert names(above, below, door) == ["drawer_upper", "drawer_lower", "door"]
    assert names(above, door) == ["drawer", "door"]


def test_parts_without_a_flat_front_are_named_by_joint_and_place() -> None:
    """No face of a ball is its front."""
    shape = trimesh.creation.icosphere(3, 0.1)
    ball = Mesh(shape.vertices, shape.faces.astype(np.int32))
    doors = [
        replace(front(k, 0.0, 0.0, hinge(0.0, 0.0, (0, 0, -1))), mesh=ball.transformed(geo.make_pose(translation=[x, 0, 0])))
        for k, x in ((2, 0.5), (3, 0.0))
    ]  # fmt: skip
    assert names(*doors) == ["door_right", "door_left"]
    assert names(*doors, eye=None) == ["door_right", "door_left"]


def test_a_namesake_gets_a_number() -> None:
    """Of four in a column two lie in the middle."""
    column = [front(k, 0.0, 0.25 * k) for k in range(2, 6)]
    assert names(*column) == ["drawer_lower", "drawer_middle", "drawer_middle_2", "drawer_upper"]
    assert names(column[0], taken=["drawer"]) == ["drawer_2"]


def test_a_name_that_was_given_is_kept() -> None:
    """The first drawer is still `drawer` when a second one is found below it."""
    above, below = front(2, 0.0, 0.6), front(3, 0.0, 0.3)
    assert names(above, below, given={2: "drawer"}) == ["drawer", "drawer_lower"]
    assert names(above, below, given={3: "drawer_upper"}) == ["drawer_upper_2", "drawer_upper"]
