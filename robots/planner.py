"""From a twin's part to a robot trajectory that opens it."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass, replace
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
from robots.trajectory import RejectedBase, RobotTrajectory, quintic
from robots.world import build_world
from twin import geometry as geo
from twin.errors import InputError, PlanningError
from twin.geometry import Array
from twin.scene import ContactPath, Part, Twin

_LOG = logging.getLogger(__name__)
_STEP = 0.02  # s between samples
_CLOSE, _HOLD, _OPEN = 0.8, 0.5, 0.5  # s; the stiff gripper closes its stroke in about 0.3 s
_WAYPOINTS = 41
_STRAIGHT_WAYPOINTS = 9
_CHECKED = 40  # bases checked for collisions before giving up
_REPORTED = 12  # rejected bases kept in the trajectory
_PLAN_PEDESTAL = 1.0  # m of column under the base while searching; doors sweep no deeper than that below the base
_CLOSED_COMMAND = 0.0


@dataclass(frozen=True, eq=False)
class _Leg:
    """Waypoints over a share 0..1: q (w, n), part state (w,), position error (w,), tool poses (w, 4, 4), length m."""

    q: Array
    state: Array
    error: Array
    tool: Array
    length: float


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
        raise PlanningError(_why(spec, target, bases, rejected), "move or clear the scene, lower the goal, or give a contact")
    worst_first = sorted(rejected, key=lambda b: -b.score)[:_REPORTED]
    _LOG.info("%s opens %s: %s, base score %.2f", spec.name, target.name, best.grasp, best.score)
    return replace(best, rejected=tuple(_reported(b) for b in worst_first))


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
    states = np.linspace(0.0, goal, _WAYPOINTS)
    tool = grasp.path(part.joint, states)
    T_base_world = geo.invert_pose(base.T_world_base)
    rough = CubicSpline(np.linspace(0.0, goal, len(base.q) - 2), base.q[1:-1])
    move = _leg(solver, T_base_world, tool, states, grasp, rough(states), config)
    back = np.linspace(config.approach, 0.0, _STRAIGHT_WAYPOINTS)
    into = np.stack([backed_off(tool[0], d) for d in back[::-1]])
    away = np.stack([backed_off(tool[-1], d) for d in back[::-1]])
    # Solved from the part outwards, so that the ends of the legs meet.
    approach = _leg(solver, T_base_world, into, np.zeros(len(into)), grasp, np.tile(move.q[0], (len(into), 1)), config)
    retreat = _leg(solver, T_base_world, away, np.full(len(away), goal), grasp, np.tile(move.q[-1], (len(away), 1)), config)
    approach = _Leg(approach.q[::-1], approach.state, approach.error[::-1], approach.tool[::-1], approach.length)
    approach.q[-1], retreat.q[0] = move.q[0], move.q[-1]
    margin = float(chain.limit_margin(np.concatenate([approach.q, move.q, retreat.q])).min())
    samples = _timed(approach, move, retreat, spec, config)
    return RobotTrajectory(
        robot=spec.name,
        twin=twin.name,
        part_id=part.id,
        part=part.name,
        joint_names=spec.arm_joints,
        T_world_base=base.T_world_base,
        pedestal=base.pedestal,
        limits=np.stack([chain.lower, chain.upper]),
        velocity_limits=spec.velocity,
        goal=goal,
        grasp=f"{grasp.label}, {1000 * grasp.hold.thickness:.0f} mm thick",
        score=base.score + min(margin, 0.35) - 50.0 * float(move.error.max()),
        clearance=base.clearance,
        **samples,
    )


def _leg(
    solver: PathSolver, T_base_world: Array, tool: Array, states: Array, grasp: Grasp, hint: Array, config: PlanConfig
) -> _Leg:
    solution = solver.follow(T_base_world @ tool, grasp.freedom, hint)
    worst = int(np.argmax(solution.position_error))
    strict = np.abs(solution.angle_error * (grasp.freedom >= 0.3)).max()
    if solution.position_error[worst] > config.position_tolerance or strict > config.angle_tolerance:
        raise PlanningError(
            f"out of reach at state {states[worst]:.2f}: {1000 * solution.position_error[worst]:.0f} mm short, "
            f"{np.rad2deg(strict):.0f} deg off"
        )
    if np.abs(np.diff(solution.q, axis=0)).max() > 0.5:
        raise PlanningError("the arm would have to reconfigure on the way")
    length = float(np.linalg.norm(np.diff(tool[:, :3, 3], axis=0), axis=1).sum())
    return _Leg(solution.q, states, solution.position_error, tool, length)


def _timed(approach: _Leg, move: _Leg, retreat: _Leg, spec: RobotSpec, config: PlanConfig) -> dict[str, object]:
    """Samples of all phases: quintic along each leg, rests between them."""
    rows: list[tuple[str, _Leg, float, float]] = [
        ("approach", approach, 0.0, spec.stroke),
        ("close", move, _CLOSE, _CLOSED_COMMAND),
        ("move", move, 0.0, _CLOSED_COMMAND),
        ("hold", move, _HOLD, _CLOSED_COMMAND),
        ("open", move, _OPEN, spec.stroke),
        ("retreat", retreat, 0.0, spec.stroke),
    ]
    clock, parts, phases = 0.0, [], []
    for name, leg, rest, gripper in rows:
        share = np.linspace(0.0, 1.0, len(leg.q))
        spline = CubicSpline(share, leg.q, bc_type="natural")
        if rest:
            times = np.linspace(0.0, rest, max(int(np.ceil(rest / _STEP)), 2) + 1)
            s = np.full(len(times), 0.0 if name == "close" else 1.0)
            rate = np.zeros(len(times))
        else:
            times, s, rate = quintic(_leg_duration(spline, leg, spec, config), _STEP)
        times, s, rate = times[1:], s[1:], rate[1:]
        if not parts:
            times, s, rate = np.r_[0.0, times], np.r_[0.0, s], np.r_[0.0, rate]
        nearest = np.rint(s * (len(leg.q) - 1)).astype(int)
        parts.append(
            {
                "times": clock + times,
                "q": np.clip(spline(s), *_inner(leg)),
                "qd": spline(s, 1) * rate[:, None],
                "gripper": np.full(len(s), gripper),
                "part_state": np.interp(s, share, leg.state),
                "T_world_tool": _between(leg.tool, s),
                "position_error": leg.error[nearest],
            }
        )
        phases += [name] * len(s)
        clock = float(parts[-1]["times"][-1])
    merged: dict[str, object] = {key: np.concatenate([p[key] for p in parts]) for key in parts[0]}
    return {**merged, "phases": tuple(phases)}


def _inner(leg: _Leg) -> tuple[Array, Array]:
    """A spline may swing past its waypoints by a hair; the extremes of the waypoints bound it."""
    slack = 0.005
    return leg.q.min(axis=0) - slack, leg.q.max(axis=0) + slack


def _leg_duration(spline: CubicSpline, leg: _Leg, spec: RobotSpec, config: PlanConfig) -> float:
    """Shortest quintic time that keeps tool speed, joint velocity and joint acceleration within their shares."""
    s = np.linspace(0.0, 1.0, 201)
    first, second = np.abs(spline(s, 1)), np.abs(spline(s, 2))
    by_speed = 1.875 * leg.length / config.tool_speed
    by_velocity = 1.875 * (first / (config.velocity_share * spec.velocity)).max()
    # |q''| <= |dq/ds| 5.774 / T^2 + |d2q/ds2| (1.875 / T)^2
    by_acceleration = np.sqrt(
        ((5.774 * first + 1.875**2 * second) / (config.acceleration_share * spec.acceleration)).max()
    )
    return float(max(by_speed, by_velocity, by_acceleration, 0.8))


def _between(tool: Array, share: Array) -> Array:
    """Tool poses interpolated over waypoints at equal shares."""
    at = share * (len(tool) - 1)
    k = np.clip(at.astype(int), 0, len(tool) - 2)
    step = geo.log_se3(geo.invert_pose(tool[k]) @ tool[k + 1])
    return tool[k] @ geo.exp_se3(step * (at - k)[:, None])


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
