"""What a replay achieved, measured from the recorded simulation alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robots.floor import Floor
from robots.model.spec import RobotSpec
from robots.simulation.faults import Fault, find_faults
from robots.simulation.record import Record
from robots.task import Task
from robots.trajectory import PHASES, RobotTrajectory
from twin import geometry as geo
from twin.cause import Cause
from twin.geometry import Array
from twin.scene import Part
from twin.verdict import Verdict, verdict_document

BoolArray = NDArray[np.bool_]
# At rest, as ManiSkill3 defines it.
STATIC_LINEAR = 0.1  # m/s
STATIC_ANGULAR = 1.0  # rad/s


@dataclass(frozen=True)
class PhaseRow:
    """One phase: start and end (s); part state at its end, and the largest and the last opening as shares of
    the range; at_rest: the part, at its end; largest slip since the grasp (mm, 0 while nothing is held), tool
    error (mm) and torque share; fingers touching (mean of 0..2); unintended contact samples; reason: the
    first thing that went wrong in it."""

    phase: str
    start: float
    end: float
    state: float
    opening_peak: float
    opening_final: float
    at_rest: bool
    slip_mm: float
    tool_error_mm: float
    torque_share: float
    touching: float
    unintended: int
    reason: str


@dataclass(frozen=True)
class UnintendedContact:
    """A pair of bodies that touched though they should not: samples, deepest overlap (mm), first time (s)."""

    bodies: tuple[str, str]
    samples: int
    depth_mm: float
    first: float


@dataclass(frozen=True, repr=False)
class ReplayReport:
    """Outcome of a replay. Openings are fractions of the demonstrated range (joint.upper).

    start, goal: m or rad; reached: share of the way from start to goal that is done at the end, 1 = at the
    goal. success_75: reached >= 0.75 and at rest (ManiSkill3); success_90: reached >= 0.90. For the default
    task, from closed to the end of the demonstrated range, that is the share open; for closing, the share
    closed. ok: success_90 with slip, torque and joint limits kept. slip_mm: largest displacement of the tool
    point in the part's frame between grasp and release. torque_share, torque_peak: of the limits, per joint.
    limit_margin: rad. tracking: of the tool against the plan while the part is moved. floor: what the robot
    stands on, see `RobotTrajectory`. faults: what went wrong, causes first; empty when ok. verdict: on the
    part as it was reconstructed.
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
    floor: Floor | None
    grasp: str
    duration: float
    wall_seconds: float
    video: str | None
    faults: tuple[Cause, ...]
    verdict: Verdict | None = None

    def __repr__(self) -> str:
        told = "ok" if self.ok else self.reason or "not ok"
        way = f"{100 * self.reached:z.0f} % of the way, slip {self.slip_mm:.1f} mm"
        return f"<ReplayReport: {self.robot} moved {self.part!r} by {way}; {told}>"

    @property
    def reason(self) -> str:
        """The first thing that went wrong, in words; empty when nothing did."""
        return self.faults[0].text if self.faults else ""

    def to_json(self) -> dict[str, Any]:
        """Plain JSON types; wall time is left out so that equal runs give equal files."""
        values = asdict(self)
        values.pop("wall_seconds")
        values.pop("faults")
        values.pop("verdict")
        return {"verdict": verdict_document(self.verdict), **values, "reason": self.reason}


def measure(
    record: Record, trajectory: RobotTrajectory, part: Part, spec: RobotSpec, wall: float, video: str | None
) -> ReplayReport:
    """Turn a record into a report."""
    upper = part.joint.upper
    share = np.abs(record.torque) / spec.effort
    held = (record.phase == PHASES.index("move")) | (record.phase == PHASES.index("hold"))
    slip = _slip(record, part, held)
    error = _tracking(record, trajectory)
    beyond = np.maximum(trajectory.limits[0] - record.q, record.q - trajectory.limits[1])
    final, peak = float(record.state[-1]), float(record.state.max())
    still = np.abs(record.speed) <= (STATIC_ANGULAR if part.joint.kind == "revolute" else STATIC_LINEAR)
    task = Task(trajectory.start, trajectory.goal)
    reached, at_rest = task.reached(final), bool(still[-1])
    success_90 = bool(reached >= 0.90)
    unintended = _unintended(record)
    faults = find_faults(record, task, slip, share, beyond, spec)
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
        ok=success_90 and not faults,
        slip_mm=1000 * float(slip.max()),
        tracking_mean_mm=1000 * float(error[held].mean()),
        tracking_max_mm=1000 * float(error[held].max()),
        torque_peak=tuple(np.abs(record.torque).max(axis=0).tolist()),
        torque_share=tuple(share.max(axis=0).tolist()),
        limit_margin=-float(beyond.max()),
        grip_force_max=float(np.abs(record.grip).max()),
        unintended=unintended,
        phases=_rows(record, error, share, slip, still, upper, faults),
        base_position=(float(p[0]), float(p[1]), float(p[2])),
        pedestal=trajectory.pedestal,
        floor=trajectory.floor,
        grasp=trajectory.grasp,
        duration=float(record.times[-1]),
        wall_seconds=wall,
        video=video,
        faults=tuple(f.reason for f in faults),
        verdict=part.verdict,
    )


def _slip(record: Record, part: Part, held: BoolArray) -> Array:
    """Displacement (n,) m of the tool point in the part's frame since the grasp; 0 while nothing is held."""
    T_part_world = geo.invert_pose(part.joint.poses(record.state))
    in_part = geo.transform(T_part_world, record.tool[:, None, :3, 3])[:, 0]
    grasped = int(np.flatnonzero(held)[0]) - 1
    return np.where(held, np.linalg.norm(in_part - in_part[grasped], axis=1), 0.0)


def _tracking(record: Record, trajectory: RobotTrajectory) -> Array:
    wanted = np.stack(
        [np.interp(record.times, trajectory.times, trajectory.T_world_tool[:, k, 3]) for k in range(3)],
        axis=1,
    )
    return np.asarray(np.linalg.norm(record.tool[:, :3, 3] - wanted, axis=1))


def _unintended(record: Record) -> tuple[UnintendedContact, ...]:
    pairs: dict[tuple[str, str], list[tuple[float, float]]] = {}
    for c in record.contacts:
        pairs.setdefault(c.bodies, []).append((c.time, c.depth))
    rows = [
        UnintendedContact(pair, len(hits), 1000 * max(d for _, d in hits), hits[0][0])
        for pair, hits in pairs.items()
    ]
    return tuple(sorted(rows, key=lambda r: -r.samples))


def _rows(
    record: Record,
    error: Array,
    share: Array,
    slip: Array,
    still: BoolArray,
    upper: float,
    faults: Sequence[Fault],
) -> tuple[PhaseRow, ...]:
    rows = []
    hits = np.array([c.time for c in record.contacts])
    for k, name in enumerate(PHASES):
        at = np.flatnonzero(record.phase == k)
        if len(at) == 0:
            continue
        t0, t1 = float(record.times[at[0]]), float(record.times[at[-1]])
        rows.append(
            PhaseRow(
                phase=name,
                start=t0,
                end=t1,
                state=float(record.state[at[-1]]),
                opening_peak=float(record.state[at].max()) / upper,
                opening_final=float(record.state[at[-1]]) / upper,
                at_rest=bool(still[at[-1]]),
                slip_mm=1000 * float(slip[at].max()),
                tool_error_mm=1000 * float(error[at].max()),
                torque_share=float(share[at].max()),
                touching=float(record.touching[at].mean()),
                unintended=int(np.count_nonzero((hits >= t0) & (hits <= t1))),
                reason=next((f.reason.text for f in faults if f.phase == k), ""),
            )
        )
    return tuple(rows)
