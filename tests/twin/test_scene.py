"""The scene types refuse what breaks their laws, and joints move as screws do."""

from __future__ import annotations

from dataclasses import FrozenInstanceError, replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.scenes.boards import boards_mesh, cabinet_twin, door_boards, world_from_cabinet
from twin import geometry as geo
from twin.errors import SceneError
from twin.scene import (
    Box,
    ContactPath,
    Inertial,
    Joint,
    Mesh,
    Motion,
    Prismatic,
    Quantity,
    Revolute,
    Trajectory,
)


def random_joint(seed: int) -> Joint:
    rng = np.random.default_rng(seed)
    axis = geo.unit(rng.normal(size=3))
    return Revolute(axis, -0.2, 1.5, pivot=rng.normal(size=3)) if seed % 2 else Prismatic(axis, -0.2, 0.5)


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 10**6), st.floats(-2, 2), st.floats(-2, 2))
def test_joints_are_one_parameter_groups(seed: int, a: float, b: float) -> None:
    joint = random_joint(seed)
    assert np.allclose(joint.pose(0.0), np.eye(4))
    assert np.allclose(joint.pose(a) @ joint.pose(b), joint.pose(a + b), atol=1e-12)
    assert np.allclose(joint.poses([a, b])[1], joint.pose(b))


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 10**6), st.floats(-1.5, 1.5))
def test_velocity_is_the_derivative_of_the_pose(seed: int, state: float) -> None:
    joint = random_joint(seed)
    point = np.random.default_rng(seed + 1).normal(size=3)
    h = 1e-6
    ahead, behind = (geo.transform(joint.pose(state + s), point[None])[0] for s in (h, -h))
    assert np.allclose(joint.velocity(state, point), (ahead - behind) / (2 * h), atol=1e-7)


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 10**6), st.floats(-1.5, 1.5))
def test_a_joint_in_another_frame_is_the_same_motion(seed: int, state: float) -> None:
    joint = random_joint(seed)
    new = geo.exp_se3(np.random.default_rng(seed + 2).normal(size=6))
    assert np.allclose(
        joint.transformed(new).pose(state), new @ joint.pose(state) @ geo.invert_pose(new), atol=1e-10
    )
    assert (joint.transformed(new).lower, joint.transformed(new).upper) == (joint.lower, joint.upper)


def test_a_hinge_does_not_move_its_axis() -> None:
    joint = Revolute(np.array([0.0, 0, -1]), 0, 1, pivot=np.array([1.0, 2, 3]))
    assert np.allclose(geo.transform(joint.pose(0.7), [[1.0, 2.0, 9.0]]), [[1.0, 2.0, 9.0]])
    opened = geo.transform(joint.pose(np.pi / 2), [[2.0, 2.0, 3.0]])
    assert np.allclose(opened, [[1.0, 1.0, 3.0]]), "axis down: the door turns clockwise seen from above"


def test_a_nested_part_is_carried_by_its_parent() -> None:
    twin = cabinet_twin(nested=True)
    door, flap = twin.part("door"), twin.part("flap")
    assert np.allclose(
        twin.part_pose("flap", {2: 0.8, 5: 0.3}), door.joint.pose(0.8) @ flap.joint.pose(0.3), atol=1e-12
    )
    assert np.allclose(twin.part_pose("flap", {5: 0.3}), flap.joint.pose(0.3))


def inertial(**options: object) -> Inertial:
    return Inertial(Quantity(1.0, "x", (0, 1)), np.zeros(3), np.eye(3), **options)  # type: ignore[arg-type]


def test_a_source_begins_with_a_known_word_or_counts_as_other() -> None:
    def origin(source: str) -> str:
        return Quantity(1.0, source, (1.0, 1.0)).origin

    assert origin("measured: kitchen scale") == "measured"
    assert origin("user") == "user"
    assert origin("users: two of them") == "other"
    assert origin("a scale: measured") == "other"


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Prismatic(np.array([1.0, 1, 0])), "length 1"),
        (lambda: Prismatic(np.array([1.0, 0, 0]), 1.0, 0.5), "lower <= upper"),
        (lambda: Prismatic(np.array([1.0, 0, np.nan])), "not finite"),
        (lambda: Prismatic(np.array([1.0, 0, 0]), covariance=-np.eye(2)), "not negative"),
        (lambda: Revolute(np.array([1.0, 0, 0]), pivot=np.zeros(3), covariance=np.eye(2)), "shape"),
        (lambda: Mesh(np.zeros((3, 3)), np.array([[0, 1, 3]])), "0..3 of 3"),
        (lambda: Mesh(np.zeros((3, 2)), np.zeros((0, 3))), "shape"),
        (lambda: Mesh(np.zeros((3, 3)), np.zeros((0, 3)), np.zeros((2, 3))), "colors"),
        (lambda: Box(np.eye(4), np.array([1.0, 0, 1])), "positive"),
        (lambda: Box(np.diag([-1.0, 1, 1, 1]), np.ones(3)), "right-handed"),
        (lambda: Box(np.diag([2.0, 1, 1, 1]), np.ones(3)), "right-handed"),
        (lambda: Quantity(2.0, "x", (0.0, 1.0)), "inside its finite interval"),
        (lambda: Inertial(Quantity(0.0, "x", (0, 1)), np.zeros(3), np.eye(3)), "mass must be positive"),
        (lambda: Inertial(Quantity(1.0, "x", (0, 1)), np.zeros(3), np.diag([1, 1, 3.0])), "triangle"),
        (
            lambda: Inertial(Quantity(1.0, "x", (0, 1)), np.zeros(3), np.diag([1, 1, -1.0])),
            "positive definite",
        ),
        (lambda: Quantity(2.0, "user: a\nb", (0.0, 3.0)), "one line"),
        (lambda: Quantity(2.0, " ", (0.0, 3.0)), "one line"),
        (lambda: inertial(inertia_interval=(1.1, 1.2)), "factors around 1"),
        (lambda: inertial(inertia_interval=(0.5, np.inf)), "factors around 1"),
        (lambda: inertial(com_interval=[[0, 0, 0], [1, 1, -1]]), "inside its interval"),
        (lambda: inertial(com_interval=[[0, 0, 0]]), "shape"),
        (lambda: ContactPath(np.zeros(3), np.diag([1, 1, -1.0]), 0.01, (), "x"), "right-handed"),
        (lambda: ContactPath(np.zeros(3), np.eye(3), -0.01, (), "x"), "width"),
        (lambda: Motion([0, 2, 2], [0, 1, 2], [0, 0, 0]), "strictly increase"),
        (lambda: Motion([0], [0], [0], ((3, 3),)), "first < last"),
        (lambda: Trajectory([0, 1], [0, 1], 2 * np.stack([np.eye(4)] * 2)), "rigid"),
        (lambda: Trajectory([], [], np.zeros((0, 4, 4))), "empty"),
    ],
)
def test_laws_are_checked_when_a_value_is_made(make: object, message: str) -> None:
    with pytest.raises(SceneError, match=message):
        make()


def test_parts_and_twins_refuse_bad_names_ids_and_trees() -> None:
    twin = cabinet_twin(nested=True)
    door, drawer, flap = twin.parts
    with pytest.raises(SceneError, match="not legal"):
        replace(door, name="the door")
    with pytest.raises(SceneError, match="part id"):
        replace(door, id=255)
    with pytest.raises(SceneError, match="unique whatever their case"):
        replace(twin, parts=(door, replace(drawer, name="DOOR")))
    with pytest.raises(SceneError, match="ids must be unique"):
        replace(twin, parts=(door, replace(drawer, id=2)))
    with pytest.raises(SceneError, match="own ancestor"):
        replace(twin, parts=(replace(door, parent=5), drawer, flap))
    with pytest.raises(SceneError, match="no part 9"):
        replace(twin, parts=(replace(door, parent=9), drawer, flap))


def test_values_can_not_be_changed_afterwards() -> None:
    mesh = boards_mesh(door_boards())
    with pytest.raises(ValueError, match="read-only"):
        mesh.vertices[0] = 1
    with pytest.raises(FrozenInstanceError):
        cabinet_twin().parts[0].name = "x"


def test_area_and_centroid_of_a_mesh_are_exact() -> None:
    square = Mesh(np.array([[0.0, 0, 0], [2, 0, 0], [2, 1, 0], [0, 1, 0]]), np.array([[0, 1, 2], [0, 2, 3]]))
    assert square.area == pytest.approx(2.0)
    assert np.allclose(square.area_centroid, [1, 0.5, 0])
    moved = square.transformed(world_from_cabinet())
    assert moved.area == pytest.approx(2.0)
    dot = Mesh(np.array([[1.0, 1, 1], [3, 1, 1]]), np.zeros((0, 3)))
    assert np.allclose(dot.area_centroid, [2, 1, 1])


def test_a_lost_camera_frame_has_no_pose() -> None:
    cameras = cabinet_twin().cameras
    assert cameras.pose(7) is None
    assert np.array_equal(cameras.pose(8), cameras.T_world_cam[7])
    new = geo.make_pose(translation=[0, 0, 1.0])
    assert np.allclose(cameras.transformed(new).pose(8)[2, 3], cameras.pose(8)[2, 3] + 1)


def test_the_scenes_for_tests_open_outwards() -> None:
    """The door's and the drawer's handles move towards the person in front of the cabinet."""
    T = world_from_cabinet()
    for part in cabinet_twin(T).parts:
        assert part.joint.velocity(0.0, part.contact.point) @ -T[:3, 1] > 0.4
