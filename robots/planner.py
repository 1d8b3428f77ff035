"""From a twin's part to a robot trajectory that opens it."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np

from robots.catalog import resolve
from robots.chain import read_chain
from robots.clearance import ClearanceCheck
from robots.config import PlanConfig
from robots.contact_path import make_grasps
from robots.grasp import find_holds
from robots.ik import PathSolver
from robots.placement import Base, BaseSearch
from robots.refine import refined
from robots.replayer import replay
from robots.spec import RobotSpec
from robots.trajectory import RejectedBase, RobotTrajectory
from robots.world import with_collision
from twin.errors import InputError, PlanningError
from twin.scene import ContactPath, Part, Twin

_LOG = logging.getLogger(__name__)
_REPORTED = 12  # rejected bases kept in the trajectory
_SEEDS = 16
_ALIKE = 0.08  # m


def plan(
    twin: Twin,
    part: int | str,
    robot: str | Path = "franka",
    *,
    contact: ContactPath | None = None,
    goal: float | None = None,
    config: PlanConfig | None = None,
) -> RobotTrajectory:
    """Plan how a robot opens a part the way the person held it.

    Args:
        twin: with collision geometry; it is made when missing.
        part: id or name. robot: bundled name or robot file. contact: instead of the part's own.
        goal: state to open to, in m or rad; default the upper end of the demonstrated range.
        config: of the search.

    Returns:
        A trajectory inside the robot's position and velocity limits, with base pose, score and rejected bases.

    Raises:
        SceneError: no such part. InputError: no such robot, no contact, a goal outside the joint's range.
        PlanningError: no base reaches the part without touching anything; says at which state and by how much.
    """
    config = config or PlanConfig()
    target = twin.part(part)
    spec = resolve(robot)
    contact = contact or target.contact
    if contact is None:
        raise InputError(
            f"part {target.name!r} has no contact, so the robot does not know where to hold it",
            "give contact=ContactPath(...) or reconstruct a recording in which the hand is seen",
        )
    goal = _checked_goal(target, goal)
    twin = with_collision(twin)
    target = twin.part(part)
    alone = mujoco.MjModel.from_xml_path(str(spec.model))
    chain = read_chain(alone, spec)
    holds = find_holds(target.mesh, contact, spec, config.seed)
    grasps = [g for k, h in enumerate(holds) for g in make_grasps(h, target.joint, spec, config, k)]
    search = BaseSearch(target.joint, goal, grasps, chain, spec, twin.static.mesh, config)
    check = ClearanceCheck(twin, target, spec, goal, config)
    bases = search.everywhere()
    accepted, rejected = check.sort(bases)
    seeds = _seeds(accepted, rejected)
    if seeds:
        nearby = search.around(seeds)
        better, worse = check.sort(nearby)
        bases, rejected = bases + nearby, rejected + worse
        accepted = sorted([*accepted, *better], key=lambda b: -b.score)
    solver = PathSolver(spec, alone)
    candidates: list[RobotTrajectory] = []
    for base in _unlike(accepted, 2 * config.finalists):
        try:
            candidates.append(
                refined(twin, target, spec, chain, solver, base, grasps[base.grasp], goal, config)
            )
        except PlanningError as e:
            rejected.append(replace(base, reason=e.problem))
        if len(candidates) == config.finalists:
            break
    if not candidates:
        raise PlanningError(
            _why(spec, target, bases, rejected), "clear the scene, lower the goal, or give another contact"
        )
    best = _best(twin, candidates, config.rehearse)
    nearest = sorted(rejected, key=lambda b: -b.score)[:_REPORTED]
    _LOG.info("%s opens %s: %s, base score %.2f", spec.name, target.name, best.grasp, best.score)
    return replace(best, rejected=tuple(_reported(b) for b in nearest))


def _checked_goal(part: Part, goal: float | None) -> float:
    joint = part.joint
    if goal is None:
        goal = joint.upper
    if not (joint.lower - 1e-9 <= goal <= joint.upper + 1e-9) or goal <= 0:
        unit = "rad" if joint.kind == "revolute" else "m"
        raise InputError(
            f"goal {goal:.3f} {unit} of part {part.name!r} is outside its demonstrated range",
            f"choose a state above 0 and at most {joint.upper:.3f} {unit}",
        )
    return float(goal)


def _seeds(accepted: Sequence[Base], rejected: Sequence[Base]) -> list[Base]:
    """Bases worth a closer look around: free ones, then those that nearly are, then those that nearly reach."""
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


def _best(twin: Twin, candidates: list[RobotTrajectory], rehearse: bool) -> RobotTrajectory:
    """The first that succeeds in a rehearsal, by score; else the one that opened furthest."""
    candidates = sorted(candidates, key=lambda t: -t.score)
    if not rehearse:
        return candidates[0]
    outcomes: list[tuple[float, float, int]] = []
    for k, trajectory in enumerate(candidates):
        report = replay(twin, trajectory, video=False)
        if report.ok:
            return trajectory
        _LOG.info("rehearsal %d of %s: %s", k + 1, trajectory.part, report.reason)
        outcomes.append((-round(report.opening_final, 2), report.slip_mm, k))
    return candidates[min(outcomes)[2]]


def _reported(base: Base) -> RejectedBase:
    p = base.T_world_base[:3, 3]
    score = base.score if np.isfinite(base.score) else -1e3
    return RejectedBase(
        (float(p[0]), float(p[1]), float(p[2])), base.yaw, base.pedestal, float(score), base.reason
    )


def _why(spec: RobotSpec, part: Part, bases: Sequence[Base], rejected: Sequence[Base]) -> str:
    """The reason of the base that came nearest to success."""
    head = f"{spec.name} can't open part {part.name!r} from any of {len(bases)} base poses"
    touched = [b for b in rejected if b.reason and np.isfinite(b.score) and b.clearance < 0]
    if touched:
        best = max(touched, key=lambda b: b.clearance)
        return f"{head}: the best of those in reach fails because {best.reason}"
    reached = [b for b in rejected if np.isfinite(b.position_error)]
    if reached:
        best = min(reached, key=lambda b: b.position_error + 0.1 * b.angle_error)
        return f"{head}: {best.reason}"
    return f"{head}: {bases[0].reason if bases else 'none was tried'}"
