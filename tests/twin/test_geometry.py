"""Laws of the rigid geometry."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from twin import geometry as geo

seeds = st.integers(0, 2**32 - 1)


def random_poses(seed: int, n: int = 4) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return geo.exp_se3(rng.normal(size=(n, 6)))


@settings(max_examples=40, deadline=None)
@given(seeds)
def test_exp_and_log_are_inverse(seed: int) -> None:
    rng = np.random.default_rng(seed)
    w = geo.unit(rng.normal(size=(5, 3))) * rng.uniform(0, np.pi - 1e-3, (5, 1))
    assert np.allclose(geo.log_so3(geo.exp_so3(w)), w, atol=1e-9)
    x = np.concatenate([rng.normal(size=(5, 3)), w], axis=1)
    assert np.allclose(geo.log_se3(geo.exp_se3(x)), x, atol=1e-7)


@pytest.mark.parametrize("angle", [0.0, 1e-12, 1e-8, 1e-4, np.pi - 1e-9])
def test_small_and_nearly_half_turns_stay_exact(angle: float) -> None:
    w = geo.unit([0.3, -0.5, 0.8]) * angle
    r = geo.exp_so3(w)
    assert np.allclose(r @ r.T, np.eye(3), atol=1e-14)
    assert geo.rotation_angle(r) == pytest.approx(angle, abs=1e-12, rel=1e-7)


@settings(max_examples=40, deadline=None)
@given(seeds)
def test_poses_form_a_group_and_act_on_points(seed: int) -> None:
    a, b, c, _ = random_poses(seed)
    assert np.allclose((a @ b) @ c, a @ (b @ c))
    assert np.allclose(geo.invert_pose(a) @ a, np.eye(4), atol=1e-12)
    points = np.random.default_rng(seed).normal(size=(7, 3))
    assert np.allclose(geo.transform(a @ b, points), geo.transform(a, geo.transform(b, points)))
    assert np.allclose(geo.rotate(a, points), geo.transform(a, points) - a[:3, 3])


@settings(max_examples=40, deadline=None)
@given(seeds)
def test_quaternions_describe_the_same_rotation(seed: int) -> None:
    r = random_poses(seed)[:, :3, :3]
    assert np.allclose(geo.matrix_from_quat_wxyz(geo.quat_wxyz_from_matrix(r)), r, atol=1e-12)
    assert np.allclose(geo.matrix_from_quat_wxyz([[1.0, 0, 0, 0]]), np.eye(3))
    quarter = geo.exp_so3([0, 0, np.pi / 2])
    assert np.allclose(geo.quat_wxyz_from_matrix(quarter), [np.sqrt(0.5), 0, 0, np.sqrt(0.5)])


@settings(max_examples=30, deadline=None)
@given(seeds)
def test_fit_rigid_recovers_a_pose_and_never_mirrors(seed: int) -> None:
    rng = np.random.default_rng(seed)
    pose = random_poses(seed, 1)[0]
    source = rng.normal(size=(6, 3)) * [1, 1, seed % 2]  # flat point sets too
    got = geo.fit_rigid(source, geo.transform(pose, source))
    assert np.allclose(got, pose, atol=1e-8)
    mirrored = geo.fit_rigid(source, source * [1, 1, -1])
    assert np.linalg.det(mirrored[:3, :3]) == pytest.approx(1.0)


def test_weights_decide_which_points_a_fit_follows() -> None:
    rng = np.random.default_rng(0)
    source = rng.normal(size=(20, 3))
    target = source + [0.1, 0, 0]
    target[10:] += 5.0
    weights = np.r_[np.ones(10), np.zeros(10)]
    assert np.allclose(geo.fit_rigid(source, target, weights)[:3, 3], [0.1, 0, 0], atol=1e-9)


def test_angles_are_exact_at_their_ends() -> None:
    assert geo.angle_between([1, 0, 0], [1, 1e-9, 0]) == pytest.approx(1e-9, rel=1e-6)
    assert geo.angle_between([1, 0, 0], [-2, 0, 0]) == pytest.approx(np.pi)
    assert geo.line_angle([1, 0, 0], [-1, 1e-7, 0]) == pytest.approx(1e-7, rel=1e-6)


def test_lines() -> None:
    assert geo.line_distance([0, 0, 0], [0, 0, 1], [3, 4, 9], [0, 0, -2]) == pytest.approx(5.0)
    assert geo.line_distance([0, 0, 0], [1, 0, 0], [7, 2, 1], [0, 1, 0]) == pytest.approx(1.0)
    assert np.allclose(geo.nearest_point_on_line([1, 2, 3], [0, 0, 10], [0, 0, -5]), [0, 0, 3])
    assert geo.point_line_distance([3, 4, 9], [0, 0, 0], [0, 0, 1]) == pytest.approx(5.0)


@settings(max_examples=30, deadline=None)
@given(seeds)
def test_bases_and_smallest_rotations(seed: int) -> None:
    rng = np.random.default_rng(seed)
    a, b = rng.normal(size=(2, 3))
    basis = geo.orthogonal_basis(a)
    assert np.allclose(basis.T @ basis, np.eye(3), atol=1e-12)
    assert np.linalg.det(basis) == pytest.approx(1.0)
    assert np.allclose(basis[:, 2], geo.unit(a))
    for target in (b, -a, a):
        r = geo.rotation_between(a, target)
        assert np.allclose(r @ geo.unit(a), geo.unit(target), atol=1e-9)
        assert geo.rotation_angle(r) == pytest.approx(geo.angle_between(a, target), abs=1e-7)


@pytest.mark.parametrize("seed", range(20))
def test_one_vector_is_treated_as_a_batch_of_one_to_the_bit(seed: int) -> None:
    rng = np.random.default_rng(seed)
    for _ in range(50):
        v = rng.normal(size=3) * 10.0 ** rng.uniform(-9, 3)
        np.testing.assert_array_equal(geo.unit(v), geo.unit(v[None])[0])
        np.testing.assert_array_equal(geo.exp_so3(v), geo.exp_so3(v[None])[0])


def test_a_zero_direction_is_refused() -> None:
    with pytest.raises(ValueError, match="not zero"):
        geo.unit([0.0, 0.0, 0.0])
    with pytest.raises(ValueError, match="must not be zero"):
        geo.matrix_from_quat_wxyz([0.0, 0, 0, 0])


@pytest.mark.parametrize("shape", [(0, 3), (7, 1), (50, 3), (4, 5, 2), (3,)])
def test_every_says_what_numpys_all_says_of_the_last_axis(shape: tuple[int, ...]) -> None:
    mask = np.random.default_rng(0).random(shape) > 0.3
    for some in (mask, np.ones(shape, bool), mask[..., ::-1]):
        assert np.array_equal(geo.every(some), np.all(some, axis=-1))


@pytest.mark.parametrize("shape", [(3,), (1, 3), (5, 3)])
def test_cross_products_are_numpys(shape: tuple[int, ...]) -> None:
    a, b = np.random.default_rng(1).normal(size=(2, *shape))
    assert np.array_equal(geo.cross(a, b), np.cross(a, b))
