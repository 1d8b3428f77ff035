"""Proof that exported parts behave: MuJoCo moves them, from every format, as the recording moved them.

What is asked of every part, one part at a time while the others stay where the recording had them:

- rest: closed, it stays within 1 mm for 10 s. `rest_half_open`: so it does half open, where its joint
  neither lifts nor lowers it (a hinge within 2 degrees of upright, a slide within 2 degrees of level).
- rest_at_...: so it does at every state in which it rested in the recording, no hand in view, the others
  where they were then.
- open, close: a steady 10 N or 2 N m, of a heavy part a tenth of its weight on its lever, of one that
  rested against its weight half more than what holds it there, takes it from one limit to the other within
  a minute, up to 1 % of its range. Weights are left out, so that friction and obstacles are asked for and
  not the weight of a lid.
- sweep: over its range it meets nothing deeper than 1 mm: neither what it is mounted on, which the files
  let it pass, nor the floor of MJCF's scene.xml. What the twin's filtered pairs let it pass is left aside.
- energy: pushed half open and let go, it never has more energy than at the start, up to 1 % of what is at
  play.
- catch_holds, catch_lets_go: where the twin states a catch, a pull of 0.95 of it leaves the closed part
  within 1 mm for 10 s, and 1.05 of it and the friction take it past the catch's width. Only MJCF simulates
  catches; other formats are tried without.
- demonstration: a servo no stronger than a hand takes it along the recorded states, and it passes the
  recorded poses within the error that the reconstruction states of itself.

The files are simulated with the time step and the integrator they ask for, which is what whoever loads them
gets: MJCF those of twin/physics/simulation.py; URDF and USD ask for none, so it is MuJoCo's default, 2 ms
and semi-implicit Euler.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from twin import geometry as geo
from twin.errors import InputError
from twin.geometry import Array
from twin.names import scene_file
from twin.physics.joints import weight_on_lever
from twin.robust import mad_sigma
from twin.scene import Part, Revolute, Twin
from twin.verification.behaviour_rows import BehaviourReport as BehaviourReport
from twin.verification.behaviour_rows import BehaviourRow as BehaviourRow
from twin.verification.caught import (
    CATCHING,
    LETS_GO,
    catch_asked,
    catch_rows,
    caught_energy,
    without_catches,
)
from twin.verification.expected import filled, surface
from twin.verification.process import BEHAVIOUR, ask
from twin.verification.rest import hold, inertia, slide
from twin.verification.rested import Rested, left, rested, rested_rows, uncaught

PULL = {"revolute": 2.0, "prismatic": 10.0}  # N m, N: no furniture in a home should ask for more
# of weight x lever (twin/physics/joints.py); chosen by us: three usual hinges' friction, twice a runner's
HEAVY = 0.1
# of the friction that stands for a catch or a balance; chosen by us: both hold a part, and let a hand move it
BALANCED = 1.5
BRISK = 0.1  # s; chosen by us: no hand opens anything faster
# rad/s, m/s: chosen by us, a door or drawer let go in a brisk motion
PUSH = {"revolute": 1.0, "prismatic": 0.3}
# N; chosen by us: a brisk pull of one hand, twice a kitchen cabinet's catch (benchmarks/door_forces.md)
HAND = 50.0
HAND_MASS = 1.0  # kg; chosen by us: what of an arm moves with its hand
DEPTH = 1e-3  # m
SHORT = 0.01  # share of the range
GAIN = 0.01  # share of the energy at play
FLOOR = 1e-3  # m: no reconstruction is asked to be better than this
_LEVEL = math.radians(2.0)  # chosen by us: more than a carpenter's error and a reconstructed axis'
_SIGMAS = 3.0
SLIDE_TIMES = tuple(round(0.05 * k, 2) for k in range(1, 21))  # s, as in twin.probes.behaviour
SLIDE_ERROR = 0.03  # of the way; chosen by us: a step of 2 ms and friction that is soft cost 1 % of it


def behave(twin: Twin, files: Mapping[str, Path]) -> BehaviourReport:
    """Move the parts of exported files in MuJoCo and judge how they behave.

    Args:
        twin: what was exported.
        files: format (urdf, mjcf, usd) -> file.

    Returns:
        for every format and part the rows that the module describes.

    Raises:
        InputError: no file was named, or one is missing.
    """
    if not files:
        raise InputError("no exported file was named", "run twin export first")
    for path in files.values():
        if not Path(path).is_file():
            raise InputError(f"{path} does not exist", "run twin export again")
    shown = {f: twin if f in CATCHING else without_catches(twin) for f in files}
    left_at = {
        f: {
            p.name: uncaught(t, p, rested(t, t.part(p.id))) if t is not twin else rested(t, p)
            for p in twin.parts
        }
        for f, t in shown.items()
    }
    jobs = [
        _job(
            f, Path(p).resolve(), shown[f], [_asked(shown[f], q, left_at[f][q.name]) for q in shown[f].parts]
        )
        for f, p in files.items()
    ]
    answers = ask(BEHAVIOUR, jobs)
    rows: list[BehaviourRow] = []
    warnings: list[str] = []
    for fmt, answer in zip(files, answers, strict=True):
        if answer["error"]:
            warnings.append(f"{fmt}: can't be simulated: {' '.join(answer['error'].split())}")
            continue
        for part in shown[fmt].parts:
            rows += _judge(fmt, shown[fmt], part, left_at[fmt][part.name], answer["parts"][part.name])
    return BehaviourReport(tuple(rows), tuple(warnings))


def _job(fmt: str, path: Path, twin: Twin, asked: list[dict[str, Any]]) -> dict[str, Any]:
    """What the probe is asked of a file; MJCF's scene has a floor as well, which an opening part may meet."""
    scene = path.with_name(scene_file(path.stem))
    with_floor = scene if fmt == "mjcf" and scene.is_file() else path
    apart = [list(pair) for pair in twin.filtered_pairs]
    return {"path": str(path), "format": fmt, "parts": asked, "scene": str(with_floor), "filtered": apart}


def _asked(twin: Twin, part: Part, where: Rested) -> dict[str, Any]:
    """What the probe has to know of a part."""
    kind, motion, lever = part.joint.kind, part.motion, _hand_lever(part)
    return {
        "name": part.name,
        "held": {p.name: s for p in twin.parts if p is not part and (s := _state_beside(part, p))},
        "force": _pull(twin, part),
        "hand": HAND * lever,
        "hand_inertia": HAND_MASS * lever**2,
        "speed": PUSH[kind],
        "slides": hold(twin, part, 0.0).moves,
        "catch": catch_asked(filled(twin)[twin.parts.index(part)][1]),
        "rests": where.asked,
        "times": motion.times.tolist(),
        "states": motion.state.tolist(),
    }


def _pull(twin: Twin, part: Part) -> float:
    """What a hand is asked for at most (N or N m), by the kind of joint and the part's weight; and no more
    than twice the friction with what takes the part over its range in 0.1 s: more flings a part of a gram
    away faster than a step can follow."""
    heavy = 0.0 if part.inertial is None else HEAVY * weight_on_lever(part.joint, part.inertial)
    span, physics = part.joint.upper - part.joint.lower, filled(twin)[twin.parts.index(part)][1]
    brisk = 2 * inertia(twin, part) * span / BRISK**2 + physics.damping.value * span / BRISK
    balance = BALANCED * physics.frictionloss.value if physics.frictionloss.origin == "recording" else 0.0
    usual = min(max(PULL[part.joint.kind], heavy, balance), 2 * physics.frictionloss.value + brisk)
    return usual + LETS_GO * physics.caught(0.0)


def _state_beside(part: Part, other: Part) -> float:
    """Where `other` was when `part` first moved: a drawer behind a door comes out once that is open."""
    if not (part.motion.intervals and len(other.motion.frames)):
        return 0.0
    state = float(np.interp(part.motion.intervals[0][0], other.motion.frames, other.motion.state))
    return float(np.clip(state, other.joint.lower, other.joint.upper))


def _lever(part: Part) -> float:
    """Distance (m) of the part's farthest point to its hinge; 1 for a slide, whose points all move alike."""
    if not isinstance(part.joint, Revolute):
        return 1.0
    return float(
        np.linalg.norm(np.cross(surface(part.mesh) - part.joint.pivot, part.joint.axis), axis=1).max()
    )


def _hand_lever(part: Part) -> float:
    """Distance (m) of the hand from the hinge: of the contact, else of the farthest point; 1 for a slide."""
    if not isinstance(part.joint, Revolute) or part.contact is None:
        return _lever(part)
    return float(geo.point_line_distance(part.contact.point, part.joint.pivot, part.joint.axis))


def _judge(fmt: str, twin: Twin, part: Part, where: Rested, got: Mapping[str, Any]) -> list[BehaviourRow]:
    """The rows of one part in one format."""
    rows: list[BehaviourRow] = []
    lever = _lever(part)

    def add(quantity: str, measured: float | None, limit: float, *explanation: str) -> None:
        broken = measured is None or not math.isfinite(measured)
        value = math.inf if measured is None or broken else float(measured)
        text = "the simulation broke down" if broken else "; ".join(explanation)
        rows.append(BehaviourRow(fmt, part.name, quantity, value, float(limit), text))

    how = f"time step {1e3 * got['step']:g} ms, {got['integrator']}"
    closed = hold(twin, part, 0.0)
    if closed.moves:
        off, limit = _slid(twin, part, got)
        told = (
            f"{closed.text}: it does not stay closed by itself; from the closed form of its way in 1 s; {how}"
        )
        add("slides_m", None if off is None else off * lever, limit * lever + FLOOR, told)
    else:
        add(*left("rest_m", f"closed{where.closed}", got["rest"], closed, lever), how)
    if _is_level(part):
        middle = (part.joint.lower + part.joint.upper) / 2
        held = {p.id: _state_beside(part, p) for p in twin.parts if p is not part}
        half = hold(twin, part, middle, held)
        if not half.moves:
            add(*left("rest_half_open_m", "half open", got["rest_half_open"], half, lever), how)
    for row in rested_rows(twin, part, where, got["rests"], lever):
        add(*row, how)
    moved = f"{inertia(twin, part):.2g} {'kg m²' if closed.unit == 'N m' else 'kg'} to move"
    against = f"against friction of {closed.friction:.2g} {closed.unit}, {moved}"
    for quantity, word in (("open", "opened"), ("close", "closed")):
        end = got[quantity]
        told = (
            "" if end is None else f"{word} by {_pull(twin, part):.3g} {closed.unit}, {end['seconds']:.1f} s"
        )
        add(quantity, None if end is None else end["left"], SHORT, told, against)
    aside = ("filtered pairs aside",) if twin.filtered_pairs else ()
    add("sweep_m", got["sweep"], DEPTH, "deepest contact over the range", *aside)
    for row in catch_rows(filled(twin)[twin.parts.index(part)][1], got["catch"], lever, closed.unit):
        add(*row, how)
    energy = got["energy"]
    told = "" if energy is None else f"gain after a push; {energy['scale']:.2g} J at play"
    gain = (
        0.0
        if energy is None
        else max(0.0, energy["gain"] - caught_energy(filled(twin)[twin.parts.index(part)][1]))
    )
    add("energy", None if energy is None else gain / energy["scale"], GAIN, told)
    shown = got["demonstration"]
    if shown is None or shown["motion"]:
        off = None if shown is None else float(_deviations(twin, part, np.array(shown["motion"])).max())
        told = "largest distance from the recorded poses"
        if shown is not None:
            told += f"; at most {shown['force']:.2g} {closed.unit}"
            weak = shown["force"] > 0.999 * HAND * _hand_lever(part)
            told += f", all that a hand gives, with {moved}" if weak else ""
        add("demonstration_m", off, _reconstruction_error(part, lever), told)
    return rows


def _slid(twin: Twin, part: Part, got: Mapping[str, Any]) -> tuple[float | None, float]:
    """Largest distance (m or rad) of the course of a part that slides from the closed form, up to its stop,
    and what passes: a share of the way (all of it on the edge of sliding), and what it goes in a time step,
    by which an integrator of first order may be late."""
    want, speed = slide(twin, part, 0.0, SLIDE_TIMES, got["armature"])
    span = part.joint.upper - part.joint.lower
    pull = hold(twin, part, 0.0).pull
    stop = part.joint.upper if pull > 0 else -part.joint.lower
    free = np.logical_and.accumulate(np.sign(pull) * want < stop - 0.05 * span)
    late = 1.05 if hold(twin, part, 0.0).on_edge else SLIDE_ERROR
    limit = late * float(np.abs(want).max()) + got["step"] * float(np.abs(speed[free]).max(initial=0.0))
    if got["slide"] is None:
        return None, limit
    return float(np.abs(np.array(got["slide"]) - want)[free].max(initial=0.0)), limit


def _is_level(part: Part) -> bool:
    """Whether the joint neither lifts nor lowers the part."""
    tilt = geo.angle_between(np.array(part.joint.axis), np.array([0.0, 0.0, 1.0]))
    off = min(tilt, math.pi - tilt) if part.joint.kind == "revolute" else abs(tilt - math.pi / 2)
    return bool(off <= _LEVEL)


def _deviations(twin: Twin, part: Part, motion: Array) -> Array:
    """Largest distance (n,) m of any corner of the part's bounding box from where the recording has it, at
    most at the ends of its range: these are quantiles of the states, and beyond them is noise.

    motion (n, 4, 4): from where the part is at its own state 0 with the others held."""
    held = {p.id: _state_beside(part, p) for p in twin.parts if p is not part}
    start = twin.part_pose(part.id, held)
    states = np.clip(part.motion.state, part.joint.lower, part.joint.upper)
    want = np.stack([twin.part_pose(part.id, held | {part.id: float(s)}) for s in states])
    points = surface(part.mesh)
    low, high = points.min(axis=0), points.max(axis=0)
    corners = np.array([[x, y, z, 1.0] for x, y, z in product(*zip(low, high, strict=True))]).T
    difference = (motion @ start - want) @ corners
    return np.asarray(np.linalg.norm(difference[:, :3], axis=1).max(axis=1))


def _reconstruction_error(part: Part, lever: float) -> float:
    """Three sigmas (m) of the part's farthest point by residual and frame noise; slow errors are followed."""
    jitter = mad_sigma(np.diff(part.motion.state, 2)) / math.sqrt(6.0)
    return max(FLOOR, _SIGMAS * math.hypot(jitter * lever, part.motion.residual))
