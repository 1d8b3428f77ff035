"""Opposite faces of a board: the step between them is found to a fraction of a degree, and only on boards."""

from __future__ import annotations

import numpy as np
import pytest

from recon.refine.parallel_faces import face_step
from tests.laws import random_pose
from twin import geometry as geo
from twin.geometry import Array
from twin.scene import Prismatic, Revolute

HINGE = Revolute(np.array([0.0, 0.0, 1.0]), pivot=np.array([0.0, 0.0, 0.0]))


def _board(
    step: float, rng: np.random.Generator, noise: float = 0.002, count: int = 400
) -> tuple[Array, Array]:
    """Surfels of a 0.5 x 0.6 x 0.03 m door; its far face is turned by `step` about the hinge. A bar stands off the front."""
    x, z = rng.uniform(0.02, 0.5, 2 * count), rng.uniform(0, 0.6, 2 * count)
    far = np.arange(2 * count) >= count
    points = np.stack([x, np.where(far, 0.015, -0.015), z], axis=1)
    normals = np.where(far[:, None], [0.0, 1.0, 0.0], [0.0, -1.0, 0.0])
    turn = geo.exp_so3([0.0, 0.0, step])
    points[far], normals[far] = points[far] @ turn.T, normals[far] @ turn.T
    bar = np.stack([rng.uniform(0.4, 0.42, 60), np.full(60, -0.06), rng.uniform(0.2, 0.4, 60)], axis=1)
    points = np.concatenate([points, bar]) + rng.normal(scale=noise, size=(2 * count + 60, 3))
    normals = np.concatenate([normals, np.tile([0.0, -1.0, 0.0], (60, 1))])
    return points, geo.unit(normals + rng.normal(scale=0.1, size=normals.shape))


@pytest.mark.parametrize("step_deg", [-4.0, -0.5, 0.0, 2.0])
def test_the_step_is_found_whatever_the_frame(step_deg: float) -> None:
    rng = np.random.default_rng(1)
    points, normals = _board(np.radians(step_deg), rng)
    T = random_pose(rng)
    found = face_step(HINGE.transformed(T), geo.transform(T, points), normals @ T[:3, :3].T)
    assert found is not None
    step, near, far = found
    # Which face is called near is not told: the sign says how the far one is turned against it.
    sign = 1.0 if near[0] else -1.0
    assert np.degrees(sign * step) == pytest.approx(step_deg, abs=0.25)
    assert not np.any(near & far)


def test_one_face_alone_a_slide_or_a_tube_say_nothing() -> None:
    rng = np.random.default_rng(0)
    points, normals = _board(0.0, rng)
    front = normals[:, 1] < 0
    assert face_step(HINGE, points[front], normals[front]) is None
    assert face_step(Prismatic(np.array([0.0, 0.0, 1.0])), points, normals) is None
    angle = rng.uniform(-np.pi, np.pi, 1000)
    round_ = np.stack([np.cos(angle), np.sin(angle), np.zeros(1000)], axis=1)
    tube = 0.2 * round_ + [0.0, 0.0, 1.0] * rng.uniform(0, 0.5, (1000, 1))
    assert face_step(HINGE, tube, round_) is None
