"""What an engine should measure, computed from the twin by plain arithmetic; shares no code with the export.

The dynamics of the tree are those of Newton and Euler: with the Jacobians J of every centre of mass and the
rates J' of them, M(q) q'' + h(q, q') + damping q' = 0, M = sum m Jv^T Jv + Jw^T I Jw, h = sum m Jv^T (Jv' q'
- g) + Jw^T (I Jw' q' + w x I w). See Featherstone, Rigid Body Dynamics Algorithms (2008), chapter 3.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from twin import geometry as geo
from twin.errors import InputError
from twin.geometry import Array
from twin.scene import Inertial, Mesh, Part, PartPhysics, Revolute, Twin

GRAVITY = np.array([0.0, 0.0, -9.81])  # m/s^2
STATES = 11
SECONDS = 0.5
TIMES = tuple(float(t) for t in np.round(np.linspace(0.05, SECONDS, 10), 3))


@dataclass(frozen=True, eq=False)
class Course:
    """What the engines are asked for: states (n, parts) along the range, `state` (parts,) off it, a start."""

    states: Array
    state: Array
    position: Array
    velocity: Array


def course(twin: Twin) -> Course:
    """All parts together from limit to limit in 11 steps; a state that differs by part for the mass matrix;
    and the rollout's start: mid-range, at half the range per second, every second part backwards."""
    low, high = (np.array([getattr(p.joint, x) for p in twin.parts]) for x in ("lower", "upper"))
    share = np.linspace(0, 1, STATES)[:, None]
    n = len(twin.parts)
    uneven = np.resize([0.3, 0.8, 0.55, 0.15], n)
    sign = np.resize([1.0, -1.0], n)
    return Course(
        states=low + share * (high - low),
        state=low + uneven * (high - low),
        position=(low + high) / 2,
        velocity=sign * 0.5 * (high - low),
    )


def filled(twin: Twin) -> list[tuple[Inertial, PartPhysics]]:
    """Mass and friction of every part. Raises InputError when one has none."""
    out = []
    for part in twin.parts:
        if part.inertial is None or part.physics is None:
            raise InputError(
                f"part {part.name!r} of the twin has no mass to compare with",
                "run twin export, which fills it in",
            )
        out.append((part.inertial, part.physics))
    return out


def armatures(twin: Twin) -> Array:
    """Added inertia (parts,) in kg m^2 or kg of the joints that our MJCF and USD carry (docs/concepts.md): a
    hundredth of the part's own about its joint."""
    out = []
    for part, (inertial, _) in zip(twin.parts, filled(twin), strict=True):
        own, joint = inertial.mass.value, part.joint
        if isinstance(joint, Revolute):
            arm = inertial.com - joint.pivot
            arm = arm - joint.axis * (arm @ joint.axis)
            own = float(own * (arm @ arm) + joint.axis @ inertial.inertia @ joint.axis)
        out.append(0.01 * own)
    return np.array(out)


def written(part: Part) -> Array:
    """Vertices (n, 3) m drawn of a part: its seen mesh, or what an inferred layer shows of it, and pieces."""
    layer = part.completion
    if layer is None:
        return surface(part.mesh)
    return np.concatenate([surface(m) for m in (layer.shown, *(p.mesh for p in layer.pieces))])


def surface(mesh: Mesh) -> Array:
    """Vertices (n, 3) m that a face uses: the others are no part of the surface, leftovers of scans."""
    return np.asarray(mesh.vertices[np.unique(mesh.faces)])


def motion(twin: Twin, states: Array) -> Array:
    """Poses (parts, n, 4, 4) from state 0 to every row of `states` (n, parts)."""
    ids = [p.id for p in twin.parts]
    rows = [dict(zip(ids, row, strict=True)) for row in states]
    return np.array([[twin.part_pose(i, row) for row in rows] for i in ids])


class Dynamics:
    """Rigid bodies of a twin under gravity. `armature`, `damping` (parts,) in SI."""

    def __init__(self, twin: Twin, armature: Array, damping: Array) -> None:
        numbers = filled(twin)
        self.name = twin.name
        n = len(twin.parts)
        at = {p.id: k for k, p in enumerate(twin.parts)}
        self.parents = [-1 if p.parent is None else at[p.parent] for p in twin.parts]
        self.order = _parents_first(self.parents)
        self.chain = np.zeros((n, n), bool)  # chain[i, j]: joint j moves body i
        for k in self.order:
            self.chain[k, k] = True
            if self.parents[k] >= 0:
                self.chain[k] |= self.chain[self.parents[k]]
        self.turns = np.array([p.joint.kind == "revolute" for p in twin.parts])
        self.axes = np.array([p.joint.axis for p in twin.parts])
        self.pivots = np.array(
            [p.joint.pivot if isinstance(p.joint, Revolute) else np.zeros(3) for p in twin.parts]
        )
        self.mass = np.array([i.mass.value for i, _ in numbers])
        self.com = np.array([i.com for i, _ in numbers])
        self.tensor = np.array([i.inertia for i, _ in numbers])
        self.armature, self.damping = armature, damping

    def mass_matrix(self, q: Array) -> Array:
        """Joint-space inertia (parts, parts) at q (parts,)."""
        return self._terms(q, np.zeros(len(q)))[0]

    def forces(self, q: Array, v: Array) -> Array:
        """Generalised forces (parts,) of gravity and of turning axes, on the side of the inertia: h."""
        return self._terms(q, v)[1]

    def acceleration(self, q: Array, v: Array) -> Array:
        """q'' (parts,)."""
        inertia, bias = self._terms(q, v)
        return np.asarray(np.linalg.solve(inertia, -bias - self.damping * v), dtype=np.float64)

    def rollout(self, position: Array, velocity: Array) -> Array:
        """Positions (len(TIMES), parts), integrated to about 1e-8."""
        from scipy.integrate import solve_ivp

        n = len(position)

        def rate(_: float, y: Array) -> Array:
            return np.concatenate([y[n:], self.acceleration(y[:n], y[n:])])

        start = np.concatenate([position, velocity])
        # LSODA also takes the stiff course of a light part with much damping
        done = solve_ivp(rate, (0, SECONDS), start, "LSODA", t_eval=TIMES, rtol=1e-8, atol=1e-10)
        if not done.success:
            raise InputError(
                f"the motion of twin {self.name!r} can't be computed: {done.message}",
                "look at its masses, inertias and dampings",
            )
        return np.asarray(done.y[:n].T)

    def _terms(self, q: Array, v: Array) -> tuple[Array, Array]:
        """Mass matrix (n, n) and the forces (n,) of gravity and of turning axes."""
        n = len(q)
        poses = np.empty((n, 4, 4))
        # spin, speed: of the body, at the origin
        axis, pivot, spin, speed = (np.zeros((n, 3)) for _ in range(4))
        axis_rate, pivot_rate = np.zeros((n, 3)), np.zeros((n, 3))
        for k in self.order:
            p = self.parents[k]
            carrier, w, u = (poses[p], spin[p], speed[p]) if p >= 0 else (np.eye(4), np.zeros(3), np.zeros(3))
            axis[k] = carrier[:3, :3] @ self.axes[k]
            pivot[k] = carrier[:3, :3] @ self.pivots[k] + carrier[:3, 3]
            axis_rate[k], pivot_rate[k] = geo.cross(w, axis[k]), u + geo.cross(w, pivot[k])
            if self.turns[k]:
                r = geo.exp_so3(self.axes[k] * q[k])
                poses[k] = carrier @ geo.make_pose(r, self.pivots[k] - r @ self.pivots[k])
                spin[k], speed[k] = w + axis[k] * v[k], u - geo.cross(axis[k] * v[k], pivot[k])
            else:
                poses[k] = carrier @ geo.make_pose(translation=self.axes[k] * q[k])
                spin[k], speed[k] = w, u + axis[k] * v[k]
        inertia, bias = np.diag(self.armature).astype(float), np.zeros(n)
        for i in range(n):
            rotation = poses[i, :3, :3]
            c = rotation @ self.com[i] + poses[i, :3, 3]
            c_rate = speed[i] + geo.cross(spin[i], c)
            turn = np.where((self.turns & self.chain[i])[:, None], axis, 0.0)  # (n, 3), rows of Jw^T
            turn_rate = np.where((self.turns & self.chain[i])[:, None], axis_rate, 0.0)
            slide = (~self.turns & self.chain[i])[:, None]
            move = np.where(slide, axis, geo.cross(turn, c - pivot))
            move_rate = np.where(
                slide, axis_rate, geo.cross(turn_rate, c - pivot) + geo.cross(turn, c_rate - pivot_rate)
            )
            tensor = rotation @ self.tensor[i] @ rotation.T
            inertia += self.mass[i] * move @ move.T + turn @ tensor @ turn.T
            bias += self.mass[i] * move @ (move_rate.T @ v - GRAVITY)
            bias += turn @ (tensor @ (turn_rate.T @ v) + geo.cross(spin[i], tensor @ spin[i]))
        return inertia, bias


def _parents_first(parents: list[int]) -> list[int]:
    order: list[int] = []
    while len(order) < len(parents):
        order += [k for k, p in enumerate(parents) if k not in order and (p < 0 or p in order)]
    return order
