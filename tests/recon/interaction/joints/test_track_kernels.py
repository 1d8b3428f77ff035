"""The kernels beneath the fits to tracks, against closed forms and numpy: states, landmarks, noise, which
tracks follow."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.scenes.tracks import minimum_jerk, moved_points, track_scene
from recon.interaction.joints.config import MIN_TRAVEL, Search
from recon.interaction.joints.hypotheses import Hypothesis, frame_pairs
from recon.interaction.joints.initial_states import states_of
from recon.interaction.joints.inliers import follows, predicted_travel
from recon.interaction.joints.observations import (
    KINDS,
    Kind,
    Model,
    Observations,
    median_landmarks,
    noise_sigma,
    squared_residuals,
    weighted_means,
)
from recon.interaction.joints.sign_and_limits import orient
from recon.interaction.motion.spread import spread
from tests.laws import part_points, random_joint
from twin.scene import Revolute


@pytest.mark.parametrize("kind", KINDS)
def test_states_are_carried_across_a_frame_in_which_nothing_is_seen(kind: Kind) -> None:
    """Most tracks end before it or begin after it; a few span it."""
    rng = np.random.default_rng(3)
    joint = random_joint(rng, kind)
    state = (0.3 if kind == "prismatic" else 1.2) * minimum_jerk(40)
    pivot = joint.pivot if isinstance(joint, Revolute) else np.zeros(3)
    points = moved_points(joint, state, part_points(rng, joint, 30))
    seen = np.ones((40, 30), dtype=bool)
    seen[20:, :13], seen[:20, 13:26], seen[20] = False, False, False
    found = states_of(Observations.of(points, seen), Hypothesis(kind, joint.axis, pivot), 0.003)
    known = np.delete(np.arange(40), 20)
    np.testing.assert_allclose((found - found[0])[known], (state - state[0])[known], atol=1e-9)


def test_landmarks_and_residuals_are_numpys_over_what_was_seen() -> None:
    rng = np.random.default_rng(1)
    z, weight = rng.normal(size=(9, 12, 3)), rng.uniform(0.1, 1.0, (9, 12)) * (rng.random((9, 12)) < 0.7)
    weight[4] = 0.0
    seen = weight > 0
    known = np.delete(np.arange(9), 4)
    gaps = np.where(seen[..., None], z, np.nan)[known]
    np.testing.assert_allclose(median_landmarks(z, weight)[known], np.nanmedian(gaps, axis=1))
    means = (weight[..., None] * z).sum(1)[known] / weight.sum(1)[known, None]
    np.testing.assert_allclose(weighted_means(z, weight)[known], means)
    marks = rng.normal(size=(9, 3))
    square = np.where(seen, ((z - marks[:, None]) ** 2).sum(-1), 0.0)
    np.testing.assert_allclose(squared_residuals(z, weight, marks), square)
    assert not median_landmarks(z, weight)[4].any()


def test_how_far_tracks_stray_is_numpys_over_what_was_seen() -> None:
    rng = np.random.default_rng(2)
    points, seen = rng.normal(size=(12, 9, 3)), rng.random((12, 9)) < 0.7
    seen[:, 4], points[~seen] = False, np.nan
    strays, count = spread(points, seen, 0.9)
    np.testing.assert_array_equal(count, seen.sum(axis=0))
    assert (strays[4], count[4]) == (0.0, 0)
    for k in np.delete(np.arange(9), 4):
        p = points[seen[:, k], k]
        off = np.linalg.norm(p - np.median(p, axis=0), axis=1)
        assert strays[k] == pytest.approx(np.quantile(off, 0.9))


def test_frame_pairs_are_those_between_which_a_quarter_moves() -> None:
    scene = track_scene("drawer", "static", seed=4, outlier_share=0.7, noise=0.0005)
    obs = Observations.of(scene.points, scene.visible)
    pairs = frame_pairs(obs, Search().pairs, MIN_TRAVEL)
    assert len(pairs)
    for i, j in pairs:
        way = np.linalg.norm(scene.points[j] - scene.points[i], axis=1)
        assert np.nanquantile(way, 0.75) > MIN_TRAVEL
    assert frame_pairs(obs, Search().pairs, 1.0).shape == (0, 2)


def test_what_was_fitted_is_counted_in_the_noise() -> None:
    """Means of four observations leave sqrt(3/4) of the noise."""
    rng = np.random.default_rng(2)
    points = rng.normal(0, 0.004, (2000, 4, 3))
    square = ((points - points.mean(axis=1, keepdims=True)) ** 2).sum(-1)
    assert noise_sigma(square, np.ones((2000, 4)), 3 * 2000) == pytest.approx(0.004, rel=0.02)


def test_the_travel_of_a_hinge_is_a_chord() -> None:
    radius, state = np.array([0.1, 0.5]), np.linspace(0.0, 2.0, 30)
    joint = Revolute(np.array([0.0, 0.0, 1.0]), pivot=np.array([0.3, -0.2, 0.0]))
    rest = joint.pivot + np.stack([radius, 0 * radius, [0.2, 0.7]], axis=1)
    obs = Observations.of(moved_points(joint, state, rest), np.ones((30, 2), dtype=bool))
    model = Model("revolute", joint.axis, joint.pivot, state)
    ends = moved_points(joint, state[[0, -1]], rest)
    expected = np.linalg.norm(ends[1] - ends[0], axis=1)
    # the running median takes one frame's state off the ends
    np.testing.assert_allclose(predicted_travel(obs, model, rest), expected, rtol=0.1)
    assert (predicted_travel(obs, model, rest) < 1.9 * radius).all()


def test_tracks_that_creep_as_all_do_follow_and_what_rests_has_no_say() -> None:
    """Points of a part creep by some millimetres over its motion, each its own way; twice as many tracks are
    seen only while it rests, and can't creep."""
    rng = np.random.default_rng(6)
    state = 0.3 * minimum_jerk(40)
    ways = rng.normal(size=(40, 3))
    ways = 0.020 * ways / np.linalg.norm(ways, axis=1, keepdims=True)
    moving = rng.uniform(-0.4, 0.4, (40, 3)) + state[:, None, None] * (np.array([0.0, 1.0, 0.0]) + ways)
    resting = np.broadcast_to(rng.uniform(-0.4, 0.4, (80, 3)), (40, 80, 3))
    points = np.concatenate([moving, resting], axis=1) + rng.normal(0, 1e-3, (40, 120, 3))
    seen = np.ones((40, 120), dtype=bool)
    seen[6:, 40:] = False
    model = Model("prismatic", np.array([0.0, 1.0, 0.0]), np.zeros(3), state)
    found = follows(Observations.of(points, seen), model, 1e-3)
    assert found[:40].mean() > 0.9
    assert not found[40:].any()


@pytest.mark.parametrize("seed", range(20))
def test_noise_does_not_end_the_first_rest(seed: int) -> None:
    """The zero is the mean over the rest, so the states' sigma says how many frames it had: at least twelve
    of fifteen."""
    sigma = 0.001
    state = 0.3 * minimum_jerk(60, 15, 45) + np.random.default_rng(seed).normal(0, sigma, 60)
    covariance = np.diag(np.r_[[1e-6, 1e-6], np.full(60, sigma**2)])
    model = Model("prismatic", np.array([0.0, 0.0, 1.0]), np.zeros(3), state)
    found = orient(model, covariance, np.arange(60), 0.02)
    rest = 1.0 / (found.state_sigma[-1] ** 2 / sigma**2 - 1.0)
    assert 12 <= rest < 25
    assert abs(found.state[:15].mean()) < sigma
