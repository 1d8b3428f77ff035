"""Doors as boards: faces are found whatever the frame, and tie together what no frame sees at once."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from benchmarks.scenes.tracks import minimum_jerk
from recon.dense.noise import GOOD_SENSOR, DepthNoise
from recon.interaction.parts.static_spans import REST_MARGIN
from recon.interaction.refine.board import BoardFaces, edge_tie, find_board, with_board
from recon.interaction.refine.observations import Views, pixels_on
from recon.interaction.refine.refine_parts import _rests
from recon.interaction.refine.solver import step
from recon.interaction.refine.terms import Terms, Tie
from recon.interaction.refine.ties import board_errors, with_board_known
from recon.recording import Intrinsics
from tests.laws import random_pose
from twin import geometry as geo
from twin.geometry import Array
from twin.scene import Motion, Prismatic, Revolute

HINGE = Revolute(np.array([0.0, 0.0, 1.0]), pivot=np.array([0.0, 0.0, 0.0]))
WIDTH, THICK = 0.5, 0.03
FRAMES, OPEN = 50, 1.2
TRUE = OPEN * np.concatenate([np.zeros(20), minimum_jerk(10), np.ones(20)])
REST = (np.arange(FRAMES) < 20) | (np.arange(FRAMES) >= 30)


def _board(
    rng: np.random.Generator,
    step: float = 0.0,
    noise: float = 0.002,
    count: int = 400,
    width: float = WIDTH - 0.02,
) -> tuple[Array, Array]:
    """Surfels of a 0.5 x 0.6 x 0.03 m door; its far face is turned by `step` about the hinge. A bar stands
    off the front."""
    x, z = 0.02 + width * rng.random(2 * count), rng.uniform(0, 0.6, 2 * count)
    far = np.arange(2 * count) >= count
    points = np.stack([x, np.where(far, 0.5, -0.5) * THICK, z], axis=1)
    normals = np.where(far[:, None], [0.0, 1.0, 0.0], [0.0, -1.0, 0.0])
    turn = geo.exp_so3([0.0, 0.0, step])
    points[far], normals[far] = points[far] @ turn.T, normals[far] @ turn.T
    bar = np.stack([rng.uniform(0.4, 0.42, 60), np.full(60, -0.06), rng.uniform(0.2, 0.4, 60)], axis=1)
    points = np.concatenate([points, bar])
    normals = np.concatenate([normals, np.tile([0.0, -1.0, 0.0], (60, 1))])
    if noise:
        points = points + rng.normal(scale=noise, size=points.shape)
        normals = geo.unit(normals + rng.normal(scale=0.1, size=normals.shape))
    return points, normals


def _known(points: Array, normals: Array, noise: DepthNoise = GOOD_SENSOR) -> BoardFaces:
    found = find_board(HINGE, points, normals, noise)
    assert found is not None
    return found


@pytest.mark.parametrize("step_deg", [-4.0, -0.5, 0.0, 2.0])
def test_both_faces_are_found_whatever_the_frame(step_deg: float) -> None:
    rng = np.random.default_rng(1)
    points, normals = _board(rng, float(np.radians(step_deg)))
    T = random_pose(rng)
    found = find_board(HINGE.transformed(T), geo.transform(T, points), normals @ T[:3, :3].T, GOOD_SENSOR)
    assert found is not None
    assert found.far is not None
    faces = sorted([found.near, found.far], key=lambda f: int(np.flatnonzero(f)[0]))
    assert np.mean(faces[0][:400]) > 0.9
    assert np.mean(faces[1][400:800]) > 0.9
    assert not np.any(faces[0] & faces[1])
    assert not np.any(faces[0][800:]), "the bar is not on the face"
    halfway = T[:3, :3] @ geo.exp_so3([0, 0, np.radians(step_deg / 2)]) @ [0.0, 1.0, 0.0]
    assert np.degrees(geo.line_angle(found.normal, halfway)) < 0.3
    assert geo.angle_between(found.outward, T[:3, :3] @ [1.0, 0.0, 0.0]) < np.radians(3.0)
    assert np.ptp(found.along) == pytest.approx(0.6, abs=0.04)


def test_perfect_faces_give_exact_figures() -> None:
    points, normals = _board(np.random.default_rng(0), noise=0.0)
    found = _known(points, normals)
    assert abs(found.normal[1]) == pytest.approx(1.0, abs=1e-12)
    assert found.rms == pytest.approx(0.0, abs=1e-12)
    assert found.offsets[0] - found.offsets[1] == pytest.approx(THICK, abs=1e-12)


def test_one_face_is_a_board_too_but_no_slide_and_no_tube() -> None:
    rng = np.random.default_rng(0)
    points, normals = _board(rng)
    front = normals[:, 1] < 0
    assert _known(points[front], normals[front]).far is None
    assert find_board(Prismatic(np.array([0.0, 0.0, 1.0])), points, normals, GOOD_SENSOR) is None
    angle = rng.uniform(-np.pi, np.pi, 1000)
    round_ = np.stack([np.cos(angle), np.sin(angle), np.zeros(1000)], axis=1)
    tube = 0.2 * round_ + [0.0, 0.0, 1.0] * rng.uniform(0, 0.5, (1000, 1))
    assert find_board(HINGE, tube, round_, GOOD_SENSOR) is None


def test_a_narrow_board_says_nothing_and_noise_is_no_relief() -> None:
    """Five centimetres tell no angle. A face is as flat as depth can show: what is rough for a good sensor is
    flat for a phone's."""
    for width, known in ((0.05, False), (0.15, True)):
        points, normals = _board(np.random.default_rng(0), width=width)
        board = slice(0, 800)  # without the bar, which stands elsewhere
        assert (find_board(HINGE, points[board], normals[board], GOOD_SENSOR) is not None) == known
    rough, normals = _board(np.random.default_rng(0), noise=0.009)
    assert find_board(HINGE, rough, normals, GOOD_SENSOR) is None
    assert find_board(HINGE, rough, normals, DepthNoise(0.012, 0.0, 0.0, 0.0)) is not None


def _seen(rng: np.random.Generator) -> tuple[NDArray[np.int64], NDArray[np.int64], Array, Array]:
    """Terms, frames, world points and world normals: the front in the first 20 frames, the inside in the last
    20, nothing between."""
    points, normals = _board(rng, noise=0.0)
    points, normals = points[:800], normals[:800]
    term = np.repeat(np.arange(800), 4)
    frame = np.where(term >= 400, rng.integers(30, 50, len(term)), rng.integers(0, 20, len(term)))
    poses = HINGE.poses(TRUE)[frame]
    q = np.einsum("nij,nj->ni", poses[:, :3, :3], points[term]) + poses[:, :3, 3]
    return term, frame, q, np.einsum("nij,nj->ni", poses[:, :3, :3], normals[term])


def _terms(joint: Revolute, state: Array, rng: np.random.Generator) -> Terms:
    """What a joint and states (n,) make of the same depth, with its board."""
    term, frame, q, world_normals = _seen(rng)
    back = geo.invert_pose(joint.poses(state))[frame]
    y = np.einsum("nij,nj->ni", back[:, :3, :3], q) + back[:, :3, 3]
    n = np.einsum("nij,nj->ni", back[:, :3, :3], world_normals)
    points, normals = (
        np.stack([np.bincount(term, c) / np.bincount(term) for c in a.T], axis=1) for a in (y, n)
    )
    terms = Terms(term, frame, q, np.full(len(term), 0.002), geo.unit(normals))
    found = find_board(joint, points, geo.unit(normals), GOOD_SENSOR)
    assert found is not None
    assert found.far is not None
    return with_board(terms, found, None)


@pytest.mark.parametrize(
    ("error_deg", "tilt"), [(-3.0, [0.02, 0.0]), (2.0, [-0.01, 0.03]), (0.0, [0.0, 0.0])]
)
def test_faces_that_no_frame_sees_together_hold_the_joint(error_deg: float, tilt: list[float]) -> None:
    """Where the inside is seen all states are too large by the same error, and the axis leans: parallel
    again, both are right. The truth itself stays where it is."""
    start = TRUE + np.radians(error_deg) * np.interp(np.arange(FRAMES), [19, 30], [0.0, 1.0])
    lean = HINGE.plus(np.array([*tilt, 0.0, 0.0]))
    assert isinstance(lean, Revolute)
    joint, state = lean, start
    for _ in range(8):
        terms = _terms(joint, state, np.random.default_rng(2))
        moved, state = step(joint, state, start, REST, terms)
        assert isinstance(moved, Revolute)
        joint = moved
    assert np.degrees(geo.line_angle(joint.axis, HINGE.axis)) < 0.05
    off = np.degrees((state - state[0]) - (TRUE - TRUE[0]))[REST]
    assert np.abs(off).max() < 0.1


def test_a_board_fills_in_what_the_recording_leaves_open_and_nothing_else() -> None:
    """A pivot known to a metre along the normal comes back to what boards are thick; one known to a tenth of
    a millimetre stays."""
    shifted = replace(HINGE, pivot=np.array([0.02, 0.04, 0.0]))
    terms = _terms(shifted, TRUE, np.random.default_rng(3))
    vague = np.diag([1e-8, 1e-8, 1.0, 1.0, *np.full(2 + FRAMES, 1e-10)])
    joint, state, covariance = with_board_known(shifted, TRUE, vague, terms)
    assert np.all(np.abs(board_errors(joint, state, terms).away) < 0.004)
    assert np.abs(board_errors(shifted, TRUE, terms).away).max() > 0.02
    assert np.sqrt(np.linalg.eigvalsh(covariance[2:4, 2:4]).min()) < 0.03
    sure = np.diag([1e-10, 1e-10, 1e-8, 1e-8, *np.full(2 + FRAMES, 1e-10)])
    exact = _terms(HINGE, TRUE, np.random.default_rng(3))
    joint, *_ = with_board_known(HINGE, TRUE, sure, exact)
    assert isinstance(joint, Revolute)
    assert np.linalg.norm(joint.pivot - HINGE.pivot) < 2e-4


def test_where_board_and_recording_contradict_each_other_neither_is_believed_as_before() -> None:
    terms = _terms(replace(HINGE, pivot=np.array([0.0, 0.2, 0.0])), TRUE, np.random.default_rng(3))
    sure = np.diag([1e-10, 1e-10, 1e-6, 1e-6, *np.full(2 + FRAMES, 1e-10)])
    wrong = replace(HINGE, pivot=np.array([0.0, 0.2, 0.0]))
    _, _, covariance = with_board_known(wrong, TRUE, sure, terms)
    assert covariance[2, 2] > 4e-6 or covariance[3, 3] > 4e-6


def _shown(joint: Revolute, width: float = WIDTH, hand: bool = False) -> list[tuple[int, Array, Array]]:
    """Each fifth frame at rest: points of the face it sees, in the frame of the part as the joint has it, and
    in the world."""
    x, z = np.meshgrid(np.arange(0.02, width, 0.004), np.arange(0.0, 0.6, 0.01))
    out = []
    for k in np.flatnonzero(REST)[::5]:
        height = -THICK / 2 if k < 20 else THICK / 2
        points = np.stack([x.ravel(), np.full(x.size, height), z.ravel()], axis=1)
        if hand:
            out_there = (z.ravel() > 0.2) & (z.ravel() < 0.3)
            points = np.concatenate([points, points[out_there] + [0.07, 0.0, 0.0]])
        world = geo.transform(HINGE.pose(float(TRUE[k])), points)
        out.append((int(k), geo.transform(geo.invert_pose(joint.pose(float(TRUE[k]))), world), world))
    return out


def _nothing(_: int, at: Array) -> NDArray[np.bool_]:
    return np.zeros(len(at), bool)


def _edge(
    shown: list[tuple[int, Array, Array]],
    inside: bool = True,
    covered: Callable[[int, Array], NDArray[np.bool_]] = _nothing,
) -> Tie | None:
    points, normals = _board(np.random.default_rng(0), noise=0.0)
    board = replace(_known(points, normals), offsets=(0.05, -0.05))
    board = replace(
        board, offsets=tuple(float(np.median(x @ board.normal)) for _, x, _ in (shown[0], shown[-1]))
    )
    return edge_tie(
        board, shown, TRUE, REST, lambda k, at, __: (np.full(len(at), inside), covered(k, at), 0.005)
    )


def _tie_away(joint: Revolute, shown: list[tuple[int, Array, Array]], inside: bool = True) -> float | None:
    found = _edge(shown, inside)
    if found is None:
        return None
    terms = _terms(HINGE, TRUE, np.random.default_rng(3))
    assert terms.board is not None
    alone = replace(terms, board=replace(terms.board, ties=(found,)))
    return float(board_errors(joint, TRUE, alone).away[1])


def test_the_outer_edge_is_the_same_closed_and_open() -> None:
    """At the truth it is, also with a hand on it; a pivot 3 cm aside moves the one against the other by what
    the turn makes of that."""
    aside = replace(HINGE, pivot=np.array([0.03, 0.0, 0.0]))
    assert _tie_away(HINGE, _shown(HINGE)) == pytest.approx(0.0, abs=1e-3)
    assert _tie_away(HINGE, _shown(HINGE, hand=True)) == pytest.approx(0.0, abs=1e-3)
    away = _tie_away(aside, _shown(aside))
    assert away is not None
    assert abs(away) == pytest.approx(0.03 * (1 - np.cos(OPEN)), abs=2e-3)


def test_an_edge_out_of_the_picture_or_of_something_else_ties_nothing() -> None:
    assert _tie_away(HINGE, _shown(HINGE), inside=False) is None
    shown = _shown(HINGE)
    other = [*shown[:4], *_shown(HINGE, width=0.35)[4:]]
    assert _tie_away(HINGE, other) is None


def test_an_outline_is_as_unsure_as_its_frames_disagree() -> None:
    sure = _edge(_shown(HINGE))
    ragged = [_shown(HINGE, width=w)[k] for k, w in enumerate((0.5, 0.4, 0.45, 0.5, 0.5, 0.42, 0.5, 0.46))]
    unsure = _edge(ragged)
    assert sure is not None
    assert unsure is not None
    assert sure.sigma < 0.015
    assert unsure.sigma > 0.04


def test_what_an_arm_covers_is_no_edge() -> None:
    """At rest closed an arm lies over most of the board's length, 12 cm from its edge on: where nothing
    covers the board it ends where it does, and where too little of the edge is free nothing is told."""

    def behind(
        share: float,
    ) -> tuple[list[tuple[int, Array, Array]], Callable[[int, Array], NDArray[np.bool_]]]:
        shown = _shown(HINGE)
        along, reach = shown[0][1][:, 2], shown[0][1][:, 0]
        low, high = along.min(), along.max()
        arm = low + share * (high - low)

        def covered(k: int, at: Array) -> NDArray[np.bool_]:
            return np.asarray((at[:, 2] < arm) & (at[:, 0] > reach.max() - 0.12) & (k < 20))

        hidden = [(k, x[~covered(k, x)], q[~covered(k, x)]) for k, x, q in shown]
        return hidden, covered

    terms = _terms(HINGE, TRUE, np.random.default_rng(3))
    assert terms.board is not None
    hidden, covered = behind(0.45)
    found = _edge(hidden, covered=covered)
    assert found is not None
    alone = replace(terms, board=replace(terms.board, ties=(found,)))
    assert float(board_errors(HINGE, TRUE, alone).away[1]) == pytest.approx(0.0, abs=2e-3)
    hidden, covered = behind(0.7)
    assert _edge(hidden, covered=covered) is None


@pytest.mark.parametrize("lean", [0.0, 60.0])
def test_a_pixel_covers_more_of_a_plane_that_leans(lean: float) -> None:
    """2 m away, at 100 px a radian: 20 mm head-on, 40 mm at 60 degrees."""
    camera = Intrinsics(64, 48, 100.0, 100.0, 31.5, 23.5)
    views = Views(camera, np.ones((1, 48, 64), np.float32), np.eye(4)[None], {0: 0})
    slide = Prismatic(np.array([0.0, 0.0, 1.0]))
    normal = geo.exp_so3([np.radians(lean), 0.0, 0.0]) @ [0.0, 0.0, -1.0]
    points = np.array([[0.0, 0.0, 1.5], [0.001, 0.0, 1.5], [9.0, 0.0, 1.5]])
    inside, covered, footprint = pixels_on(
        views, np.array([0]), slide, np.array([0.5]), 0, points[:2], normal
    )
    assert inside.all()
    assert covered.all()  # depth is 1 m, they are 2 m away
    assert footprint == pytest.approx(0.02 / np.cos(np.radians(lean)), rel=0.01)
    far = replace(views, depth=2.0 * views.depth)
    inside, covered, _ = pixels_on(far, np.array([0]), slide, np.array([0.5]), 0, points, normal)
    assert inside.tolist() == [True, True, False]
    assert not covered.any()


def test_a_face_that_no_frame_shows_ties_nothing() -> None:
    points, normals = _board(np.random.default_rng(0), noise=0.0)
    board = _known(points, normals)
    assert board.far is not None
    for unseen, count in ((board.far, 1), (board.near, 0)):
        term = np.flatnonzero(~unseen)
        seen = Terms(term, np.zeros(len(term), np.int64), points[term], np.full(len(term), 0.002), normals)
        found = with_board(seen, board, None).board
        assert found is not None
        assert len(found.ties) == count


def test_rest_keeps_its_distance_from_the_motion_on_both_sides() -> None:
    frames = np.arange(100)
    motion = Motion(frames, frames / 15.0, np.zeros(100), intervals=((20, 30), (50, 70)))
    near = np.zeros(100, bool)
    for first, last in motion.intervals:
        near[first - REST_MARGIN : last + REST_MARGIN + 1] = True
    np.testing.assert_array_equal(_rests(motion), ~near)
    assert not _rests(Motion(frames, frames / 15.0, np.zeros(100))).any(), "unknown intervals are no rest"
