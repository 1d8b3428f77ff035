"""Every measure on cases whose answer is known in closed form."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from recon.evaluation import metrics
from tests.makers.recon.tiny import box, cameras
from twin import geometry as geo


def test_interval_starts_and_ends_two_percent_of_the_travel_from_rest() -> None:
    states = np.array([0.0, 0.0, 0.01, 0.02, 0.021, 0.5, 0.97, 0.979, 0.981, 1.0, 1.0])
    assert metrics.moving_span(states) == (4, 7)
    assert metrics.moving_span(5 + 3 * states, offset=10) == (14, 17)
    assert metrics.moving_span(states[::-1]) == (3, 6)


def test_interval_of_a_part_that_opens_and_closes_ends_at_its_last_move() -> None:
    states = np.array([0.0, 0.0, 0.5, 1.0, 1.0, 0.5, 0.0, 0.0])
    assert metrics.moving_span(states) == (2, 5)


def test_nothing_moves_has_no_interval() -> None:
    assert metrics.moving_span(np.full(9, 0.3)) is None
    assert metrics.moving_span(np.zeros(0)) is None


def test_interval_overlap() -> None:
    assert metrics.span_iou((3, 7), (3, 7)) == 1.0
    assert metrics.span_iou((0, 9), (5, 14)) == pytest.approx(5 / 15)
    assert metrics.span_iou((0, 4), (5, 9)) == 0.0
    assert metrics.span_iou((0, 4), None) == 0.0


def test_interval_detection_counts_each_interval_once() -> None:
    true = [(0, 9), (20, 29)]
    assert metrics.span_detection(true, true) == (1.0, 1.0)
    assert metrics.span_detection(true, [(0, 9)]) == (1.0, 0.5)
    assert metrics.span_detection(true, [(0, 9), (1, 9), (20, 29), (50, 59)]) == (0.5, 1.0)
    assert metrics.span_detection(true, [(0, 29)]) == (0.0, 0.0)
    assert metrics.span_detection([], []) == (1.0, 1.0)
    assert metrics.span_detection([], [(0, 3)]) == (0.0, 1.0)


def test_overlap_of_several_intervals_counts_frames_and_of_one_is_that_of_intervals() -> None:
    twice = [(0, 9), (90, 99)]
    assert metrics.spans_iou(twice, twice[::-1]) == 1.0
    assert metrics.spans_iou(twice, [(0, 9)]) == 0.5
    assert metrics.spans_iou(twice, [(40, 60)]) == 0.0
    assert metrics.spans_iou([(0, 9)], [(5, 14)]) == metrics.span_iou((0, 9), (5, 14))
    assert metrics.spans_iou([], twice) == metrics.spans_iou([], []) == 0.0
    np.testing.assert_array_equal(metrics.span_frames([(7, 8), (1, 3), (2, 4)]), [1, 2, 3, 4, 7, 8])


@given(st.lists(st.floats(-2, 2), min_size=3, max_size=20), st.sampled_from([1, -1]), st.floats(-5, 5))
def test_state_error_forgives_sign_and_zero_alone(states: list[float], sign: int, zero: float) -> None:
    true = np.array(states)
    assert metrics.state_error(true, sign * true + zero)[0] == pytest.approx(0.0, abs=1e-12)


def test_state_error_sees_scale() -> None:
    true = np.array([0.0, 0.0, 0.5, 1.0, 1.0])
    error, sign = metrics.state_error(true, -0.9 * true)
    assert sign == -1
    assert error == pytest.approx(np.mean(np.abs(0.1 * true - 0.05)))


def test_world_alignment_undoes_any_rigid_motion_even_of_one_camera() -> None:
    T = geo.exp_se3([0.4, -1.0, 2.0, 0.3, 2.0, -0.5])
    true = cameras(12)
    for n in (1, 2, 12):
        found = metrics.align_worlds(true[:n], geo.invert_pose(T) @ true[:n])
        np.testing.assert_allclose(found, T, atol=1e-12)
    assert np.array_equal(metrics.align_worlds(true, true), np.eye(4))


def test_trajectory_errors_of_a_known_disturbance() -> None:
    true = np.tile(np.eye(4), (10, 1, 1))
    found = true.copy()
    found[::2, 0, 3] = 0.002
    assert metrics.absolute_trajectory_error(true, found) == pytest.approx(0.002 * np.sqrt(0.5))
    assert metrics.relative_pose_error(true, found) == pytest.approx((0.002, 0.0))
    found = np.stack([geo.make_pose(geo.exp_so3([0, 0, 0.01 * k])) for k in range(10)])
    assert metrics.relative_pose_error(true, found) == pytest.approx((0.0, 0.01))
    assert metrics.relative_pose_error(true[:1], found[:1]) == (0.0, 0.0)


def test_add_counts_the_same_vertex_and_add_s_the_nearest() -> None:
    square = np.array([[1.0, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0]])
    quarter = geo.make_pose(geo.exp_so3([0, 0, np.pi / 2]))
    add, add_s = metrics.vertex_distances(square, np.eye(4), quarter)
    assert add == pytest.approx(np.sqrt(2))
    assert add_s == pytest.approx(0.0, abs=1e-12)
    assert metrics.vertex_distances(square, quarter, quarter) == (0.0, 0.0)


def test_area_under_accuracy_is_one_for_exact_and_half_for_half_the_limit() -> None:
    assert metrics.area_under_accuracy([0.0, 0.0]) == 1.0
    assert metrics.area_under_accuracy([0.05]) == pytest.approx(0.5)
    assert metrics.area_under_accuracy([0.5]) == 0.0
    assert metrics.area_under_accuracy([]) == 0.0


def test_diameter_of_a_box_and_of_flat_points() -> None:
    assert metrics.diameter(box((1, 2, 3), (0.3, 0.4, 1.2)).vertices) == pytest.approx(1.3)
    assert metrics.diameter(np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])) == pytest.approx(
        np.sqrt(2)
    )
    assert metrics.diameter(np.zeros((1, 3))) == 0.0


def test_mask_overlap() -> None:
    a = np.array([True, True, False, False])
    assert metrics.iou(a, a) == 1.0
    assert metrics.iou(a, ~a) == 0.0
    assert metrics.iou(a, np.array([True, False, True, False])) == pytest.approx(1 / 3)
    assert metrics.iou(a & ~a, a & ~a) == 1.0


def test_distance_to_a_box() -> None:
    surface = metrics.DistanceField(box((0, 0, 0), (2, 2, 2)))
    points = np.array([[3.0, 0, 0], [0.9, 0, 0], [2, 2, 0], [1, 0.2, 0.3]])
    np.testing.assert_allclose(surface.distance(points), [2.0, 0.1, np.sqrt(2), 0.0], atol=1e-6)
    np.testing.assert_allclose(surface.nearest(points)[0], [1.0, 0, 0], atol=1e-6)


def test_directions_see_the_sign() -> None:
    a = np.array([[1.0, 0, 0], [0, 2, 0], [0, 0, 3]])
    b = np.array([[2.0, 0, 0], [0, -1, 0], [0, 1, 0]])
    np.testing.assert_array_equal(metrics.signed_angles(a, b), [0.0, np.pi, np.pi / 2])
    assert metrics.same_direction(np.arange(5.0), np.arange(5.0) * 2 - 7)
    assert not metrics.same_direction(np.arange(5.0), -np.arange(5.0))
    assert not metrics.same_direction(np.arange(5.0), np.zeros(5))
