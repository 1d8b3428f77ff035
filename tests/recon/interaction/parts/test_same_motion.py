"""One board found in two pieces is one part, two boards are two."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from recon.interaction.parts.moving_part import MovingPart
from recon.interaction.parts.same_motion import distinct, move_alike
from tests.makers.recon.cabinets import Kind, make_clip
from twin import geometry as geo
from twin.scene import Prismatic, Revolute


def part(kind: Kind) -> MovingPart:
    return make_clip(kind).part


def again(p: MovingPart, aside: float = 0.0, tilt: float = 0.0, noise: float = 0.0) -> MovingPart:
    """The same part with another id: its hinge shifted, its axis tilted (rad), its states with noise and
    another zero."""
    across = geo.orthogonal_basis(p.joint.axis)[:, 0]
    joint = replace(p.joint, axis=geo.exp_so3(tilt * across) @ p.joint.axis, covariance=None)
    if isinstance(joint, Revolute):
        joint = replace(joint, pivot=joint.pivot + aside * across + 0.2 * joint.axis)
    state = p.motion.state + np.random.default_rng(0).normal(0.0, noise, len(p.motion.state)) + 0.1
    return MovingPart(p.id + 1, joint, replace(p.motion, state=state))


@pytest.mark.parametrize("kind", ["door", "drawer"])
def test_the_same_motion_is_one_part(kind: Kind) -> None:
    one = part(kind)
    two = again(one, 0.002, 0.005, 0.001)
    assert move_alike(one, two)
    assert distinct((one, two)) == (one,)


@pytest.mark.parametrize("kind", ["door", "drawer"])
def test_what_moves_otherwise_is_another_part(kind: Kind) -> None:
    one = part(kind)
    late = again(one)
    late = replace(late, motion=replace(late.motion, state=np.roll(late.motion.state, 5)))
    back = replace(again(one), joint=one.joint.reversed())
    others = [again(one, tilt=0.2), late, back]
    if kind == "door":
        others.append(again(one, aside=0.1))
    for other in others:
        assert not move_alike(one, other)
        assert distinct((one, other)) == (one, other)
    assert not move_alike(one, part("drawer" if kind == "door" else "door"))


def test_what_hardly_moves_is_no_evidence() -> None:
    one = part("drawer")
    still = replace(one, motion=replace(one.motion, state=0.02 * one.motion.state))
    assert not move_alike(still, again(still))
    nowhere = replace(one, motion=replace(one.motion, frames=one.motion.frames + 10_000))
    assert not move_alike(one, nowhere)
    assert isinstance(one.joint, Prismatic)
