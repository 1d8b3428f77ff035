"""Part-pose graph: the edge convention, exactness, analytic derivatives, confidences, the noise scale."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import minimize_scalar

from benchmarks.scenes.tracks import minimum_jerk, moved_points, part_poses
from recon.interaction.joints.config import JointConfig
from recon.interaction.joints.fit_tracks import fit_motion
from recon.interaction.joints.observations import Kind, Model, Observations
from recon.interaction.joints.pose_graph.bundle import _covariance, refine_poses
from recon.interaction.joints.pose_graph.edges import (
    PoseEdges,
    edges_from_poses,
    edges_from_tracks,
    graph_pairs,
)
from recon.interaction.joints.pose_graph.fit_tracks import pose_graph_of_tracks
from recon.interaction.joints.pose_graph.solver import (
    PoseGraph,
    PoseGraphConfig,
    closed_form_start,
    edge_costs,
    edge_errors,
    error_jacobians,
    solve_pose_graph,
)
from tests.laws import EXACT, part_points, random_joint
from twin import geometry as geo
from twin.errors import ConfigError, InputError, ReconstructionError
from twin.scene import Prismatic, Revolute

KINDS: tuple[Kind, Kind] = ("prismatic", "revolute")


def truth_graph(joint: Prismatic | Revolute, state: np.ndarray) -> PoseGraph:
    pivot = np.zeros(3)
    if isinstance(joint, Revolute):
        pivot = joint.pivot - joint.axis * (joint.axis @ joint.pivot)
    return PoseGraph(
        joint.kind, joint.axis, pivot, state, np.ones(0), np.ones(0, dtype=bool), 1.0, np.zeros((0, 0))
    )


def world_edges(
    kind: Kind, seed: int = 0, frames: int = 30, noise: float = 0.0, noise_rad: float = 0.0
) -> tuple[Prismatic | Revolute, np.ndarray, PoseEdges]:
    """Edges in coordinates that are the world's at state 0, so the true joint is the graph's own."""
    rng = np.random.default_rng(seed)
    joint = random_joint(rng, kind)
    state = (0.4 if kind == "prismatic" else 1.2) * minimum_jerk(frames)
    poses = joint.poses(state)
    scale = np.array([noise] * 3 + [noise_rad] * 3)
    poses = poses @ geo.exp_se3(rng.normal(0, 1, (frames, 6)) * scale)
    return joint, state, edges_from_poses(poses, graph_pairs(frames, 10), 0.005, 0.05)


def line_error(graph: PoseGraph, joint: Prismatic | Revolute) -> tuple[float, float]:
    turned = geo.line_angle(graph.axis, joint.axis)
    shifted = (
        geo.point_line_distance(graph.pivot, joint.pivot, joint.axis) if isinstance(joint, Revolute) else 0.0
    )
    return turned, shifted


@pytest.mark.parametrize("kind", KINDS)
def test_edge_convention(kind: Kind) -> None:
    """T_parti_partj = T_world_parti^-1 T_world_partj leaves no residual; its inverse leaves twice the
    motion."""
    joint, state, edges = world_edges(kind)
    poses = joint.poses(state)
    i, j = int(edges.first[40]), int(edges.second[40])
    np.testing.assert_allclose(edges.T_parti_partj[40], geo.invert_pose(poses[i]) @ poses[j], atol=1e-12)
    truth = truth_graph(joint, state)
    assert np.abs(edge_errors(edges, truth)).max() < 1e-10
    wrong = replace(edges, T_parti_partj=geo.invert_pose(edges.T_parti_partj))
    motion = np.abs(state[edges.second] - state[edges.first])
    size = np.linalg.norm(edge_errors(wrong, truth)[:, : 3 if kind == "prismatic" else 6][:, -3:], axis=1)
    np.testing.assert_allclose(size, 2 * motion, atol=1e-9)


@pytest.mark.parametrize("kind", KINDS)
def test_exact_edges_give_zero(kind: Kind) -> None:
    joint, state, edges = world_edges(kind, seed=1)
    graph = solve_pose_graph(edges, len(state), kind)
    turned, shifted = line_error(graph, joint)
    assert turned < EXACT
    assert shifted < EXACT
    sign = np.sign(graph.axis @ joint.axis)
    np.testing.assert_allclose(sign * graph.state, state, atol=EXACT)
    assert edge_costs(edges, graph).max() < 1e-9
    assert graph.kept.all()
    assert abs(graph.axis @ graph.pivot) < 1e-12  # the gauge a . p = 0
    unknowns = 2 if kind == "prismatic" else 4  # N + 2 and N + 4
    assert graph.covariance.shape == (unknowns + len(state),) * 2


@pytest.mark.parametrize("kind", KINDS)
def test_closed_form_start_is_near(kind: Kind) -> None:
    joint, _, edges = world_edges(kind, seed=2, noise=0.002, noise_rad=0.01)
    start = closed_form_start(edges, 30, kind)
    turned, shifted = line_error(start, joint)
    assert turned < 0.03
    assert shifted < 0.03


@pytest.mark.parametrize("kind", KINDS)
def test_jacobians_match_differences(kind: Kind) -> None:
    joint, state, edges = world_edges(kind, seed=3, noise=0.02, noise_rad=0.1)
    graph = truth_graph(joint, state + 0.05 * np.sin(np.arange(len(state))))
    _, by_joint, by_distance = error_jacobians(edges, graph)
    basis = geo.orthogonal_basis(graph.axis)[:, :2]
    step = 1e-6

    def moved(column: int, h: float) -> PoseGraph:
        axis, pivot = graph.axis, graph.pivot
        if column < 2:
            axis = geo.exp_so3(h * basis[:, column]) @ axis
        else:
            pivot = pivot + h * basis[:, column - 2]
        return replace(graph, axis=axis, pivot=pivot)

    for column in range(by_joint.shape[2]):
        numeric = (edge_errors(edges, moved(column, step)) - edge_errors(edges, moved(column, -step))) / (
            2 * step
        )
        np.testing.assert_allclose(by_joint[..., column], numeric, atol=2e-7)
    late = replace(graph, state=graph.state + step * np.arange(len(state)))
    early = replace(graph, state=graph.state - step * np.arange(len(state)))
    numeric = (edge_errors(edges, late) - edge_errors(edges, early)) / (2 * step)
    gap = (edges.second - edges.first)[:, None]
    np.testing.assert_allclose(by_distance * gap, numeric, atol=2e-7 * len(state))


@pytest.mark.parametrize("kind", KINDS)
def test_confidences_are_the_minimisers_of_the_paper_s_terms(kind: Kind) -> None:
    """Those of the solved graph, edge by edge: loops as l f + mu (sqrt(l) - 1)^2 has its least, consecutive
    edges fully trusted."""
    _, state, edges = world_edges(kind, seed=3, noise=0.004, noise_rad=0.01)
    config = PoseGraphConfig()
    graph = solve_pose_graph(edges, len(state), kind, config)
    costs = edge_costs(edges, graph) / graph.scale**2
    assert np.all(graph.confidence[~edges.loop] == 1.0)
    loops = np.flatnonzero(edges.loop)
    assert np.ptp(costs[loops]) > 1.0
    for k in loops[:: max(1, len(loops) // 20)]:

        def term(root: float, cost: float = float(costs[k])) -> float:
            return root**2 * cost + config.mu * (root - 1) ** 2

        best = minimize_scalar(term, bounds=(0, 1), method="bounded", options={"xatol": 1e-9})
        assert graph.confidence[k] == pytest.approx(best.x**2, abs=1e-5)


@pytest.mark.parametrize("kind", KINDS)
def test_wrong_loops_are_doubted_and_pruned(kind: Kind) -> None:
    joint, state, edges = world_edges(kind, seed=4, noise=0.002, noise_rad=0.005)
    rng = np.random.default_rng(4)
    wrong = edges.loop & (rng.random(len(edges)) < 0.3)
    poses = edges.T_parti_partj.copy()
    poses[wrong] = poses[wrong] @ geo.exp_se3(rng.normal(0, 0.3, (int(wrong.sum()), 6)))
    graph = solve_pose_graph(replace(edges, T_parti_partj=poses), len(state), kind)
    clean = solve_pose_graph(edges, len(state), kind)
    assert np.degrees(line_error(graph, joint)[0]) < np.degrees(line_error(clean, joint)[0]) + 0.3
    assert not graph.kept[wrong].any()
    assert graph.kept[~wrong].mean() > 0.9
    assert graph.confidence[wrong].max() < 0.3


def test_static_wrong_loops_do_not_freeze_the_part() -> None:
    joint, state, edges = world_edges("revolute", seed=5, noise=0.002, noise_rad=0.005)
    rng = np.random.default_rng(5)
    wrong = edges.loop & (rng.random(len(edges)) < 0.3)
    poses = np.where(wrong[:, None, None], np.eye(4), edges.T_parti_partj)
    graph = solve_pose_graph(replace(edges, T_parti_partj=poses), len(state), "revolute")
    assert np.degrees(line_error(graph, joint)[0]) < 1.0
    assert abs(graph.state[-1]) == pytest.approx(state[-1], abs=0.02)


def test_the_noise_scale_comes_from_the_data() -> None:
    """Information that is wrong by a factor changes the reported scale, not the answer."""
    joint, state, edges = world_edges("revolute", seed=6, noise=0.004, noise_rad=0.02)
    graph = solve_pose_graph(edges, len(state), "revolute")
    other = solve_pose_graph(replace(edges, information=100.0 * edges.information), len(state), "revolute")
    np.testing.assert_allclose(other.state, graph.state, atol=1e-5)
    assert other.scale == pytest.approx(10.0 * graph.scale, rel=1e-3)
    assert line_error(other, joint)[0] == pytest.approx(line_error(graph, joint)[0], abs=1e-5)


def test_uncertainty_is_honest() -> None:
    errors = []
    for seed in range(16):
        joint, state, edges = world_edges("revolute", seed=seed, noise=0.004, noise_rad=0.02)
        graph = solve_pose_graph(edges, len(state), "revolute")
        errors.append(line_error(graph, joint)[0] / np.sqrt(np.trace(graph.covariance[:2, :2])))
    assert 0.6 < np.sqrt(np.mean(np.square(errors))) < 1.6


@pytest.mark.parametrize("kind", KINDS)
def test_edges_from_tracks(kind: Kind) -> None:
    rng = np.random.default_rng(7)
    joint = random_joint(rng, kind)
    state = (0.3 if kind == "prismatic" else 1.0) * minimum_jerk(25)
    rest = part_points(rng, joint, 40)
    visible = rng.random((25, 40)) < 0.8
    exact = edges_from_tracks(moved_points(joint, state, rest), visible, graph_pairs(25, 6), 0.003)
    graph = solve_pose_graph(exact, 25, kind)
    assert line_error(graph, joint)[0] < 1e-6
    noisy = moved_points(joint, state, rest) + rng.normal(0, 0.003, (25, 40, 3))
    noisy[:, ::4] += rng.normal(0, 0.3, (25, 10, 3))  # a quarter of the tracks is wild
    graph = solve_pose_graph(edges_from_tracks(noisy, visible, graph_pairs(25, 6), 0.003), 25, kind)
    assert np.degrees(line_error(graph, joint)[0]) < 0.6
    assert 0.5 < graph.scale < 2.0  # the information of the correspondences has the right size


def test_an_edge_knows_as_much_as_its_correspondences() -> None:
    """Nearly all of those that are only noisy count: n / (2 sigma^2) for each shift."""
    rng = np.random.default_rng(8)
    joint = random_joint(rng, "prismatic")
    points = moved_points(joint, np.linspace(0, 0.2, 10), rng.uniform(-0.4, 0.4, (100, 3)))
    points = points + rng.normal(0, 0.003, points.shape)
    edges = edges_from_tracks(points, np.ones((10, 100), dtype=bool), graph_pairs(10, 6), 0.003)
    shifts = np.trace(edges.information[:, :3, :3], axis1=1, axis2=2) / 3.0 * 2.0 * 0.003**2
    assert len(edges) == len(graph_pairs(10, 6))
    assert 95 < shifts.mean() <= 100


@pytest.mark.parametrize("rho", [0.3, 0.6])
def test_errors_that_repeat_from_pose_to_pose_widen_the_covariance(rho: float) -> None:
    """The same errors in their own order and shuffled: (1 + rho) / (1 - rho) times the variance."""
    rng = np.random.default_rng(9)
    joint, n = random_joint(rng, "revolute"), 1500
    assert isinstance(joint, Revolute)
    error = rng.normal(size=(n, 6))
    for t in range(1, n):
        error[t] = rho * error[t - 1] + np.sqrt(1 - rho**2) * error[t]
    error *= np.array([0.002] * 3 + [0.01] * 3)
    state, rest = np.linspace(0, 1.2, n), geo.make_pose(translation=joint.pivot + [0.3, 0.1, 0.2])
    of_joint = [
        np.trace(_covariance("revolute", joint.axis, joint.pivot, state, rest, e, 0.002, 0.01)[:4, :4])
        for e in (error, rng.permutation(error))
    ]
    assert of_joint[0] / of_joint[1] == pytest.approx((1 + rho) / (1 - rho), rel=0.1)


def test_poses_are_refined_until_nothing_changes() -> None:
    """From starts a fraction of the noise away, so near that the noise itself has settled, to one
    solution."""
    rng = np.random.default_rng(10)
    joint, state = random_joint(rng, "revolute"), 1.2 * minimum_jerk(60)
    assert isinstance(joint, Revolute)
    rest = geo.make_pose(translation=joint.pivot + [0.3, 0.1, 0.2])
    poses = joint.poses(state) @ rest @ geo.exp_se3(rng.normal(0, 0.003, (60, 6)))
    best = refine_poses(poses, "revolute", joint.axis, joint.pivot, state, rest, iterations=200)
    for tilt in (-0.003, 0.002):
        axis = geo.exp_so3(tilt * geo.orthogonal_basis(best.axis)[:, 0]) @ best.axis
        again = refine_poses(poses, "revolute", axis, best.pivot, best.state, best.T_world_rest)
        assert geo.line_angle(again.axis, best.axis) < 1e-5


def test_the_noise_of_tracks_counts_what_the_graph_fitted() -> None:
    """Six frames: a sixth of the observations goes into the landmarks."""
    rng = np.random.default_rng(13)
    joint, state = random_joint(rng, "prismatic"), np.linspace(0, 0.3, 6)
    points = moved_points(joint, state, rng.uniform(-0.4, 0.4, (800, 3))) + rng.normal(0, 0.003, (6, 800, 3))
    obs = Observations.of(points, np.ones((6, 800), dtype=bool))
    bundle = pose_graph_of_tracks(obs, Model("prismatic", joint.axis, np.zeros(3), state), 0.003)
    assert bundle.sigma == pytest.approx(0.003, rel=0.03)


def test_errors_teach() -> None:
    joint, state, edges = world_edges("revolute")
    with pytest.raises(ReconstructionError, match="reaches"):
        solve_pose_graph(edges, len(state) + 2, "revolute")
    still = edges_from_poses(np.tile(np.eye(4), (5, 1, 1)), graph_pairs(5, 2), 0.01, 0.01)
    with pytest.raises(ReconstructionError, match="do not move"):
        solve_pose_graph(still, 5, "prismatic")
    with pytest.raises(InputError, match="two different frames"):
        replace(edges, second=edges.first)
    with pytest.raises(ConfigError, match="mu"):
        PoseGraphConfig(mu=-1.0)
    assert part_poses(joint, state, np.random.default_rng(0)).shape == (len(state), 4, 4)


def test_pairs_hold_every_consecutive_one_and_never_a_frame_twice() -> None:
    pairs = graph_pairs(40, 5)
    assert (np.diff(pairs, axis=1) > 0).all()
    assert len({tuple(p) for p in pairs.tolist()}) == len(pairs)
    consecutive = pairs[np.diff(pairs, axis=1)[:, 0] == 1]
    assert len(consecutive) == 39
    assert len(pairs) == 39 + 200


@pytest.mark.parametrize("kind", KINDS)
def test_the_joint_of_tracks_by_the_pose_graph(kind: Kind) -> None:
    """`joints.method = "pose_graph"` finds the exact joint of exact tracks, and under noise one within its
    own sigma."""
    rng = np.random.default_rng(11)
    joint = random_joint(rng, kind)
    state = (0.3 if kind == "prismatic" else 1.0) * minimum_jerk(30)
    rest = part_points(rng, joint, 40)
    points, config = moved_points(joint, state, rest), JointConfig(method="pose_graph")
    exact = fit_motion(points, config=config)
    assert geo.line_angle(exact.joint.axis, joint.axis) < 1e-6
    assert exact.state == pytest.approx(state - state[0], abs=1e-6)
    noisy = fit_motion(points + rng.normal(0, 0.003, points.shape), config=config)
    assert noisy.joint.kind == kind
    assert noisy.joint.sigma is not None
    assert geo.line_angle(noisy.joint.axis, joint.axis) < 4.0 * np.sqrt(2.0) * noisy.joint.sigma.axis
    if isinstance(joint, Revolute) and isinstance(noisy.joint, Revolute):
        off = geo.line_distance(noisy.joint.pivot, noisy.joint.axis, joint.pivot, joint.axis)
        assert off < 4.0 * np.sqrt(2.0) * (noisy.joint.sigma.pivot or 0.0)
    assert noisy.state == pytest.approx(state - state[0], abs=0.01)


def test_frames_that_share_no_tracks_with_the_others_leave_the_graph() -> None:
    """Tracks that end at frame 20 and others that begin there: the larger piece is fitted, the states of the
    rest are held."""
    rng = np.random.default_rng(12)
    joint = random_joint(rng, "prismatic")
    state = 0.3 * minimum_jerk(30)
    points = moved_points(joint, state, rng.uniform(-0.4, 0.4, (40, 3)))
    seen = np.zeros((30, 40), dtype=bool)
    seen[:20, :20], seen[20:, 20:] = True, True
    obs = Observations.of(points, seen)
    bundle = pose_graph_of_tracks(obs, Model("prismatic", joint.axis, np.zeros(3), state), 0.003)
    assert bundle.model.state[:20] == pytest.approx(state[:20] - state[0], abs=1e-6)
    assert bundle.model.state[20:] == pytest.approx(np.full(10, bundle.model.state[19]))
    assert bundle.covariance.shape == (32, 32)
    with pytest.raises(ReconstructionError, match="frames share"):
        pose_graph_of_tracks(obs.take(np.arange(5)), bundle.model, 0.003)
