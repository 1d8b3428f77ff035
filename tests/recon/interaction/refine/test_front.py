"""Drawers: a front without texture does not tell how far its axis leans, what is known of fronts does."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.scenes.tracks import minimum_jerk
from recon.dense.noise import GOOD_SENSOR
from recon.interaction.refine.front import LEAN_OF_DEPTH, LEAN_OF_TRACKS, find_front
from recon.interaction.refine.solver import step
from recon.interaction.refine.terms import FrontTie, Terms
from recon.interaction.refine.ties import with_board_known
from tests.laws import random_pose
from twin import geometry as geo
from twin.geometry import Array
from twin.scene import Joint, Prismatic

OUT = np.array([0.0, -1.0, 0.0])
FRAMES, WAY = 40, 0.3
TRUE = WAY * np.concatenate([np.zeros(15), minimum_jerk(10), np.ones(15)])
REST = (np.arange(FRAMES) < 15) | (np.arange(FRAMES) >= 25)


def leaning(degrees: float) -> Prismatic:
    return Prismatic(geo.exp_so3([0.0, 0.0, np.radians(degrees)]) @ OUT)


def drawer(rng: np.random.Generator, floor: int = 0) -> tuple[Array, Array]:
    """Surfels of a front of 0.5 x 0.2 m, and of the floor behind it."""
    front = np.stack([rng.uniform(0, 0.5, 400), np.zeros(400), rng.uniform(0, 0.2, 400)], axis=1)
    inside = np.stack([rng.uniform(0, 0.5, floor), rng.uniform(0, 0.3, floor), np.zeros(floor)], axis=1)
    normals = np.concatenate([np.tile(OUT, (400, 1)), np.tile([0.0, 0.0, 1.0], (floor, 1))])
    points = np.concatenate([front, inside]) + rng.normal(scale=0.001, size=(400 + floor, 3))
    return points, geo.unit(normals + rng.normal(scale=0.05, size=normals.shape))


def seen(joint: Joint, rng: np.random.Generator) -> Terms:
    """What every frame sees of a front that truly slides along its normal, as terms of a joint; with what is
    known of it."""
    points, normals = drawer(rng)
    term = np.repeat(np.arange(len(points)), 6)
    frame = rng.integers(0, FRAMES, len(term))
    q = points[term] + TRUE[frame][:, None] * OUT
    terms = Terms(term, frame, q, np.full(len(term), 0.002), np.tile(OUT, (len(points), 1)))
    front = find_front(joint, points, normals, GOOD_SENSOR, LEAN_OF_DEPTH)
    return terms if front is None else replace(terms, board=front)


def found(joint: Joint, points: Array, normals: Array, lean: float = LEAN_OF_DEPTH) -> FrontTie | None:
    return find_front(joint, points, normals, GOOD_SENSOR, lean)


def test_the_front_is_found_in_any_frame_and_beside_a_larger_floor() -> None:
    rng = np.random.default_rng(0)
    points, normals = drawer(rng, floor=900)
    T = random_pose(rng)
    for sign in (1.0, -1.0):
        axis = T[:3, :3] @ (sign * leaning(8.0).axis)
        front = found(Prismatic(axis), geo.transform(T, points), normals @ T[:3, :3].T)
        assert front is not None
        assert np.degrees(geo.line_angle(front.normal, T[:3, :3] @ OUT)) < 0.3
        assert front.of_faces[:400].mean() > 0.9
        assert front.of_faces[400:].mean() < 0.02


def test_what_slides_in_its_plane_or_is_slanted_has_no_front() -> None:
    points, normals = drawer(np.random.default_rng(1))
    assert found(Prismatic(np.array([1.0, 0.0, 0.0])), points, normals) is None
    for degrees, lean, known in (
        (22.0, LEAN_OF_DEPTH, True),
        (28.0, LEAN_OF_DEPTH, False),
        (12.0, LEAN_OF_TRACKS, False),
        (3.0, LEAN_OF_TRACKS, True),
    ):
        assert (found(leaning(degrees), points, normals, lean) is not None) == known
    assert found(leaning(0.0), points[:30], normals[:30]) is None


@pytest.mark.parametrize("lean_deg", [-20.0, 10.0, 2.0])
def test_a_plain_front_holds_the_axis_to_its_normal(lean_deg: float) -> None:
    """All of its depth agrees with an axis that leans and states that are as much longer."""
    joint: Joint = leaning(lean_deg)
    state = TRUE / np.cos(np.radians(lean_deg))
    terms = seen(joint, np.random.default_rng(2))
    for _ in range(8):
        joint, state = step(joint, state, state, REST, terms)
    assert np.degrees(geo.line_angle(joint.axis, OUT)) < 0.3
    assert np.ptp(state) == pytest.approx(WAY, abs=1e-3)


def test_what_is_known_of_fronts_counts_where_the_recording_says_less() -> None:
    """An axis known to 10 degrees comes to the normal, and is known to a degree; one known to a tenth stays,
    a degree askew."""
    joint = leaning(1.0)
    terms = seen(joint, np.random.default_rng(3))
    for sigma_deg, off, stated in ((10.0, 0.0, 1.0), (0.1, 1.0, 0.1)):
        vague = np.diag(np.append(np.full(2, np.radians(sigma_deg) ** 2), np.full(FRAMES, 1e-10)))
        moved, _, covariance = with_board_known(joint, TRUE, vague, terms)
        assert np.degrees(geo.line_angle(moved.axis, OUT)) == pytest.approx(off, abs=0.1)
        assert np.degrees(np.sqrt(covariance[0, 0])) == pytest.approx(stated, rel=0.25)
