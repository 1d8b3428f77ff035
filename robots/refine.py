"""The precise joint path over a chosen base, timed into a trajectory."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import CubicSpline

from robots.chain import Chain
from robots.config import PlanConfig
from robots.contact_path import Grasp, backed_off
from robots.ik import PathSolver
from robots.placement import Base
from robots.spec import RobotSpec
from robots.timing import Leg, timed
from robots.trajectory import RobotTrajectory
from robots.world import frictionloss, mass_and_com
from twin import geometry as geo
from twin.errors import PlanningError
from twin.geometry import Array
from twin.scene import Part, Twin

_WAYPOINTS = 41
_STRAIGHT_WAYPOINTS = 9
_GRAVITY = 9.81


def refined(
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
