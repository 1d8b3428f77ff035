"""What a replay achieved, measured from the recorded simulation alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from robots.goals import Task
from robots.spec import RobotSpec
from robots.trajectory import PHASES, RobotTrajectory
from twin import geometry as geo
from twin.geometry import Array
from twin.scene import Part

STATIC_LINEAR, STATIC_ANGULAR = 0.1, 1.0  # m/s, rad/s: at rest, as ManiSkill3 defines it
SLIP_LIMIT = 0.010  # m


@dataclass(frozen=True, eq=False)
class Record:
    """What the simulation did, n samples. times (n,) s; phase (n,) index into PHASES, -1 while settling; state and
    speed (n,) of the part; q (n, j); torque (n, j) N m, gravity compensation included; tool (n, 4, 4); grip (n,) N;
    touching (n,) fingers that touch the part; contacts: (time, name, name, depth m) that should not be."""

    times: Array
    phase: Array
    state: Array
    speed: Array
    q: Array
    torque: Array
    tool: Array
    grip: Array
    touching: Array
    contacts: tuple[tuple[float, str, str, float], ...]


@dataclass(frozen=True)
class PhaseRow:
    """One phase: start and end (s), part state at its end, largest tool error (mm), torque share, fingers touching
    (mean of 0..2), unintended contact samples."""

    phase: str
    start: float
    end: float
    state: float
    tool_error_mm: float
    torque_share: float
    touching: float
    unintended: int


@dataclass(frozen=True)
class UnintendedContact:
    """A pair of bodies that touched though they should not: samples, deepest overlap (mm), first time (s)."""

    bodies: tuple[str, str]
    samples: int
    depth_mm: float
    first: float


@dataclass(frozen=True)
class ReplayReport:
    """Outcome of a replay. Openings are fractions of the demonstrated range (joint.upper).

    start, goal: m or rad; reached: share of the way from start to goal that is done at the end, 1 = at the goal.
    success_75: reached >= 0.75 and at rest (ManiSkill3); success_90: reached >= 0.90. For the default task, from closed
    to the end of the demonstrated range, that is the share open; for closing, the share closed.
    ok: success_90 with slip, torque and joint limits kept. slip_mm: largest displacement of the tool point in the
    part's frame between grasp and release. torque_share, torque_peak: of the limits, per joint. limit_margin: rad.
    tracking: of the tool against the plan while the part is moved. reason: what went wrong, empty when ok.
    """

    robot: str
    twin: str
    part: str
    start: float
    goal: float
    reached: float
    state_peak: float
    state_final: float
    opening_peak: float
    opening_final: float
    at_rest: bool
    success_75: bool
    success_90: bool
    ok: bool
    slip_mm: float
    tracking_mean_mm: float
    tracking_max_mm: float
    torque_peak: tuple[float, ...]
    torque_share: tuple[float, ...]
    limit_margin: float
    grip_force_max: float
    unintended: tuple[UnintendedContact, ...]
    phases: tuple[PhaseRow, ...]
    base_position: tuple[float, float, float]
    pedestal: float
    grasp: str
    duration: float
    wall_seconds: float
    video: str | None
    reason: str

    def to_json(self) -> dict[str, Any]:
        """Plain JSON types; wall time is left out so that equal runs give equal files."""
        values = asdict(self)
        values.pop("wall_seconds")
        return values


def measure(
    record: Record, trajectory: RobotTrajectory, part: Part, spec: RobotSpec, wall: float, video: str | None
) -> ReplayReport:
    """Turn a record into a report."""
    upper = part.joint.upper
    share = np.abs(record.torque) / spec.effort
    in_part = _tool_in_part(record, part)
    held = (record.phase == PHASES.index("move")) | (record.phase == PHASES.index("hold"))
    start = int(np.flatnonzero(held)[0]) - 1
    slip = float(np.linalg.norm(in_part[held] - in_part[start], axis=1).max())
    error = _tracking(record, trajectory)
    margin = float(np.minimum(record.q - trajectory.limits[0], trajectory.limits[1] - record.q).min())
    final, peak = float(record.state[-1]), float(record.state.max())
    limit = STATIC_ANGULAR if part.joint.kind == "revolute" else STATIC_LINEAR
    at_rest = bool(abs(record.speed[-1]) <= limit)
    task = Task(trajectory.start, trajectory.goal)
    reached = task.reached(final)
    success_90 = bool(reached >= 0.90)
    unintended = _unintended(record)
    reason = _reason(record, task, slip, share, margin, unintended, spec)
    p = trajectory.T_world_base[:3, 3]
    return ReplayReport(
        robot=trajectory.robot,
        twin=trajectory.twin,
        part=trajectory.part,
        start=task.start,
        goal=task.goal,
        reached=reached,
        state_peak=peak,
        state_final=final,
        opening_peak=peak / upper,
        opening_final=final / upper,
        at_rest=at_rest,
        success_75=bool(reached >= 0.75) and at_rest,
        success_90=success_90,
        ok=success_90 and not reason,
        slip_mm=1000 * slip,
        tracking_mean_mm=1000 * float(error[held].mean()),
        tracking_max_mm=1000 * float(error[held].max()),
        torque_peak=tuple(np.abs(record.torque).max(axis=0).tolist()),
        torque_share=tuple(share.max(axis=0).tolist()),
        limit_margin=margin,
        grip_force_max=float(np.abs(record.grip).max()),
        unintended=unintended,
        phases=_rows(record, error, share),
        base_position=(float(p[0]), float(p[1]), float(p[2])),
        pedestal=trajectory.pedestal,
        grasp=trajectory.grasp,
        duration=float(record.times[-1]),
        wall_seconds=wall,
        video=video,
        reason=reason,
    )


def _tool_in_part(record: Record, part: Part) -> Array:
    T_part_world = geo.invert_pose(part.joint.poses(record.state))
    return geo.transform(T_part_world, record.tool[:, None, :3, 3])[:, 0]


def _tracking(record: Record, trajectory: RobotTrajectory) -> Array:
    wanted = np.stack(
        [np.interp(record.times, trajectory.times, trajectory.T_world_tool[:, k, 3]) for k in range(3)],
        axis=1,
    )
    return np.asarray(np.linalg.norm(record.tool[:, :3, 3] - wanted, axis=1))


def _unintended(record: Record) -> tuple[UnintendedContact, ...]:
    pairs: dict[tuple[str, str], list[tuple[float, float]]] = {}
    for time, a, b, depth in record.contacts:
        pairs.setdefault((a, b), []).append((time, depth))
    rows = [
        UnintendedContact(pair, len(hits), 1000 * max(d for _, d in hits), hits[0][0])
        for pair, hits in pairs.items()
    ]
    return tuple(sorted(rows, key=lambda r: -r.samples))


def _rows(record: Record, error: Array, share: Array) -> tuple[PhaseRow, ...]:
    rows = []
    hits = np.array([c[0] for c in record.contacts])
    for k, name in enumerate(PHASES):
        at = np.flatnonzero(record.phase == k)
        if len(at) == 0:
            continue
        t0, t1 = float(record.times[at[0]]), float(record.times[at[-1]])
        rows.append(
            PhaseRow(
                name,
                t0,
                t1,
                float(record.state[at[-1]]),
                1000 * float(error[at].max()),
                float(share[at].max()),
                float(record.touching[at].mean()),
                int(np.count_nonzero((hits >= t0) & (hits <= t1))),
            )
        )
    return tuple(rows)


def _reason(
    record: Record,
    task: Task,
    slip: float,
    share: Array,
    margin: float,
    unintended: Sequence[UnintendedContact],
    spec: RobotSpec,
) -> str:
    """The first thing that went wrong, in the order of cause."""
    move = record.phase == PHASES.index("move")
    closed = np.flatnonzero(record.phase == PHASES.index("close"))
    if record.touching[closed[-1]] < 2:
        return f"the fingers did not get hold of the part ({record.touching[closed[-1]]:.0f} of 2 touch it)"
    if share.max() >= 1.0 - 1e-6:
        k = int(np.argmax(share.max(axis=0)))
        t = record.times[int(np.argmax(share[:, k]))]
        unit = "N" if k < len(spec.base_joints) - 1 else "N m"  # a planar base slides twice, then turns
        return f"{spec.arm_joints[k]} is at its torque limit of {spec.effort[k]:.0f} {unit} at {t:.1f} s"
    if margin < 0:
        return f"a joint goes {-margin:.3f} rad beyond its limit"
    lost = np.flatnonzero(move & (record.touching == 0))
    final = task.reached(float(record.state[-1]))
    if final < 0.90:
        done = "opened" if task.direction > 0 else "closed"
        peak = max(task.reached(float(s)) for s in record.state)
        if len(lost):
            return f"the hand lost the part at state {record.state[lost[0]]:.2f}"
        if peak >= 0.90:
            return f"the part {done} {peak:.2f} of the way and ended at {final:.2f}"
        if unintended:
            a, b = unintended[0].bodies
            return f"{done} {peak:.2f} of the way; {a} pressed against {b}"
        return f"{done} {peak:.2f} of the way; the part did not follow the hand"
    if slip > SLIP_LIMIT:
        return f"the grip slipped by {1000 * slip:.0f} mm"
    return ""
