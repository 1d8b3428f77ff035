"""Joints of a file as joints of a twin: state 0 is the closed end, opening is positive."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from twin import geometry as geo
from twin.errors import InputError
from twin.geometry import Array
from twin.importers.source import Closed, Source, SourceJoint
from twin.scene import Joint, Mesh, Prismatic, Revolute

_AT_END = 0.01  # of the range: a rest pose nearer than this to an end is that end (chosen by us)


def range_of(
    source: Source, joint: SourceJoint, limits: Mapping[str, tuple[float, float]]
) -> tuple[float, float]:
    low, high = limits.get(joint.name, (joint.lower, joint.upper))
    if low is None or high is None or not np.isfinite([low, high]).all() or not low < high:
        said = (
            "no limits" if low is None or high is None else f"the range {low:g} to {high:g}, which is no way"
        )
        raise InputError(
            f"{source.path}: joint {joint.name!r} has {said}",
            f"give them in m or rad: limits={{{joint.name!r}: (0.0, 1.5)}}, or --limit {joint.name}=0,1.5",
        )
    return float(low), float(high)


def closed_at(
    source: Source, joint: SourceJoint, low: float, high: float, closed: Mapping[str, Closed]
) -> tuple[float, float, str]:
    """Where the joint is closed, in the file's coordinate, the sign in which it opens, and who says so."""
    if joint.name in closed:
        asked = closed[joint.name]
        start = {"lower": low, "upper": high}.get(asked, np.nan) if isinstance(asked, str) else float(asked)
        if not low <= start <= high:
            raise InputError(
                f"joint {joint.name!r} can't be closed at {asked!r}",
                f"give lower, upper or a number from {low:g} to {high:g}",
            )
        return start, -1.0 if start == high else 1.0, "given by the user"
    near = _AT_END * (high - low)
    for end, direction in ((low, 1.0), (high, -1.0)):
        if abs(joint.rest - end) <= near:
            return end, direction, f"the rest pose of {source.path.name}"
    return low, 1.0, f"the lower end of the range in {source.path.name}, whose rest pose is neither end"


def at_rest(joint: SourceJoint) -> Joint:
    """The joint as the file's world has it at rest, moving from there."""
    return Prismatic(joint.axis) if joint.kind == "prismatic" else Revolute(joint.axis, pivot=joint.pivot)


def joint_of(joint: SourceJoint, T: Array, direction: float, ends: Sequence[float], mesh: Mesh) -> Joint:
    """The joint of a twin, moved by T from the file's rest pose; its point is the one nearest the mesh's centroid."""
    axis, low, high = geo.unit(geo.rotate(T, joint.axis) * direction), ends[0] + 0.0, ends[1] + 0.0
    if joint.kind == "prismatic":
        return Prismatic(axis, low, high)
    pivot = geo.transform(T, joint.pivot[None])[0]
    return Revolute(axis, low, high, pivot=geo.nearest_point_on_line(mesh.area_centroid, pivot, axis))
