"""Submaps: a long path of short ones, pieces where tracking is lost, loops that bend nothing rigid."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from recon.cameras.graph import bent
from recon.cameras.places import Seen
from recon.cameras.submaps import WHOLE, regular_spans, solve_pieces
from twin import geometry as geo
from twin.geometry import Array


def path(count: int, seed: int = 0) -> Array:
    """Poses (n, 4, 4) of a walk round a room and back."""
    t = np.linspace(0.0, 2 * np.pi, count)
    centre = np.stack([2.0 * np.cos(t), 1.5 * np.sin(t), 1.5 + 0.05 * np.sin(5 * t)], axis=-1)
    turn = np.stack([0.05 * np.sin(3 * t), 0.04 * np.cos(2 * t), t], axis=-1)
    del seed
    return np.stack([geo.make_pose(geo.exp_so3(r), c) for r, c in zip(turn, centre, strict=True)])


def solver(truth: Array, lost: NDArray[np.bool_], noise: float = 0.0):  # type: ignore[no-untyped-def]
    """Solves each span in a frame of its own; after a lost frame nothing is known any more."""
    asked = []

    def solve(first: int, last: int) -> tuple[Array, NDArray[np.bool_]]:
        rng = np.random.default_rng(first)
        asked.append((first, last))
        start = geo.exp_se3(rng.normal(size=6))
        poses = start @ geo.invert_pose(truth[first]) @ truth[first : last + 1]
        poses = poses @ geo.exp_se3(noise * rng.normal(size=(len(poses), 6)))
        return poses, ~np.logical_or.accumulate(lost[first : last + 1])

    return solve, asked


def worst(poses: Array, truth: Array) -> float:
    """Largest distance, m, of a path from the truth, both begun alike."""
    back = geo.invert_pose(geo.invert_pose(truth[0]) @ truth) @ geo.invert_pose(poses[0]) @ poses
    return float(np.linalg.norm(back[:, :3, 3], axis=1).max())


@pytest.mark.parametrize("count", [WHOLE + 1, 500, 1000])
def test_many_short_paths_make_the_long_one(count: int) -> None:
    truth = path(count)
    solve, asked = solver(truth, np.zeros(count, bool))
    (piece,) = solve_pieces(count, solve)
    np.testing.assert_array_equal(piece.frames, np.arange(count))
    assert asked == regular_spans(count)
    assert len(asked) > 1
    assert worst(piece.poses, truth) < 1e-9


def test_a_clip_is_solved_as_one() -> None:
    truth = path(WHOLE)
    solve, asked = solver(truth, np.zeros(WHOLE, bool))
    (piece,) = solve_pieces(WHOLE, solve)
    assert asked == regular_spans(WHOLE) == [(0, WHOLE - 1)]
    assert len(piece.frames) == WHOLE


def test_errors_of_short_paths_make_no_jumps() -> None:
    """Where one submap ends, the next one takes over little by little."""
    count, noise = 700, 5e-4
    truth = path(count)
    solve, _ = solver(truth, np.zeros(count, bool), noise)
    (piece,) = solve_pieces(count, solve)
    steps = (
        geo.invert_pose(geo.invert_pose(truth[:-1]) @ truth[1:])
        @ geo.invert_pose(piece.poses[:-1])
        @ piece.poses[1:]
    )
    assert np.linalg.norm(steps[:, :3, 3], axis=1).max() < 8 * noise


def test_what_follows_a_covered_lens_is_a_piece_of_its_own() -> None:
    count = 900
    truth, lost = path(count), np.zeros(count, bool)
    lost[400:412] = True
    solve, _ = solver(truth, lost)
    pieces = solve_pieces(count, solve)
    assert len(pieces) == 2
    first, second = pieces
    assert first.frames[-1] == 399
    assert second.frames[-1] == count - 1
    assert second.frames[0] >= 412
    assert second.frames[0] - 412 < 60
    for piece in pieces:
        assert worst(piece.poses, truth[piece.frames]) < 1e-9


def drifting(truth: Array, noise: float, seed: int) -> Array:
    rng = np.random.default_rng(seed)
    steps = (
        geo.invert_pose(truth[:-1]) @ truth[1:] @ geo.exp_se3(noise * rng.normal(size=(len(truth) - 1, 6)))
    )
    out = [truth[0]]
    for step in steps:
        out.append(out[-1] @ step)
    return np.stack(out)


@pytest.fixture(scope="module")
def looped() -> tuple[Array, Array, list[Seen]]:
    """The truth, a path that drifts, and loops between its two ends."""
    truth = path(600)
    poses = drifting(truth, 6e-4, 3)
    pairs = [(a, 599 - a) for a in range(5, 45, 10)]
    return truth, poses, [Seen(a, b, geo.invert_pose(truth[a]) @ truth[b], 80, 0.9) for a, b in pairs]


def test_loops_take_the_drift_away(looped: tuple[Array, Array, list[Seen]]) -> None:
    truth, poses, loops = looped
    frames = np.arange(600)
    closed = bent(frames, poses, loops, [])
    apart = [worst(p[[5, 594]], truth[[5, 594]]) for p in (poses, closed)]
    assert apart[1] < 0.3 * apart[0]
    np.testing.assert_array_equal(bent(frames, poses, [], []), poses)


def test_windows_stay_rigid_and_the_path_has_no_jump(looped: tuple[Array, Array, list[Seen]]) -> None:
    truth, poses, loops = looped
    windows = [(100, 220), (300, 380)]
    closed = bent(np.arange(600), poses, loops, windows)
    for a, b in windows:
        before, after = (geo.invert_pose(p[a]) @ p[a : b + 1] for p in (poses, closed))
        np.testing.assert_allclose(after, before, atol=1e-9)
    steps = [geo.invert_pose(p[:-1]) @ p[1:] for p in (poses, closed)]
    moved = np.linalg.norm((geo.invert_pose(steps[0]) @ steps[1])[:, :3, 3], axis=1)
    assert moved.max() < 2e-3
    assert worst(closed[[5, 594]], truth[[5, 594]]) < worst(poses[[5, 594]], truth[[5, 594]])


def test_a_false_loop_among_true_ones_loses_its_weight(looped: tuple[Array, Array, list[Seen]]) -> None:
    truth, poses, loops = looped
    away = geo.make_pose(translation=np.array([0.4, 0.0, 0.0]))
    false = Seen(150, 450, away @ geo.invert_pose(truth[150]) @ truth[450], 30, 0.7)
    frames = np.arange(600)
    alone, among = (bent(frames, poses, told, []) for told in (loops, [*loops, false]))
    assert np.abs(among - alone).max() < 0.01


def test_the_world_of_the_path_does_not_matter(looped: tuple[Array, Array, list[Seen]]) -> None:
    _, poses, loops = looped
    T = geo.exp_se3(np.array([0.3, -1.0, 2.0, 0.4, 0.2, -1.1]))
    one, other = bent(np.arange(600), poses, loops, []), bent(np.arange(600), T @ poses, loops, [])
    np.testing.assert_allclose(other, T @ one, atol=1e-6)


def test_a_leap_ends_a_piece_and_a_walk_does_not() -> None:
    """From frame 450 on the camera is 15 cm farther on in every frame: no head moves so."""
    count = 700
    truth = path(count)
    slipped = truth.copy()
    slipped[450:, 0, 3] += 0.15 * np.arange(1, count - 449)
    times = np.arange(count) / 15.0
    solve, _ = solver(truth, np.zeros(count, bool))
    assert len(solve_pieces(count, solve, times)) == 1
    solve, _ = solver(slipped, np.zeros(count, bool))
    first, *_ = solve_pieces(count, solve, times)
    assert 440 < first.frames[-1] <= 450


def test_what_follows_a_hole_is_a_piece_with_a_bridge_to_the_one_before() -> None:
    count = 700
    truth = path(count)
    hole = np.zeros(count, bool)
    hole[200:220] = True  # within one submap

    def solve(first: int, last: int) -> tuple[Array, NDArray[np.bool_]]:
        return truth[first : last + 1].copy(), ~hole[first : last + 1]

    before, after = solve_pieces(count, solve, np.arange(count) / 15.0)
    assert (before.frames[-1], after.frames[0]) == (199, 220)
    assert before.bridge is None
    assert after.bridge is not None
    assert (after.bridge.a, after.bridge.b) == (199, 220)
    np.testing.assert_allclose(after.bridge.T_a_b, geo.invert_pose(truth[199]) @ truth[220], atol=1e-9)


def test_a_path_that_leaps_all_the_time_is_not_solved_for_each_of_its_frames() -> None:
    count = 400
    rng = np.random.default_rng(0)
    wild = path(count)
    wild[:, :3, 3] += rng.uniform(-1.0, 1.0, (count, 3))
    solve, asked = solver(wild, np.zeros(count, bool))
    assert solve_pieces(count, solve, np.arange(count) / 15.0) == ()
    assert len(asked) <= count / 10
