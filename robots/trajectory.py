"""A robot's motion over time, checked, and the law by which it was timed."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from robots.floor import Floor
from twin.errors import PlanningError
from twin.geometry import Array

PHASES = ("approach", "close", "move", "hold", "open", "retreat")


@dataclass(frozen=True)
class RejectedBase:
    """A base pose that was tried: position (m, world), yaw (rad), pedestal height (m), score, reason."""

    position: tuple[float, float, float]
    yaw: float
    pedestal: float
    score: float
    reason: str


@dataclass(frozen=True, eq=False, repr=False)
class RobotTrajectory:
    """Joint trajectory of an arm that moves one part; n samples, j arm joints.

    times: (n,) s from 0. q, qd: (n, j) rad and rad/s, m and m/s of the slides of a planar base. gripper: (n,)
    commanded opening in m, 0 = closed with full force. phases: (n,) names out of PHASES. part_state: (n,)
    commanded state, m or rad. T_world_tool: (n, 4, 4). position_error: (n,) m between the wanted and the
    reachable tool position. T_world_base: (4, 4). pedestal: m, height of the base above the floor. limits:
    (2, j), velocity_limits: (j,) in the units of q and qd. effort: (n, j) N m (N for a slide) that the motion
    and the part ask of the joints beside gravity compensation, by the twin's physics; zeros when left out.
    start, goal: states from which and to which the part is brought. grasp: how the hand holds the part.
    score, clearance (m): of the chosen base. floor: what it was planned to stand on; None in earlier files.
    """

    robot: str
    twin: str
    part_id: int
    part: str
    joint_names: tuple[str, ...]
    times: Array
    q: Array
    qd: Array
    gripper: Array
    phases: tuple[str, ...]
    part_state: Array
    T_world_tool: Array
    position_error: Array
    T_world_base: Array
    pedestal: float
    limits: Array
    velocity_limits: Array
    goal: float
    grasp: str
    score: float
    clearance: float
    rejected: tuple[RejectedBase, ...] = ()
    start: float = 0.0
    effort: Array = field(default_factory=lambda: np.zeros(0))
    floor: Floor | None = None

    def __post_init__(self) -> None:
        n, j = len(self.times), len(self.joint_names)
        shapes = {
            "times": (n,), "q": (n, j), "qd": (n, j), "gripper": (n,), "part_state": (n,),
            "T_world_tool": (n, 4, 4), "position_error": (n,), "T_world_base": (4, 4),
            "limits": (2, j), "velocity_limits": (j,), "effort": (n, j),
        }  # fmt: skip
        if np.size(self.effort) == 0:
            object.__setattr__(self, "effort", np.zeros((n, j)))
        for key, shape in shapes.items():
            values = np.array(getattr(self, key), dtype=np.float64)
            if values.shape != shape or not np.all(np.isfinite(values)):
                raise PlanningError(f"trajectory {key} must be finite with shape {shape}, got {values.shape}")
            values.flags.writeable = False
            object.__setattr__(self, key, values)
        if n < 2 or np.any(np.diff(self.times) <= 0):
            raise PlanningError("trajectory times must strictly increase and hold two samples or more")
        unknown = set(self.phases) - set(PHASES)
        if len(self.phases) != n or unknown:
            raise PlanningError(
                f"a trajectory needs a known phase for each sample, unknown: {sorted(unknown)}"
            )
        self._check_limits()

    def _check_limits(self) -> None:
        over = np.maximum(self.limits[0] - self.q, self.q - self.limits[1]).max(axis=0)
        if over.max() > 1e-6:
            k = int(np.argmax(over))
            raise PlanningError(f"joint {self.joint_names[k]} leaves its limits by {over[k]:.4f}")
        speed = (np.abs(self.qd) / self.velocity_limits).max(axis=0)
        if speed.max() > 1 + 1e-6:
            k = int(np.argmax(speed))
            raise PlanningError(f"joint {self.joint_names[k]} moves at {speed[k]:.2f} of its velocity limit")

    def __repr__(self) -> str:
        way = f"from state {self.start:.3g} to {self.goal:.3g} in {self.duration:.1f} s"
        counted = f"{len(self.times)} samples of {len(self.joint_names)} joints"
        return f"<RobotTrajectory: {self.robot} moves {self.part!r} {way}, {counted}; {self.grasp}>"

    @property
    def duration(self) -> float:
        """Seconds from the first to the last sample."""
        return float(self.times[-1] - self.times[0])

    def effort_at(self, times: Array) -> Array:
        """Effort (m, j) at any times, linear between samples, held beyond the ends."""
        return np.stack([np.interp(times, self.times, e) for e in self.effort.T], axis=1)

    def at(self, times: Array) -> tuple[Array, Array, Array]:
        """Joint positions (m, j), velocities (m, j) and gripper command (m,) at any times, held beyond.

        Cubic Hermite between samples, so positions and velocities agree.
        """
        t = np.clip(times, self.times[0], self.times[-1])
        k = np.clip(np.searchsorted(self.times, t, side="right") - 1, 0, len(self.times) - 2)
        h = (self.times[k + 1] - self.times[k])[:, None]
        u = ((t - self.times[k])[:, None]) / h
        q0, q1, v0, v1 = self.q[k], self.q[k + 1], self.qd[k] * h, self.qd[k + 1] * h
        q = (
            (1 + 2 * u) * (1 - u) ** 2 * q0
            + u * (1 - u) ** 2 * v0
            + u**2 * (3 - 2 * u) * q1
            + u**2 * (u - 1) * v1
        )
        qd = (6 * u * (u - 1) * (q0 - q1) + (3 * u - 1) * (u - 1) * v0 + u * (3 * u - 2) * v1) / h
        outside = ((times < self.times[0]) | (times > self.times[-1]))[:, None]
        return q, np.where(outside, 0.0, qd), self.gripper[k]
