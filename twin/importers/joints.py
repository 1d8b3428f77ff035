"""Joints of a file as joints of a twin."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from twin import geometry as geo
from twin.errors import InputError
from twin.geometry import Array
from twin.importers.closed_end import Travel
from twin.importers.source import Source, SourceJoint
from twin.scene import Joint, Mesh, Prismatic, Revolute


def has_range(low: float | None, high: float | None) -> bool:
    """Whether limits leave a way to go."""
    return low is not None and high is not None and bool(np.isfinite([low, high]).all()) and low < high


def range_of(
    source: Source, joint: SourceJoint, limits: Mapping[str, tuple[float, float]]
) -> tuple[float, float]:
    low, high = limits.get(joint.name, (joint.lower, joint.upper))
    if low is None or high is None or not has_range(low, high):
        said = (
            "no limits" if low is None or high is None else f"the range {low:g} to {high:g}, which is no way"
        )
        raise InputError(
            f"{source.path}: joint {joint.name!r} has {said}",
            f"give them in m or rad: limits={{{joint.name!r}: (0.0, 1.5)}}, or --limit {joint.name}=0,1.5",
        )
    return float(low), float(high)


def joint_of(joint: SourceJoint, T: Array, travel: Travel, mesh: Mesh) -> Joint:
    """A twin's joint, moved by T from the file's rest pose; its point is nearest to the mesh's middle."""
    axis = geo.unit(geo.rotate(T, joint.axis) * travel.opens)
    low, high = sorted(travel.opens * (end - travel.closed) + 0.0 for end in (travel.lower, travel.upper))
    if joint.kind == "prismatic":
        return Prismatic(axis, low, high)
    pivot = geo.transform(T, joint.pivot[None])[0]
    return Revolute(axis, low, high, pivot=geo.nearest_point_on_line(mesh.area_centroid, pivot, axis))
