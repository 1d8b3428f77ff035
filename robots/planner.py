"""From a twin's part to a robot trajectory that opens it."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
from scipy.interpolate import CubicSpline

from robots import placement
from robots.catalog import resolve
from robots.chain import Chain, read_chain
from robots.config import PlanConfig
from robots.contact_path import Grasp, backed_off, make_grasps
from robots.grasp import find_holds
from robots.ik import PathSolver
from robots.placement import Base, CollisionCheck
from robots.spec import RobotSpec
from robots.timing import Leg, timed
from robots.trajectory import RejectedBase, RobotTrajectory
from robots.world import build_world, frictionloss, mass_and_com
from twin import geometry as geo
from twin.errors import InputError, PlanningError
from twin.geometry import Array
from twin.scene import ContactPath, Part, Twin

_LOG = logging.getLogger(__name__)
_WAYPOINTS = 41
_STRAIGHT_WAYPOINTS = 9
_CHECKED = 200  # bases checked for collisions before giving up
_REPORTED = 12  # rejected bases kept in the trajectory
_PLAN_PEDESTAL = (
    1.0  # m of column under the base while searching; doors sweep no deeper than that below the base
)
_GRAVITY = 9.81


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
    bases = placement.search(target.joint, goal, grasps, chain, spec, twin.static.mesh, config)
    accepted, rejected = _free_of_collision(twin, target, spec, goal, bases, config)
    solver = PathSolver(spec, alone)
    best: RobotTrajectory | None = None
    for base in accepted[: config.finalists]:
        try:
            candidate = _refined(twin, target, spec, chain, solver, base, grasps[base.grasp], goal, config)
        except PlanningError as e:
            rejected.append(replace(base, reason=e.problem))
            continue
        if best is None or candidate.score > best.score:
            best = candidate
    if best is None:
        raise PlanningError(
            _why(spec, target, bases, rejected), "clear the scene, lower the goal, or give another contact"
        )
    nearest = sorted(rejected, key=lambda b: -b.score)[:_REPORTED]
    _LOG.info("%s opens %s: %s, base score %.2f", spec.name, target.name, best.grasp, best.score)
    return replace(best, rejected=tuple(_reported(b) for b in nearest))


def with_collision(twin: Twin) -> Twin:
    """The twin with collision geometry for its static part and every part; made when missing."""
    if twin.static.collision and all(p.collision for p in twin.parts):
        return twin
    from twin.collision import with_collision as make

    return make(twin)


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


def _free_of_collision(
    twin: Twin, part: Part, spec: RobotSpec, goal: float, bases: Sequence[Base], config: PlanConfig
) -> tuple[list[Base], list[Base]]:
    """Bases whose rough path touches nothing, best first, and all the others."""
    world = build_world(twin, spec, np.eye(4), _PLAN_PEDESTAL)
    check = CollisionCheck(world, part.id, config.clearance)
    accepted: list[Base] = []
    rejected = [b for b in bases if b.reason]
    reachable = [b for b in bases if not b.reason]
    for k, base in enumerate(reachable):
        if k >= _CHECKED or len(accepted) >= 3 * config.finalists:
            break
        inner = np.linspace(0.0, goal, base.q.shape[0] - 2)
        checked = placement.check_clearance(
            base, np.concatenate([[0.0], inner, [goal]]), check, world, spec.stroke
        )
        checked = replace(checked, score=checked.score + checked.clearance / config.clearance)
        (rejected if checked.reason else accepted).append(checked)
    accepted.sort(key=lambda b: -b.score)
    return accepted, rejected


def _refined(
    twin: Twin,
    part: Part,
    spec: RobotSpec,
    chain: Chain,
    solver: PathSolver,
    base: Base,
    grasp: Grasp,
    goal: float,
    config: PlanConfig,
) -> RobotTrajectory:
    """The precise path over a base, timed. Raises PlanningError when it misses the tolerances."""
    states = np.linspace(0.0, goal, _WAYPOINTS)
    tool = grasp.path(part.joint, states)
    rough = CubicSpline(np.linspace(0.0, goal, len(base.q) - 2), base.q[1:-1])
    back = np.linspace(0.0, config.approach, _STRAIGHT_WAYPOINTS)

    def leg(poses: Array, at: Array, hint: Array) -> Leg:
        return _leg(solver, base, poses, at, grasp, hint, config)

    def straight(pose: Array, state: float, q: Array) -> Leg:
        poses = np.stack([backed_off(pose, d) for d in back])
        found = leg(poses, np.full(len(back), state), np.tile(q, (len(back), 1)))
        found.q[0] = q
        return found

    move = leg(tool, states, rough(states))
    approach = straight(tool[0], 0.0, move.q[0]).reversed()
    retreat = straight(tool[-1], goal, move.q[-1])
    margin = float(chain.limit_margin(np.concatenate([approach.q, move.q, retreat.q])).min())
    release = not falls_shut(part, goal) if config.release is None else config.release
    samples = timed(approach, move, retreat, spec, config, release)
    return RobotTrajectory(
        robot=spec.name,
        twin=twin.name,
        part_id=part.id,
        part=part.name,
        joint_names=spec.arm_joints,
        times=samples.times,
        q=np.clip(samples.q, chain.lower, chain.upper),
        qd=samples.qd,
        gripper=samples.gripper,
        phases=samples.phases,
        part_state=samples.part_state,
        T_world_tool=samples.T_world_tool,
        position_error=samples.position_error,
        T_world_base=base.T_world_base,
        pedestal=base.pedestal,
        limits=np.stack([chain.lower, chain.upper]),
        velocity_limits=spec.velocity,
        goal=goal,
        grasp=f"{grasp.label}, {1000 * grasp.hold.thickness:.0f} mm thick",
        score=base.score + min(margin, 0.35) - 50.0 * float(move.error.max()),
        clearance=base.clearance,
    )


def _leg(
    solver: PathSolver, base: Base, tool: Array, states: Array, grasp: Grasp, hint: Array, config: PlanConfig
) -> Leg:
    solution = solver.follow(geo.invert_pose(base.T_world_base) @ tool, grasp.freedom, hint)
    worst = int(np.argmax(solution.position_error))
    strict = float(np.abs(solution.angle_error * (grasp.freedom >= 0.3)).max())
    if solution.position_error[worst] > config.position_tolerance or strict > config.angle_tolerance:
        raise PlanningError(
            f"out of reach at state {states[worst]:.2f}: {1000 * solution.position_error[worst]:.0f} mm short, "
            f"{np.rad2deg(strict):.0f} deg off"
        )
    if np.abs(np.diff(solution.q, axis=0)).max() > 0.5:
        raise PlanningError("the arm would have to reconfigure on the way")
    return Leg(solution.q, states, solution.position_error, tool)


def falls_shut(part: Part, state: float) -> bool:
    """True when the part's weight would close it again from `state`, so that the hand must keep holding it."""
    mass, com = mass_and_com(part)
    pull = mass * _GRAVITY * float(part.joint.velocity(state, com)[2])  # > 0: opening lifts the part
    return pull > 0.8 * frictionloss(part)


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
