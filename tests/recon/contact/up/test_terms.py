"""Each witness of up speaks for the direction that its law says, and is outweighed by others."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from recon.contact.up.decide import ODDS
from recon.contact.up.evidence import PartShown, UpEvidence
from recon.contact.up.terms import log_likelihood, terms
from tests.makers.recon.steep import look
from twin.level import Plane

UP, AHEAD, RIGHT = np.array([0.0, 0.0, 1.0]), np.array([0.0, 1.0, 0.0]), np.array([1.0, 0.0, 0.0])
EYE = np.array([0.0, -0.6, 1.5])
WAYS = {"up": UP, "ahead": AHEAD, "behind": -AHEAD, "right": RIGHT, "left": -RIGHT, "down": -UP}


def seen(pitch: float = 20.0, **what: object) -> UpEvidence:
    """A level camera that looks down by so many degrees and sees nothing else."""
    blank = UpEvidence(EYE, look(pitch, np.zeros(3))[:3, :3], (), (), None)
    return replace(blank, **what)  # type: ignore[arg-type]


def lead(evidence: UpEvidence, witness: str, rival: str) -> float:
    """By how much a witness speaks for up against another direction, nats."""
    return terms(UP, evidence)[witness] - terms(WAYS[rival], evidence)[witness]


FLOOR, TOP = Plane(UP, np.array([0.0, 0.0, 0.0]), 2.0), Plane(UP, np.array([0.0, 0.3, 0.9]), 0.4)
WALL, FRONT = Plane(-AHEAD, np.array([0.0, 0.9, 1.2]), 2.0), Plane(-AHEAD, np.array([0.0, 0.0, 0.7]), 0.5)


def slide(axis: np.ndarray) -> PartShown:
    return PartShown(True, axis, (-AHEAD, -AHEAD))


def hinged(axis: np.ndarray, shut: np.ndarray, opened: np.ndarray | None = None) -> PartShown:
    return PartShown(False, axis, (shut, shut if opened is None else opened))


@pytest.mark.parametrize("rival", ["right", "left", "down", "behind"])
def test_the_camera_is_level_and_not_upside_down(rival: str) -> None:
    assert lead(seen(), "camera", rival) > np.log(ODDS)


def test_the_camera_is_rather_above_what_it_looks_at_than_below() -> None:
    """As steep, to the ceiling; the posture alone doesn't decide from 60 degrees on."""
    assert lead(seen(47.0), "camera", "ahead") > 1.0
    assert abs(lead(seen(60.0), "camera", "ahead")) < np.log(ODDS)


def test_large_planes_face_up_and_the_nearer_of_two_that_face_down_is_the_rarest() -> None:
    one = seen(planes=(FLOOR, WALL))
    both = seen(planes=(FLOOR, TOP, WALL, FRONT))
    assert lead(one, "planes", "ahead") > 0.5
    assert terms(AHEAD, both)["planes"] < terms(AHEAD, one)["planes"]


def test_the_floor_is_as_far_below_as_people_are_tall() -> None:
    high = seen(planes=(replace(FLOOR, centre=np.array([0.0, 0.0, -2.5])),))
    low = seen(planes=(replace(FLOOR, centre=np.array([0.0, 0.0, 1.2])),))
    right = terms(UP, seen(planes=(FLOOR,)))["floor"]
    assert right > 1.0
    assert all(terms(UP, wrong)["floor"] < -0.5 for wrong in (high, low))
    assert terms(UP, seen(planes=(WALL,)))["floor"] == 0.0


@pytest.mark.parametrize("rival", ["ahead", "behind", "down"])
def test_a_drawer_runs_level_and_its_front_stands(rival: str) -> None:
    told = lead(seen(parts=(slide(-AHEAD),)), "parts", rival)
    assert told > np.log(ODDS) if rival != "down" else told == 0.0


def test_a_sliding_door_runs_level_and_its_front_does_not_face_down() -> None:
    assert lead(seen(parts=(slide(RIGHT),)), "parts", "ahead") > np.log(ODDS)
    assert lead(seen(parts=(slide(RIGHT),)), "parts", "right") > np.log(ODDS)


def test_a_front_does_not_face_down() -> None:
    assert lead(seen(parts=(hinged(UP, -AHEAD),)), "parts", "ahead") > np.log(ODDS)
    assert lead(seen(parts=(hinged(RIGHT, -AHEAD),)), "parts", "ahead") > 2.5


def test_a_lid_is_as_likely_as_a_flap_and_says_nothing() -> None:
    """Turned by 90 degrees one is the other."""
    assert abs(lead(seen(parts=(hinged(RIGHT, UP),)), "parts", "ahead")) < 0.5


def test_either_end_of_the_travel_may_be_the_closed_one() -> None:
    """A flap that is open first: there its front faces down."""
    flap, once = hinged(RIGHT, -UP, -AHEAD), hinged(RIGHT, -UP)
    assert terms(UP, seen(parts=(flap,)))["parts"] > terms(UP, seen(parts=(once,)))["parts"] + 0.5


def test_a_part_that_is_none_does_not_outweigh_all_others() -> None:
    """A slide straight up, of something that was carried."""
    told = seen(20.0, planes=(FLOOR, TOP, WALL, FRONT), parts=(slide(UP),))
    assert max(WAYS, key=lambda way: log_likelihood(WAYS[way], told)) == "up"


@pytest.mark.parametrize(("rival", "least"), [("down", 1.5), ("right", 0.7), ("left", 0.7)])
def test_the_arm_comes_from_below(rival: str, least: float) -> None:
    evidence = seen(20.0)
    below = replace(evidence, arm=evidence.camera[:, 1])
    assert lead(below, "arm", rival) > least
    assert lead(evidence, "arm", rival) == 0.0


def test_an_arm_from_beside_is_no_contradiction() -> None:
    evidence = seen(20.0, planes=(FLOOR, WALL), parts=(slide(-AHEAD),))
    beside = replace(evidence, arm=evidence.camera[:, 0])
    assert max(WAYS, key=lambda way: log_likelihood(WAYS[way], beside)) == "up"
