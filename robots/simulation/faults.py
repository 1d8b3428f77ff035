"""What went wrong in a replay, when, and in which order of cause."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robots.model.spec import RobotSpec
from robots.simulation.record import Record
from robots.task import Task
from robots.trajectory import PHASES
from twin.geometry import Array

SLIP_LIMIT = 0.010  # m
DEPTH_LIMIT = 0.002  # m of the robot's overlap with the static scene
STATIC = "static_"  # how the body of the static scene is named in the replay


@dataclass(frozen=True)
class Fault:
    """One thing that went wrong, and the index into PHASES of when it did (-1: after the last)."""

    phase: int
    text: str


def find_faults(
    record: Record, task: Task, slip: Array, share: Array, beyond: Array, spec: RobotSpec
) -> list[Fault]:
    """All faults, causes before what follows from them.

    Args:
        slip: (n,) m. share: (n, j) torques of their limits. beyond: (n, j) by which joints are out of their range.
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
    return [Fault(close, f"the fingers did not get hold of the part ({touching:.0f} of 2 touch it)")]


def _joints(record: Record, share: Array, beyond: Array, spec: RobotSpec) -> list[Fault]:
    found = []
    if share.max() >= 1.0 - 1e-6:
        k = int(np.argmax(share.max(axis=0)))
        at = int(np.argmax(share[:, k]))
        unit = "N" if k < len(spec.base_joints) - 1 else "N m"  # a planar base slides twice, then turns
        text = f"{spec.arm_joints[k]} is at its torque limit of {spec.effort[k]:.0f} {unit} at {record.times[at]:.1f} s"
        found.append(Fault(int(record.phase[at]), text))
    if beyond.max() > 0:
        at = int(np.argmax(beyond.max(axis=1)))
        found.append(Fault(int(record.phase[at]), f"a joint goes {beyond.max():.3f} rad beyond its limit"))
    return found


def _way(record: Record, task: Task) -> list[Fault]:
    """Why the part is not where it was to go."""
    final = task.reached(float(record.state[-1]))
    if final >= 0.90:
        return []
    move = PHASES.index("move")
    lost = np.flatnonzero((record.phase == move) & (record.touching == 0))
    if len(lost):
        return [Fault(move, f"the hand lost the part at state {record.state[lost[0]]:.2f}")]
    done = "opened" if task.direction > 0 else "closed"
    reached = np.array([task.reached(float(s)) for s in record.state])
    if reached.max() >= 0.90:
        after = record.phase[np.flatnonzero(reached >= 0.90)[-1]]
        return [Fault(int(after), f"the part {done} {reached.max():.2f} of the way and ended at {final:.2f}")]
    pressed = _pressed(record)
    if pressed:
        return [
            Fault(move, f"{done} {reached.max():.2f} of the way; {pressed[0]} pressed against {pressed[1]}")
        ]
    return [Fault(move, f"{done} {reached.max():.2f} of the way; the part did not follow the hand")]


def _pressed(record: Record) -> tuple[str, str] | None:
    """The two bodies that touched most often though they should not."""
    pairs = [(a, b) for _, a, b, _ in record.contacts]
    return max(dict.fromkeys(pairs), key=pairs.count) if pairs else None


def _scene(record: Record) -> list[Fault]:
    deep = [
        c
        for c in record.contacts
        if c[3] > DEPTH_LIMIT and (c[1].startswith(STATIC) or c[2].startswith(STATIC))
    ]
    if not deep:
        return []
    time, a, b, depth = max(deep, key=lambda c: c[3])
    body = b if a.startswith(STATIC) else a
    phase = int(record.phase[int(np.argmin(np.abs(record.times - time)))])
    return [Fault(phase, f"{body} goes {1000 * depth:.1f} mm into the static scene at {time:.1f} s")]


def _slips(record: Record, slip: Array) -> list[Fault]:
    if slip.max() <= SLIP_LIMIT:
        return []
    at = int(np.argmax(slip > SLIP_LIMIT))
    return [Fault(int(record.phase[at]), f"the grip slipped by {1000 * slip.max():.0f} mm")]
