"""What went wrong in a replay, when, and in which order of cause."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robots.model.spec import RobotSpec
from robots.reasons import reason
from robots.simulation.record import Record
from robots.task import Task
from robots.trajectory import PHASES
from twin.cause import Cause
from twin.geometry import Array

SLIP_LIMIT = 0.010  # m
DEPTH_LIMIT = 0.002  # m of the robot's overlap with the static scene


@dataclass(frozen=True)
class Fault:
    """One thing that went wrong, and the index into PHASES of when it did (-1: after the last)."""

    phase: int
    reason: Cause


def find_faults(
    record: Record, task: Task, slip: Array, share: Array, beyond: Array, spec: RobotSpec
) -> list[Fault]:
    """All faults, causes before what follows from them.

    Args:
        slip: (n,) m.
        share: (n, j) torques of their limits.
        beyond: (n, j) by which joints are out of their range.
    """
    return [
        *_grip(record),
        *_joints(record, share, beyond, spec),
        *_way(record, task),
        *_scene(record),
        *_slips(record, slip),
    ]


def _grip(record: Record) -> list[Fault]:
    close = PHASES.index("close")
    touching = record.touching[np.flatnonzero(record.phase == close)[-1]]
    if touching >= 2:
        return []
    return [Fault(close, reason("NotGripped", float(touching)))]


def _joints(record: Record, share: Array, beyond: Array, spec: RobotSpec) -> list[Fault]:
    found = []
    if share.max() >= 1.0 - 1e-6:
        k = int(np.argmax(share.max(axis=0)))
        at = int(np.argmax(share[:, k]))
        unit = "N" if k < len(spec.base_joints) - 1 else "N m"  # a planar base slides twice, then turns
        weak = reason(
            "AtTorqueLimit", spec.arm_joints[k], float(spec.effort[k]), unit, float(record.times[at])
        )
        found.append(Fault(int(record.phase[at]), weak))
    if beyond.max() > 0:
        at = int(np.argmax(beyond.max(axis=1)))
        found.append(Fault(int(record.phase[at]), reason("BeyondJointLimit", float(beyond.max()))))
    return found


def _way(record: Record, task: Task) -> list[Fault]:
    """Why the part is not where it was to go."""
    final = task.reached(float(record.state[-1]))
    if final >= 0.90:
        return []
    move = PHASES.index("move")
    lost = np.flatnonzero((record.phase == move) & (record.touching == 0))
    if len(lost):
        return [Fault(move, reason("LostPart", float(record.state[lost[0]])))]
    done = "opened" if task.direction > 0 else "closed"
    reached = np.array([task.reached(float(s)) for s in record.state])
    peak = float(reached.max())
    if peak >= 0.90:
        after = record.phase[np.flatnonzero(reached >= 0.90)[-1]]
        return [Fault(int(after), reason("CameBack", done, peak, final))]
    return [Fault(move, reason("Stuck", done, peak, _pressed(record)))]


def _pressed(record: Record) -> tuple[str, str] | None:
    """The two bodies that touched most often though they should not."""
    pairs = [c.bodies for c in record.contacts]
    return max(dict.fromkeys(pairs), key=pairs.count) if pairs else None


def _scene(record: Record) -> list[Fault]:
    deep = [c for c in record.contacts if c.static and c.depth > DEPTH_LIMIT]
    if not deep:
        return []
    worst = max(deep, key=lambda c: c.depth)
    phase = int(record.phase[int(np.argmin(np.abs(record.times - worst.time)))])
    return [Fault(phase, reason("IntoScene", worst.bodies[0], worst.depth, worst.time))]


def _slips(record: Record, slip: Array) -> list[Fault]:
    if slip.max() <= SLIP_LIMIT:
        return []
    at = int(np.argmax(slip > SLIP_LIMIT))
    return [Fault(int(record.phase[at]), reason("Slipped", float(slip.max())))]
