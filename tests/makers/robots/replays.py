"""What holds for every replay, whichever robot does it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

import robots


def check_opened(report):
    """The part is open, and was opened as it should be: held throughout, within the robot's limits, nothing
    else touched."""
    assert report.ok, report.reason
    assert report.opening_final >= 0.90
    assert report.success_75
    assert report.success_90
    assert report.slip_mm <= 10
    assert max(report.torque_share) < 1
    assert report.limit_margin > 0
    assert 0 < report.grip_force_max <= 70 + 1e-9
    assert not report.unintended


def check_open_hand_gets_no_hold(twin, trajectory, opening):
    """The same way with the hand left open by `opening` metres moves nothing: what opens the part is the grip
    alone."""
    open_hand = replace(trajectory, gripper=np.full(len(trajectory.times), opening))
    report = robots.replay(twin, open_hand, video=False)
    assert not report.ok
    assert "did not get hold" in report.reason
