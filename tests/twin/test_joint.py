"""Laws of the joints' algebra, for both kinds, with samples near zero and near half a turn."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from twin import geometry as geo
from twin.errors import SceneError
from twin.geometry import Array
from twin.joint import Joint, JointSigma, Prismatic, Revolute

KINDS = ("prismatic", "revolute")
TILTS = {"none": 0.0, "almost none": 1e-9, "moderate": 0.3, "almost half a turn": np.pi - 1e-6}


def joint_of(kind: str, rng: np.random.Generator) -> Joint:
    axis = geo.unit(rng.normal(size=3))
    root = rng.normal(size=(4, 4)) * [0.01, 0.02, 0.003, 0.005]
    sigma = JointSigma(0.01, None if kind == "prismatic" else 0.003, 0.02)
    if kind == "prismatic":
        square = (root.T @ root)[:2, :2]
        return Prismatic(axis, lower=-0.1, upper=0.4, covariance=square, sigma=sigma)
    pivot = rng.normal(size=3)
    return Revolute(axis, lower=-0.1, upper=1.2, covariance=root.T @ root, sigma=sigma, pivot=pivot)


def same_line(a: Joint, b: Joint, tolerance: float = 1e-9) -> bool:
    if isinstance(a, Revolute):
        assert isinstance(b, Revolute)
        if geo.line_distance(a.pivot, a.axis, b.pivot, b.axis) > tolerance:
            return False
    return bool(np.allclose(a.axis, b.axis, atol=tolerance))


def spread(joint: Joint) -> Array:
    """The covariance as it is whatever the basis: of the axis' tilt vector and of its shift vector, in the
    world (3, 3) each."""
    assert joint.covariance is not None
    both = np.kron(np.eye(len(joint.covariance) // 2), joint.basis)
    return np.asarray(both @ joint.covariance @ both.T)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("tilt", TILTS)
@pytest.mark.parametrize("seed", range(5))
def test_minus_undoes_plus(kind: str, tilt: str, seed: int) -> None:
    rng = np.random.default_rng([seed, len(tilt)])
    joint = joint_of(kind, rng)
    delta = np.concatenate([TILTS[tilt] * geo.unit(rng.normal(size=2)), rng.normal(size=2)])
    delta = delta[: 2 if kind == "prismatic" else 4]
    assert np.allclose(joint.plus(delta).minus(joint), delta, atol=1e-8)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seed", range(5))
def test_plus_of_minus_is_the_other_line(kind: str, seed: int) -> None:
    rng = np.random.default_rng(seed)
    one, other = joint_of(kind, rng), joint_of(kind, rng)
    assert same_line(other.plus(one.minus(other)), one)
    assert same_line(one.plus(one.reversed().minus(one)), one.reversed()), "opposite axes"


@pytest.mark.parametrize("kind", KINDS)
def test_nothing_added_is_the_joint_itself(kind: str) -> None:
    joint = joint_of(kind, np.random.default_rng(0))
    assert joint.plus(np.zeros(4)) is joint
    assert np.array_equal(joint.minus(joint), np.zeros(2 if kind == "prismatic" else 4))


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("state", [0.0, 1e-9, 0.3, np.pi - 1e-9])
def test_reversed_is_the_same_motion_counted_the_other_way(kind: str, state: float) -> None:
    joint = joint_of(kind, np.random.default_rng(1))
    back = joint.reversed()
    assert np.allclose(back.pose(-state), joint.pose(state), atol=1e-12)
    assert (back.lower, back.upper) == (-joint.upper, -joint.lower)
    assert np.allclose(spread(back), spread(joint), atol=1e-15)
    again = back.reversed()
    assert np.array_equal(again.axis, joint.axis)
    assert again.covariance is not None
    assert joint.covariance is not None
    assert np.allclose(again.covariance, joint.covariance, atol=1e-15)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("turn", [1e-9, 0.7, np.pi - 1e-9])
def test_another_frame_keeps_motion_and_uncertainty(kind: str, turn: float) -> None:
    rng = np.random.default_rng(2)
    joint = joint_of(kind, rng)
    T = geo.make_pose(geo.exp_so3(turn * geo.unit(rng.normal(size=3))), rng.normal(size=3))
    moved = joint.transformed(T)
    assert np.allclose(moved.pose(0.4), T @ joint.pose(0.4) @ geo.invert_pose(T), atol=1e-12)
    both = np.kron(np.eye(1 if kind == "prismatic" else 2), T[:3, :3])
    assert np.allclose(spread(moved), both @ spread(joint) @ both.T, atol=1e-15)
    assert moved.sigma == joint.sigma
    home = moved.transformed(geo.invert_pose(T))
    assert home.covariance is not None
    assert joint.covariance is not None
    assert np.allclose(home.covariance, joint.covariance, atol=1e-12)


@pytest.mark.parametrize("kind", KINDS)
def test_moves_commute_with_the_frame(kind: str) -> None:
    """A joint moved and then seen from another frame is that joint seen from there and then moved."""
    rng = np.random.default_rng(3)
    joint, n = joint_of(kind, rng), 1 if kind == "prismatic" else 2
    T = geo.make_pose(geo.exp_so3(rng.normal(size=3)), rng.normal(size=3))
    delta = 0.2 * rng.normal(size=2 * n)
    seen = joint.transformed(T)
    there = np.kron(np.eye(n), seen.basis.T @ T[:3, :3] @ joint.basis) @ delta
    one, other = joint.plus(delta).transformed(T), seen.plus(there)
    assert same_line(one, other)
    assert np.allclose(spread(one), spread(other), atol=1e-12)


def test_a_pivot_moves_along_its_axis_with_the_uncertainty_of_sampled_axes() -> None:
    rng = np.random.default_rng(1)
    root = rng.normal(size=(4, 4)) * [0.01, 0.01, 0.003, 0.003]
    joint = Revolute(
        np.array([0.0, 0.0, 1.0]),
        covariance=root.T @ root,
        sigma=JointSigma(0.01, 0.003, 0.01),
        pivot=np.array([0.1, 0.2, 0.3]),
    )
    moved = joint.with_pivot([0.5, 0.2, 1.9])
    assert np.allclose(moved.pivot, [0.1, 0.2, 1.9])
    assert np.allclose(moved.pose(0.7), joint.pose(0.7))
    sampled = [joint.plus(d) for d in rng.multivariate_normal(np.zeros(4), root.T @ root, size=5000)]
    axes, pivots = np.array([s.axis for s in sampled]), np.array([s.pivot for s in sampled])
    # where each sampled axis meets the plane through the moved pivot
    t = (moved.pivot[2] - pivots[:, 2]) / axes[:, 2]
    shifts = (pivots + t[:, None] * axes - moved.pivot) @ joint.basis
    assert moved.covariance is not None
    assert np.allclose(np.cov(shifts.T), moved.covariance[2:, 2:], rtol=0.1, atol=1e-6)
    assert moved.sigma is not None
    assert moved.sigma.pivot == pytest.approx(np.sqrt(shifts.var(axis=0).mean()), rel=0.05)
    back = moved.with_pivot(joint.pivot)
    assert back.covariance is not None
    assert np.allclose(back.covariance, joint.covariance)


def test_a_slide_has_no_pivot_to_move() -> None:
    joint = Prismatic(np.array([1.0, 0.0, 0.0]))
    assert joint.with_pivot([1.0, 2.0, 3.0]) is joint


@pytest.mark.parametrize("kind", KINDS)
def test_sigma_is_one_standard_deviation_per_direction(kind: str) -> None:
    """Monte Carlo: of what `plus` does to joints whose error is alike in every direction."""
    rng = np.random.default_rng(4)
    joint = joint_of(kind, rng)
    sizes = np.array([0.02, 0.02, 0.004, 0.004])[: 2 if kind == "prismatic" else 4]
    sigma = JointSigma.of(np.diag(sizes**2), 0.03)
    drawn = [joint.plus(sizes * rng.normal(size=len(sizes))) for _ in range(4000)]
    off = np.array([d.minus(joint) for d in drawn])
    assert sigma.axis == pytest.approx(0.02)
    assert np.allclose(off[:, :2].std(axis=0), sigma.axis, rtol=0.05)
    assert sigma.state == 0.03
    if kind == "prismatic":
        assert sigma.pivot is None
    else:
        assert sigma.pivot == pytest.approx(0.004)
        assert np.allclose(off[:, 2:].std(axis=0), 0.004, rtol=0.05)


def test_what_has_no_difference_is_refused() -> None:
    slide, hinge = Prismatic(np.array([1.0, 0, 0])), Revolute(np.array([1.0, 0, 0]), pivot=np.zeros(3))
    with pytest.raises(SceneError, match="a revolute joint minus a prismatic one"):
        hinge.minus(slide)
    with pytest.raises(SceneError, match="right angles"):
        replace(hinge, axis=np.array([0, 1.0, 0]), pivot=np.array([1.0, 0, 0])).minus(hinge)


@pytest.mark.parametrize("kind", KINDS)
def test_poses_of_many_states_are_those_of_each(kind: str) -> None:
    joint = joint_of(kind, np.random.default_rng(5))
    states = np.array([-0.7, 0.0, 1e-9, 0.4, np.pi])
    assert np.array_equal(joint.poses(states), np.stack([joint.pose(float(s)) for s in states]))
    assert joint.poses(0.4).shape == (1, 4, 4)
