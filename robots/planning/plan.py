"""From a twin's part to a robot trajectory that opens or closes it."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from robots.config import PlanConfig
from robots.floor import Floor, floor_of
from robots.grasp.holds import Hold
from robots.grasp.tool_path import make_grasps
from robots.grasp.where_to_hold import elsewhere, holds_of
from robots.model.catalog import resolve
from robots.model.dynamics import ArmDynamics, part_load, with_payload
from robots.model.kinematics import read_chain
from robots.model.mjcf import compiled
from robots.model.spec import RobotSpec
from robots.planning.base_search import Base, BaseSearch
from robots.planning.clearance import ClearanceCheck
from robots.planning.ik import PathSolver
from robots.planning.joint_path import refined
from robots.planning.timing import Effort
from robots.reasons import reason_of
from robots.scene.as_handled import as_handled
from robots.scene.world import completed
from robots.simulation.faults import SLIP_LIMIT
from robots.simulation.replay import replay
from robots.task import Goal, Task, task_of
from robots.trajectory import RejectedBase, RobotTrajectory
from twin.collision.meetings import shapes_of
from twin.errors import PlanningError
from twin.files.paths import AnyPath
from twin.geometry import Array
from twin.runs.progress import shows_bar
from twin.scene import ContactPath, Part, Twin

_LOG = logging.getLogger(__name__)
_REPORTED = 12  # rejected bases kept in the trajectory
_SEEDS = 16
_ROUNDS = 2  # closer looks around the best, as long as no base is free
_ALIKE = 0.08  # m


@shows_bar("plan")
def plan(
    twin: Twin,
    part: int | str,
    robot: AnyPath = "franka",
    *,
    contact: ContactPath | Array | None = None,
    goal: Goal | None = None,
    from_state: Goal | None = None,
    config: PlanConfig | None = None,
    floor: Floor | float | None = None,
) -> RobotTrajectory:
    """Plan how a robot opens or closes a part the way the person held it.

    Args:
        twin: shapes, masses and friction that it lacks are made; for a replay give a `completed` one.
        part: id or name; what carries it stands as when the person first handled it (`as_handled`).
        robot: bundled name or robot file.
        contact: instead of the part's own: a ContactPath, or a point (3,) in m on the part, world frame at
            state 0. A part without contact is held where its shape offers a bar, a knob or a rim.
        goal: "open", "close", a share of the demonstrated range (0.5 or "50%"), or a state with its unit
            ("15deg", "0.2m"). Default: open.
        from_state: the same. Default: the closed end, or the open end if the goal is closed.
        config: of the search.
        floor: its height z in m, twin's world; by default the one that the twin shows, else it is assumed at
            the scene's lowest point (`RobotTrajectory.floor` says which).

    Returns:
        A trajectory inside the robot's limits, with base pose, score and rejected bases.

    Raises:
        SceneError: no such part.
        InputError: no such robot, a contact off the part, nothing to hold, a goal or from_state outside the
            joint's range, a floor that is not finite.
        PlanningError: no base reaches the part without touching anything, or the arm is too weak; says at
            which state and by how much.
    """
    config = config or PlanConfig()
    twin, target = as_handled(twin, part)
    spec = resolve(robot)
    task = task_of(target, goal, from_state)
    ground = floor_of(twin, floor)
    holds = holds_of(twin, target, spec, contact, config.seed)
    twin = completed(twin)
    target = twin.part(part)
    if not shapes_of(target):
        raise PlanningError(
            f"part {target.name!r} has no collision shape, so no gripper can touch it",
            f"give it one: a box or a convex mesh in `collision` of {target.name!r} in twin.json",
        )
    try:
        return _planned(twin, target, spec, task, holds, config, _ROUNDS, robot, ground)
    except PlanningError as first:
        others = elsewhere(target, holds, spec, config.seed)
        if not others:
            raise
        quick = replace(config, candidates=config.candidates // 2 + 1)
        try:
            return _planned(twin, target, spec, task, others, quick, 1, robot, ground)
        except PlanningError:
            raise first from None


def _planned(
    twin: Twin,
    target: Part,
    spec: RobotSpec,
    task: Task,
    holds: Sequence[Hold],
    config: PlanConfig,
    rounds: int,
    robot: AnyPath,
    floor: Floor,
) -> RobotTrajectory:
    """The best trajectory that takes the part by one of the holds; rounds: closer looks around near misses.

    Raises PlanningError with the reason of the base that came nearest.
    """
    alone = compiled(spec)
    chain = read_chain(alone, spec)
    way = task.goal - task.start
    grasps = [g for k, h in enumerate(holds) for g in make_grasps(h, target.joint, spec, k, way)]
    search = BaseSearch(target.joint, task, grasps, chain, spec, twin.static.mesh, config, floor.height)
    check = ClearanceCheck(twin, target, spec, task, grasps, config)
    bases = search.everywhere()
    accepted, rejected = check.sort(bases)
    for _ in range(rounds):
        seeds = _seeds(accepted, rejected)
        if not seeds:
            break
        nearby = search.around(seeds)
        better, worse = check.sort(nearby)
        bases, rejected = bases + nearby, rejected + worse
        accepted = sorted([*accepted, *better], key=lambda b: -b.score)
        if accepted:
            break
    solver = PathSolver(spec, alone)
    effort = Effort(ArmDynamics(spec, alone), part_load(with_payload(twin, target)))
    candidates: list[RobotTrajectory] = []
    for base in _unlike(accepted, 4 * config.finalists):
        try:
            made = refined(twin, target, spec, chain, solver, base, grasps[base.grasp], task, effort, config)
            candidates.append(replace(made, floor=floor))
        except PlanningError as e:
            rejected.append(replace(base, reason=reason_of(e)))
        if len(candidates) == config.finalists:
            break
    if not candidates:
        raise PlanningError(
            _why(spec, target, task, bases, rejected, floor),
            "clear the scene, choose another goal, or give another contact",
        )
    best = _best(twin, candidates, config.rehearse, robot)
    nearest = sorted(rejected, key=lambda b: -b.score)[:_REPORTED]
    _LOG.info("%s moves %s from %.2f to %.2f: %s", spec.name, target.name, task.start, task.goal, best.grasp)
    return replace(best, rejected=tuple(_reported(b) for b in nearest))


def _seeds(accepted: Sequence[Base], rejected: Sequence[Base]) -> list[Base]:
    """Bases worth a closer look around: free ones, then nearly free, then nearly reaching."""
    touching = sorted((b for b in rejected if b.clearance < 0), key=lambda b: -b.clearance)
    short = sorted(
        (b for b in rejected if b.clearance == 0 and np.isfinite(b.position_error)),
        key=lambda b: b.position_error + 0.1 * b.angle_error,
    )
    return [*accepted[:_SEEDS], *touching[: _SEEDS // 2], *short[: _SEEDS // 2]][:_SEEDS]


def _unlike(accepted: Sequence[Base], count: int) -> list[Base]:
    """The best bases that differ from one another in place or grasp."""
    chosen: list[Base] = []
    for base in accepted:
        alike = any(
            base.grasp == c.grasp
            and np.linalg.norm(base.T_world_base[:3, 3] - c.T_world_base[:3, 3]) < _ALIKE
            for c in chosen
        )
        if not alike:
            chosen.append(base)
        if len(chosen) == count:
            break
    return chosen


def _best(twin: Twin, candidates: list[RobotTrajectory], rehearse: bool, robot: AnyPath) -> RobotTrajectory:
    """The first, by score, that succeeds in a rehearsal with half the slip allowed; else the success that
    slips least, else the one that came nearest to the goal."""
    candidates = sorted(candidates, key=lambda t: -t.score)
    if not rehearse:
        return candidates[0]
    outcomes: list[tuple[bool, float, float, int]] = []
    for k, trajectory in enumerate(candidates):
        report = replay(twin, trajectory, robot=robot, video=False)
        if report.ok and report.slip_mm <= 500 * SLIP_LIMIT:
            return trajectory
        reason = report.reason or f"slips by {report.slip_mm:.1f} mm"
        _LOG.info("rehearsal %d of %s, %s: %s", k + 1, trajectory.part, trajectory.grasp, reason)
        outcomes.append((not report.ok, -round(report.reached, 2), report.slip_mm, k))
    return candidates[min(outcomes)[3]]


def _reported(base: Base) -> RejectedBase:
    p = base.T_world_base[:3, 3]
    score = base.score if np.isfinite(base.score) else -1e3
    return RejectedBase(
        (float(p[0]), float(p[1]), float(p[2])), base.yaw, base.pedestal, float(score), _reason_text(base)
    )


def _reason_text(base: Base) -> str:
    return "" if base.reason is None else base.reason.text


def _why(
    spec: RobotSpec,
    part: Part,
    task: Task,
    bases: Sequence[Base],
    rejected: Sequence[Base],
    floor: Floor,
) -> str:
    """The reason of the base that came nearest to success, and where it stands."""
    verb = "open" if task.direction > 0 else "close"
    where = f" on a floor that is {floor.text}" if floor.source == "assumed" else ""
    head = f"{spec.name} can't {verb} part {part.name!r} from any of {len(bases)} base poses{where}"
    reached = [b for b in rejected if np.isfinite(b.position_error)]
    if not reached:
        return f"{head}: {_reason_text(bases[0]) if bases else 'none was tried'}"
    refused = [b for b in reached if b.clearance > 0]  # free of contact, and still refused
    touched = [b for b in reached if b.clearance < 0]
    if refused:
        best = max(refused, key=lambda b: b.score)
    elif touched:
        best = max(touched, key=lambda b: b.clearance)
    else:
        best = min(reached, key=lambda b: b.position_error + 0.1 * b.angle_error)
    x, y, z = best.T_world_base[:3, 3]
    return (
        f"{head}: {_reason_text(best)}; nearest base at ({x:.2f}, {y:.2f}, {z:.2f}) m, score {best.score:.2f}"
    )
