"""The stored pivot lies beside the part, and its uncertainty is that of the axis there."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from recon.assemble import centred
from tests.laws import random_joint
from tests.recon.tiny import box
from twin import geometry as geo
from twin.scene import JointSigma, Prismatic, Revolute


def test_the_pivot_moves_along_the_axis_to_the_part() -> None:
    rng = np.random.default_rng(0)
    joint = random_joint(rng, "revolute")
    mesh = box((0.3, -0.8, 1.4), (0.4, 0.5, 0.02))
    moved = centred(joint, mesh)
    assert isinstance(joint, Revolute)
    assert isinstance(moved, Revolute)
    assert geo.line_distance(joint.pivot, joint.axis, moved.pivot, moved.axis) < 1e-12
    assert abs((mesh.area_centroid - moved.pivot) @ moved.axis) < 1e-12
    assert np.allclose(moved.pose(0.7), joint.pose(0.7))


def test_uncertainty_moves_with_it_as_sampled_axes_do() -> None:
    rng = np.random.default_rng(1)
    root = rng.normal(size=(4, 4)) * [0.01, 0.01, 0.003, 0.003]
    joint = Revolute(
        np.array([0.0, 0.0, 1.0]),
        covariance=root.T @ root,
        sigma=JointSigma(0.01, 0.003, 0.01),
        pivot=np.array([0.1, 0.2, 0.3]),
    )
    moved = centred(joint, box((0.5, 0.2, 1.9), (0.1, 0.1, 0.1)))
    assert isinstance(moved, Revolute)
    basis = geo.orthogonal_basis(joint.axis)[:, :2]
    deltas = rng.multivariate_normal(np.zeros(4), joint.covariance, size=20000)
    axes = joint.axis + np.cross(deltas[:, :2] @ basis.T, joint.axis)
    pivots = joint.pivot + deltas[:, 2:] @ basis.T
    # where each sampled axis meets the plane through the moved pivot
    t = (moved.pivot[2] - pivots[:, 2]) / axes[:, 2]
    shifts = (pivots + t[:, None] * axes - moved.pivot) @ basis
    assert moved.covariance is not None
    assert np.allclose(np.cov(shifts.T), moved.covariance[2:, 2:], rtol=0.1, atol=1e-6)
    assert moved.sigma is not None
    assert moved.sigma.pivot is not None
    assert moved.sigma.pivot > 0.003


def test_a_slide_stays_as_it_is() -> None:
    joint = Prismatic(np.array([1.0, 0.0, 0.0]))
    assert centred(joint, box((1, 1, 1), (1, 1, 1))) is joint
    assert replace(joint, upper=0.2).upper == 0.2
