"""Leaps of a state by one or two frames are no motion."""

from __future__ import annotations

import numpy as np
import pytest

from recon.interaction.refine.refine_parts import without_leaps


def opened(frames: int, fast: int) -> np.ndarray:
    """Rest, a motion of `fast` frames by .3, and rest."""
    t = np.clip((np.arange(frames) - 20) / fast, 0.0, 1.0)
    return np.asarray(0.3 * (3 * t**2 - 2 * t**3))


@pytest.mark.parametrize("length", [1, 2])
def test_a_leap_while_the_part_rests_is_taken_out(length: int) -> None:
    state = opened(60, 12)
    leaping = state.copy()
    leaping[40 : 40 + length] += 0.03
    assert np.array_equal(without_leaps(leaping), state)


@pytest.mark.parametrize("fast", [3, 8, 40])
def test_a_motion_stays_as_it_is(fast: int) -> None:
    """Also one that goes back at once, and one of three frames."""
    state = opened(60, fast)
    for way in (state, state[::-1]):
        assert np.array_equal(without_leaps(way), way)
    at_once = np.concatenate([state[: 20 + fast + 1], state[20 : 20 + fast][::-1], state[:20]])
    if fast >= 8:
        assert np.array_equal(without_leaps(at_once), at_once)
