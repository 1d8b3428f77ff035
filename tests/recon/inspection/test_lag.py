"""Depth that lags behind colour is told from depth that lies beside colour, and from nothing that moves."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from recon.inspection import motion_checks
from recon.inspection.finding import Unknown
from recon.inspection.findings import doubts, late_frames
from recon.inspection.glance import Stretch, glance
from recon.inspection.inspect import quick_findings
from recon.inspection.lag import fit_lag
from recon.readers import open_recording
from recon.recording import Recording
from twin.cause import Cause
from twin.files.assets import asset


@pytest.fixture(scope="module")
def recording() -> Recording:
    """The shipped one."""
    return open_recording(asset("recordings/cabinet_drawer"))


@pytest.fixture(scope="module")
def stretch(recording: Recording) -> Stretch:
    (only,) = glance(recording)
    return only


def lagging(stretch: Stretch, frames: int, x: int = 0, y: int = 0) -> Stretch:
    """Depth shows what colour showed so many frames before, and lies x, y px beside it."""
    small = stretch.small.without_depth_delay(-frames)
    move = np.array([[1.0, 0, x], [0, 1.0, y]])

    def depth(i: int) -> np.ndarray:
        return cv2.warpAffine(small.depth(i), move, small.depth(i).shape[::-1], flags=cv2.INTER_NEAREST)

    return Stretch(
        stretch.frames[: len(small)], replace(small, read_depth=depth), stretch.facts[: len(small)]
    )


@pytest.mark.parametrize("lag", [-2, -1, 1, 2, 3])
def test_a_lag_of_whole_frames_is_named(recording: Recording, stretch: Stretch, lag: int) -> None:
    (found,) = motion_checks.lag([lagging(stretch, lag)], recording)
    assert found.type == "DepthDelayed"
    assert late_frames(found) == lag
    assert found.numbers["lag"] == pytest.approx(lag / 15, abs=0.012)
    assert f"--depth-delay {lag}," in found.help
    assert f"{abs(lag)} frame{'s' * (abs(lag) > 1)} (" in found.text
    assert ("lags" in found.text) == (lag > 0)


def test_depth_in_time_is_not_late(recording: Recording, stretch: Stretch) -> None:
    assert motion_checks.lag([stretch], recording) == []


@pytest.mark.parametrize("lag", [0, 2])
def test_depth_beside_colour_is_not_taken_for_late(recording: Recording, stretch: Stretch, lag: int) -> None:
    found = motion_checks.lag([lagging(stretch, lag, 8, -5)], recording)
    assert [late_frames(f) for f in found if isinstance(f, Cause)] == [lag] * bool(lag)


def test_a_recording_denser_than_is_looked_at_tells_its_own_frames(
    recording: Recording, stretch: Stretch
) -> None:
    """Every second frame, as of a recording with 30 a second: one of its frames is half of one that is looked
    at."""
    late = lagging(stretch, 1)
    kept = np.arange(0, len(late.small), 2)
    small = late.small[::2]
    (found,) = motion_checks.lag([Stretch(kept, small, ())], recording)
    assert found.type == "DepthDelayed"
    assert late_frames(found) == 1


def test_where_nothing_moves_the_lag_is_not_known(recording: Recording, stretch: Stretch) -> None:
    color, depth = stretch.small.frame(0)
    still = replace(stretch.small, read_color=lambda _: color, read_depth=lambda _: depth)
    assert fit_lag([Stretch(stretch.frames, still, ())]) is None
    (found,) = motion_checks.lag([Stretch(stretch.frames, still, ())], recording)
    assert isinstance(found, Unknown)


def test_frames_in_another_order_have_no_lag(stretch: Stretch) -> None:
    order = np.random.default_rng(4).permutation(len(stretch.small))
    small = stretch.small
    mixed = replace(small, read_depth=lambda i: small.depth(int(order[i])))
    assert fit_lag([Stretch(stretch.frames, mixed, ())]) is None


def test_late_depth_is_said_before_a_reconstruction_and_not_called_beside_colour(
    recording: Recording,
) -> None:
    with pytest.warns(
        UserWarning, match=r"depth lags 2 frames \(1\d\d ± \d+ ms\) behind colour; open it with"
    ):
        found = quick_findings(recording.without_depth_delay(-2))
    assert any(late_frames(f) == 2 and doubts(f) for f in found)
    assert not any(f.type == "Misregistered" for f in found)
    assert quick_findings(recording) == ()
