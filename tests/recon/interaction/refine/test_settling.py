"""Rounds that creep arrive, and rounds that do not end say how far they are."""

from __future__ import annotations

import numpy as np
import pytest

from recon.interaction.refine.observations import Drift
from recon.interaction.refine.settling import MOST_ROUNDS, Mixing, settle
from recon.interaction.refine.solver import step
from recon.interaction.refine.terms import Terms
from recon.interaction.refine.uncertainty import with_uncertainty
from tests.recon.interaction.refine.test_refine_uncertainty import FRAMES, JOINTS, STATE, observed
from twin.geometry import Array
from twin.joint import Joint

NO_TERMS = Terms(np.zeros(0, int), np.zeros(0, int), np.zeros((0, 3)), np.zeros(0), np.zeros((0, 3)))


def towards(joint: Joint, state: Array, share: Array, seen: list[float]):  # type: ignore[no-untyped-def]
    """A round that goes a share (2,) or (4,) of the way to a joint, and all of the way to the states."""

    def one_round(at: Joint, _: Array) -> tuple[Joint, Array, Terms]:
        way = joint.minus(at)
        seen.append(float(np.linalg.norm(way)))
        return at.plus(share * way), state, NO_TERMS

    return one_round


@pytest.mark.parametrize("name", JOINTS)
def test_a_joint_that_creeps_along_a_valley_arrives(name: str) -> None:
    """A twentieth of the way a round in one direction, as a plain flap whose pivot is off along the plane
    that halves its turn."""
    joint, state = JOINTS[name], JOINTS[name].upper * STATE
    n = len(joint.minus(joint))
    off = np.array([0.03, -0.02, 0.05, 0.02])[:n]
    share = np.array([0.9, 0.05, 0.05, 0.9])[:n]
    seen: list[float] = []
    end = settle(towards(joint, state, share, seen), joint.plus(off), state)
    assert len(seen) < MOST_ROUNDS
    assert np.abs(joint.minus(end.joint)[:2]).max() < np.radians(
        0.2
    )  # a round's step is 0.01 deg at most: a twentieth of the way
    assert np.abs(joint.minus(end.joint)[2:]).max(initial=0.0) < 0.002
    assert not end.left.any()
    plainly = off * (1.0 - share) ** len(seen)
    assert np.abs(joint.minus(end.joint)).max() < 0.3 * np.abs(plainly).max()


def test_a_joint_at_its_place_takes_two_rounds_and_stays() -> None:
    joint, state = JOINTS["door"], JOINTS["door"].upper * STATE
    seen: list[float] = []
    end = settle(towards(joint, state, np.ones(4), seen), joint, state)
    assert len(seen) == 2
    assert not joint.minus(end.joint).any()
    np.testing.assert_array_equal(end.state, state)


def test_what_a_joint_has_left_to_go_is_part_of_its_uncertainty() -> None:
    """It turns half a degree a round, for ever."""
    joint, state = JOINTS["drawer"], JOINTS["drawer"].upper * STATE
    turn = np.array([np.radians(0.5), 0.0])
    end = settle(lambda at, s: (at.plus(turn), s, NO_TERMS), joint, state)
    assert abs(float(end.left[0])) == pytest.approx(np.radians(5.0))
    terms, rests = observed(joint, state, np.random.default_rng(0), 0.002, 0.0), np.zeros(FRAMES, bool)
    sure, unsure = (
        with_uncertainty(joint, state, state, rests, terms, left, Drift()) for left in (np.zeros(2), end.left)
    )
    np.testing.assert_allclose(unsure.covariance, sure.covariance + np.outer(end.left, end.left), atol=1e-15)
    assert unsure.sigma.axis > 10.0 * sure.sigma.axis


def test_mixing_ends_a_linear_iteration_of_two_slow_directions() -> None:
    slow, fixed = np.diag([0.12, 0.3]), np.array([3.0, -2.0])
    mixing, x = Mixing(), np.zeros(2)
    for _ in range(7):
        x = mixing.next(x, slow @ (fixed - x))
    plain = np.zeros(2)
    for _ in range(7):
        plain = plain + slow @ (fixed - plain)
    assert np.linalg.norm(x - fixed) < 1e-3 * np.linalg.norm(plain - fixed)


@pytest.mark.parametrize("name", JOINTS)
def test_a_joint_of_which_nothing_was_observed_stays_and_is_as_unsure_as_can_be(name: str) -> None:
    """No label shows the part, or depth is lost: nothing breaks, and the verdict refuses it."""
    joint, state, rests = JOINTS[name], JOINTS[name].upper * STATE, np.zeros(FRAMES, bool)
    after, states = step(joint, state, state, rests, NO_TERMS)
    np.testing.assert_allclose(after.minus(joint), 0.0, atol=1e-12)
    left = np.zeros(len(joint.minus(joint)))
    found = with_uncertainty(after, states, state, rests, NO_TERMS, left, Drift())
    assert found.sigma.axis > np.radians(90.0)
    assert found.residual == 0.0
