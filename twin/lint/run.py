"""Runs one file in MuJoCo: python -m twin.lint.run FILE FORMAT ANSWER.json. See twin.lint.simulate.

The probe stands for a hand: 10 N on a slide, 2 N m on a hinge (a door of 0.4 m pulled with 5 N at its edge),
on what is heavy a tenth of its weight on its lever, as `twin check` asks (twin/verification/behaviour.py),
gravity left out so that a heavy lid is not taken for a stuck one, all other joints held. Joints with a motor,
or coupled to others, are left to their controllers.
"""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from twin.geometry import Array
from twin.lint.loading import load

_FORCE = {int(mujoco.mjtJoint.mjJNT_SLIDE): 10.0, int(mujoco.mjtJoint.mjJNT_HINGE): 2.0}  # N, N m
_HEAVY = 0.1 * 9.81  # m/s^2
_DEEP = 1e-3  # m
_DRIFT = 1e-3  # m
_SECONDS = 10.0  # of simulated time
# s, chosen by us: a gate of 10 m damped to stop in 1 s takes 15 s; stuck parts stand still long before
_PUSHED = 60.0
_REACHED = 0.01  # share of the range that may be left: limits are soft
_NO_CONTACT = int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
_STALLED = 1e-5  # share of the range per step; slower for half a second is standing still


class Scene:
    """A compiled model and what is part, motor and rest in it."""

    def __init__(self, model: Any) -> None:
        self.model, self.data = model, mujoco.MjData(model)
        motored = {
            int(model.actuator_trnid[a, 0])
            for a in range(model.nu)
            if model.actuator_trntype[a] in (mujoco.mjtTrn.mjTRN_JOINT, mujoco.mjtTrn.mjTRN_JOINTINPARENT)
        }
        coupled = {
            int(j)
            for t in range(model.nwrap)
            if model.wrap_type[t] == mujoco.mjtWrap.mjWRAP_JOINT
            for j in [model.wrap_objid[t]]
        }
        for e in range(model.neq):
            if model.eq_type[e] == mujoco.mjtEq.mjEQ_JOINT:
                coupled |= {int(model.eq_obj1id[e]), int(model.eq_obj2id[e])} - {-1}
        self.parts = [
            j
            for j in range(model.njnt)
            if int(model.jnt_type[j]) in _FORCE and j not in motored and j not in coupled
        ]
        self.loose = {  # trees that stand on nothing: where they start says nothing about them
            int(model.body_rootid[model.jnt_bodyid[j]])
            for j in range(model.njnt)
            if model.jnt_type[j] == mujoco.mjtJoint.mjJNT_FREE
        }
        self.motored = {int(model.jnt_bodyid[j]) for j in motored}

    def joint(self, j: int) -> str:
        name = self.model.joint(j).name
        return f"joint {name!r}" if name else f"joint {j} of {self.body(int(self.model.jnt_bodyid[j]))}"

    def body(self, b: int) -> str:
        name = self.model.body(b).name
        return f"body {name!r}" if name else f"body {b}"

    def carries(self, j: int) -> list[int]:
        """Bodies that move with joint j."""
        mine, m = {int(self.model.jnt_bodyid[j])}, self.model
        for b in range(m.nbody):
            if int(m.body_parentid[b]) in mine:
                mine.add(b)
        return sorted(mine)

    def rest(self) -> None:
        """Everything at zero, or at the limit next to zero."""
        m, d = self.model, self.data
        mujoco.mj_resetData(m, d)
        for j in range(m.njnt):
            if int(m.jnt_type[j]) in _FORCE and m.jnt_limited[j] and m.jnt_range[j, 0] <= m.jnt_range[j, 1]:
                at = int(m.jnt_qposadr[j])
                d.qpos[at] = np.clip(d.qpos[at], *m.jnt_range[j])

    def forget_parts_of(self, bodies: set[int]) -> None:
        """Leave out parts whose shapes overlap others: stuck or driven off is one fault, not three."""
        self.parts = [j for j in self.parts if not bodies & set(self.carries(j))]

    def settled_by_hand(self, j: int) -> bool:
        """False when a motor or nothing at all holds what the joint hangs on."""
        b = int(self.model.jnt_bodyid[j])
        if int(self.model.body_rootid[b]) in self.loose:
            return False
        while b:
            if b in self.motored:
                return False
            b = int(self.model.body_parentid[b])
        return True


def contacts(scene: Scene) -> dict[tuple[int, int], float]:
    """Deepest overlap (m) at rest of every pair of bodies that are not rigidly attached to each other."""
    m, d = scene.model, scene.data
    scene.rest()
    mujoco.mj_forward(m, d)
    found: dict[tuple[int, int], float] = {}
    for c in d.contact:
        b0, b1 = (int(m.body_weldid[m.geom_bodyid[g]]) for g in c.geom)
        loose = {int(m.body_rootid[b]) for b in (b0, b1)} & scene.loose
        if b0 == b1 or (loose and m.body_rootid[b0] != m.body_rootid[b1]):
            continue
        pair = (min(b0, b1), max(b0, b1))
        if -c.dist > max(_DEEP, found.get(pair, 0.0)):
            found[pair] = float(-c.dist)
    return found


def overlaps(spec: Any, scene: Scene, pushing: dict[tuple[int, int], float]) -> Iterator[list[str]]:
    """Pairs that push each other, and pairs of part and parent that only this file keeps from touching."""
    for (a, b), depth in pushing.items():
        yield [
            "error", f"{scene.body(a)}, {scene.body(b)}", f"{depth * 1000:.3g} mm", "their collision shapes overlap at rest",
            "shrink or split the shapes until they clear each other",
        ]  # fmt: skip
    for pair in list(spec.excludes):
        spec.delete(pair)
    free = spec.compile()
    free.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_FILTERPARENT)
    hidden = Scene(free)
    parts = {int(free.body_weldid[free.jnt_bodyid[j]]) for j in hidden.parts if hidden.settled_by_hand(j)}
    for (a, b), depth in contacts(hidden).items():
        if (a, b) not in pushing and ((a == 0 and b in parts) or (b == 0 and a in parts)):
            yield [
                "warning", f"{scene.body(a)}, {scene.body(b)}", f"{depth * 1000:.3g} mm",
                "their collision shapes overlap at rest; this file keeps the pair from colliding, other formats can't",
                "shrink or split the shapes until they clear each other",
            ]  # fmt: skip


def stuck(scene: Scene) -> Iterator[list[str]]:
    """Push every part to both of its limits."""
    m = scene.model
    gravity, flags = m.opt.gravity.copy(), int(m.opt.disableflags)
    adhesion = m.pair_adhesion.copy(), m.geom_adhesion.copy()
    m.opt.gravity[:] = 0
    m.pair_adhesion[:], m.geom_adhesion[:] = 0.0, 0.0  # a catch is nothing in the way
    m.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_ACTUATION)
    for j in scene.parts:
        lower, upper = (float(x) for x in m.jnt_range[j])
        if not m.jnt_limited[j] or not upper > lower or int(m.body_rootid[m.jnt_bodyid[j]]) in scene.loose:
            continue
        turning = int(m.jnt_type[j]) == int(mujoco.mjtJoint.mjJNT_HINGE)
        unit, scale, of = ("degrees", np.rad2deg(1.0), "N m") if turning else ("mm", 1000.0, "N")
        force = f"{_pull(scene, j):.3g} {of}"
        for sign, name, limit in ((1.0, "upper", upper), (-1.0, "lower", lower)):
            end = _push(scene, j, sign)
            if sign * (limit - end) <= _REACHED * (upper - lower):
                continue
            m.opt.disableflags |= _NO_CONTACT
            free = sign * (limit - _push(scene, j, sign)) <= _REACHED * (upper - lower)
            m.opt.disableflags &= ~_NO_CONTACT
            yield [  # a latch may lock a door, a stop have some slack, a hinge be stiff
                "warning", scene.joint(j), f"{end * scale:.4g} of {limit * scale:.4g} {unit}",
                f"{force} don't bring it to its {name} limit",
                "look for shapes in its way, and the range" if free else "look for friction, damping and the range",
            ]  # fmt: skip
    m.opt.gravity[:], m.opt.disableflags = gravity, flags
    m.pair_adhesion[:], m.geom_adhesion[:] = adhesion


def _pull(scene: Scene, j: int) -> float:
    """The probe's force (N or N m); a hinge's lever is its radius of gyration, sqrt(inertia / mass)."""
    m = scene.model
    mass, inertia = float(m.body_subtreemass[m.jnt_bodyid[j]]), float(m.dof_M0[m.jnt_dofadr[j]])
    return max(_FORCE[int(m.jnt_type[j])], _HEAVY * float(np.sqrt(mass * inertia)))


def _push(scene: Scene, j: int, sign: float) -> float:
    """Where the joint ends under the probe, every other joint held."""
    m, d = scene.model, scene.data
    scene.rest()
    qa, va = int(m.jnt_qposadr[j]), int(m.jnt_dofadr[j])
    rest = d.qpos.copy()
    reach = float(m.jnt_range[j, 1] - m.jnt_range[j, 0])
    goal = float(m.jnt_range[j, 1] if sign > 0 else m.jnt_range[j, 0])
    force = sign * _pull(scene, j)
    still, limit = 0, max(int(0.5 / m.opt.timestep), 1)
    for _ in range(int(_PUSHED / m.opt.timestep)):
        d.qfrc_applied[:] = 0
        d.qfrc_applied[va] = force
        before = float(d.qpos[qa])
        mujoco.mj_step(m, d)
        q, v = float(d.qpos[qa]), float(d.qvel[va])
        d.qpos[:], d.qvel[:] = rest, 0.0
        d.qpos[qa], d.qvel[va] = q, v
        still = still + 1 if abs(q - before) < _STALLED * reach else 0
        if not np.isfinite(q) or sign * (goal - q) <= _REACHED * reach or still >= limit:
            return q
    return float(d.qpos[qa])


def drifts(scene: Scene) -> Iterator[list[str]]:
    """Wait, and see how far any corner of any part moves against what it is mounted on."""
    m, d = scene.model, scene.data
    watched = [j for j in scene.parts if scene.settled_by_hand(j)]
    if not watched:
        return
    scene.rest()
    mujoco.mj_forward(m, d)
    start = {j: _corners(m, d, scene.carries(j), int(m.jnt_bodyid[j])) for j in watched}
    most = dict.fromkeys(watched, 0.0)
    steps = int(_SECONDS / m.opt.timestep)
    for k in range(1, steps + 1):
        mujoco.mj_step(m, d)
        if k % max(steps // 100, 1) == 0:
            mujoco.mj_kinematics(m, d)
            for j in watched:
                corners = _corners(m, d, scene.carries(j), int(m.jnt_bodyid[j]))
                moved = np.linalg.norm(corners - start[j], axis=-1).max(initial=0.0)
                most[j] = max(most[j], float(moved) if np.isfinite(moved) else np.inf)
    diverged = any(
        d.warning[int(w)].number
        for w in (
            mujoco.mjtWarning.mjWARN_BADQACC,
            mujoco.mjtWarning.mjWARN_BADQPOS,
            mujoco.mjtWarning.mjWARN_BADQVEL,
        )
    )
    for j in watched:
        if diverged or most[j] > _DRIFT:
            value = "the simulation diverges" if diverged else f"{most[j] * 1000:.3g} mm in {_SECONDS:g} s"
            yield [  # what falls shut or rolls may be meant to
                "error" if diverged else "warning", scene.joint(j), value, "the part moves although nobody touches it",
                "look at the direction of gravity and of the axis, at shapes that overlap, and at its friction",
            ]  # fmt: skip


def _corners(m: Any, d: Any, bodies: list[int], part: int) -> Array:
    """Corners (n, 3) of the boxes around bodies' geoms (or origins), in the frame of `part`'s parent."""
    mine = np.isin(m.geom_bodyid, bodies) & (m.geom_type != int(mujoco.mjtGeom.mjGEOM_PLANE))
    signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=np.float64)
    box = m.geom_aabb[mine]
    local = box[:, None, :3] + signs * box[:, None, 3:]
    turn = d.geom_xmat[mine].reshape(-1, 3, 3)
    world = np.einsum("nij,nkj->nki", turn, local) + d.geom_xpos[mine][:, None]
    points = world.reshape(-1, 3) if mine.any() else d.xpos[bodies]
    parent = int(m.body_parentid[part])
    seen: Array = (points - d.xpos[parent]) @ d.xmat[parent].reshape(3, 3)
    return seen


def main(path: str, fmt: str, answer: str) -> None:
    """Answer one request."""
    told: dict[str, Any] = {"refused": "", "skipped": "", "overlaps": [], "stuck": [], "drifts": []}
    try:
        spec = load(Path(path), fmt)
        spec.compiler.fusestatic = False
        scene = Scene(spec.compile())
        pushing = contacts(scene)
        scene.forget_parts_of({b for pair in pushing for b in pair})
        told["stuck"] = list(stuck(scene))
        told["drifts"] = list(drifts(scene))
        told["overlaps"] = list(overlaps(spec, scene, pushing))
    except LookupError as e:
        told["skipped"] = str(e.args[0])
    except (ValueError, mujoco.FatalError) as e:
        told["refused"] = " ".join(str(e).split())
    Path(answer).write_text(json.dumps(told), encoding="utf-8")


if __name__ == "__main__":
    main(*sys.argv[1:])
    os._exit(0)  # the answer is written, and to take the imports down takes as long as to load them
