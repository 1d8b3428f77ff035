"""Joint fits on tracks and poses: exactness, invariance, robustness, the type rule, honest uncertainty."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.sparse import lil_matrix

from benchmarks.scenes.tracks import (
    TrackScene,
    make_part,
    minimum_jerk,
    moved_points,
    moved_scene,
    track_scene,
)
from recon.interaction.joints.fit_tracks import MotionFit, fit_motion, fit_motion_poses
from recon.interaction.joints.hypotheses import joints_of_motion, travel_and_noise
from recon.interaction.joints.observations import Observations
from recon.interaction.joints.type_selection import TypeEvidence, decide
from tests.laws import EXACT, EXACT_DEG, axis_error_deg, pivot_error, random_pose
from twin import geometry as geo
from twin.errors import InputError, ReconstructionError
from twin.geometry import Array
from twin.scene import Revolute


def exact_scene(part: str, seed: int = 0) -> TrackScene:
    return track_scene(part, "none", seed=seed, noise=0.0, tracks=60)  # type: ignore[arg-type]


def fit(scene: TrackScene, **options: object) -> MotionFit:
    return fit_motion(scene.points, scene.visible, **options)  # type: ignore[arg-type]


@pytest.mark.parametrize("part", ["door", "drawer"])
def test_exact_tracks_give_the_exact_joint(part: str) -> None:
    scene = exact_scene(part)
    found = fit(scene)
    assert found.joint.kind == scene.joint.kind
    assert axis_error_deg(found.joint, scene.joint) < EXACT_DEG
    assert np.abs(found.state - scene.state[found.frames]).max() < EXACT
    assert found.residual < EXACT
    assert found.joint.lower == 0.0
    assert found.joint.upper == pytest.approx(scene.joint.upper, rel=1e-3)
    assert found.joint.axis @ scene.joint.axis > 0  # the net motion is positive
    if isinstance(scene.joint, Revolute):
        assert pivot_error(found.joint, scene.joint) < EXACT
    good = found.track_inliers
    np.testing.assert_allclose(found.landmarks[good], scene.rest_points[good], atol=1e-6)
    assert np.isnan(found.landmarks[~good]).all()


@pytest.mark.parametrize("outliers", ["static", "drift", "mixed", "obs"])
@pytest.mark.parametrize("part", ["door", "drawer"])
def test_public_recipe(part: str, outliers: str) -> None:
    for seed in (0, 1):
        scene = track_scene(part, outliers, seed=seed)  # type: ignore[arg-type]
        found = fit(scene)
        assert found.joint.kind == scene.joint.kind
        assert axis_error_deg(found.joint, scene.joint) < 0.5
        error = np.abs(found.state - scene.state[found.frames]).mean()
        assert error < (np.radians(0.5) if part == "door" else 0.003)
        if part == "door":
            assert pivot_error(found.joint, scene.joint) < 0.003
        assert (found.track_inliers & scene.member).sum() > 0.85 * scene.member.sum()
        assert not (found.track_inliers & ~scene.member).any()


@pytest.mark.parametrize(("part", "travel"), [("door", float(np.radians(20))), ("drawer", 0.10)])
def test_small_motion_keeps_its_type(part: str, travel: float) -> None:
    scene = track_scene(part, "mixed", seed=3, travel=travel)  # type: ignore[arg-type]
    found = fit(scene)
    assert found.joint.kind == scene.joint.kind
    # what 5 mm noise allows over so short a motion is about 0.2 degrees: METHOD's sigma / (sqrt(N) std)
    assert axis_error_deg(found.joint, scene.joint) < 0.7


@pytest.mark.parametrize("part", ["door", "drawer"])
def test_mostly_static_background(part: str) -> None:
    scene = track_scene(part, "none", seed=5, background_share=0.8)  # type: ignore[arg-type]
    found = fit(scene)
    assert found.joint.kind == scene.joint.kind
    assert axis_error_deg(found.joint, scene.joint) < 0.5


def test_hand_that_turns_about_the_handle_is_not_the_part() -> None:
    scene = track_scene("door", "hand", seed=2, outlier_share=0.47)
    found = fit(scene)
    assert axis_error_deg(found.joint, scene.joint) < 0.5
    assert pivot_error(found.joint, scene.joint) < 0.005
    hand_taken = (found.track_inliers & ~scene.member).sum() / (~scene.member).sum()
    assert hand_taken < 0.45  # those nearest the grip hardly move against the part
    assert (found.track_inliers & scene.member).sum() > 0.85 * scene.member.sum()


def test_the_number_of_threads_changes_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    scene, found = track_scene("door", "hand", seed=2, outlier_share=0.3), []
    for count in ("1", "2"):
        monkeypatch.setenv("OMP_NUM_THREADS", count)
        found.append(fit(scene))
    one, two = found
    assert np.array_equal(one.joint.axis, two.joint.axis)
    assert np.array_equal(one.state, two.state)
    assert np.array_equal(one.track_inliers, two.track_inliers)


def naive_axis(points: Array, visible: NDArray[np.bool_]) -> Array:
    """The fit that must not come back: chained frame-to-frame motions start a soft_l1 refinement against each
    track's first observation."""
    frames = len(points)
    pose, poses = np.eye(4), [np.eye(4)]
    for frame in range(frames - 1):
        both = visible[frame] & visible[frame + 1]
        pose = geo.fit_rigid(points[frame, both], points[frame + 1, both]) @ pose
        poses.append(pose)
    turns = geo.log_so3(np.stack(poses)[:, :3, :3])
    axis = geo.unit(turns[-1])
    pivot = np.linalg.lstsq(np.eye(3) - pose[:3, :3], pose[:3, 3], rcond=None)[0]
    first = np.asarray(visible.argmax(axis=0), dtype=np.int64)
    t, k = (np.asarray(index) for index in np.nonzero(visible))
    start = points[first, np.arange(points.shape[1])][k]

    def residual(x: Array) -> Array:
        a, s = x[:3] / np.linalg.norm(x[:3]), (x[6:][t] - x[6:][first[k]])[:, None]
        d = start - x[3:6]
        moved = d * np.cos(s) + np.cross(a, d) * np.sin(s) + a * (d @ a)[:, None] * (1 - np.cos(s))
        return np.asarray((points[t, k] - moved - x[3:6]).ravel())

    rows = np.arange(3 * len(t))
    pattern = lil_matrix((3 * len(t), 6 + frames), dtype=int)
    pattern[:, :6] = 1
    pattern[rows, 6 + np.repeat(t, 3)] = 1
    pattern[rows, 6 + np.repeat(first[k], 3)] = 1
    x0 = np.concatenate([axis, pivot, turns @ axis])
    out = least_squares(residual, x0, loss="soft_l1", f_scale=0.01, jac_sparsity=pattern, max_nfev=15)
    return geo.unit(out.x[:3])


def test_door_on_which_a_chained_start_fails() -> None:
    scene = track_scene("door", "obs", seed=1)
    travel, noise = travel_and_noise(Observations.of(scene.points, scene.visible))
    moving = travel > 5 * noise
    naive = naive_axis(scene.points[:, moving], scene.visible[:, moving])
    assert np.degrees(geo.line_angle(naive, scene.joint.axis)) > 20.0
    assert axis_error_deg(fit(scene).joint, scene.joint) < 0.2


@pytest.mark.parametrize("noise", [0.0, 0.005])
@pytest.mark.parametrize("part", ["door", "drawer"])
def test_moving_the_scene_moves_the_joint(part: str, noise: float) -> None:
    scene = track_scene(part, "none" if noise == 0 else "mixed", seed=4, noise=noise)  # type: ignore[arg-type]
    T_new_old = random_pose(np.random.default_rng(4))
    here, there = fit(scene), fit(moved_scene(scene, T_new_old))
    expected = here.joint.transformed(T_new_old)
    # with noise the random triples see other neighbours in a tie; both answers lie far inside the uncertainty
    slack = 1.0 if noise == 0 else 1e3
    assert axis_error_deg(there.joint, expected) < slack * EXACT_DEG
    np.testing.assert_allclose(there.state, here.state, atol=slack * EXACT)
    assert there.joint.axis @ expected.axis > 0
    if isinstance(expected, Revolute):
        assert pivot_error(there.joint, expected) < slack * EXACT


@pytest.mark.parametrize("part", ["door", "drawer"])
def test_reversed_time_flips_the_motion(part: str) -> None:
    scene = track_scene(part, "none", seed=6, noise=0.0)  # type: ignore[arg-type]
    found = fit_motion(scene.points[::-1], scene.visible[::-1])
    assert found.joint.axis @ scene.joint.axis < -1 + 1e-9
    upper = float(scene.state.max())
    np.testing.assert_allclose(found.state, upper - scene.state[::-1][found.frames], atol=1e-6)
    assert found.joint.upper == pytest.approx(upper, rel=1e-3)


def test_there_and_back_is_positive_from_the_first_rest() -> None:
    rng = np.random.default_rng(0)
    joint, rest = make_part("drawer", 0.3, 80, rng)
    share = minimum_jerk(60, 6, 26) - minimum_jerk(60, 32, 52)
    points = moved_points(joint, 0.3 * share, rest) + rng.normal(0, 0.002, (60, 80, 3))
    found = fit_motion(points, np.ones((60, 80), dtype=bool))
    assert found.joint.axis @ joint.axis > 0.99
    assert np.abs(found.state - 0.3 * share).max() < 0.004
    assert found.joint.lower == 0.0


def test_near_zero_motion_says_so() -> None:
    scene = track_scene("door", "none", travel=float(np.radians(0.2)))
    with pytest.raises(ReconstructionError, match="almost nothing moves"):
        fit(scene)
    nothing = np.zeros(scene.visible.shape, dtype=bool)
    with pytest.raises(ReconstructionError, match="almost nothing moves"):
        fit_motion(scene.points, nothing)


def test_tracks_that_share_no_joint_are_refused() -> None:
    rng = np.random.default_rng(1)
    ways = geo.unit(rng.normal(size=(200, 3)))
    share = np.stack(
        [minimum_jerk(40, f, f + 6) for f in rng.integers(2, 30, 200)], axis=1
    )  # each at its own time
    points = rng.uniform(-1, 1, (200, 3)) + 0.3 * share[:, :, None] * ways
    with pytest.raises(ReconstructionError, match="no slide or hinge"):
        fit_motion(points, np.ones((40, 200), dtype=bool))


def test_a_joint_that_carries_too_small_a_share_of_what_moves_is_refused() -> None:
    """Seventy tracks of a drawer, and thirty that each move on their own."""
    drawer = track_scene("drawer", "none", seed=3, tracks=70, noise=0.001)
    rng = np.random.default_rng(2)
    rigid = moved_points(drawer.joint, drawer.state, drawer.rest_points)

    def with_others(count: int, members: int) -> np.ndarray:
        share = np.stack([minimum_jerk(40, f, f + 6) for f in rng.integers(2, 30, count)], axis=1)
        start = drawer.rest_points[0] + rng.uniform(-1, 1, (count, 3))
        ways = geo.unit(rng.normal(size=(count, 3)))
        return np.concatenate([rigid[:, :members], start + 0.25 * share[:, :, None] * ways], axis=1)

    points = with_others(30, 70)
    found = fit_motion(points, np.ones(points.shape[:2], dtype=bool))
    assert found.track_inliers[:70].all()
    assert axis_error_deg(found.joint, drawer.joint) < 1.0
    alone = with_others(116, 4)
    with pytest.raises(ReconstructionError, match="carries 6 of them together"):
        fit_motion(alone, np.ones(alone.shape[:2], dtype=bool))


@pytest.mark.parametrize("part", ["door", "drawer"])
def test_all_of_what_is_only_noisy_agrees(part: str) -> None:
    """Less than 1 in 10 000 of normal errors in three coordinates is beyond 5.2 standard deviations of
    one."""
    scene = track_scene(part, "none", seed=2)  # type: ignore[arg-type]
    assert fit(scene).inliers > 0.995


@pytest.mark.parametrize(("angle", "kinds"), [(5e-4, ["prismatic"]), (2e-3, ["prismatic", "revolute"])])
def test_a_rigid_motion_speaks_for_a_hinge_when_it_turns_by_a_milliradian(
    angle: float, kinds: list[str]
) -> None:
    hinge = Revolute(geo.unit(np.array([0.2, -0.1, 1.0])), pivot=np.array([0.3, 0.1, 0.5]))
    before = hinge.pivot + np.random.default_rng(0).uniform(-0.4, 0.4, (20, 3)) + [0.5, 0.0, 0.0]
    found = joints_of_motion(hinge.pose(angle), before, geo.transform(hinge.pose(angle), before))
    assert [h.kind for h in found] == kinds
    for h in (h for h in found if h.kind == "revolute"):
        assert geo.line_angle(h.axis, hinge.axis) < 1e-6
        assert geo.line_distance(h.pivot, h.axis, hinge.pivot, hinge.axis) < 1e-6


def test_frames_with_few_tracks_do_not_jump() -> None:
    scene = track_scene("door", "none", seed=7)
    visible = scene.visible.copy()
    for frame in (15, 16, 17, 22):
        seen = np.flatnonzero(visible[frame])
        visible[frame, seen[3:]] = False
    found = fit_motion(scene.points, visible)
    error = np.degrees(np.abs(found.state - scene.state[found.frames]))
    assert error.max() < 2.0
    assert error.mean() < 0.3


def test_confidence_removes_what_it_distrusts() -> None:
    scene = track_scene("drawer", "none", seed=8, noise=0.0)
    rng = np.random.default_rng(8)
    wild = rng.random(scene.visible.shape) < 0.3
    points = scene.points + wild[..., None] * rng.normal(0, 0.3, scene.points.shape)
    found = fit_motion(points, scene.visible, confidence=np.where(wild, 0.0, 1.0))
    assert axis_error_deg(found.joint, scene.joint) < EXACT_DEG


def test_the_user_can_name_the_type() -> None:
    scene = track_scene("drawer", "none", seed=9)
    assert fit(scene).type_source.startswith("motion")
    named = fit(scene, joint_type="revolute")
    assert named.joint.kind == "revolute"
    assert named.type_source == "given"


@pytest.mark.parametrize(
    ("evidence", "kind"),
    [
        (TypeEvidence(500.0, 1.0, 0.5), "revolute"),
        (TypeEvidence(15.0, 1.0, 0.5), "prismatic"),
        (TypeEvidence(500.0, float(np.radians(2.9)), 0.5), "prismatic"),
        (TypeEvidence(500.0, 1.0, 3.1), "prismatic"),
        (TypeEvidence(float("inf"), 1.0, 0.5), "revolute"),
    ],
)
def test_type_rule(evidence: TypeEvidence, kind: str) -> None:
    found, why = decide(evidence)
    assert found == kind
    assert "BIC" in why


def test_bad_input_names_the_value() -> None:
    with pytest.raises(InputError, match=r"\(5, 4, 3\)"):
        fit_motion(np.zeros((5, 4, 3)), np.ones((5, 3), dtype=bool))
    with pytest.raises(InputError, match="confidence"):
        fit_motion(np.zeros((5, 4, 3)), np.ones((5, 4), dtype=bool), confidence=np.ones((4, 4)))
    with pytest.raises(InputError, match="infinite"):
        fit_motion(np.full((5, 4, 3), np.inf), np.ones((5, 4), dtype=bool))


def test_uncertainty_is_honest() -> None:
    axis, pivot, state = [], [], []
    for seed in range(10):
        scene = track_scene("door", "mixed", seed=seed, tracks=80)
        found = fit(scene)
        sigma = found.joint.sigma
        assert sigma is not None
        assert sigma.pivot is not None
        axis.append(np.radians(axis_error_deg(found.joint, scene.joint)) / sigma.axis)
        pivot.append(pivot_error(found.joint, scene.joint) / sigma.pivot)
        state.append(
            np.sqrt(np.mean(((found.state - scene.state[found.frames]) / (found.state_sigma + 1e-9)) ** 2))
        )
    for normalised in (axis, pivot, state):
        assert 0.6 < np.sqrt(np.mean(np.square(normalised))) < 1.6


def check_kitchen_logs(folder: Path, names: tuple[str, ...]) -> None:
    for name in names:
        values = np.loadtxt(folder / "real_tracks" / "kitchen" / f"M2U00{name}.log")
        poses = np.tile(np.eye(4), (len(values), 1, 1))
        poses[:, :3, :3] = geo.matrix_from_quat_wxyz(values[:, [6, 3, 4, 5]])
        poses[:, :3, 3] = values[:, :3]
        found = fit_motion_poses(poses)
        slides = name in ("394", "395")
        assert found.joint.kind == ("prismatic" if slides else "revolute"), name
        assert found.residual < (0.001 if slides else 0.0023), name
        if slides:
            assert 0.41 < found.joint.upper < 0.47
        else:
            assert 45 < np.degrees(found.joint.upper) < 100


def test_real_doors_and_drawers(funtwin_data: Path) -> None:
    """Logged kitchen parts: the type, and residuals near those of a published-quality fit."""
    check_kitchen_logs(funtwin_data, ("390", "395", "401"))


@pytest.mark.slow
def test_every_real_door_and_drawer(funtwin_data: Path) -> None:
    check_kitchen_logs(
        funtwin_data, ("389", "390", "391", "392", "393", "394", "395", "396", "397", "401", "403", "404")
    )
