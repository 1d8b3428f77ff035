"""Joints derived from a part's annotated poses: short and long arcs, noise, slides and parts at rest."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from recon.evaluation.imported.joint_from_poses import box_surface, fit_joint
from twin import geometry as geo
from twin.scene import Prismatic, Revolute


def hinge_poses(angles: Any, middle: Any, noise: float = 0.0) -> Any:
    joint = Revolute(geo.unit([0.1, 0.2, 1.0]), pivot=np.array([0.5, -0.3, 0.2]))
    T = joint.poses(angles) @ middle
    rng = np.random.default_rng(3)
    wobble = [
        geo.make_pose(geo.exp_so3(rng.normal(0, 2 * noise, 3)), rng.normal(0, noise, 3))
        for _ in np.atleast_1d(angles)
    ]
    return joint, T @ np.stack(wobble)


@pytest.mark.parametrize("degrees", [12.0, -25.0, 90.0, 175.0])
def test_a_hinge_is_found_from_short_and_long_arcs(degrees: float) -> None:
    middle = geo.make_pose(geo.exp_so3([0.4, 0.1, 0.3]), [0.9, 0.1, 0.4])
    angles = np.radians(degrees) * np.linspace(0, 1, 30) ** 2
    joint, T = hinge_poses(angles, middle)
    fitted = fit_joint(T, np.array([0.5, 0.4, 0.02]))
    assert fitted is not None
    assert fitted.kind == "revolute"
    assert geo.line_angle(fitted.axis, joint.axis) < 1e-6
    assert geo.line_distance(fitted.pivot, fitted.axis, joint.pivot, joint.axis) < 1e-6
    np.testing.assert_allclose(fitted.states, np.abs(angles), atol=1e-6)
    assert np.sign(fitted.axis @ joint.axis) == np.sign(degrees)
    assert fitted.residual < 1e-6


def test_noise_of_annotations_moves_a_hinge_little() -> None:
    middle = geo.make_pose(translation=[0.9, 0.1, 0.4])
    joint, T = hinge_poses(np.radians(70.0) * np.linspace(0, 1, 300), middle, noise=0.003)
    fitted = fit_joint(T, np.array([0.5, 0.4, 0.02]))
    assert fitted is not None
    assert np.degrees(geo.line_angle(fitted.axis, joint.axis)) < 0.5
    assert geo.line_distance(fitted.pivot, fitted.axis, joint.pivot, joint.axis) < 0.003
    assert 0.002 < fitted.residual < 0.006


def test_slides_and_parts_at_rest() -> None:
    rng = np.random.default_rng(0)
    states = np.array([0.0, -0.1, -0.25, -0.3, -0.2])
    T = Prismatic(geo.unit([1.0, 2.0, 0.5])).poses(states) @ geo.make_pose(translation=[0, 1, 2])
    fitted = fit_joint(T, np.array([0.4, 0.3, 0.2]))
    assert fitted is not None
    assert fitted.kind == "prismatic"
    np.testing.assert_allclose(fitted.axis, -geo.unit([1.0, 2.0, 0.5]), atol=1e-9)
    np.testing.assert_allclose(fitted.states, -states, atol=1e-9)
    still = np.stack(
        [geo.make_pose(geo.exp_so3(rng.normal(0, 0.01, 3)), rng.normal(0, 0.003, 3)) for _ in range(20)]
    )
    assert fit_joint(still, np.array([0.4, 0.3, 0.2])) is None


def test_points_lie_even_on_the_box() -> None:
    size = np.array([0.4, 0.2, 0.1])
    points = box_surface(size, 20_000, np.random.default_rng(1))
    on_face = np.isclose(np.abs(points), size / 2)
    assert np.all(on_face.any(axis=1))
    assert np.all(np.abs(points) <= size / 2 + 1e-12)
    areas = np.array([0.02, 0.04, 0.08])
    np.testing.assert_allclose(on_face.mean(axis=0), areas / areas.sum(), atol=0.01)
    np.testing.assert_allclose(points.mean(axis=0), 0.0, atol=0.005)
