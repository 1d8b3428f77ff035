"""Where the robot's base stands: many poses are tried at once, and each rejected one has a reason."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import qmc

from robots.config import PlanConfig
from robots.grasp.tool_path import APPROACH, Grasp, backed_off
from robots.model.kinematics import Chain
from robots.model.spec import RobotSpec
from robots.planning.ground import Ground
from robots.planning.planar_base import planar_starts
from robots.reasons import reason
from robots.task import Task
from twin import geometry as geo
from twin.cause import Cause
from twin.geometry import Array
from twin.scene import Joint, Mesh, Revolute

_WAYPOINTS = 8
# Steps of the first state, of each that follows, of a path that is nearly reached
_START_STEPS = 45
_FOLLOW_STEPS = 7
_POLISH_STEPS = 25
_REACHED = 0.006  # m of the tool's worst error that is good enough for a rough path
_NEARLY = 0.10  # m of it that is worth more steps
_OVERSAMPLED = 10  # in a furnished room nine of ten places around a handle are taken
_BLOCKED_KEPT = 20
_FURNITURE_COST = 1.0  # of the score: standing on a table is possible, on the floor is better
_AT_LIMIT = 1e-3  # rad
_BELOW = (-0.15, 0.75)  # m by which the base lies below the handle


@dataclass(frozen=True, eq=False)
class Base:
    """A base pose with the arm's rough path over it.

    T_world_base: (4, 4). pedestal: m above the floor. grasp: index. q: (waypoints + 2, n): approach, states,
    retreat. position_error m and angle_error rad: worst along the path.
    margin: least distance from a joint limit (rad). manipulability: least. clearance: least distance (m) from
    anything not to be touched. reason: why it was rejected, None when it was not.
    """

    T_world_base: Array
    pedestal: float
    grasp: int
    q: Array
    position_error: float
    angle_error: float
    margin: float
    manipulability: float
    score: float
    clearance: float = 0.0
    reason: Cause | None = None

    @property
    def yaw(self) -> float:
        """Heading in rad."""
        return float(np.arctan2(self.T_world_base[1, 0], self.T_world_base[0, 0]))


class BaseSearch:
    """Tries base poses for tool paths of several grasps on a part, on a floor at the height `floor` (m)."""

    def __init__(
        self,
        joint: Joint,
        task: Task,
        grasps: Sequence[Grasp],
        chain: Chain,
        spec: RobotSpec,
        static: Mesh,
        config: PlanConfig,
        floor: float,
    ) -> None:
        if spec.planar:  # feet stand on the floor, never on a pedestal
            config = replace(config, pedestal=(0.0, 0.0))
        self._grasps, self._chain, self._spec, self._config = grasps, chain, spec, config
        states = task.states(_WAYPOINTS)
        self._states = np.concatenate([states[:1], states, states[-1:]])
        self._unit = "rad" if isinstance(joint, Revolute) else "m"
        self._paths = np.stack([_tool_path(g, joint, states) for g in grasps])
        self._ground = Ground(static, spec.footprint, floor)
        self._handle = float(self._paths[0, 1:-1, 2, 3].min()) - 0.05
        self._rng = np.random.default_rng(config.seed)
        # natural grasps are tried more often
        share = np.cumsum(np.exp(-2.0 * np.array([g.cost for g in grasps])))
        self._share = share / share[-1]

    def everywhere(self) -> list[Base]:
        """Bases from all around the handle, best score first, rejected ones (with a reason) last."""
        n = _OVERSAMPLED * self._config.candidates
        near, far = self._spec.distance
        u = qmc.Halton(5, seed=self._config.seed).random(n)
        middle = self._paths[0, 1:-1, :3, 3].mean(axis=0)
        angle, radius = 2 * np.pi * u[:, 0], near + (far - near) * u[:, 1]
        z = middle[2] - (_BELOW[0] + (_BELOW[1] - _BELOW[0]) * u[:, 2])
        xy = middle[:2] + radius[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
        yaw = angle + np.pi + (u[:, 3] - 0.5) * 2.0
        return self._evaluated(xy, z, yaw, np.searchsorted(self._share, u[:, 4]))

    def around(self, seeds: Sequence[Base]) -> list[Base]:
        """Bases near others, in the same order."""
        n = 2 * self._config.candidates
        which = self._rng.integers(0, len(seeds), n)
        position = np.stack([b.T_world_base[:3, 3] for b in seeds])[which] + self._rng.normal(0, 0.06, (n, 3))
        yaw = np.array([b.yaw for b in seeds])[which] + self._rng.normal(0, 0.25, n)
        same = np.array([b.grasp for b in seeds])[which]
        other = np.searchsorted(self._share, self._rng.random(n))
        choice = np.where(self._rng.random(n) < 0.6, same, other)
        return self._evaluated(position[:, :2], position[:, 2], yaw, choice)

    def _evaluated(self, xy: Array, z: Array, yaw: Array, choice: Array) -> list[Base]:
        config, ground = self._config, self._ground
        z = np.clip(z, ground.floor + config.pedestal[0], ground.floor + config.pedestal[1])
        poses = np.tile(np.eye(4), (len(z), 1, 1))
        poses[:, :3, :3] = geo.exp_so3(np.stack([np.zeros(len(z)), np.zeros(len(z)), yaw], axis=1))
        poses[:, :2, 3], poses[:, 2, 3] = xy, z
        supports = ground.supports(poses, self._handle, config)
        blocked, keep = (
            np.flatnonzero(np.isnan(supports))[:_BLOCKED_KEPT],
            np.flatnonzero(np.isfinite(supports)),
        )
        bases = [_blocked(poses[k], z[k] - ground.floor, int(choice[k])) for k in blocked]
        if len(keep):
            bases += self._reached(poses[keep], z[keep] - supports[keep], choice[keep])
        return sorted(bases, key=lambda b: (b.reason is not None, -b.score))

    def _reached(self, poses: Array, pedestals: Array, choice: Array) -> list[Base]:
        chain, grasps = self._chain, self._grasps
        targets = geo.invert_pose(poses)[:, None] @ self._paths[choice]
        q, error = _follow(chain, targets, grasps, choice, self._spec)
        manipulability = chain.manipulability(q.reshape(-1, q.shape[2])).reshape(q.shape[:2]).min(axis=1)
        margin = chain.limit_margin(q).min(axis=1)
        on_floor = np.abs(poses[:, 2, 3] - pedestals - self._ground.floor) < 1e-6
        penalty = np.where(on_floor, 0.0, _FURNITURE_COST)
        return [
            _rated(
                _blocked(poses[k], pedestals[k], int(choice[k])),
                q[k],
                error[k],
                _Ways(self._states, self._unit, chain.lower, chain.upper, self._spec.arm_joints),
                float(margin[k]),
                float(manipulability[k]),
                grasps[choice[k]],
                float(penalty[k]),
            )
            for k in range(len(poses))
        ]


def _tool_path(grasp: Grasp, joint: Joint, states: Array) -> Array:
    path = grasp.path(joint, states)
    first, last = (backed_off(p, APPROACH, grasp.room) for p in (path[0], path[-1]))
    return np.stack([first, *path, last])


def _blocked(pose: Array, pedestal: float, grasp: int) -> Base:
    nothing = np.zeros((0, 0))
    return Base(
        pose, float(pedestal), grasp, nothing, np.inf, np.inf, 0.0, 0.0, -np.inf,
        reason=reason("NoRoom"),
    )  # fmt: skip


def _follow(
    chain: Chain, targets: Array, grasps: Sequence[Grasp], choice: Array, spec: RobotSpec
) -> tuple[Array, Array]:
    """Rough joint paths (B, W, n) and errors (B, W, 6) along targets (B, W, 4, 4), middle first."""
    batch, count = targets.shape[:2]
    q = np.empty((batch, count, len(spec.home)))
    error = np.empty((batch, count, 6))
    # Grasps of one call share their freedom where their holds are of one kind; the mean is exact then.
    weights = np.concatenate([np.ones(3), np.mean([grasps[g].freedom for g in choice], axis=0)])
    middle = count // 2
    starts = _starts(targets[:, middle], chain, spec)
    goals = np.tile(targets[:, middle], (len(starts), 1, 1))
    tried, off = chain.solve(np.concatenate(starts), goals, weights, _START_STEPS)
    cost = np.linalg.norm(off * weights, axis=1) - 0.02 * chain.limit_margin(tried).clip(0, 0.5)
    best = np.argmin(cost.reshape(len(starts), batch), axis=0) * batch + np.arange(batch)
    q[:, middle], error[:, middle] = tried[best], off[best]
    for away in range(1, middle + 1):  # both ways at a time
        ways = [(k, k - step) for step in (1, -1) if (k := middle + step * away) < count]
        to, since = np.array(ways).T
        start, goal = (x.reshape(-1, *x.shape[2:]) for x in (q[:, since], targets[:, to]))
        there, left = chain.solve(start, goal, weights, _FOLLOW_STEPS)
        q[:, to], error[:, to] = (x.reshape(batch, len(to), -1) for x in (there, left))
    worst = np.linalg.norm(error[:, :, :3], axis=2).max(axis=1)
    near = np.flatnonzero((worst > _REACHED) & (worst < _NEARLY))
    if len(near):  # a mobile base converges slowly
        shape = (len(near) * count, -1)
        polished, left = chain.solve(
            q[near].reshape(shape), targets[near].reshape(-1, 4, 4), weights, _POLISH_STEPS
        )
        q[near], error[near] = polished.reshape(q[near].shape), left.reshape(error[near].shape)
    return q, error


def _starts(target: Array, chain: Chain, spec: RobotSpec) -> list[Array]:
    """Start configurations: home turned towards the target, and with the elbow out to either side."""
    facing = np.arctan2(target[:, 1, 3], target[:, 0, 3])
    starts = []
    if spec.planar:
        return planar_starts(target, chain, spec)
    for elbow, wrist in ((0.0, 0.0), (1.2, 1.5), (-1.2, -1.5)):
        q = np.tile(spec.home, (len(target), 1))
        q[:, 0] += facing - 0.5 * elbow
        if q.shape[1] > 2:
            q[:, 2] += elbow
        q[:, -1] += wrist
        starts.append(np.clip(q, chain.lower, chain.upper))
    return starts


@dataclass(frozen=True, eq=False)
class _Ways:
    """What a reason is told in: states (w,) along the path, their unit, joint limits (n,) and names."""

    states: Array
    unit: str
    lower: Array
    upper: Array
    joints: tuple[str, ...]

    def stopped(self, q: Array) -> str:
        """The joints of a configuration that are at a limit, in words."""
        low, high = q - self.lower < _AT_LIMIT, self.upper - q < _AT_LIMIT
        return ", ".join(
            f"{self.joints[k]} at its {'lower' if low[k] else 'upper'} limit"
            for k in np.flatnonzero(low | high)
        )


def _rated(
    base: Base,
    q: Array,
    error: Array,
    ways: _Ways,
    margin: float,
    manipulability: float,
    grasp: Grasp,
    penalty: float,
) -> Base:
    """The base with its rough path judged: a score, and a reason when it does not reach."""
    position = np.linalg.norm(error[:, :3], axis=1)
    angle = np.abs(error[:, 3:] * (grasp.freedom >= 0.3)).max(axis=1)
    free_angle = float(np.abs(error[:, 3:]).max())
    states, worst = ways.states, int(np.argmax(position + 0.1 * angle))
    jump = float(np.abs(np.diff(q, axis=0)).max())
    why: Cause | None = None
    if position.max() > _REACHED or angle.max() > 0.10 or free_angle > 0.5:
        turned = max(float(angle[worst]), free_angle if free_angle > 0.5 else 0.0)
        stopped = ways.stopped(q[worst])
        why = reason("Unreachable", float(states[worst]), ways.unit, float(position[worst]), turned, stopped)
    elif jump > 1.0:
        why = reason("Reconfigures", jump)
    # Terms of about equal weight: 1/3 rad from the limits and a manipulability of 0.06 count as plenty.
    score = min(margin, 0.35) / 0.35 + min(manipulability, 0.06) / 0.06
    score -= grasp.cost + 0.15 * jump + penalty + 20.0 * float(position.max()) + 0.5 * free_angle
    return replace(
        base,
        q=q,
        position_error=float(position.max()),
        angle_error=float(angle.max()),
        margin=margin,
        manipulability=manipulability,
        score=score,
        reason=why,
    )
