"""What the judge knows of the truth: the inside of drawers, their front, and what of them was seen."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest

from benchmarks.completed.balls import inside_of, opens_far
from benchmarks.completed.sight import front_of
from benchmarks.completed.surfaces import (
    both_faces_seen,
    rear_share,
    side_share,
)
from benchmarks.scenes.boards import Board
from benchmarks.scenes.furniture import mesh_of
from recon.evaluation.truth import Truth, TruthPart
from recon.simulate.random.furniture import KINDS
from tests.makers.benchmarks.completed import (
    BODIES,
    TWIN,
    T,
)
from twin import geometry as geo

CARCASS = TWIN.static.mesh


@cache
def true_drawer(kind: str, seed: int) -> tuple[TruthPart, Any]:
    made = KINDS[kind](np.random.default_rng(seed), "bar")
    states = np.linspace(0.0, made.joint.upper, 5)
    part = TruthPart(
        2, kind, made.joint, states, made.joint.poses(states), mesh_of(made.part), ((0, 4),), None
    )
    return part, made


@pytest.mark.parametrize("kind", KINDS)
def test_the_inside_of_random_furniture_is_that_of_its_boards(kind: str) -> None:
    for seed in range(4):
        part, made = true_drawer(kind, seed)
        inside = inside_of(part)
        if not kind.startswith("drawer"):
            assert inside is None
            continue
        floor, *sides = made.panels[1:]
        gap = sides[1].corners[:, 0].min() - sides[0].corners[:, 0].max()
        if inside is None:
            assert np.min([gap, floor.size[1]]) < 0.15
            continue
        assert inside.floor == pytest.approx(floor.corners[:, 2].max(), abs=1e-4)
        assert inside.rim == pytest.approx(max(s.corners[:, 2].max() for s in sides), abs=1e-4)
        assert inside.front == pytest.approx(-floor.corners[:, 1].min(), abs=0.003), (
            "which ends 9 mm behind the front"
        )
        np.testing.assert_allclose((inside.high - inside.low)[0], gap, atol=0.005)
        low, high = inside.opened(part.travel)
        assert (high - low)[1] == pytest.approx(part.travel, abs=0.005)
        wide = min(gap, part.travel) >= 0.15 and max(gap, part.travel) >= 0.2
        assert (opens_far(part) is not None) == wide or min(
            abs(min(gap, part.travel) - 0.15), abs(max(gap, part.travel) - 0.2)
        ) < 0.006


def test_the_front_is_the_upright_side_towards_the_camera(truth: Truth) -> None:
    assert truth.cameras is not None
    for part in truth.parts:
        np.testing.assert_allclose(
            front_of(part.closed_mesh, truth.cameras.T_world_cam), -T[:3, 1], atol=1e-6
        )


def test_what_was_seen_is_told_by_its_points(truth: Truth) -> None:
    door, drawer = truth.parts
    rear = drawer.closed_mesh.vertices @ drawer.joint.axis
    back = drawer.closed_mesh.vertices[rear < rear.min() + 0.012]
    along = rear.min() + np.arange(0.0, 0.4, 0.001)[:, None] * 1.0
    assert rear_share(drawer, along * drawer.joint.axis) == pytest.approx(0.03 / 0.4, abs=0.003)
    others = drawer.closed_mesh.vertices[rear > rear.max() - 0.05]
    assert rear_share(drawer, np.concatenate([back, others])) == pytest.approx(
        len(back) / (len(back) + len(others))
    )
    assert rear_share(drawer, others) == rear_share(drawer, np.zeros((0, 3))) == 0.0
    assert rear_share(door, others) is None
    outer = geo.transform(T, _grid(BODIES["door"][0], 1, low=True))
    inner = geo.transform(T, _grid(BODIES["door"][0], 1, low=False))
    assert both_faces_seen(door.closed_mesh, np.concatenate([outer, inner]))
    assert not both_faces_seen(door.closed_mesh, outer)
    outward = -T[:3, 1]
    faces = np.concatenate([geo.transform(T, _grid(b, 1, low=True)) for b in BODIES["static"]])
    assert side_share(CARCASS, outward, faces) < 0.12, "their edges alone"
    flank = geo.transform(T, _grid(BODIES["static"][0], 0, low=True))
    assert side_share(CARCASS, outward, flank) > 0.1


def _grid(board: Board, axis: int, low: bool) -> np.ndarray:
    """Points every 8 mm of one side of a board, in the cabinet's frame."""
    at = [np.arange(a, b + 1e-9, 0.008) for a, b in zip(board.low, board.high, strict=True)]
    at[axis] = np.array([board.low[axis] if low else board.high[axis]])
    return np.stack(np.meshgrid(*at, indexing="ij"), axis=-1).reshape(-1, 3)
