"""MuJoCo moves the parts of exported files; run as an engine of its own, see the package.

A job is {path, format, parts, scene}, where scene is the file with a floor, or path again without one; each
part has name, held {other part: state}, force (N or N m, of a steady pull), hand (N or N m, the most a hand
gives), hand_inertia (kg or kg m^2), speed (m/s or rad/s of a push), times (n,) s and states (n,) of the
demonstration, slides, whether its weight is more than friction holds when it is closed, catch, null or what
it bears, and rests, the states in which it stood still, each with the others {name: state} held. What is
measured is said at each function; what a simulation could not give, because it broke down, is null.

The files are simulated as they are, with the step and the integrator that they ask for. What is changed, in
memory: the other parts have no joints (`moved.moved`); in `_reach` nothing has weight, so that it asks for
friction and obstacles and not for the weight of a lid; in `_sweep` bodies that the file keeps apart may
touch; in `_demonstration` the hand's mass goes with the part.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from copy import copy
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from scipy.interpolate import PchipInterpolator

from .moved import BrokenDown, Moved, moved, pose_of, watch

REST_SECONDS = 10.0
REACH_SECONDS = 60.0  # a gate of 10 m whose damping stops it in a second takes 15 s
SWING_SECONDS = 5.0
SWEEP_STATES = 41
SLIDE_TIMES = tuple(round(0.05 * k, 2) for k in range(1, 21))  # s
VERSION = mujoco.__version__
# rad/s: natural frequency of the servo that leads a part, critically damped; far above a hand's motion
_STIFF = 150.0

_SLOW = 0.01  # ranges a second: slower, the servo leaves the joint's dry friction to its stiffness

_File = tuple[Any, Any]  # mujoco.MjSpec and the mujoco.MjModel compiled from it


def read(path: Path, fmt: str, job: Mapping[str, Any]) -> dict[str, Any]:
    """Move every part of the model in `path`."""
    if fmt == "usd":
        import_module("mujoco._usd")  # registers the schemas: before any other use of pxr in this process
    spec = mujoco.MjSpec.from_file(str(path))
    whole, touching = spec.compile(), _touching(Path(job["scene"]), job["filtered"])
    ways = (spec, whole), (touching, touching.compile())
    return {part["name"]: _measured(part, *ways) for part in job["parts"]}


def _measured(part: Mapping[str, Any], file: _File, touching: _File) -> dict[str, Any]:
    """All that is asked of one part. file, touching: a specification and the model compiled from it."""
    weighed = moved(*file, part["name"], part["held"])
    closed = moved(*file, part["name"], {}) if part["held"] else weighed
    free = replace(weighed, model=copy(weighed.model))
    free.model.opt.gravity[:] = 0.0
    model = weighed.model
    return {
        "rest": None if part["slides"] else _guarded(_stay, closed, 0.0),
        "rest_half_open": _guarded(_stay, weighed, (weighed.lower + weighed.upper) / 2),
        "rests": [_guarded(_stay, moved(*file, part["name"], r["held"]), r["state"]) for r in part["rests"]],
        "slide": _guarded(_slide, closed) if part["slides"] else None,
        "armature": float(model.dof_armature[weighed.dof]),
        "open": _guarded(_reach, free, free.lower, part["force"]),
        "close": _guarded(_reach, free, free.upper, -part["force"]),
        "catch": None if part["catch"] is None else _catch(free, part["catch"]),
        "sweep": _sweep(moved(*touching, part["name"], part["held"])),
        "energy": _guarded(_energy, weighed, part["speed"]),
        "demonstration": _guarded(_demonstration, weighed, part),
        "step": float(model.opt.timestep),
        "integrator": mujoco.mjtIntegrator(model.opt.integrator).name.removeprefix("mjINT_").lower(),
    }


def _touching(path: Path, filtered: Sequence[Sequence[str]]) -> Any:
    """The specification with every pair of bodies allowed to touch, also a part and what it is mounted on,
    but for the twin's filtered pairs (names of bodies, of which one may stand still)."""
    spec = mujoco.MjSpec.from_file(str(path))
    apart = {frozenset(pair) for pair in filtered}
    for pair in list(spec.excludes):
        names = (name.rpartition("/")[2] for name in (pair.bodyname1, pair.bodyname2))  # of USD a prim's path
        if frozenset(names) not in apart:
            spec.delete(pair)
    spec.option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_FILTERPARENT)
    return spec


def _guarded(run: Callable[..., Any], *arguments: Any) -> Any:
    """What `run` measures, None where its simulation broke down."""
    try:
        return run(*arguments)
    except BrokenDown:
        return None


def _steps(model: Any, data: Any, seconds: float, look: Callable[[], bool]) -> None:
    """Simulate up to `seconds`, until a look says that it is done."""
    insist = watch(data)
    while data.time < seconds:
        mujoco.mj_step(model, data)
        insist()
        if look():
            return


def _slide(part: Moved) -> list[float]:
    """States at SLIDE_TIMES of the part let go when all are closed."""
    data, course = part.data(0.0), []
    insist = watch(data)
    for until in SLIDE_TIMES:
        while data.time < until - part.model.opt.timestep / 2:
            mujoco.mj_step(part.model, data)
        insist()
        course.append(float(data.qpos[part.at]))
    return course


def _creep(part: Moved) -> tuple[float, float]:
    """Slackness and damping of dry friction: to a pull (N or N m) that it holds it yields with slackness *
    pull / damping (m/s or rad/s). MuJoCo's friction is a soft constraint, R f = -b v once nothing accelerates
    (its documentation, Computation, "Constraint model"). Its solver without slip leaves none."""
    model, (constant, ratio) = part.model, map(float, part.model.dof_solref[part.dof])
    if model.opt.noslip_iterations > 0:
        return 0.0, 1.0
    d = float(model.dof_solimp[part.dof, 0])
    damping = 2.0 / (float(model.dof_solimp[part.dof, 1]) * constant) if constant > 0 else -ratio
    return (1.0 - d) / d * float(model.dof_invweight0[part.dof]), damping


def _stay(part: Moved, state: float) -> dict[str, float]:
    """Greatest change of state in 10 s when left at `state`, and what friction would yield in that time to
    gravity's pull where the part is: a door that creeps away from its balance is pulled more and more."""
    data, most, creep = part.data(state), 0.0, 0.0
    (slack, damping), step = _creep(part), part.model.opt.timestep
    position, bias, at, dof = data.qpos, data.qfrc_bias, part.at, part.dof

    def look() -> bool:
        nonlocal most, creep
        most = max(most, abs(float(position[at]) - state))
        creep += step * (slack * abs(float(bias[dof])) / damping)
        return False

    _steps(part.model, data, REST_SECONDS, look)
    return {"drift": most, "creep": creep}


def _reach(part: Moved, start: float, force: float) -> dict[str, float]:
    """Pull from `start` with a steady generalised force: the share of the range left, and the time."""
    goal = part.upper if force > 0 else part.lower
    span = part.upper - part.lower
    data = part.data(start)
    data.qfrc_applied[part.dof] = force
    left, sign, position, at = 1.0, float(np.sign(force)), data.qpos, part.at

    def look() -> bool:
        nonlocal left
        left = min(left, max(0.0, sign * (goal - float(position[at])) / span))
        return left == 0.0

    _steps(part.model, data, REACH_SECONDS, look)
    return {"left": float(left), "seconds": float(data.time)}


def _catch(part: Moved, asked: Mapping[str, float]) -> dict[str, Any]:
    """A catch: how far the part goes in 10 s of pull `less`, width left after `more`, and when."""
    near = replace(part, upper=part.lower + asked["width"])
    return {
        "less": _guarded(_pulled, part, asked["less"]),
        "more": _guarded(_reach, near, part.lower, asked["more"]),
    }


def _pulled(part: Moved, force: float) -> float:
    """Greatest change of state in 10 s of a steady generalised force on the closed part."""
    data, most = part.data(part.lower), 0.0
    data.qfrc_applied[part.dof] = force

    def look() -> bool:
        nonlocal most
        most = max(most, abs(float(data.qpos[part.at]) - part.lower))
        return False

    _steps(part.model, data, REST_SECONDS, look)
    return most


def _sweep(part: Moved) -> float:
    """Greatest depth (m) at which the part, opened alone, or what it carries, meets anything."""
    model, data, deepest = part.model, mujoco.MjData(part.model), 0.0
    carried = _below(model, part.body)
    for state in np.linspace(part.lower, part.upper, SWEEP_STATES):
        data.qpos[part.at] = state
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_collision(model, data)
        for c in data.contact:
            a, b = (int(model.geom_bodyid[g]) for g in c.geom)
            if (a in carried) != (b in carried):
                deepest = max(deepest, -float(c.dist))
    return deepest


def _below(model: Any, body: int) -> set[int]:
    found = {body}
    for b in range(body + 1, model.nbody):  # parents come before their children
        if int(model.body_parentid[b]) in found:
            found.add(b)
    return found


def _energy(part: Moved, speed: float) -> dict[str, float]:
    """Push the half open part and let go: the greatest total energy (J) above that at the start, and the
    scale to judge it by: the push's kinetic energy and what the part's weight can give on its way."""
    model = part.model
    flags = int(model.opt.enableflags)
    model.opt.enableflags = flags | int(mujoco.mjtEnableBit.mjENBL_ENERGY)
    try:
        heights = [float(part.data(s).energy[0]) for s in np.linspace(part.lower, part.upper, 11)]
        data = part.data((part.lower + part.upper) / 2)
        data.qvel[part.dof] = speed
        mujoco.mj_forward(model, data)
        begin, most = float(data.energy.sum()), 0.0
        scale = float(data.energy[1]) + max(heights) - min(heights)

        def look() -> bool:
            nonlocal most
            mujoco.mj_forward(model, data)  # the energy of what is held must not count
            most = max(most, float(data.energy.sum()) - begin)
            return False

        _steps(model, data, SWING_SECONDS, look)
    finally:
        model.opt.enableflags = flags
    return {"gain": most, "scale": scale}


def _demonstration(part: Moved, asked: Mapping[str, Any]) -> dict[str, Any]:
    """Lead the part along its recorded states by a servo as heavy as a hand and no stronger: its motion (n,
    4, 4) from where it is with the others held and its own state 0, at the recorded times, and the greatest
    force used. It does not press against a stop: it leads to the stop where a state lies beyond."""
    times, states = np.array(asked["times"]), np.clip(asked["states"], part.lower, part.upper)
    if len(times) < 2:
        return {"motion": [], "force": 0.0}
    model, times = copy(part.model), times - times[0]
    model.dof_armature[part.dof] += asked["hand_inertia"]
    part = replace(part, model=model)
    rest = np.linalg.inv(pose_of(part.data(0.0), part.body))
    path = PchipInterpolator(times, states)
    steps = model.opt.timestep * np.arange(math.ceil(times[-1] / model.opt.timestep) + 1)
    course = np.stack([path(steps), path.derivative()(steps), path.derivative(2)(steps)], axis=1).tolist()
    data, shown, k = part.data(float(states[0])), mujoco.MjData(model), 0
    unit, column = np.zeros(model.nv), np.zeros(model.nv)
    unit[part.dof] = 1.0
    mujoco.mj_mulM(model, data, column, unit)
    inertia, damping = float(column[part.dof]), float(model.dof_damping[part.dof])
    friction, slow = float(model.dof_frictionloss[part.dof]), _SLOW * (part.upper - part.lower)
    hand, motion, most, insist = float(asked["hand"]), [], 0.0, watch(data)
    for t in times:
        while steps[k] < t:
            state, speed, push = course[k]
            off, lag = state - float(data.qpos[part.at]), speed - float(data.qvel[part.dof])
            pull = inertia * (push + _STIFF**2 * off + 2 * _STIFF * lag)
            pull += float(data.qfrc_bias[part.dof]) + damping * speed + friction * math.tanh(speed / slow)
            pull = min(max(pull, -hand), hand)
            data.qfrc_applied[part.dof] = pull
            most, k = max(most, abs(pull)), k + 1
            mujoco.mj_step(model, data)
        insist()
        shown.qpos[:] = data.qpos
        shown.qpos[part.at] -= data.qvel[part.dof] * (steps[k] - t)  # the last step went a little past t
        mujoco.mj_kinematics(model, shown)
        motion.append((pose_of(shown, part.body) @ rest).tolist())
    return {"motion": motion, "force": most}
