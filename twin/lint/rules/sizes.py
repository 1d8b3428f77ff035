"""Sizes of parts and of their ways, and colliders that are not where their body is drawn."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import permutations

import numpy as np

from twin.geometry import Array
from twin.lint.model import Body, Fault, LintModel, Severity, Shape

# m. The largest gate of a house. Chosen by us.
_LARGE = 5.0
# m. Less than the smallest button that a finger finds. Chosen by us.
_SMALL = 0.005
# Beyond these sizes times this factor is an error. Chosen by us: millimetres taken for metres are 1000.
_SURE = 10.0
# rad, 2 degrees. Chosen by us: a right angle converted twice is 1.6 degrees, a rocker switch turns by 8.
_TURN = 0.035
# m. Chosen by us: keys of a keyboard go 2 mm.
_WAY = 0.001
# Least share of the largest side that a side counts as: panels collide without handles. Chosen by us.
_THIN = 0.1
# Largest ratio of sides that are the same. Chosen by us.
_SAME = 1.25
# Smallest ratio of sides that can't be the same. Chosen by us.
_OTHER = 2.5
# A metre in millimetres, centimetres, inches; an inch in millimetres.
_UNITS = np.array([1000.0, 100.0, 39.37, 25.4])
# Share of the larger side. Two of one size that have less than this in common along an axis are beside each
# other; so are two of other sizes with a gap of as much, since a collider may be a part of its body. Chosen
# by us on 218 robots and objects of three collections.
_BESIDE = 0.05


def part(model: LintModel) -> Iterator[Fault]:
    """A body that carries other parts may be small: a helper between two joints makes two axes."""
    told: set[str] = set()
    group = model.groups()
    carry = {group.get(j.parent) for j in model.joints if j.kind != "fixed"}
    for joint, bodies, shapes in model.moving():
        points = _points(shapes)
        names = {b.name for b in bodies}
        if joint.kind not in ("revolute", "continuous", "prismatic") or names & told or not len(points):
            continue
        told |= names
        sides = np.ptp(points, axis=0)
        largest = float(sides.max())
        large, small = largest > _LARGE, largest < _SMALL and group[joint.child] not in carry
        if not large and not small:
            continue
        sure = largest > _SURE * _LARGE or largest < _SMALL / _SURE
        element = next((b.element for b in bodies if b.name == joint.child), joint.element)
        what, factor = ("large", "0.001") if large else ("small", "1000")
        yield Fault(
            "error" if sure else "warning", element, " x ".join(f"{x:.3g}" for x in sides) + " m",
            f"a part is too {what} for furniture", f"look for lengths in other units than metres: a mesh is scaled by {factor}",
        )  # fmt: skip


def way(model: LintModel) -> Iterator[Fault]:
    """Limits in degrees that are none of a few degrees; those are told by the rule limits-unit."""
    for j in model.joints:
        if j.lower is None or j.upper is None or not np.isfinite([j.lower, j.upper]).all():
            continue
        written = f"{j.lower:g} .. {j.upper:g} {j.unit}"
        range_ = j.upper - j.lower
        if j.kind == "revolute" and j.unit == "rad" and 0 < range_ < _TURN:
            yield Fault(
                "error", j.element, written, f"it turns by {np.rad2deg(range_):.2g} degrees",
                f"if {np.rad2deg(range_):.3g} rad are meant, they were converted from degrees twice: multiply by 57.2958",
            )  # fmt: skip
        elif j.kind == "prismatic" and 0 < range_ < _WAY:
            yield Fault(
                "error", j.element, written, f"it slides by {1000 * range_:.2g} mm", "write the way in metres"
            )  # fmt: skip


def collider(model: LintModel) -> Iterator[Fault]:
    """Readers differ in whether they turn a mesh whose file counts y upwards: it should fit both ways."""
    for body in model.bodies:
        mine = [s for s in model.shapes if s.body == body.name]
        faults = [_of_body(body, mine)]
        if any(s.upright is not None for s in mine):
            turned = [s if s.upright is None else replace(s, points=s.upright) for s in mine]
            faults.append(_of_body(body, turned))
        found = next((f for f in faults if f is not None), None)
        if found is None:
            continue
        if None not in faults:
            yield found
            continue
        which = "as its numbers are" if faults[0] is None else "turned from y up to z up"
        yield replace(
            found, severity="warning", problem=f"its mesh fits its collider only {which}: readers differ in turning it",
            remedy="write the mesh with z up, in a format that does not say which way is up",
        )  # fmt: skip


def _of_body(body: Body, shapes: Sequence[Shape]) -> Fault | None:
    """What differs between a body's visuals and colliders, by boxes around them along the colliders' axes."""
    seen, solid = (_points([s for s in shapes if s.role == role]) for role in ("visual", "collision"))
    if not len(seen) or not len(solid):
        return None
    boxes = [_box(points) for points in (seen, solid)]
    if _unlike(boxes[0][1], boxes[1][1]) < _SAME and not _against(*boxes):
        return None  # the smallest box takes seconds for detailed meshes
    axes = _axes(solid)
    boxes = [_box(points @ axes.T) for points in (seen, solid)]
    found = _against(*boxes)
    if found is None:
        return None
    severity, problem, remedy = found
    sizes = " against ".join(" x ".join(f"{x:.3g}" for x in 2 * half) + " m" for _, half in boxes)
    return Fault(severity, body.element, sizes, problem, remedy)


def _axes(points: Array) -> Array:
    """Rows (3, 3): axes of the smallest box around points; those of the world where the points are flat."""
    import trimesh

    try:
        return np.asarray(trimesh.bounds.oriented_bounds(points)[0][:3, :3], np.float64)
    except (ValueError, RuntimeError):  # Qhull's errors are among them
        return np.eye(3)


def _against(seen: tuple[Array, Array], solid: tuple[Array, Array]) -> tuple[Severity, str, str] | None:
    """What is wrong between boxes (centre, half sides) around what is drawn and what collides, or None."""
    factor = float(np.exp(np.log(seen[1] / solid[1]).mean()))
    unit = np.abs(np.log(np.concatenate([_UNITS, 1 / _UNITS]) / factor)).min()
    if _unlike(seen[1], factor * solid[1]) < _SAME and unit < np.log(_SAME):
        return "error", f"it is drawn {factor:.3g} times the size of its collider", "write both in metres"
    halves = [np.maximum(half, _THIN * half.max()) for _, half in (seen, solid)]
    alike = _unlike(*halves)
    turned = min(_unlike(halves[0][list(p)], halves[1]) for p in permutations(range(3)))
    if turned < _SAME and alike > _OTHER:
        return (
            "error", "it is drawn across its collider, turned by 90 degrees",
            "turn one of them: many meshes count y upwards, URDF and MJCF count z",
        )  # fmt: skip
    gap = np.abs(seen[0] - solid[0]) - halves[0] - halves[1]
    if np.any(gap > (-1 if alike < _SAME else 1) * _BESIDE * 2 * np.maximum(*halves)):
        return "warning", "it is drawn beside its collider", "correct the origin of one of them"
    return None


def _unlike(a: Array, b: Array) -> float:
    """The largest ratio between sides (3,)."""
    return float(np.exp(np.abs(np.log(a / b)).max()))


def _points(shapes: Sequence[Shape]) -> Array:
    """All points (n, 3) of shapes whose place is known."""
    known = [s.points for s in shapes if s.points is not None and np.isfinite(s.points).all()]
    return np.concatenate(known) if known else np.zeros((0, 3))


def _box(points: Array) -> tuple[Array, Array]:
    """Centre and half sides (3,) of the box around points; no side is zero."""
    low, high = points.min(axis=0), points.max(axis=0)
    return (low + high) / 2, np.maximum((high - low) / 2, 1e-9)
