"""Depth tells parts without a track: joints and states on cabinets of closed form, and nothing where nothing
moves."""

from __future__ import annotations

from dataclasses import replace
from typing import cast

import numpy as np
import pytest
from scipy.spatial import KDTree

from recon.interaction.boards.carried import Carried, best_path
from recon.interaction.boards.proposals import Proposed
from recon.interaction.boards.search import DepthPart, _worth_telling, parts_by_depth
from recon.interaction.boards.seeds import seeds
from recon.observation.pictures import Pictures
from tests.makers.recon.cabinets import Clip, Kind, make_clip
from twin import geometry as geo
from twin.mesh import sample_surface
from twin.scene import Joint, Revolute


@pytest.fixture(scope="module", params=["door", "drawer", "slide"])
def clip(request: pytest.FixtureRequest) -> Clip:
    kind: Kind = request.param
    return make_clip(kind)


@pytest.fixture(scope="module")
def parts(clip: Clip) -> list[DepthPart]:
    return parts_by_depth(clip.recording, clip.cameras)


def apart(joint: Joint, true: Joint) -> tuple[float, float]:
    """Angle of the axes in degrees, and distance of the hinges in metres."""
    away = 0.0
    if isinstance(joint, Revolute) and isinstance(true, Revolute):
        away = geo.line_distance(joint.pivot, joint.axis, true.pivot, true.axis)
    return float(np.rad2deg(geo.line_angle(joint.axis, true.axis))), away


def test_depth_alone_tells_joint_and_states(clip: Clip, parts: list[DepthPart]) -> None:
    (part,) = parts
    found, true = part.oriented(0.02), clip.part
    assert found.joint.kind == true.joint.kind
    angle, away = apart(found.joint, true.joint)
    assert angle < 3.0
    assert away < 0.03
    moved, truth = np.abs(found.state - found.state[0]), np.abs(true.motion.state)
    assert np.all(moved[:7] < 0.02)  # it rests
    if clip.recording.depth(0).any() and true.joint.kind == "revolute":
        assert np.abs(moved - truth).max() < 0.12
    assert float(np.ptp(found.state)) > 0.9 * float(np.ptp(true.motion.state))


def test_nothing_moves_in_a_room_at_rest(clip: Clip) -> None:
    depth = clip.recording.depth(0)

    def noisy(frame: int) -> np.ndarray:
        noise = np.random.default_rng(frame).normal(0, 0.004, depth.shape)
        return np.where(depth > 0, depth + noise, 0).astype(np.float32)

    cameras = replace(clip.cameras, T_world_cam=np.tile(clip.cameras.T_world_cam[0], (26, 1, 1)))
    assert parts_by_depth(replace(clip.recording, read_depth=noisy), cameras) == []


def test_the_world_frame_does_not_matter(clip: Clip, parts: list[DepthPart]) -> None:
    T = geo.make_pose(geo.exp_so3(np.array([0.3, -1.0, 0.4])), [2.0, -1.0, 0.5])
    (moved,) = parts_by_depth(clip.recording, clip.cameras.transformed(T))
    here, there = (p.oriented(0.02).joint for p in (parts[0], moved))
    angle, away = apart(there, here.transformed(T))
    assert angle < 3.0  # rounding may take the search another way; both are as near to the truth
    assert away < 0.03


def test_the_board_lies_on_the_part_in_the_first_frame(clip: Clip, parts: list[DepthPart]) -> None:
    """To the search's error, by its own joint and states, from the rest that it was seen in."""
    (part,) = parts
    board = part.carried.board(part.joint, part.state)
    away = KDTree(sample_surface(clip.mesh, 20_000, np.random.default_rng(0))[0]).query(board)[0]
    assert len(board) > 100
    assert np.quantile(away, 0.9) < 0.04


def _explaining(score: float, first: int, last: int) -> DepthPart:
    """A part that moves from one of 100 frames to another and explains so much."""
    state = np.interp(np.arange(100), [first, last], [0.0, 0.3])
    none = cast(Carried, None)
    return DepthPart(Proposed("prismatic", np.eye(3)[0], np.zeros(3)), np.arange(100), state, score, none)


def test_a_further_part_explains_enough_or_moves_in_turn() -> None:
    door = _explaining(100.0, 20, 40)
    for score, first, last, told in (
        (31.0, 20, 40, True),
        (29.0, 20, 40, False),
        (29.0, 60, 80, True),
        (11.0, 60, 80, True),
        (9.0, 60, 80, False),
        (29.0, 35, 55, True),
        (13.0, 35, 55, False),
        (29.0, 25, 45, False),
    ):
        other = _explaining(score, first, last)
        assert _worth_telling([door, other]) == ([door, other] if told else [door])


@pytest.mark.parametrize(("wide", "pieces"), [(2, False), (8, True)])
def test_a_door_that_holes_cut_into_pieces_is_one(wide: int, pieces: bool) -> None:
    clip = make_clip("door")

    def striped(frame: int) -> np.ndarray:
        depth = clip.recording.depth(frame).copy()
        for k in range(wide):
            depth[10 + k :: 44], depth[:, k::52] = 0, 0
        return depth

    recording = replace(clip.recording, read_depth=striped)
    assert (len(seeds(Pictures.of(recording, clip.cameras), 0)) > 2) == pieces
    found = parts_by_depth(recording, clip.cameras)[0].oriented(0.02)
    angle, away = apart(found.joint, clip.part.joint)
    assert angle < 5.0  # refinement takes it on
    assert away < 0.03


def test_a_surface_that_is_seen_in_spots_is_one_surface() -> None:
    """A dark front returns no depth in 45 % of its pixels, other ones in each frame."""
    clip = make_clip("door")

    def spotted(frame: int) -> np.ndarray:
        lost = np.random.default_rng(frame).random(clip.labels[0].shape) < 0.45
        near = min(clip.labels, key=lambda f: abs(f - frame))
        return np.where(lost & (clip.labels[near] == clip.part.id), 0, clip.recording.depth(frame))

    recording = replace(clip.recording, read_depth=spotted)
    whole = (seeds(Pictures.of(r, clip.cameras), 0) for r in (clip.recording, recording))
    (clean,), (seen,) = whole
    assert len(seen.points) > 0.45 * len(clean.points)
    assert (recording.depth(0)[seen.mask] > 0).all()
    (part,) = parts_by_depth(recording, clip.cameras)
    angle, away = apart(part.oriented(0.02).joint, clip.part.joint)
    assert angle < 3.0
    assert away < 0.03


def test_the_best_path_keeps_to_the_speed_limit() -> None:
    score = np.zeros((6, 9))
    score[:3, 1], score[3:, 7] = 1.0, 1.0
    free, total = best_path(score, np.full(6, 9), 0.0)
    assert free.tolist() == [1, 1, 1, 7, 7, 7]
    assert total == 6.0
    slow, less = best_path(score, np.full(6, 2), 0.0)
    assert np.abs(np.diff(slow)).max() <= 2
    assert less < total
    dear, _ = best_path(score, np.full(6, 9), 1.0)
    assert len(set(dear.tolist())) == 1  # six steps cost more than the three frames give
