"""From waypoints to samples in time: quintic along each leg, rests between them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

from robots.config import PlanConfig
from robots.model.dynamics import ArmDynamics, PartLoad
from robots.model.spec import RobotSpec
from robots.reasons import RefusedError, reason
from twin import geometry as geo
from twin.geometry import Array

STEP = 0.02  # s between samples
CLOSE = 1.0  # s; a finger travels its 40 mm in 0.7 s
HOLD = 0.5  # s
OPEN = 0.8  # s
SHORTEST = 0.8  # s of a leg
# Share of the robot's velocity limits; chosen by us
VELOCITY_SHARE = 0.5
# Share of the robot's acceleration limits; chosen by us
ACCELERATION_SHARE = 0.3


@dataclass(frozen=True, eq=False)
class Leg:
    """Waypoints over 0..1: q (w, n), part state (w,), error (w,) m, tool poses (w, 4, 4) in the world."""

    q: Array
    state: Array
    error: Array
    tool: Array

    @property
    def length(self) -> float:
        """Of the tool point's way in metres."""
        return float(np.linalg.norm(np.diff(self.tool[:, :3, 3], axis=0), axis=1).sum())

    def reversed(self) -> Leg:
        """The leg the other way round."""
        return Leg(self.q[::-1], self.state[::-1], self.error[::-1], self.tool[::-1])


@dataclass(frozen=True, eq=False)
class Samples:
    """Columns of a RobotTrajectory, all of one length."""

    times: Array
    q: Array
    qd: Array
    gripper: Array
    part_state: Array
    T_world_tool: Array
    position_error: Array
    effort: Array
    phases: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Effort:
    """What timing needs to keep the torque limits: the arm, and the part it moves."""

    arm: ArmDynamics
    load: PartLoad


def timed(
    approach: Leg | None,
    move: Leg,
    retreat: Leg | None,
    spec: RobotSpec,
    config: PlanConfig,
    *,
    around: Leg | None = None,
    clear: Leg | None = None,
    held: float = 0.0,
    effort: Effort | None = None,
) -> Samples:
    """Samples of all phases.

    Without `approach` the motion starts with the hand about the part, opened to `held` (m); without `retreat`
    the hand keeps holding at the end. around, clear: ways of the hand while it closes and while it opens.
    effort: also keep the torques within their share.

    Raises PlanningError when a joint is too weak for the way however slowly it is taken.
    """
    pieces = []
    moving = _travel("move", move, 0.0, spec, config, effort, loaded=True)
    nothing = np.zeros(move.q.shape[1])
    if approach is not None:
        pieces.append(_travel("approach", approach, spec.stroke, spec, config, effort, loaded=False))
        if around is not None:
            pieces.append(_travel("close", around, 0.0, spec, config, effort, loaded=False))
        closing = _rest("close", move, 0, CLOSE, 0.0, nothing)
    else:
        closing = _rest("close", move, 0, CLOSE, 0.0, moving.effort[0])
        closing.gripper[0] = held
    pieces += [closing, moving, _rest("hold", move, -1, HOLD, 0.0, moving.effort[-1])]
    if retreat is not None:
        if clear is not None:
            pieces.append(_travel("open", clear, spec.stroke, spec, config, effort, loaded=False))
        pieces.append(_rest("open", clear or move, -1, OPEN, spec.stroke, nothing))
        pieces.append(_travel("retreat", retreat, spec.stroke, spec, config, effort, loaded=False))
    clock = 0.0
    starts, first = [], True
    for p in pieces:
        starts.append((clock, slice(0 if first else 1, None)))
        clock, first = clock + float(p.times[-1]), False

    def column(name: str) -> Array:
        return np.concatenate([getattr(p, name)[s] for p, (_, s) in zip(pieces, starts, strict=True)])

    return Samples(
        times=np.concatenate([p.times[s] + c for p, (c, s) in zip(pieces, starts, strict=True)]),
        q=column("q"),
        qd=column("qd"),
        gripper=column("gripper"),
        part_state=column("part_state"),
        T_world_tool=column("T_world_tool"),
        position_error=column("position_error"),
        effort=column("effort"),
        phases=tuple(name for p, (_, s) in zip(pieces, starts, strict=True) for name in p.phases[s]),
    )


def quintic(duration: float, step: float) -> tuple[Array, Array, Array]:
    """Times (n,), share (n,) from 0 to 1 and its rate (n,) 1/s of the quintic with rest at both ends.

    s = 10 u^3 - 15 u^4 + 6 u^5: peak rate 1.875 / duration, peak acceleration 5.774 / duration^2.
    """
    count = max(int(np.ceil(duration / step)), 2) + 1
    times = np.linspace(0.0, duration, count)
    u = times / duration
    return times, u**3 * (10 - 15 * u + 6 * u**2), 30 * u**2 * (1 - u) ** 2 / duration


def _travel(
    name: str,
    leg: Leg,
    gripper: float,
    spec: RobotSpec,
    config: PlanConfig,
    effort: Effort | None,
    *,
    loaded: bool,
) -> Samples:
    share = np.linspace(0.0, 1.0, len(leg.q))
    spline = CubicSpline(share, leg.q, bc_type="natural")
    duration = _duration(spline, leg, spec, config)
    if effort is not None:
        duration = max(duration, _by_torque(spline, leg, spec, config, effort, loaded))
    times, s, rate = quintic(duration, STEP)
    states = np.interp(s, share, leg.state)
    torque = np.zeros((len(s), leg.q.shape[1]))
    if effort is not None:
        u = times / duration
        acceleration = (60 * u - 180 * u**2 + 120 * u**3) / duration**2
        load = effort.load if loaded else None
        torque = effort.arm.beyond_gravity(
            spline(s), spline(s, 1), spline(s, 2), rate, acceleration, states, load
        )
    return Samples(
        times=times,
        q=spline(s),
        qd=spline(s, 1) * rate[:, None],
        gripper=np.full(len(s), gripper),
        part_state=states,
        T_world_tool=_between(leg.tool, s),
        position_error=np.interp(s, share, leg.error),
        effort=torque,
        phases=(name,) * len(s),
    )


def _rest(name: str, leg: Leg, at: int, seconds: float, gripper: float, effort: Array) -> Samples:
    n = int(np.ceil(seconds / STEP)) + 1
    return Samples(
        times=np.linspace(0.0, seconds, n),
        q=np.tile(leg.q[at], (n, 1)),
        qd=np.zeros((n, leg.q.shape[1])),
        gripper=np.full(n, gripper),
        part_state=np.full(n, leg.state[at]),
        T_world_tool=np.tile(leg.tool[at], (n, 1, 1)),
        position_error=np.full(n, leg.error[at]),
        effort=np.tile(effort, (n, 1)),
        phases=(name,) * n,
    )


def _duration(spline: CubicSpline, leg: Leg, spec: RobotSpec, config: PlanConfig) -> float:
    """Shortest quintic time with tool speed, joint velocity and joint acceleration in their shares."""
    s = np.linspace(0.0, 1.0, 201)
    first, second = np.abs(spline(s, 1)), np.abs(spline(s, 2))
    by_speed = 1.875 * leg.length / config.tool_speed
    by_velocity = 1.875 * (first / (VELOCITY_SHARE * spec.velocity)).max()
    # |q''| <= |dq/ds| 5.774 / T^2 + |d2q/ds2| (1.875 / T)^2
    by_acceleration = np.sqrt(
        ((5.774 * first + 1.875**2 * second) / (ACCELERATION_SHARE * spec.acceleration)).max()
    )
    return float(max(by_speed, by_velocity, by_acceleration, SHORTEST))


def _by_torque(
    spline: CubicSpline, leg: Leg, spec: RobotSpec, config: PlanConfig, effort: Effort, loaded: bool
) -> float:
    """Shortest quintic time that keeps every joint torque within its share of the limit."""
    u, s, rate = quintic(1.0, 1.0 / 60)
    states = np.interp(s, np.linspace(0.0, 1.0, len(leg.state)), leg.state)
    acceleration = 60 * u - 180 * u**2 + 120 * u**3
    terms = effort.arm.terms(
        spline(s), spline(s, 1), spline(s, 2), rate, acceleration, states, effort.load if loaded else None
    )
    limit = config.torque_share * spec.effort
    shortest = terms.shortest(limit)
    if np.isfinite(shortest):
        return shortest
    share = np.abs(terms.still) / spec.effort
    k, joint = np.unravel_index(int(np.argmax(share)), share.shape)
    needed, usable = abs(float(terms.still[k, joint])), float(limit[joint])
    raise RefusedError(
        reason(
            "TooWeak",
            spec.arm_joints[joint],
            float(states[k]),
            loaded,
            needed,
            usable,
            float(spec.effort[joint]),
        )
    )


def _between(tool: Array, share: Array) -> Array:
    """Tool poses interpolated over waypoints at equal shares."""
    at = share * (len(tool) - 1)
    k = np.clip(at.astype(int), 0, len(tool) - 2)
    step = geo.log_se3(geo.invert_pose(tool[k]) @ tool[k + 1])
    return tool[k] @ geo.exp_se3(step * (at - k)[:, None])
