"""Whether a part stays where it is left, by statics: its weight along the joint against dry friction.

A lid on a slope opens by itself, and a file in which it does is right. How it then moves is one ordinary
differential equation, M(q) q'' + h(q, q') + damping q' + friction sign(q') = 0, with the other parts held.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from twin.geometry import Array
from twin.scene import Part, Twin
from twin.verification.expected import Dynamics, filled


@dataclass(frozen=True)
class Hold:
    """pull (N or N m, positive opens) of the weight, friction (N or N m) that holds against it, whether a
    stop does, and how much a catch (N or N m) holds against being opened."""

    pull: float
    friction: float
    stopped: bool
    unit: str
    caught: float = 0.0

    @property
    def least(self) -> float:
        """Pull (N or N m) needed to move it on: against friction, and a catch where it is to open."""
        return self.friction + (self.caught if self.pull > 0 else 0.0)

    @property
    def moves(self) -> bool:
        """The pull is more than friction and a catch hold, and not against a stop."""
        return not self.stopped and abs(self.pull) > self.least

    @property
    def on_edge(self) -> bool:
        """It moves, but with so little pull left that MuJoCo's friction (impedance 0.9) may hold it back."""
        return self.moves and 0.85 * abs(self.pull) < self.least

    @property
    def text(self) -> str:
        """For a reader."""
        against = "a stop holds it" if self.stopped else f"friction holds {self.friction:.2g} {self.unit}"
        against += f", a catch {self.caught:.2g} {self.unit} against being opened" if self.caught else ""
        return f"its weight pulls with {abs(self.pull):.2g} {self.unit}, {against}"


def hold(twin: Twin, part: Part, state: float, others: dict[int, float] | None = None) -> Hold:
    """What keeps `part` at `state` with the others where they are (part id -> state; closed by default)."""
    k, q = _place(twin, part, state, others)
    pull = -float(_dynamics(twin, np.zeros(len(twin.parts))).forces(q, np.zeros(len(q)))[k])
    stop = part.joint.lower if pull < 0 else part.joint.upper
    physics = filled(twin)[k][1]
    unit = "N m" if part.joint.kind == "revolute" else "N"
    return Hold(pull, physics.frictionloss.value, abs(state - stop) < 1e-9, unit, physics.caught(state))


def slide(
    twin: Twin, part: Part, state: float, times: Sequence[float], armature: float
) -> tuple[Array, Array]:
    """States (t,) and speeds (t,), endless, at `times` (s, rising) of a part let go at `state`, to its stop.

    armature: of its joint, kg m^2 or kg, as the file has it.
    """
    from scipy.integrate import solve_ivp

    k, q = _place(twin, part, state, None)
    added = np.zeros(len(twin.parts))
    added[k] = armature
    moved = _dynamics(twin, added)
    held, physics = hold(twin, part, state), filled(twin)[k][1]
    sign = np.sign(held.pull)

    def rate(_: float, y: Array) -> list[float]:
        now, speed = q.copy(), np.zeros(len(q))
        now[k], speed[k] = y
        force = (
            moved.forces(now, speed)[k]
            + moved.damping[k] * y[1]
            + held.friction * sign
            + physics.caught(y[0])
        )
        return [float(y[1]), -float(force / moved.mass_matrix(now)[k, k])]

    done = solve_ivp(rate, (0.0, times[-1]), [state, 0.0], "LSODA", t_eval=times, rtol=1e-8, atol=1e-10)
    return np.clip(done.y[0], part.joint.lower, part.joint.upper), np.asarray(done.y[1])


def _place(twin: Twin, part: Part, state: float, others: dict[int, float] | None) -> tuple[int, Array]:
    states = {**(others or {}), part.id: state}
    return twin.parts.index(part), np.array([states.get(p.id, 0.0) for p in twin.parts])


def _dynamics(twin: Twin, armature: Array) -> Dynamics:
    return Dynamics(twin, armature, np.array([n.damping.value for _, n in filled(twin)]))


def inertia(twin: Twin, part: Part) -> float:
    """kg m^2 about its hinge or kg along its slide, of a part and what it carries, all closed."""
    k, q = _place(twin, part, 0.0, None)
    return float(_dynamics(twin, np.zeros(len(twin.parts))).mass_matrix(q)[k, k])
