"""Joint fits on poses of a part: exactness, robustness, invariance, errors that teach."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.scenes.tracks import (
    minimum_jerk,
    part_poses,
)
from recon.interaction.joints.fit_tracks import fit_motion_poses
from tests.laws import EXACT, EXACT_DEG, axis_error_deg, pivot_error, random_joint, state_error
from twin import geometry as geo
from twin.errors import InputError, ReconstructionError
from twin.scene import Revolute


@pytest.mark.parametrize("kind", ["prismatic", "revolute"])
def test_exact_poses_give_the_exact_joint(kind: str) -> None:
    rng = np.random.default_rng(11)
    joint = random_joint(rng, kind)
    state = (0.4 if kind == "prismatic" else 1.3) * minimum_jerk(50)
    found = fit_motion_poses(part_poses(joint, state, rng))
    assert found.joint.kind == kind
    assert axis_error_deg(found.joint, joint) < EXACT_DEG
    assert found.joint.axis @ joint.axis > 0
    np.testing.assert_allclose(found.state, state[found.frames], atol=EXACT)
    assert found.residual < EXACT
    if kind == "revolute":
        assert pivot_error(found.joint, joint) < EXACT


@pytest.mark.parametrize("shift", [0.0, 4.0], ids=["near the origin", "far from it"])
def test_the_radius_of_a_hinge_is_the_parts_distance_from_it(shift: float) -> None:
    hinge = Revolute(np.array([0.0, 0.0, 1.0]), pivot=np.array([shift, -shift, 0.5]))
    rest = geo.make_pose(translation=hinge.pivot + [0.3, 0.4, 0.2])
    found = fit_motion_poses(hinge.poses(1.2 * minimum_jerk(40)) @ rest)
    assert found.joint.kind == "revolute"
    assert found.evidence.radius == pytest.approx(0.5, abs=1e-6)


@pytest.mark.parametrize("kind", ["prismatic", "revolute"])
def test_noisy_poses_with_wild_ones(kind: str) -> None:
    rng = np.random.default_rng(12)
    joint = random_joint(rng, kind)
    state = (0.4 if kind == "prismatic" else 1.0) * minimum_jerk(80)
    poses = part_poses(joint, state, rng, noise=0.003, noise_rad=np.radians(1.0), wild_share=0.1)
    poses[3] = np.nan
    numbers = 10 + 2 * np.arange(len(poses))
    found = fit_motion_poses(poses, numbers)
    assert found.joint.kind == kind
    assert axis_error_deg(found.joint, joint) < 1.0
    assert 16 not in found.frames
    assert found.frames.min() >= 10
    assert state_error(found.state, state[(found.frames - 10) // 2]) < (
        0.003 if kind == "prismatic" else 0.02
    )
    assert 0.8 < found.inliers < 0.97


def test_pose_fit_does_not_depend_on_the_part_coordinates() -> None:
    rng = np.random.default_rng(13)
    joint = random_joint(rng, "revolute")
    poses = part_poses(joint, minimum_jerk(40), rng)
    turned = poses @ geo.make_pose(geo.exp_so3([0.4, -1.0, 0.3]), [0.05, 0.02, -0.1])
    a, b = fit_motion_poses(poses), fit_motion_poses(turned)
    assert axis_error_deg(a.joint, b.joint) < EXACT_DEG
    np.testing.assert_allclose(a.state, b.state, atol=EXACT)


def test_pose_errors_teach() -> None:
    with pytest.raises(InputError, match=r"\(N, 4, 4\)"):
        fit_motion_poses(np.eye(4))
    with pytest.raises(InputError, match="orthonormal"):
        fit_motion_poses(np.tile(np.diag([2.0, 1, 1, 1]), (5, 1, 1)))
    with pytest.raises(InputError, match="increasing"):
        fit_motion_poses(np.tile(np.eye(4), (5, 1, 1)), [0, 1, 1, 2, 3])
    with pytest.raises(ReconstructionError, match="do not move"):
        fit_motion_poses(np.tile(np.eye(4), (8, 1, 1)))
