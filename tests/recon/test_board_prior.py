"""Opposite faces of a board: the step between them is found to a fraction of a degree, and only on boards."""

from __future__ import annotations

import numpy as np
import pytest

from recon.parts.static_spans import REST_MARGIN
from recon.refine.observations import Terms
from recon.refine.parallel_faces import face_step
from recon.refine.refine_parts import _rests, _with_parallel_faces
from tests.laws import random_pose
from twin import geometry as geo
from twin.geometry import Array
from twin.scene import Motion, Prismatic, Revolute

HINGE = Revolute(np.array([0.0, 0.0, 1.0]), pivot=np.array([0.0, 0.0, 0.0]))


def _board(
    step: float, rng: np.random.Generator, noise: float = 0.002, count: int = 400, width: float = 0.48
) -> tuple[Array, Array]:
    """Surfels of a 0.5 x 0.6 x 0.03 m door; its far face is turned by `step` about the hinge. A bar stands off the front."""
    x, z = 0.02 + width * rng.random(2 * count), rng.uniform(0, 0.6, 2 * count)
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


def test_a_narrow_board_says_nothing() -> None:
    """Its sides are longer than its faces are wide; five centimetres tell no angle."""
    for width, known in ((0.05, False), (0.15, True)):
        points, normals = _board(0.0, np.random.default_rng(0), width=width)
        board = slice(0, 800)  # without the bar, which stands elsewhere
        assert (face_step(HINGE, points[board], normals[board]) is not None) == known


@pytest.mark.parametrize("error_deg", [-3.0, 2.0])
def test_the_step_between_both_faces_leaves_the_states(error_deg: float) -> None:
    """The front is seen in the first 20 frames, the inside in the last 20, where all states are too large by the same error;
    nothing is seen in the ten between. Turned back by it, the far face is parallel again."""
    error, rng = float(np.radians(error_deg)), np.random.default_rng(2)
    points, normals = _board(-error, rng)
    far = np.arange(len(points)) // 400 == 1
    term = np.repeat(np.arange(len(points)), 3)
    frame = np.where(far[term], rng.integers(30, 50, len(term)), rng.integers(0, 20, len(term)))
    zeros = np.zeros((len(term), 3))
    terms = Terms(term, frame, zeros, np.full(len(term), 0.002), np.zeros((len(points), 3)))
    true = np.linspace(0.0, 1.5, 50)
    wrong = true + error * np.interp(np.arange(50), [19, 30], [0.0, 1.0])
    off = np.degrees(_with_parallel_faces(HINGE, wrong, (points, normals), terms) - true)
    assert np.ptp(off[[*range(20), *range(30, 50)]]) < 0.3
    assert np.ptp(off) < 0.5, "between the two the correction is interpolated"
    nothing = Terms(term[:0], frame[:0], zeros[:0], np.zeros(0), np.zeros((len(points), 3)))
    assert _with_parallel_faces(HINGE, wrong, (points, normals), nothing) is wrong


def test_rest_keeps_its_distance_from_the_motion_on_both_sides() -> None:
    frames = np.arange(100)
    motion = Motion(frames, frames / 15.0, np.zeros(100), intervals=((20, 30), (50, 70)))
    near = np.zeros(100, bool)
    for first, last in motion.intervals:
        near[first - REST_MARGIN : last + REST_MARGIN + 1] = True
    np.testing.assert_array_equal(_rests(motion), ~near)
    assert not _rests(Motion(frames, frames / 15.0, np.zeros(100))).any(), "unknown intervals are no rest"
