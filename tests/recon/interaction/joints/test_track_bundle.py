"""The bundle's normal equations against differences of the cost that has its landmarks eliminated."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.scenes.tracks import track_scene
from recon.interaction.joints.bundle import correlation_factor, refine, smoothness, step
from recon.interaction.joints.cholesky import solve_positive
from recon.interaction.joints.normal_equations import normal_equations
from recon.interaction.joints.observations import (
    Kind,
    Model,
    Observations,
    noise_sigma,
    pull_back,
    weighted_means,
)
from twin import geometry as geo
from twin.geometry import Array
from twin.scene import Revolute


def scene_model(kind: Kind) -> tuple[Observations, Model]:
    scene = track_scene("door" if kind == "revolute" else "drawer", "none", seed=1, tracks=15, frames=12)
    pivot = scene.joint.pivot if isinstance(scene.joint, Revolute) else np.zeros(3)
    state = scene.state + 0.05 * np.sin(np.arange(12))
    return Observations.of(scene.points, scene.visible), Model(kind, scene.joint.axis, pivot, state)


def projected_cost(obs: Observations, model: Model) -> float:
    z = pull_back(obs.points, obs.weight, model.kind == "revolute", model.axis, model.pivot, model.state)
    marks = weighted_means(z, obs.weight)
    return 0.5 * float((obs.weight[..., None] * (z - marks[:, None]) ** 2).sum())


def unit_step(n: int, k: int, h: float) -> Array:
    out = np.zeros(n)
    out[k] = h
    return out


@pytest.mark.parametrize("kind", ["prismatic", "revolute"])
def test_gradient_and_hessian(kind: Kind) -> None:
    obs, model = scene_model(kind)
    hessian, gradient = normal_equations(obs, obs.weight, model)
    n, h = len(gradient), 1e-6
    assert n == (4 if kind == "revolute" else 2) + 12
    up = [projected_cost(obs, step(model, unit_step(n, k, h))) for k in range(n)]
    down = [projected_cost(obs, step(model, unit_step(n, k, -h))) for k in range(n)]
    numeric = (np.array(up) - np.array(down)) / (2 * h)
    np.testing.assert_allclose(gradient, numeric, rtol=1e-5, atol=1e-6 * np.abs(numeric).max())
    np.testing.assert_allclose(hessian, hessian.T)
    if kind == "prismatic":  # all states may shift together with the landmarks
        shift = np.concatenate([np.zeros(2), np.ones(12)])
        assert np.abs(hessian @ shift).max() < 1e-9 * np.abs(hessian).max()


def test_noise_of_one_coordinate() -> None:
    rng = np.random.default_rng(0)
    square = (rng.normal(0, 0.004, (50, 40, 3)) ** 2).sum(-1)
    assert noise_sigma(square, np.ones((50, 40)), 0) == pytest.approx(0.004, rel=0.05)


def test_smoothness_only_speaks_where_data_are_silent() -> None:
    state = np.sin(np.linspace(0, 3, 30))
    strong, weak = np.full(30, 1e12), np.full(30, 1e12)
    weak[10] = 0.0
    assert np.abs(smoothness(strong, state)).max() < 1e-3
    prior = smoothness(weak, state)
    assert prior[10, 10] > 1e3
    assert np.abs(prior[20:, 20:]).max() < 1e-3


def test_smoothness_is_as_strong_as_well_observed_frames_are_smooth() -> None:
    """Twice the root mean square of their second differences is what the prior allows; where an unseen
    frame's state happens to be says nothing."""
    state, information = np.sin(np.linspace(0, 3, 30)), np.full(30, 1e12)
    information[10] = 0.0
    second = np.delete(np.diff(state, 2), [8, 9, 10])
    expected = 6.0 / (
        4.0 * np.mean(second**2)
    )  # weights 1, -2, 1 of the three differences that hold frame 10
    for wild in (0.0, 5.0):
        prior = smoothness(information, state + wild * (np.arange(30) == 10))
        assert prior[10, 10] == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize("rho", [0.0, 0.6])
def test_repeated_errors_count_once(rho: float) -> None:
    """First-order autoregressive errors, whose sum has (1 + rho) / (1 - rho) times the variance of
    independent ones."""
    rng = np.random.default_rng(4)
    noise = rng.normal(0, 0.003, (80, 200, 3))
    for t in range(1, len(noise)):
        noise[t] = rho * noise[t - 1] + np.sqrt(1 - rho**2) * noise[t]
    still = Model("prismatic", np.array([0.0, 0.0, 1.0]), np.zeros(3), np.zeros(80))
    obs = Observations.of(rng.uniform(-1, 1, (1, 200, 3)) + noise, np.ones((80, 200), dtype=bool))
    factor = correlation_factor(obs, np.zeros((200, 80)), obs.weight, still)
    assert factor == pytest.approx((1 + rho) / (1 - rho), rel=0.1)


def test_refine_recovers_from_a_poor_start() -> None:
    scene = track_scene("door", "obs", seed=3, tracks=60)
    assert isinstance(scene.joint, Revolute)
    obs = Observations.of(scene.points, scene.visible)
    rough = step(
        Model("revolute", scene.joint.axis, scene.joint.pivot, scene.state),
        np.concatenate([[0.15, -0.1, 0.05, 0.05], 0.1 * np.random.default_rng(0).normal(size=40)]),
    )
    found = refine(obs, rough, 0.005, 40)
    assert np.degrees(geo.line_angle(found.model.axis, scene.joint.axis)) < 0.4
    assert found.sigma == pytest.approx(0.005, rel=0.25)


def test_a_hinge_on_the_tracks_of_a_slide_ends_where_no_part_has_its_axis() -> None:
    """It moves away for ever; on the tracks of a door the same limit changes nothing."""
    scene = track_scene("drawer", "none", seed=2, tracks=60, noise=0.002)
    obs, middle = Observations.of(scene.points, scene.visible), np.nanmean(scene.points, axis=(0, 1))
    across = geo.orthogonal_basis(scene.joint.axis)
    near = Model("revolute", across[:, 0], middle + 2.0 * across[:, 1], scene.state / 2.0)

    def away(model: Model) -> float:
        return float(np.linalg.norm(np.cross(middle - model.pivot, model.axis)))

    ended, on = (away(refine(obs, near, 0.002, 30, farthest=f).model) for f in (4.0, np.inf))
    assert 4.0 < ended < on
    door, model = scene_model("revolute")
    a, b = (refine(door, model, 0.005, 30, farthest=f).model for f in (9.0, np.inf))
    np.testing.assert_array_equal(a.state, b.state)


def test_solver_is_lapack_s() -> None:
    rng = np.random.default_rng(2)
    a = rng.normal(size=(20, 20))
    a = a @ a.T + np.eye(20)
    b = rng.normal(size=(20, 3))
    np.testing.assert_allclose(solve_positive(a, b), np.linalg.solve(a, b), rtol=1e-9)
