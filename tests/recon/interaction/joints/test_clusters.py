"""Clusters of tracks: several parts at once, hands, backgrounds, and the shapes of single tracks."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import least_squares

from benchmarks.scenes.tracks import TrackScene, minimum_jerk, moved_points, together, track_scene
from recon.interaction.joints.clustering.clusters import Cluster, ClusterConfig, cluster_tracks
from recon.interaction.joints.clustering.line_arc import track_shapes
from recon.interaction.joints.observations import Observations
from tests.laws import axis_error_deg
from twin.errors import ConfigError
from twin.geometry import Array
from twin.scene import Prismatic, Revolute


def matches(cluster: Cluster, scene: TrackScene, offset: int) -> tuple[float, int]:
    """Share of the scene's part that the cluster holds, and how many others it holds."""
    truth = np.zeros(len(cluster.members), dtype=bool)
    truth[offset : offset + len(scene.member)] = scene.member
    return float((cluster.members & truth).sum() / truth.sum()), int((cluster.members & ~truth).sum())


@pytest.mark.parametrize("seed", [0, 1, 3])
def test_a_door_and_a_drawer_at_once_are_two_clusters(seed: int) -> None:
    door = track_scene("door", "mixed", seed=seed, tracks=120)
    drawer = track_scene("drawer", "mixed", seed=seed + 50, tracks=120)
    clusters = cluster_tracks(*together(door, drawer))
    assert sorted(c.kind for c in clusters) == ["prismatic", "revolute"]
    for cluster in clusters:
        scene, offset = (door, 0) if cluster.kind == "revolute" else (drawer, 120)
        share, foreign = matches(cluster, scene, offset)
        assert share > 0.8
        assert foreign == 0
        assert axis_error_deg(cluster.joint, scene.joint) < 0.5


def test_two_doors_that_turn_alike_are_two_clusters() -> None:
    a, b = track_scene("door", "none", seed=3, tracks=150), track_scene("door", "none", seed=12, tracks=150)
    clusters = cluster_tracks(*together(a, b))
    assert [c.kind for c in clusters] == ["revolute", "revolute"]
    owners = {int(matches(c, b, 150)[0] > 0.5) for c in clusters}
    assert owners == {0, 1}


def test_parallel_drawers_pulled_by_different_lengths_are_two_clusters() -> None:
    a = track_scene("drawer", "none", seed=2, tracks=100)
    b = track_scene("drawer", "none", seed=2, tracks=100, travel=0.15)
    clusters = cluster_tracks(*together(a, b))
    assert len(clusters) == 2
    assert matches(clusters[0], a, 0)[0] > 0.8  # the longer way scores higher
    assert matches(clusters[1], b, 100)[0] > 0.7


def test_a_hand_is_no_part_of_its_own() -> None:
    scene = track_scene("door", "hand", seed=1, outlier_share=0.4)
    clusters = cluster_tracks(scene.points, scene.visible)
    assert clusters[0].kind == "revolute"
    assert matches(clusters[0], scene, 0)[0] > 0.85
    assert len(clusters) == 1


def test_nothing_moves_nothing_is_found() -> None:
    scene = track_scene("door", "none", travel=0.0)
    assert cluster_tracks(scene.points, scene.visible) == []
    assert cluster_tracks(np.zeros((10, 0, 3)), np.zeros((10, 0), dtype=bool)) == []


def test_a_part_has_a_share_of_what_moves() -> None:
    """A drawer with ten tracks beside a door with 290: fewer than one in twenty."""
    door, drawer = (
        track_scene("door", "none", seed=3, tracks=290),
        track_scene("drawer", "none", seed=7, tracks=10),
    )
    points, seen = together(door, drawer)
    assert [c.kind for c in cluster_tracks(points, seen)] == ["revolute"]
    kinds = [c.kind for c in cluster_tracks(points, seen, config=ClusterConfig(min_share=0.01))]
    assert kinds == ["revolute", "prismatic"]


def test_arcs_are_those_of_least_squares() -> None:
    """Short noisy arcs, where an algebraic circle is far too small, against scipy's geometric ones."""
    rng = np.random.default_rng(5)
    hinge = Revolute(axis=np.array([0.0, 0, 1]), pivot=np.zeros(3))
    rest = np.array([0.5, 0.0, 0.0]) + rng.uniform(-0.1, 0.1, (20, 3))
    points = moved_points(hinge, 0.7 * minimum_jerk(40), rest)
    points[..., :2] += rng.normal(0, 0.004, points[..., :2].shape)
    found = track_shapes(Observations.of(points, np.ones((40, 20), dtype=bool)), 0.001)
    assert found.arc.all()
    for k in range(20):
        xy = points[:, k, :2]

        def off(circle: Array, xy: Array = xy) -> Array:
            return np.asarray(np.hypot(*(xy - circle[:2]).T) - circle[2])

        best = least_squares(off, [0.0, 0.0, float(np.linalg.norm(rest[k, :2]))])
        assert found.error[k] == pytest.approx(np.sqrt(np.mean(best.fun**2)), rel=1e-3)


def test_scores_fall() -> None:
    a, b = track_scene("drawer", "none", seed=4, tracks=80), track_scene("door", "none", seed=5, tracks=80)
    scores = [c.score for c in cluster_tracks(*together(a, b))]
    assert scores == sorted(scores, reverse=True)
    assert min(scores) > 0


def shapes(joint: Prismatic | Revolute, rest: Array, noise: float) -> tuple[Array, Array]:
    state = (0.3 if isinstance(joint, Prismatic) else 1.2) * minimum_jerk(40)
    points = moved_points(joint, state, rest) + np.random.default_rng(0).normal(0, noise, (40, len(rest), 3))
    found = track_shapes(Observations.of(points, np.ones((40, len(rest)), dtype=bool)), max(noise, 1e-3))
    return np.asarray(found.arc), found.screw


def test_single_tracks_tell_lines_from_arcs() -> None:
    rng = np.random.default_rng(1)
    rest = np.array([0.4, 0.0, 0.0]) + rng.uniform(-0.1, 0.1, (30, 3))
    hinge = Revolute(axis=np.array([0.0, 0, 1]), pivot=np.zeros(3))
    slide = Prismatic(axis=np.array([0.0, 1, 0]))
    arc, screw = shapes(hinge, rest, 1e-4)
    assert arc.all()
    # every track speaks for the same joint, in the sense of its own motion
    np.testing.assert_allclose(screw, screw.mean(0)[None].repeat(30, 0), atol=0.02)
    assert (screw[:, 5] > 0).all()
    arc, screw = shapes(slide, rest, 1e-4)
    assert not arc.any()
    np.testing.assert_allclose(screw, np.tile([0, 1.0, 0, 0, 0, 0], (30, 1)), atol=0.01)


def test_config_is_checked() -> None:
    with pytest.raises(ConfigError, match="min_size"):
        ClusterConfig(min_size=2)
    with pytest.raises(ConfigError, match="eps_s"):
        ClusterConfig(eps_s=0.0)
