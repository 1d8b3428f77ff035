"""Windows: handled times with rest around, joined where they meet."""

from __future__ import annotations

import numpy as np
import pytest

from recon.dense.noise import GOOD_SENSOR
from recon.windows.activity import activity, moved_points, share_in_view
from recon.windows.windows import REST_S, Window, apart, find_windows, handled, looked_at, padded
from tests.makers.recon.cabinets import make_clip
from tests.makers.recon.visits import Visit, visits_of
from twin.scene import Trajectory

FPS = 10.0


def shares(busy: list[tuple[int, int]], frames: int = 400) -> tuple[np.ndarray, np.ndarray]:
    out = np.zeros(frames)
    for a, b in busy:
        out[a : b + 1] = 0.05
    return out, 5.0 + np.arange(frames) / FPS


def test_each_handled_time_has_rest_on_both_sides() -> None:
    share, times = shares([(100, 140), (300, 320)])
    rest = round(REST_S * FPS)
    first, second = padded(handled(share, times), times)
    assert first == Window(100 - rest, 140 + rest, (100, 140))
    assert second == Window(300 - rest, 320 + rest, (300, 320))


def test_neighbours_share_the_rest_between_them_and_none_leaves_the_recording() -> None:
    share, times = shares([(10, 40), (60, 120), (380, 399)])
    windows = padded(handled(share, times), times)
    assert windows == (Window(0, 59, (10, 40)), Window(41, 150, (60, 120)), Window(350, 399, (380, 399)))
    assert apart(windows) == [(0, 150), (350, 399)]


def test_a_hand_that_holds_still_ends_nothing_and_a_flash_is_nothing() -> None:
    share, times = shares([(100, 130), (138, 160), (250, 252)])
    assert handled(share, times) == [(100, 160)]


def test_rest_ends_where_the_person_looks_elsewhere() -> None:
    """From frame 95 to 155 the place is in view, half of it or more of what is ever seen of it."""
    times, shown = np.arange(400) / FPS, np.zeros(400)
    shown[95:156], shown[120] = 0.4, 0.7
    whole = Window(70, 170, (100, 140))
    assert looked_at(whole, shown, times) == Window(93, 155, (100, 140))  # .7 s stay
    assert looked_at(whole, np.ones(400), times) == whole
    shown[85:90] = 1.0  # a glance that is not joined to the rest; nor does it count for what is in view
    assert looked_at(whole, shown, times) == Window(93, 155, (100, 140))


def test_moved_points_are_in_view_where_the_camera_looks() -> None:
    """Of a door they lie about it; a camera that has turned round sees none."""
    clip = make_clip("door")
    first, last = clip.part.motion.intervals[0]
    points = moved_points(clip.recording, clip.cameras, GOOD_SENSOR, (first, last))
    assert len(points) > 100
    turned = clip.cameras.T_world_cam.copy()
    turned[0] = turned[0] @ np.diag([-1.0, 1.0, -1.0, 1.0])
    away = Trajectory(clip.cameras.frames, clip.cameras.times, turned)
    shown = share_in_view(points, clip.recording, away)
    assert shown[0] == 0.0
    assert shown[1:].min() > 0.9


def test_frames_without_a_camera_say_nothing() -> None:
    share, times = shares([(100, 140)])
    share[115:120] = np.nan
    assert handled(share, times) == [(100, 140)]


def test_windows_shift_with_the_recording_and_not_with_its_clock() -> None:
    share, times = shares([(100, 140)])
    assert padded(handled(share, times + 1000.0), times + 1000.0) == padded(handled(share, times), times)
    later = np.roll(share, 50)
    (a,), (b,) = padded(handled(share, times), times), padded(handled(later, times), times)
    assert (b.first - a.first, b.last - a.last) == (50, 50)


@pytest.mark.parametrize("kind", ["door", "drawer", "slide"])
def test_what_moves_is_the_part_and_the_hand(kind: str) -> None:
    clip = make_clip(kind)
    share = activity(clip.recording, clip.cameras, GOOD_SENSOR)
    moving = np.zeros(len(clip.recording), bool)
    for first, last in clip.part.motion.intervals:
        moving[first : last + 1] = True
    assert (share[moving] > 0.004).all()


def test_a_room_in_which_nothing_moves_is_still() -> None:
    clip = make_clip("door")
    recording, cameras, _ = visits_of([Visit(clip)])
    still = recording[0:10]
    frozen = type(still).from_arrays(
        np.stack([recording.color(0)] * 10), np.stack([recording.depth(0)] * 10), recording.intrinsics, fps=15
    )
    share = activity(
        frozen,
        type(cameras)(cameras.frames[:10], cameras.times[:10], np.stack([cameras.T_world_cam[0]] * 10)),
        GOOD_SENSOR,
    )
    assert (share == 0).all()


def test_a_clip_is_one_window_with_all_its_frames() -> None:
    clip = make_clip("door")
    assert find_windows(clip.recording, clip.cameras, GOOD_SENSOR) == (Window(0, len(clip.recording) - 1),)
