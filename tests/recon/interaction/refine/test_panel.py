"""Panels that slide in their own plane: depth tells neither how far nor which way in it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.scenes.tracks import minimum_jerk
from recon.dense.noise import GOOD_SENSOR
from recon.interaction.refine.observations import Drift
from recon.interaction.refine.panel import find_panel
from recon.interaction.refine.solver import step
from recon.interaction.refine.terms import PanelTie, Terms
from recon.interaction.refine.uncertainty import with_uncertainty
from tests.laws import random_pose
from twin import geometry as geo
from twin.geometry import Array
from twin.scene import Joint, Prismatic

WAY = np.array([1.0, 0.0, 0.0])
FACING = np.array([0.0, -1.0, 0.0])
FRAMES = 40
TRUE = 0.25 * np.concatenate([np.zeros(15), minimum_jerk(10), np.ones(15)])
REST = (np.arange(FRAMES) < 15) | (np.arange(FRAMES) >= 25)


def surfels(rng: np.random.Generator, rim: int = 0, front: int = 0) -> tuple[Array, Array]:
    """Of a panel of 0.5 x 0.8 m, of what leaks into its rim from a wall beside it, and of a front that faces
    its way."""
    face = np.stack([rng.uniform(0, 0.5, 600), np.zeros(600), rng.uniform(0, 0.8, 600)], axis=1)
    wall = np.stack([np.full(rim, 0.5), rng.uniform(0, 0.1, rim), rng.uniform(0, 0.8, rim)], axis=1)
    ahead = np.stack([np.zeros(front), rng.uniform(0, 0.5, front), rng.uniform(0, 0.8, front)], axis=1)
    normals = np.concatenate([np.tile(FACING, (600, 1)), np.tile(-WAY, (rim, 1)), np.tile(-WAY, (front, 1))])
    points = np.concatenate([face, wall, ahead])
    points += rng.normal(scale=0.001, size=points.shape)
    return points, geo.unit(normals + rng.normal(scale=0.05, size=normals.shape))


def panel_of(joint: Joint, states: Array, points: Array, normals: Array) -> PanelTie | None:
    return find_panel(joint, states, points, normals, GOOD_SENSOR)[0]


def test_its_face_alone_is_observed_by_one_normal_in_any_frame() -> None:
    rng = np.random.default_rng(0)
    points, normals = surfels(rng, rim=50)
    T = random_pose(rng)
    moved = geo.transform(T, points), normals @ T[:3, :3].T
    tie, (seen, facing) = find_panel(Prismatic(T[:3, :3] @ WAY), TRUE, *moved, GOOD_SENSOR)
    assert tie is not None
    assert np.degrees(geo.line_angle(tie.normal, T[:3, :3] @ FACING)) < 0.3
    assert (facing == tie.normal).all()
    assert 550 < len(seen) <= 600
    np.testing.assert_allclose(((seen - T[:3, 3]) @ T[:3, :3])[:, 1], 0.0, atol=0.02)


def test_what_has_a_front_or_comes_out_is_no_panel() -> None:
    """A drawer's sides and floor slide in their planes, too, but its front tells how far it is."""
    rng = np.random.default_rng(1)
    points, normals = surfels(rng, front=120)
    assert panel_of(Prismatic(WAY), TRUE, points, normals) is None
    plain = surfels(rng)
    assert panel_of(Prismatic(WAY), TRUE, *plain) is not None
    assert panel_of(Prismatic(FACING), TRUE, *plain) is None
    assert panel_of(Prismatic(geo.unit(WAY + FACING)), TRUE, *plain) is None


def terms_of(joint: Joint, states: Array, rng: np.random.Generator, lean_deg: float) -> Terms:
    """What every frame sees of the face, whose normal is fused some tenths of a degree aside of its way."""
    points, normals = surfels(rng)
    tie, (face, facing) = find_panel(joint, states, points, normals, GOOD_SENSOR)
    assert tie is not None
    leaning = geo.exp_so3([0.0, 0.0, np.radians(lean_deg)]) @ FACING
    term = np.repeat(np.arange(len(face)), 6)
    frame = rng.integers(0, FRAMES, len(term))
    q = face[term] + TRUE[frame][:, None] * WAY + rng.normal(scale=0.001, size=(len(term), 3))
    tie = replace(tie, normal=leaning)
    return Terms(term, frame, q, np.full(len(term), 0.002), np.tile(leaning, (len(facing), 1)), tie)


@pytest.mark.parametrize("lean_deg", [0.0, 0.5, -0.5])
def test_states_and_axis_in_the_plane_stay_where_they_were_told(lean_deg: float) -> None:
    told = TRUE + np.random.default_rng(2).normal(scale=0.004, size=FRAMES)
    joint: Joint = Prismatic(geo.exp_so3([0.0, np.radians(1.0), 0.0]) @ WAY)
    terms, state = terms_of(joint, told, np.random.default_rng(3), lean_deg), told
    for _ in range(12):
        joint, state = step(joint, state, told, REST, terms)
    np.testing.assert_allclose(state - state.mean(), TRUE - TRUE.mean(), atol=0.015)
    assert abs(joint.axis @ terms.board.normal) < np.radians(0.2)  # type: ignore[union-attr]
    assert np.degrees(np.arcsin(abs(joint.axis[2]))) == pytest.approx(1.0, abs=0.1)
    fit = with_uncertainty(joint, state, told, REST, terms, np.zeros(2), Drift())
    assert 0.001 < fit.sigma.state < 0.01
    assert np.degrees(fit.sigma.axis) == pytest.approx(2.0, rel=0.3)
