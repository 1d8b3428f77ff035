"""What went wrong is found in the phase in which it did, causes before consequences."""

from __future__ import annotations

import numpy as np
import pytest

from robots.model.catalog import resolve
from robots.simulation.faults import find_faults
from robots.simulation.record import Contact, Record
from robots.task import Task
from robots.trajectory import PHASES

TASK = Task(0.0, 1.0)
N = 60  # ten samples of each phase


@pytest.fixture(scope="module")
def franka():
    return resolve("franka")


def record(**changes):
    """A replay in which all went well: ten samples of each phase, state 1 from the end of `move` on."""
    phase = np.repeat(np.arange(len(PHASES)), 10)
    values = {
        "times": np.arange(N) / 10.0,
        "phase": phase,
        "state": np.concatenate([np.zeros(20), np.linspace(0, 1, 10), np.ones(30)]),
        "speed": np.zeros(N),
        "q": np.zeros((N, 7)),
        "torque": np.zeros((N, 7)),
        "tool": np.tile(np.eye(4), (N, 1, 1)),
        "grip": np.zeros(N),
        "touching": np.where((phase >= 1) & (phase <= 3), 2.0, 0.0),
        "contacts": (),
    }
    return Record(**{**values, **changes})


def faults(spec, *, slip=None, share=None, beyond=None, **changes):
    nothing = np.full((N, 7), 0.1)
    return find_faults(
        record(**changes),
        TASK,
        np.zeros(N) if slip is None else slip,
        nothing if share is None else share,
        -nothing if beyond is None else beyond,
        spec,
    )


def test_nothing_is_found_where_nothing_went_wrong(franka):
    assert faults(franka) == []


def test_a_hand_that_misses_is_a_fault_of_closing(franka):
    found = faults(franka, touching=np.ones(N))
    assert [PHASES[f.phase] for f in found] == ["close"]
    assert "1 of 2 touch" in found[0].reason.text


@pytest.mark.parametrize("at", [5, 25, 45])
def test_a_joint_at_its_limit_is_named_where_it_was(franka, at):
    share = np.full((N, 7), 0.2)
    share[at, 3] = 1.0
    (fault,) = faults(franka, share=share)
    assert PHASES[fault.phase] == PHASES[at // 10]
    assert "joint4 is at its torque limit of 87 N m" in fault.reason.text
    beyond = np.full((N, 7), -0.1)
    beyond[at, 2] = 0.004
    (fault,) = faults(franka, beyond=beyond)
    assert fault.phase == at // 10
    assert "0.004 rad" in fault.reason.text


def test_only_what_goes_deeper_than_2_mm_into_the_static_scene_counts(franka):
    grazed = Contact(2.5, ("link5", "wall"), 0.0019, static=True)
    deep = Contact(3.5, ("link5", "wall"), 0.0031, static=True)
    other = Contact(3.5, ("link5", "static_door"), 0.0100, static=False)
    assert faults(franka, contacts=(grazed, other)) == []
    (fault,) = faults(franka, contacts=(grazed, deep, other))
    assert PHASES[fault.phase] == "hold"
    assert "link5 goes 3.1 mm into the static scene" in fault.reason.text


def test_a_part_that_comes_back_after_it_was_let_go(franka):
    state = np.concatenate([np.zeros(20), np.linspace(0, 1, 10), np.ones(15), np.full(15, 0.4)])
    (fault,) = faults(franka, state=state)
    assert PHASES[fault.phase] == "open"
    assert "1.00 of the way and ended at 0.40" in fault.reason.text


def test_causes_come_before_what_follows_from_them(franka):
    share = np.full((N, 7), 0.2)
    share[25, 0] = 1.0
    state = np.minimum(record().state, 0.3)
    found = faults(franka, share=share, state=state, slip=np.where(np.arange(N) > 27, 0.02, 0.0))
    assert ["torque limit" in f.reason.text for f in found] == [True, False, False]
    assert "did not follow" in found[1].reason.text
    assert "slipped by 20 mm" in found[2].reason.text
