"""Compares what an engine measured in a file with what the twin says."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from twin import geometry as geo
from twin.geometry import Array
from twin.scene import Revolute, Twin
from twin.verification.exceptions import unsupported
from twin.verification.expected import (
    STATES,
    Course,
    Dynamics,
    armatures,
    course,
    filled,
    motion,
    surface,
    written,
)
from twin.verification.rows import CheckRow

# Largest difference that passes: degrees; metres; metres or radians; relative; for the rollout relative to
# the way it goes or to the range, whichever is more.
TOLERANCE = {
    "loads": 0.0, "tree": 0.0, "type": 0.0, "axis_deg": 1e-3, "pivot_m": 1e-5, "lower": 1e-5, "upper": 1e-5, "damping": 1e-5,
    "frictionloss": 1e-5, "armature": 1e-5, "friction": 1e-5, "mass": 1e-5, "com_m": 1e-5, "inertia": 1e-5,
    "mesh_bounds_m": 1e-4, "motion": 1e-5, "mass_diagonal": 1e-5, "rollout": 1e-3, "self_collision_m": 1e-3,
}  # fmt: skip
FIELDS = tuple(TOLERANCE)
_SPACINGS = 8.0  # of single precision that an engine's chain of additions may lose; chosen by us
SINGLE_PRECISION = ("newton", "physx", "sapien")  # engines that compute with 24 bits: ten times the tolerance
# tolerances that don't depend on precision
_EXACT = "loads", "tree", "type", "mesh_bounds_m", "self_collision_m"
# where contact between a part and what it is mounted on is looked at: URDF can't exclude it
_SWEPT = "mujoco", "urdf"
_ASKED = {
    "tree": "parent", "axis_deg": "axis", "pivot_m": "pivot", "com_m": "com", "mesh_bounds_m": "bounds",
    "self_collision_m": "collision",
}  # fmt: skip


def tolerance(engine: str, field: str) -> float:
    """Largest difference that passes."""
    factor = 10.0 if engine in SINGLE_PRECISION and field not in _EXACT else 1.0
    return factor * TOLERANCE[field]


def allowed(engine: str, fmt: str, field: str, twin: Twin, k: int) -> float:
    """Largest difference that passes for part k: far from the origin single precision can't hold 1e-5 m.

    What is computed with 24 bits may be off by some spacings of these at the twin's distance: positions by as
    many metres, inertia about the joint by as much of its lever. USD keeps orientations in single precision.
    """
    single = engine in SINGLE_PRECISION
    off = spacing(twin) * (_SPACINGS if single else 1.0)
    base = tolerance(engine, field)
    if field == "motion" and (single or fmt == "usd"):
        return max(base, off)
    if single and field in ("pivot_m", "com_m", "mesh_bounds_m", "lower", "upper", "self_collision_m"):
        return max(base, off)
    if single and field in ("mass_diagonal", "rollout"):
        return max(base, 2 * off / max(_arm(twin, k), 1e-6))
    return base


def spacing(twin: Twin) -> float:
    """Spacing (m) of single precision at the part's vertex farthest from the origin."""
    far = [float(np.abs(surface(p.mesh)).max()) for p in twin.parts if len(p.mesh.faces)]
    return float(np.spacing(np.float32(max(far, default=0.0))))


def far_away(twin: Twin) -> tuple[str, ...]:
    """A note on a twin that lies where single precision is coarser than the check's finest tolerance."""
    step = spacing(twin)
    if step <= TOLERANCE["pivot_m"]:
        return ()
    centres = [p.mesh.area_centroid for p in twin.parts if len(p.mesh.faces)]
    away = float(np.linalg.norm(np.mean(centres, axis=0)))
    text = f"the twin lies {away:.0f} m from its origin: single precision holds {1e3 * step:.2g} mm there, which is what USD and "
    return (f"{text}{', '.join(SINGLE_PRECISION)} are judged by; move it to its origin for more",)


def _arm(twin: Twin, k: int) -> float:
    """Distance (m) of the centre of mass from the hinge; what a slide carries needs none."""
    joint, (inertial, _) = twin.parts[k].joint, filled(twin)[k]
    if not isinstance(joint, Revolute):
        return float("inf")
    return float(geo.point_line_distance(inertial.com, joint.pivot, joint.axis))


@dataclass(frozen=True, eq=False)
class Truth:
    """A twin with everything that is expected of it, computed once for all engines."""

    twin: Twin

    @cached_property
    def course(self) -> Course:
        return course(self.twin)

    @cached_property
    def motion(self) -> Array:
        return motion(self.twin, self.course.states)

    @cached_property
    def armature(self) -> Array:
        return armatures(self.twin)

    @cached_property
    def _known(self) -> dict[tuple[bytes, bytes], tuple[Array, Array]]:
        return {}

    def dynamics(self, armature: Array, damping: Array) -> tuple[Array, Array]:
        """Diagonal (parts,) of the mass matrix and rollout (t, parts)."""
        key = armature.tobytes(), damping.tobytes()
        if key not in self._known:
            d, c = Dynamics(self.twin, armature, damping), self.course
            self._known[key] = np.diag(d.mass_matrix(c.state)), d.rollout(c.position, c.velocity)
        return self._known[key]


def compare(engine: str, fmt: str, truth: Truth, got: Mapping[str, Mapping[str, Any]]) -> list[CheckRow]:
    """One row for every part and field. A field that should be there and is not gives a row that fails."""
    twin = truth.twin
    rows = []
    diagonal, rollout = _dynamics(engine, fmt, truth, got)
    for k, part in enumerate(twin.parts):
        mine = got[part.name]
        wanted = dict(_values(truth, k))
        wanted |= {"mass_diagonal": float(diagonal[k]), "rollout": rollout[:, k]}
        for field in FIELDS:
            entry = unsupported(engine, fmt, field)
            measured = mine.get(_ASKED.get(field, field))
            if field not in wanted or (measured is None and entry):
                continue
            if field == "self_collision_m" and (engine, fmt) != _SWEPT:
                continue
            want = wanted[field]
            off = np.inf if measured is None else _difference(field, want, measured, twin, k)
            rows.append(
                CheckRow(
                    fmt, engine, field, part.name, _text(want), "nothing" if measured is None else _text(measured),
                    float(off) if np.isfinite(off) else float("inf"), allowed(engine, fmt, field, twin, k),
                    known=entry.reason if entry else "",
                    told=entry is None or entry.instead is None or _differs(want, entry.instead),
                )
            )  # fmt: skip
    return rows


def loads(engine: str, fmt: str, error: str | None) -> CheckRow:
    """Whether the engine makes a model of the file at all: a refused file disagrees in everything."""
    measured, off = ("refused", float("inf")) if error else ("a model", 0.0)
    return CheckRow(fmt, engine, "loads", "", "a model", measured, off, tolerance(engine, "loads"))


def _differs(want: Any, instead: float) -> bool:
    return abs(float(want) - instead) > 1e-3 * max(abs(instead), 1e-9)


def _dynamics(
    engine: str, fmt: str, truth: Truth, got: Mapping[str, Mapping[str, Any]]
) -> tuple[Array, Array]:
    """If the table says that a number is lost, the twin is moved with the one that the engine reports."""
    parts = truth.twin.parts
    numbers = [physics for _, physics in filled(truth.twin)]
    armature, damping = (
        np.array([float(own[k]) if not unsupported(engine, fmt, field) else float(got[p.name].get(field) or 0.0)
                  for k, p in enumerate(parts)])
        for field, own in (
            ("armature", truth.armature), ("damping", [n.damping.value for n in numbers]),
        )
    )  # fmt: skip
    return truth.dynamics(armature, damping)


def _values(truth: Truth, k: int) -> Iterator[tuple[str, Any]]:
    """What the twin says of part k."""
    twin = truth.twin
    part = twin.parts[k]
    joint, (inertial, physics) = part.joint, filled(twin)[k]
    yield "tree", twin.static.name if part.parent is None else twin.part(part.parent).name
    yield "type", joint.kind
    yield "axis_deg", joint.axis
    if isinstance(joint, Revolute):
        yield "pivot_m", joint.pivot
    yield from (("lower", joint.lower), ("upper", joint.upper))
    for name in ("damping", "frictionloss", "friction"):
        if name != "friction" or part.collision or part.completion is not None:
            yield name, getattr(physics, name).value
    yield "armature", float(truth.armature[k])
    yield from (("mass", inertial.mass.value), ("com_m", inertial.com), ("inertia", inertial.inertia))
    if len(part.mesh.faces):
        v = written(part)
        yield "mesh_bounds_m", np.stack([v.min(axis=0), v.max(axis=0)])
    yield "motion", truth.motion[k]
    yield "self_collision_m", 0.0


def _difference(field: str, want: Any, measured: Any, twin: Twin, k: int) -> float:
    """In the unit of the field's tolerance."""
    if field in ("tree", "type"):
        same = measured == want or (
            field == "tree" and twin.parts[k].parent is None and measured in ("", "world")
        )
        return 0.0 if same else float("inf")
    got = np.asarray(measured, dtype=np.float64)
    if field == "axis_deg":
        return float(np.rad2deg(geo.angle_between(want, got)))
    if field == "pivot_m":
        return geo.point_line_distance(got, want, twin.parts[k].joint.axis)
    if field == "com_m":
        return float(np.linalg.norm(got - want))
    if field == "inertia":
        return float(np.linalg.norm(got - want) / np.linalg.norm(want))
    if field == "rollout":
        joint = twin.parts[k].joint
        way = max(joint.upper - joint.lower, float(np.ptp(want)))
        return float(np.abs(got - want).max() / way) if got.shape == np.shape(want) else float("inf")
    if field in ("mass", "mass_diagonal", "damping", "frictionloss", "armature", "friction"):
        return float(np.abs(got - want).max() / max(abs(want), 1e-9))
    return float(np.abs(got - want).max()) if got.shape == np.shape(want) else float("inf")


def _text(value: Any) -> str:
    """For a reader: numbers, the diagonal of a tensor, the end of a course, the count of poses."""
    if isinstance(value, str):
        return value
    a = np.asarray(value, dtype=np.float64)
    if a.ndim == 3:
        return f"{len(a)} of {STATES} states"
    a = np.diag(a) if a.shape == (3, 3) else np.unique(a) if a.shape == (2,) else a.ravel()
    return ("... " if len(a) > 6 else "") + " ".join(f"{v:.6g}" for v in (a if len(a) <= 6 else a[-3:]))
