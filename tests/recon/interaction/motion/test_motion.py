"""Parts found among tracks of rendered recordings: how many, which joints, when."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Literal

import numpy as np
import pytest

from benchmarks.scenes.tracks import together, track_scene
from recon.cameras.poses import estimate_cameras
from recon.interaction.joints.config import JointConfig
from recon.interaction.joints.fit_tracks import fit_motion
from recon.interaction.joints.group_fits import on_course, widened
from recon.interaction.motion.movers import Movers
from recon.interaction.parts.config import MAX_RESIDUAL, REST_TOLERANCE, MotionConfig
from recon.interaction.parts.find_parts import Search, _moving_part, find_parts
from recon.readers import open_recording
from recon.recording import Recording
from recon.tracking.follow import track_points
from recon.tracking.tracks import Tracks
from tests.makers.recon import tiny
from twin import geometry as geo
from twin.errors import ConfigError
from twin.scene import Revolute, Trajectory

FRAMES = 120
OF_TWO = 80  # frames, half of them for each part; 43 tracks are on the door, 27 on the drawer
Tracked = tuple[Recording, Tracks, Trajectory]


def _tracked(folder: Path) -> Tracked:
    recording = open_recording(folder)
    tracks = track_points(recording).dense()
    cameras = estimate_cameras(tracks, recording.times, recording.intrinsics.fx)
    return recording, tracks, cameras.transformed(tiny.cameras(len(recording))[0])


@pytest.fixture(scope="module")
def two(tmp_path_factory: pytest.TempPathFactory) -> Tracked:
    """A door is opened, then a drawer."""
    folder = tmp_path_factory.mktemp("motion") / "two"
    return _tracked(tiny.write_recording(folder, ("door", "drawer"), frames=OF_TWO, scale=4, pattern=47.0))


@pytest.mark.parametrize("method", ["fits", "clusters"])
def test_two_parts_that_move_one_after_the_other(two: Tracked, method: Literal["fits", "clusters"]) -> None:
    found = find_parts(*two, MotionConfig(method=method))
    assert {p.part.joint.kind for p in found.parts} == {"revolute", "prismatic"}
    assert len(found.parts) == 2
    for part in found.parts:
        joint = part.part.joint
        truth, _, _ = tiny.JOINTS["door" if joint.kind == "revolute" else "drawer"]
        assert np.degrees(geo.line_angle(joint.axis, truth.axis)) < 3.0  # before refinement
        if isinstance(joint, Revolute) and isinstance(truth, Revolute):
            assert geo.line_distance(joint.pivot, joint.axis, truth.pivot, truth.axis) < 0.03
        (interval,) = part.part.motion.intervals
        first = OF_TWO // 8 if joint.kind == "revolute" else OF_TWO // 2 + OF_TWO // 8
        last = 3 * OF_TWO // 8 if joint.kind == "revolute" else OF_TWO // 2 + 3 * OF_TWO // 8
        assert first - 2 <= interval[0] < interval[1] <= last + 2


def test_nothing_moves(tmp_path: Path) -> None:
    folder = tiny.write_recording(
        tmp_path / "still", ("drawer",), frames=FRAMES, scale=2, pattern=47.0, still=True
    )
    recorded = _tracked(folder)
    with pytest.warns(UserWarning, match="moves"):
        assert find_parts(*recorded).parts == ()


def test_what_travels_far_does_not_outvote_a_part_that_travels_little(tmp_path: Path) -> None:
    """A door seen near its hinge moves by centimetres; drifting tracks travel a metre, each its own way."""
    recording = open_recording(tiny.write_recording(tmp_path / "still", ("door",), frames=FRAMES, still=True))
    rng = np.random.default_rng(3)
    state = np.interp(np.arange(FRAMES), [30, 60], [0.0, 1.0])
    joint = Revolute(geo.unit(np.array([0.1, 1.0, 0.05])), 0.0, 1.0, pivot=np.array([0.2, 0.0, 1.5]))
    door = joint.pivot + np.array([0.15, 0.4, 0.04]) * rng.uniform(-1.0, 1.0, (60, 3))
    door = geo.transform(joint.poses(state), door)
    drifting = (
        np.cumsum(rng.normal(0.0, 0.012, (FRAMES, 25, 3)), axis=0)
        + rng.uniform(-0.5, 0.5, (25, 3))
        + [0, 0, 2]
    )
    points = np.concatenate([door, drifting], axis=1) + rng.normal(0.0, 0.001, (FRAMES, 85, 3))
    seen = np.ones(points.shape[:2], bool)
    tracks = Tracks(points, np.zeros((*seen.shape, 2)), seen)
    still = Trajectory(np.arange(FRAMES), recording.times, np.tile(np.eye(4), (FRAMES, 1, 1)))
    found = find_parts(recording, tracks, still)
    (part,) = found.parts
    assert part.members[:60].mean() > 0.9
    assert not part.members[60:].any()
    assert np.degrees(geo.line_angle(part.part.joint.axis, joint.axis)) < 0.5
    assert part.part.motion.state[-1] == pytest.approx(1.0, abs=0.01)


def test_tracks_once_seen_on_the_hand_stay_there() -> None:
    """The colours that are learnt around the second part's motion add to those of the first's."""
    door = track_scene("door", "none", seed=1, tracks=80)
    drawer = track_scene("drawer", "none", seed=6, tracks=80)
    points, seen = together(door, drawer)
    every = np.ones(160, bool)
    on_hand = iter([np.arange(160) == 3, np.arange(160) == 120, np.zeros(160, bool)])
    to_part = partial(_moving_part, np.arange(len(points)), np.arange(len(points)) / 15.0)
    search = Search(
        Movers(points, seen, every, every),
        lambda _: next(on_hand),
        to_part,
        JointConfig(),
        (),
    )
    assert search.take(every)
    search.take(every)
    assert np.flatnonzero(search.hand).tolist() == [3, 120]
    assert not search.free[[3, 120]].any()


def test_settings_are_checked() -> None:
    with pytest.raises(ConfigError):
        MotionConfig(max_parts=0)


def test_a_track_that_circles_the_axis_is_on_course_whatever_its_state() -> None:
    joint = Revolute(geo.unit(np.array([0.1, 1.0, 0.05])), 0.0, 1.0, pivot=np.array([0.2, 0.0, 1.5]))
    state = np.linspace(0.0, 1.2, 30)
    on_door = geo.transform(joint.poses(state), joint.pivot + np.array([[0.3, 0.2, 0.0], [0.0, -0.3, 0.25]]))
    straight = joint.pivot + np.linspace([0.3, 0.0, 0.0], [0.3, 0.1, 0.3], 30)
    still = np.tile(joint.pivot + [0.1, 0.1, 0.1], (30, 1))
    points = np.concatenate([on_door, straight[:, None], still[:, None]], axis=1)
    moving = np.array([True, True, True, False])
    movers = Movers(points, np.ones(points.shape[:2], bool), moving, moving)
    fit = fit_motion(
        geo.transform(joint.poses(state), joint.pivot + np.random.default_rng(1).uniform(-0.3, 0.3, (20, 3))),
        np.ones((30, 20), bool),
    )
    assert on_course(fit, movers, REST_TOLERANCE).tolist() == [True, True, False, False]


def test_a_part_fitted_again_from_both_sides_keeps_why_it_is_a_hinge() -> None:
    """The front is seen in the first 30 frames, the inside in the last 25."""
    joint = Revolute(geo.unit(np.array([0.1, 1.0, 0.05])), 0.0, 1.0, pivot=np.array([0.2, 0.0, 1.5]))
    rng = np.random.default_rng(1)
    points = geo.transform(
        joint.poses(np.linspace(0.0, 1.2, 50)), joint.pivot + rng.uniform(-0.3, 0.3, (40, 3))
    )
    points = points + rng.normal(0, 5e-4, points.shape)
    seen = np.ones(points.shape[:2], bool)
    seen[30:, :20], seen[:25, 20:] = False, False
    everything = np.ones(40, bool)
    movers = Movers(points, seen, everything, everything)
    front = fit_motion(points[:, :20], seen[:, :20])
    both = widened(front, everything, movers, JointConfig(), MAX_RESIDUAL)
    assert len(both.frames) == 50 > len(front.frames)
    assert both.type_source == front.type_source
    assert both.type_source.startswith("motion")
    assert widened(front, everything, movers, JointConfig(), 0.5 * both.residual) is front, (
        "too loose to be kept"
    )
