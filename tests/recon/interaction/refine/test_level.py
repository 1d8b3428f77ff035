"""Furniture is level: axes lie along a direction of the room unless they are surely askew."""

from __future__ import annotations

import numpy as np
import pytest

from recon.interaction.refine.level import with_room_known
from recon.observation.room import Room
from tests.makers.recon.cabinets import make_clip
from twin import geometry as geo
from twin.geometry import Array
from twin.joint import Joint, Prismatic, Revolute

ROOM = Room(np.eye(3), np.full(3, np.radians(0.05)))
STATES = np.linspace(0.0, 1.0, 5)


def _covariance(joint: Joint, tilt_deg: float, shift: float = 0.002) -> Array:
    """Errors of a joint and its states that hang together: what tilts the axis shifts pivot and states."""
    rng = np.random.default_rng(3)
    size = joint.dof + len(STATES)
    sigmas = np.full(size, shift)
    sigmas[:2] = np.radians(tilt_deg)
    shared = rng.normal(size=(size, size)) * 0.3 + np.eye(size)
    correlated = shared @ shared.T
    scale = sigmas / np.sqrt(np.diag(correlated))
    return correlated * np.outer(scale, scale)


def _tilted(kind: str, axis: Array, degrees: float) -> Joint:
    tilt = geo.orthogonal_basis(axis)[:, 0] * np.radians(degrees)
    turned = geo.exp_so3(tilt) @ axis
    return Prismatic(turned) if kind == "slide" else Revolute(turned, pivot=np.array([0.4, 0.2, 0.9]))


@pytest.mark.parametrize("kind", ["slide", "hinge"])
@pytest.mark.parametrize("axis", [[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
def test_an_unsure_axis_is_drawn_to_the_direction_next_to_it(kind: str, axis: list[float]) -> None:
    level = np.array(axis)
    joint = _tilted(kind, level, 0.9)
    covariance = _covariance(joint, 0.8)
    found, _, after = with_room_known(joint, STATES, covariance, ROOM)
    assert geo.line_angle(found.axis, level) < np.radians(0.3)
    assert np.linalg.eigvalsh(after[:2, :2]).max() < np.radians(0.31) ** 2
    assert np.linalg.eigvalsh(after).min() > -1e-12
    assert found.axis @ joint.axis > 0.99


def test_pivot_and_states_go_along_as_their_errors_hang_on_the_axis() -> None:
    joint = _tilted("hinge", np.array([0.0, 0.0, 1.0]), 0.9)
    covariance = _covariance(joint, 0.8)
    found, states, _ = with_room_known(joint, STATES, covariance, ROOM)
    moved = found.minus(joint)
    hangs = covariance[:, :2] @ np.linalg.inv(covariance[:2, :2]) @ moved[:2]
    np.testing.assert_allclose(moved[2:], hangs[2:4], atol=2e-5)
    np.testing.assert_allclose(states - STATES, hangs[4:], atol=1e-12)
    assert np.abs(states - STATES).max() > 1e-4


@pytest.mark.parametrize(("off", "sigma"), [(6.0, 0.1), (15.0, 0.4), (20.0, 40.0), (0.9, 3000.0)])
def test_what_is_surely_askew_and_what_is_not_known_at_all_stays(off: float, sigma: float) -> None:
    joint = _tilted("hinge", np.array([0.0, 0.0, 1.0]), off)
    covariance = _covariance(joint, sigma)
    found, states, after = with_room_known(joint, STATES, covariance, ROOM)
    assert found is joint
    assert states is STATES
    assert after is covariance


def test_a_sure_axis_keeps_its_place() -> None:
    joint = _tilted("hinge", np.array([0.0, 0.0, 1.0]), 0.4)
    found, _, _ = with_room_known(joint, STATES, _covariance(joint, 0.02), ROOM)
    assert geo.line_angle(found.axis, joint.axis) < np.radians(0.02)


def test_a_fit_that_claims_too_much_counts_less() -> None:
    """Five of its sigmas off, it goes farther to the room's direction than its own sigma lets it."""
    joint = _tilted("slide", np.array([0.0, 1.0, 0.0]), 1.25)
    covariance = np.diag(np.full(2 + len(STATES), np.radians(0.2) ** 2))
    found, _, after = with_room_known(joint, STATES, covariance, ROOM)
    claimed = 1.25 * 0.2**2 / (0.2**2 + 0.3**2 + 0.05**2)
    assert np.degrees(geo.line_angle(found.axis, joint.axis)) > 1.1 * claimed
    assert np.sqrt(after[0, 0]) > 0.9 * np.radians(0.2)


def test_no_direction_of_the_room_changes_nothing() -> None:
    joint = _tilted("slide", np.array([0.0, 1.0, 0.0]), 1.0)
    nowhere = Room(np.zeros((3, 0)), np.zeros(0))
    assert with_room_known(joint, STATES, _covariance(joint, 0.8), nowhere)[0] is joint


def test_the_answer_does_not_depend_on_the_world_s_axes() -> None:
    T = geo.make_pose(geo.exp_so3([0.3, -0.5, 0.9]), [1.0, 2.0, 3.0])
    joint = _tilted("hinge", np.array([1.0, 0.0, 0.0]), 0.7)
    covariance = np.diag(np.full(4 + len(STATES), np.radians(0.5) ** 2))
    found, _, _ = with_room_known(joint, STATES, covariance, ROOM)
    turned = Room(T[:3, :3] @ -ROOM.directions[:, ::-1], ROOM.sigma)
    there, _, _ = with_room_known(joint.transformed(T), STATES, covariance, turned)
    assert geo.line_angle(there.axis, geo.rotate(T, found.axis)) < 1e-9


def test_the_room_of_a_recording_has_the_furniture_s_directions() -> None:
    clip = make_clip("drawer")
    room = Room.of(clip.recording, clip.cameras)
    near = max(np.abs(room.directions.T @ axis).max() for axis in np.eye(3))
    assert np.degrees(np.arccos(min(near, 1.0))) < 0.5
    assert (np.degrees(room.sigma) < 1.0).all()
