"""When a joint moves, from closed-form states."""

from __future__ import annotations

import numpy as np
import pytest

from recon.interaction.motion.intervals import Interval, state_intervals
from tests.makers.recon.tiny import smooth
from twin.errors import SceneError


def _expected(state: np.ndarray, share: float = 0.02) -> tuple[int, int]:
    span = np.ptp(state)
    first = int(np.argmax(np.abs(state - state[0]) > share * span))
    last = len(state) - 1 - int(np.argmax(np.abs(state[::-1] - state[-1]) > share * span))
    return first, last


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_one_motion_is_found_to_the_frame(sign: float) -> None:
    state = sign * 1.2 * smooth(120, 40, 90)
    found = state_intervals(np.arange(120), state, 0.0)
    assert [(i.first, i.last) for i in found] == [_expected(state)]


def test_noise_moves_the_ends_by_few_frames() -> None:
    clean = 1.2 * smooth(120, 40, 90)
    noisy = clean + np.random.default_rng(0).normal(scale=0.004, size=120)
    (found,) = state_intervals(np.arange(120), noisy, 0.004)
    first, last = _expected(clean)
    assert abs(found.first - first) <= 2
    assert abs(found.last - last) <= 2


def test_open_and_close_again_are_two_intervals_and_frame_numbers_are_kept() -> None:
    state = smooth(160, 20, 60) - smooth(160, 90, 130)
    frames = np.arange(160) + 7
    found = state_intervals(frames, state, 0.0)
    assert len(found) == 2
    assert 27 <= found[0].first < found[0].last <= 67 < 97 <= found[1].first < found[1].last <= 137


def test_rest_has_no_interval() -> None:
    assert state_intervals(np.arange(50), np.random.default_rng(0).normal(scale=1e-3, size=50), 1e-3) == ()


def test_motion_that_reaches_the_last_frame_ends_there() -> None:
    state = smooth(100, 60, 100)[:90]
    (found,) = state_intervals(np.arange(90), state, 0.0)
    # what lies within 2 % of the last state counts as rest; the last frames settle within that
    assert abs(found.last - _expected(state)[1]) <= 1


def test_laws() -> None:
    with pytest.raises(SceneError):
        Interval(5, 5)
