"""Limits, axes and places of joints."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from twin.geometry import Array
from twin.lint.model import WORLD, Fault, LintModel

_TURN = 2 * np.pi
# Degrees. Half a turn in radians: doors turn by less. A switch may turn by 4 to 6 degrees. Chosen by us.
_HALF = 3.2
# How far the axis of a hinge may pass beside the part: concealed furniture hinges turn about a line 2 to 3 cm
# off the door, small mechanisms about one a few per cent of their size away. Chosen by us.
_BESIDE = 0.10  # share of the part's diagonal
_BESIDE_M = 0.05  # m, at most
_FRAMES = (1e-3, np.deg2rad(0.5))  # m, rad: what rounding of a float32 pose in a room can't explain


def order(model: LintModel) -> Iterator[Fault]:
    for j in model.joints:
        if j.lower is not None and j.upper is not None and j.lower > j.upper:
            yield Fault(
                "error",
                j.element,
                f"{j.lower:g} > {j.upper:g} {j.unit}",
                "its lower limit is above the upper one",
                "swap them",
            )


def empty(model: LintModel) -> Iterator[Fault]:
    for j in model.joints:
        if any(x is not None and np.isnan(x) for x in (j.lower, j.upper)):
            yield Fault(
                "error", j.element, f"{j.lower} .. {j.upper}", "a limit is not a number", "write both limits"
            )
        elif j.lower is not None and j.lower == j.upper:
            yield Fault(
                "error", j.element, f"{j.lower:g} .. {j.upper:g} {j.unit}", "its limits leave no room",
                "write the range, or make the joint fixed (or continuous)",
            )  # fmt: skip


def missing(model: LintModel) -> Iterator[Fault]:
    for j in model.joints:
        if j.missing:
            # lower and upper fall back to 0 by the format's rules; effort and velocity are demanded
            yield Fault(
                "error", j.element, "no " + ", ".join(j.missing), "its <limit> is not complete",
                'write <limit lower="..." upper="..." effort="..." velocity="..."/>',
            )  # fmt: skip


def unit(model: LintModel) -> Iterator[Fault]:
    """Degrees in place of radians: no hinge turns by more than two rounds to one side. Radians in place of
    degrees: no part that is made to be opened opens by less than 6.3 degrees. A multiple of 15 degrees,
    written in radians, tells the same."""
    for j in model.joints:
        limits = np.array([x for x in (j.lower, j.upper) if x is not None and np.isfinite(x)])
        if j.kind != "revolute" or not len(limits):
            continue
        largest = float(np.abs(limits).max())
        written = f"{' .. '.join(f'{x:g}' for x in limits)} {j.unit}"
        if j.unit == "deg" and 0 < np.ptp(limits) <= _TURN and largest <= _TURN:
            yield Fault(
                "error" if np.ptp(limits) < _HALF else "warning", j.element, written,
                f"limits of a few degrees look like radians ({' .. '.join(f'{x:.4g}' for x in np.rad2deg(limits))} degrees)",
                "multiply by 57.2958; if the joint does turn by so little, ignore the rule limits-unit",
            )  # fmt: skip
        if j.unit == "rad" and largest > 2 * _TURN:
            yield Fault(
                "error", j.element, written, "limits of more than two full turns look like degrees",
                "multiply by 0.0174533; if the joint does turn so far, ignore the rule limits-unit",
            )  # fmt: skip


def axis(model: LintModel) -> Iterator[Fault]:
    for j in model.joints:
        if j.axis is None or j.kind not in ("revolute", "continuous", "prismatic"):
            continue
        text = " ".join(f"{x:g}" for x in j.axis)
        n = float(np.linalg.norm(j.axis))
        if not np.isfinite(n) or n < 1e-9:
            yield Fault("error", j.element, text, "its axis has no direction", "write a vector of length one")
        elif model.format != "mjcf" and abs(n - 1) > 1e-3:  # MJCF promises to scale it to one
            what = "its axis" if model.format == "urdf" else "a rotation of its frames"
            yield Fault(
                "warning",
                j.element,
                f"{text} (length {n:.4g})",
                f"{what} is not of length one",
                "divide it by its length",
            )


def frames(model: LintModel) -> Iterator[Fault]:
    for j in model.joints:
        if j.gap[0] > _FRAMES[0] or j.gap[1] > _FRAMES[1]:
            yield Fault(
                "error", j.element, f"{j.gap[0] * 1000:.3g} mm, {np.rad2deg(j.gap[1]):.3g} degrees",
                "its two bodies disagree about its frame at rest", "write localPos0/1 and localRot0/1 of the same line in space",
            )  # fmt: skip


def pivot(model: LintModel) -> Iterator[Fault]:
    for j, _, shapes in model.moving():
        points = [
            s.points for s in shapes if s.points is not None and len(s.points) and np.isfinite(s.points).all()
        ]
        if (
            j.kind not in ("revolute", "continuous")
            or not points
            or j.axis_world is None
            or j.pivot_world is None
        ):
            continue
        size = float(np.linalg.norm(np.ptp(np.concatenate(points), axis=0)))
        off = _beside(np.concatenate(points), j.axis_world, j.pivot_world)
        if off > min(_BESIDE * size, _BESIDE_M):
            yield Fault(  # an arm may stand for links that are left out, but not farther off than it is large
                "error" if off > size else "warning", j.element, f"{off * 1000:.3g} mm beside a part of {size * 1000:.3g} mm",
                "its axis does not touch the part it turns", "move the pivot onto the hinge line",
            )  # fmt: skip


def _beside(points: Array, axis: Array, pivot: Array) -> float:
    """Distance (m) of the joint's line from the box of the points in a frame along the line: 0 inside."""
    n = np.linalg.norm(axis)
    if not np.isfinite(n) or n < 1e-9:
        return 0.0
    a = axis / n
    flat = points - pivot
    flat = flat - (flat @ a)[:, None] * a
    # distance of the origin from the convex outline: over directions, the largest gap of the support function
    u = np.linalg.svd(np.eye(3) - np.outer(a, a))[0][:, :2]
    plane = flat @ u
    angles = np.linspace(0, 2 * np.pi, 90, endpoint=False)  # 0.06 % short at worst
    support = (plane @ np.stack([np.cos(angles), np.sin(angles)])).min(axis=0)
    return float(max(support.max(), 0.0))


def target(model: LintModel) -> Iterator[Fault]:
    known = {b.name for b in model.bodies} | ({WORLD} if model.format != "urdf" else set())
    for j in model.joints:
        if j.implied:
            continue
        for end in (j.parent, j.child):
            if end not in known:
                yield Fault(
                    "error",
                    j.element,
                    end or "none written",
                    "it names a body that is not there",
                    "name an existing body",
                )
        if j.parent == j.child and j.child in known:
            yield Fault(
                "error",
                j.element,
                j.child,
                "it joins a body with itself",
                "name the two bodies that it joins",
            )
