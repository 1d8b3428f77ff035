"""The fit to a group of tracks: what creeps along edges carries none, whatever joint it follows."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.scenes.tracks import minimum_jerk
from recon.interaction.joints.config import MIN_TRACKS, JointConfig
from recon.interaction.joints.group_fits import fit_group
from recon.interaction.motion.movers import Movers
from twin import geometry as geo
from twin.errors import ReconstructionError

FRAMES = np.arange(100.0)
OPENING = np.concatenate([np.zeros(30), minimum_jerk(40), np.ones(30)])
DRAWER = np.arange(28) < 20
CREEPING = ~DRAWER


def movers() -> Movers:
    """20 tracks of a drawer that goes 250 mm; 8 that creep 20 mm, each when and whereto it likes."""
    rng = np.random.default_rng(0)
    ways, axis = np.zeros((len(FRAMES), 28, 3)), np.array([0.0, 1.0, 0.0])
    ways[:, DRAWER] = 0.25 * OPENING[:, None, None] * axis
    for k in np.flatnonzero(CREEPING):
        state = np.interp(FRAMES - rng.uniform(-30, 30), FRAMES, OPENING)
        ways[:, k] = 0.02 * state[:, None] * geo.unit(axis + rng.normal(0.0, 0.3, 3))
    points = rng.uniform(-0.3, 0.3, (28, 3)) + ways + rng.normal(0.0, 0.001, ways.shape)
    every = np.ones(28, bool)
    return Movers(points, np.ones(points.shape[:2], bool), every, every)


def test_tracks_that_creep_carry_no_fit_that_must_explain_something() -> None:
    tracks, every = movers(), np.ones(28, bool)
    loose = fit_group((CREEPING,), every, tracks, JointConfig())
    assert loose.members.sum() > MIN_TRACKS  # enough follow, and hardly better than they stand still
    with pytest.raises(ReconstructionError, match="hardly better than they stand still"):
        fit_group((CREEPING,), every, tracks, JointConfig(), least=MIN_TRACKS)


def test_a_choice_that_explains_something_is_taken_after_one_that_does_not() -> None:
    found = fit_group((CREEPING, DRAWER), np.ones(28, bool), movers(), JointConfig(), least=MIN_TRACKS)
    np.testing.assert_array_equal(found.chosen, DRAWER)
    assert found.fit.joint.upper == pytest.approx(0.25, abs=0.005)
