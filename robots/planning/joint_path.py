"""The precise joint path over a chosen base, timed into a trajectory."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import CubicSpline

from robots.config import PlanConfig
from robots.grasp.tool_path import APPROACH, Grasp, backed_off
from robots.model.dynamics import with_payload
from robots.model.kinematics import Chain
from robots.model.spec import RobotSpec
from robots.planning.base_search import Base
from robots.planning.ik import PathSolver
from robots.planning.timing import Effort, Leg, Samples, timed
from robots.reasons import RefusedError, reason
from robots.task import Task, unit
from robots.trajectory import RobotTrajectory
from twin import geometry as geo
from twin.geometry import Array
from twin.physics import physics_of, weight_load
from twin.scene import Part, Twin

# m; greatest error of the path in position; chosen by us
POSITION_TOLERANCE = 0.003
# rad; greatest error of the path in angle; chosen by us
_ANGLE_TOLERANCE = 0.05
_WAYPOINTS = 41
_STRAIGHT_WAYPOINTS = 9
_ROOM = 0.006  # m that the fingers leave about a part that the hand holds from the start


def refined(
    twin: Twin,
    part: Part,
    spec: RobotSpec,
    chain: Chain,
    solver: PathSolver,
    base: Base,
    grasp: Grasp,
    task: Task,
    effort: Effort,
    config: PlanConfig,
) -> RobotTrajectory:
    """The precise path over a base, timed. Raises PlanningError when it misses the tolerances or a joint is
    too weak."""
    legs = _Legs(solver, base, grasp, unit(part))
    states = task.states(_WAYPOINTS)
    rough = CubicSpline(np.linspace(0.0, 1.0, len(base.q) - 2), base.q[1:-1])
    tool = grasp.path(part.joint, states)
    move = legs.along(tool, states, rough(np.linspace(0.0, 1.0, _WAYPOINTS)))
    out, back_off = legs.away(tool[0], task.start, move.q[0], base.q[0])
    around, approach = out and out.reversed(), back_off.reversed()
    clear, retreat = legs.away(tool[-1], task.goal, move.q[-1], base.q[-1])
    margin = float(chain.limit_margin(np.concatenate([approach.q, move.q, retreat.q])).min())
    laden = with_payload(twin, part)
    release = not may_move_alone(laden, task.goal) if config.release is None else config.release
    samples = timed(
        None if moves_alone(laden, task.start) else approach,
        move,
        retreat if release else None,
        spec,
        config,
        around=around,
        clear=clear,
        held=min(grasp.hold.thickness + _ROOM, spec.stroke),
        effort=effort,
    )
    score = base.score + min(margin, 0.35) - 50.0 * float(move.error.max())
    return _trajectory(samples, twin, part, spec, chain, base, grasp, task, score)


def _trajectory(
    samples: Samples,
    twin: Twin,
    part: Part,
    spec: RobotSpec,
    chain: Chain,
    base: Base,
    grasp: Grasp,
    task: Task,
    score: float,
) -> RobotTrajectory:
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
        effort=samples.effort,
        T_world_base=base.T_world_base,
        pedestal=base.pedestal,
        limits=np.stack([chain.lower, chain.upper]),
        velocity_limits=spec.velocity,
        start=task.start,
        goal=task.goal,
        grasp=f"{grasp.label}, {1000 * grasp.hold.thickness:.0f} mm thick",
        score=score,
        clearance=base.clearance,
    )


@dataclass(frozen=True, eq=False)
class _Legs:
    """Pieces of the path over one base with one grasp; of: the unit of the part's state."""

    solver: PathSolver
    base: Base
    grasp: Grasp
    of: str

    def along(self, tool: Array, states: Array, hint: Array) -> Leg:
        """The joints (n, dof) for tool poses (n, 4, 4) at the part's states (n,), near a hint."""
        grasp = self.grasp
        solution = self.solver.follow(geo.invert_pose(self.base.T_world_base) @ tool, grasp.freedom, hint)
        worst = int(np.argmax(solution.position_error))
        strict = float(np.abs(solution.angle_error * (grasp.freedom >= 0.3)).max())
        if solution.position_error[worst] > POSITION_TOLERANCE or strict > _ANGLE_TOLERANCE:
            off = float(solution.position_error[worst])
            raise RefusedError(reason("Unreachable", float(states[worst]), self.of, off, strict, ""))
        if np.abs(np.diff(solution.q, axis=0)).max() > 0.5:
            raise RefusedError(reason("Reconfigures", None))
        return Leg(solution.q, states, solution.position_error, tool)

    def straight(self, poses: Array, state: float, q: Array, end: Array) -> Leg:
        """From the joints q about straight to `end`, the part at rest."""
        hint = q + np.linspace(0.0, 1.0, len(poses))[:, None] * (end - q)
        found = self.along(poses, np.full(len(poses), state), hint)
        found.q[0] = q
        return found

    def away(self, pose: Array, state: float, q: Array, end: Array) -> tuple[Leg | None, Leg]:
        """Aside until the jaws are clear of the part, if they need it, and back to about `end`."""
        room = self.grasp.room
        back = np.linspace(0.0, APPROACH, _STRAIGHT_WAYPOINTS)
        if room == 0.0:
            return None, self.straight(np.stack([backed_off(pose, d) for d in back]), state, q, end)
        aside = np.linspace(0.0, room, _STRAIGHT_WAYPOINTS)
        clear = self.straight(np.stack([backed_off(pose, 0.0, d) for d in aside]), state, q, q)
        poses = np.stack([backed_off(pose, d, room) for d in back])
        return clear, self.straight(poses, state, clear.q[-1], end)


def moves_alone(part: Part, state: float) -> bool:
    """True when the part's weight, or its catch, would move it off `state`, so that a hand must hold it.

    A lid falls shut, an oven's door falls open; at the ends of the range the stops hold against one.
    """
    load = weight_load(part, state) + physics_of(part).caught(state)
    friction = 0.8 * physics_of(part).frictionloss.value
    least = 1e-3 * (part.joint.upper - part.joint.lower)
    shuts = load > friction and state > part.joint.lower + least
    opens = -load > friction and state < part.joint.upper - least
    return shuts or opens


def may_move_alone(part: Part, state: float) -> bool:
    """True when the part would move alone with its axis as the twin has it, or two sigma off anywhere."""
    if part.joint.covariance is None:
        return moves_alone(part, state)
    values, vectors = np.linalg.eigh(part.joint.covariance[:2, :2])
    tilts = 2.0 * np.sqrt(np.maximum(values, 0.0)) * vectors
    shifts = [np.zeros(4), *(np.append(sign * t, [0.0, 0.0]) for t in tilts.T for sign in (1.0, -1.0))]
    return any(moves_alone(replace(part, joint=part.joint.plus(s)), state) for s in shifts)
