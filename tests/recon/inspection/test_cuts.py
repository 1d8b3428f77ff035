"""Cuts in the video are named by their frames; a change of light and of a screen are none."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from recon.inspection import frame_checks
from recon.inspection.cuts import Shown, thumbnail
from recon.inspection.finding import Unknown
from recon.inspection.findings import doubts, finding
from recon.inspection.inspect import quick_findings
from recon.readers import open_recording
from recon.recording import Recording
from twin.cause import Cause
from twin.files.assets import asset


@pytest.fixture(scope="module")
def recording() -> Recording:
    return open_recording(asset("recordings/cabinet_drawer"))


def of_frames(recording: Recording, frames: list[int]) -> Recording:
    """These frames in this order, as if recorded one after the other."""
    times = recording.times[: len(frames)]
    return replace(
        recording,
        times=times,
        read_color=lambda i: recording.color(frames[i]),
        read_depth=lambda i: recording.depth(frames[i]),
    )


def told(recording: Recording) -> list[Cause | Unknown]:
    thumbnails = [thumbnail(recording.frame(i)) for i in range(len(recording))]
    return frame_checks.cut([Shown(np.arange(len(recording)), thumbnails)], recording)


def test_a_cut_is_named_by_its_frames(recording: Recording) -> None:
    (found,) = told(of_frames(recording, [*range(20), *range(60, 88)]))
    assert found == finding("Cut", 19, 1)
    assert doubts(found)
    assert "between frames 19 and 20" in found.text
    assert "--start and --end" in found.help


def test_two_cuts_are_counted(recording: Recording) -> None:
    assert told(of_frames(recording, [*range(20), *range(50, 70), *range(20)])) == [finding("Cut", 19, 2)]


def test_a_whole_video_has_no_cut(recording: Recording) -> None:
    assert told(recording) == []


def test_a_change_of_light_is_no_cut(recording: Recording) -> None:
    def color(i: int) -> np.ndarray:
        return (recording.color(i) * (0.6 if i >= 40 else 1.0)).astype(np.uint8)

    assert told(replace(recording, read_color=color)) == []


def test_a_screen_that_shows_another_picture_is_no_cut(recording: Recording) -> None:
    """All of colour changes, and no depth."""

    def color(i: int) -> np.ndarray:
        return recording.color(i) if i < 40 else recording.color(i)[::-1, ::-1]

    assert told(replace(recording, read_color=color)) == []


def test_frames_that_the_clock_tells_to_be_missing_are_no_cut(recording: Recording) -> None:
    cut = of_frames(recording, [*range(20), *range(60, 88)])
    times = cut.times.copy()
    times[20:] += 2.0
    assert told(replace(cut, times=times)) == []


def test_a_cut_of_a_dense_video_is_named_by_the_frames_between_those_that_are_looked_at(
    recording: Recording,
) -> None:
    cut = of_frames(recording, [*range(21), *range(60, 88)])
    kept = np.arange(0, len(cut), 2)
    shown = Shown(kept, [thumbnail(cut.frame(int(i))) for i in kept])
    assert frame_checks.cut([shown], cut) == [finding("Cut", 20, 1)]


def test_a_cut_is_said_before_a_reconstruction(recording: Recording) -> None:
    with pytest.warns(UserWarning, match="the video is cut: between frames 19 and 20"):
        found = quick_findings(of_frames(recording, [*range(20), *range(60, 88)]))
    assert finding("Cut", 19, 1) in found
