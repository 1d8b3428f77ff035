"""Distances of the arm from all it must not touch, in the replay's own scene."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import mujoco
import numpy as np

from robots.config import PlanConfig
from robots.grasp.tool_path import Grasp
from robots.model.spec import RobotSpec
from robots.planning.base_search import Base
from robots.reasons import reason
from robots.scene.world import ROBOT, build_world
from robots.task import Task
from twin.geometry import Array
from twin.scene import Part, Twin

_CHECKED = 200  # bases looked at in one call
_ENOUGH = 25  # accepted ones after which a call stops
_PEDESTAL = 1.0  # m of column under the base while searching; doors sweep no deeper than that below the base
_SWING = 4  # openings of a claw that are looked at while it closes
_HOPELESS = -0.02  # m of overlap at which a path is given up


class ClearanceCheck:
    """Sorts base poses into those whose rough path touches nothing and the others."""

    def __init__(
        self,
        twin: Twin,
        part: Part,
        spec: RobotSpec,
        task: Task,
        grasps: Sequence[Grasp],
        config: PlanConfig,
    ) -> None:
        self._world = build_world(twin, spec, np.eye(4), 0.0 if spec.planar else _PEDESTAL)
        self._world.model.geom_margin[self._world.owner == ROBOT] = config.clearance
        model = self._world.model
        self._caught = [
            set(pair)
            for pair in np.stack([model.pair_geom1, model.pair_geom2], 1)[model.pair_adhesion > 0].tolist()
        ]
        self._data = mujoco.MjData(model)
        self._part, self._reach, self._task = part.id, config.clearance, task
        self._spec, self._grasps = spec, grasps

    def sort(self, bases: Sequence[Base]) -> tuple[list[Base], list[Base]]:
        """Accepted bases, best first, and rejected ones with their reasons. `bases` come best first."""
        rejected = [b for b in bases if b.reason is not None]
        accepted: list[Base] = []
        for base in [b for b in bases if b.reason is None][:_CHECKED]:
            checked = self.checked(base)
            (accepted if checked.reason is None else rejected).append(checked)
            if len(accepted) == _ENOUGH:
                break
        return sorted(accepted, key=lambda b: -b.score), rejected

    def checked(self, base: Base) -> Base:
        """The base with its clearance in the score, and a reason when the arm would touch something."""
        states = self._task.states(len(base.q) - 2)
        self._world.move_base(base.T_world_base)
        least, met = np.inf, ("", 0.0)
        for q, state, opening in self._poses(base, states):
            distance, names = self._nearest(q, float(state), opening)
            if distance < least:
                least, met = distance, (names, float(state))
            if least < _HOPELESS:
                break
        if least < 0.0:
            return replace(base, clearance=float(least), reason=reason("InCollision", *met, -float(least)))
        return replace(base, clearance=float(least), score=base.score + least / self._reach)

    def _poses(self, base: Base, states: Array) -> Iterator[tuple[Array, float, float]]:
        """Arm, part and opening of the hand along the way; swinging jaws also while they close."""
        spec, full = self._spec, self._spec.stroke
        yield base.q[0], states[0], full
        if spec.gripper_kind == "claw":
            held = min(self._grasps[base.grasp].hold.thickness, full)
            for q, state in ((base.q[1], states[0]), (base.q[-2], states[-1])):
                yield from ((q, state, float(o)) for o in np.linspace(held, full, _SWING))
        yield from ((q, float(s), full) for q, s in zip(base.q[1:-1], states, strict=True))
        yield base.q[-1], states[-1], full

    def _nearest(self, q: Array, state: float, opening: float) -> tuple[float, str]:
        """Least distance (m, at most the reach of the check) and the two bodies that have it."""
        w, d, m = self._world, self._data, self._world.model
        d.qpos[w.arm_qpos] = q
        d.qpos[w.gripper_qpos] = self._spec.jaws(opening)
        d.qpos[w.part_qpos[self._part]] = state
        mujoco.mj_kinematics(m, d)
        mujoco.mj_comPos(m, d)
        mujoco.mj_collision(m, d)
        least, names = self._reach, ""
        for (g1, g2), distance in zip(d.contact.geom.tolist(), d.contact.dist.tolist(), strict=True):
            if distance < least and not self._allowed(g1, g2):
                least = distance
                names = f"{w.body_of(g1)} and {w.body_of(g2)}"
        return least, names

    def _allowed(self, g1: int, g2: int) -> bool:
        """Fingers may be near the part they are about to hold, and the two that a catch pulls together."""
        w = self._world
        return bool(
            {g1, g2} in self._caught
            or (w.finger[g1] and w.geom_part[g2] == self._part)
            or (w.finger[g2] and w.geom_part[g1] == self._part)
        )
