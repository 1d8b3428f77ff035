"""Edits of a part's joint: axis, pivot, limits, and which end is the closed one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from twin import geometry as geo
from twin.completion import without_shapes
from twin.completion.asset import is_reconstructed
from twin.edits.unfit import Unfit
from twin.edits.values import degrees_between
from twin.geometry import Array
from twin.limits import with_limits
from twin.placed import counted_from, replaced
from twin.scene import Part, Revolute, Twin

# An axis that a new reconstruction found elsewhere: degrees from what the edit was made of, and m of its
# pivot. Chosen by us: beyond it is another joint.
_OTHER_AXIS, _OTHER_PIVOT = 15.0, 0.1
USER = "user"


def with_axis(twin: Twin, part: Part, to: Array, was: Array) -> Twin:
    """The part turning about, or sliding along, another direction; a hinge's line keeps the point that is
    nearest to the part."""
    now = part.joint.axis
    if min(degrees_between(now, was), degrees_between(now, to)) > _OTHER_AXIS:
        raise Unfit(f"its axis is {degrees_between(now, was):.0f} degrees from the one that was edited")
    joint = part.joint.with_pivot(part.mesh.area_centroid) if len(part.mesh.faces) else part.joint
    to = to if to @ now >= 0 else -to
    new = replace(joint, axis=geo.unit(to), covariance=None, sigma=None)
    return bare(replaced(twin, replace(part, joint=new)))


def with_pivot(twin: Twin, part: Part, to: Array, was: Array) -> Twin:
    """The hinge through another point."""
    joint = part.joint
    if not isinstance(joint, Revolute):
        raise Unfit("it slides, and a slide has no pivot")
    now = [geo.nearest_point_on_line(p, joint.pivot, joint.axis) for p in (was, to)]
    off = min(float(np.linalg.norm(n - p)) for n, p in zip(now, (was, to), strict=True))
    if off > _OTHER_PIVOT:
        raise Unfit(f"its axis runs {100 * off:.0f} cm beside the one that was edited")
    new = replace(joint, pivot=to, covariance=None, sigma=None)
    return bare(replaced(twin, replace(part, joint=new)))


def with_limit(twin: Twin, part: Part, what: str, to: float) -> Twin:
    """Another lower or upper limit."""
    changed = with_limits(twin, part.id, **{what: to})
    return replaced(changed, replace(changed.part(part.id), limits_source=USER))


def with_closed(twin: Twin, part: Part, at: float) -> Twin:
    """The part counted from another state, where it is closed; opening is positive again."""
    joint = part.joint
    if not joint.lower - 1e-9 <= at <= joint.upper + 1e-9:
        raise Unfit(f"it is never at {at:.4g}: its range is {joint.lower:.4g} to {joint.upper:.4g}")
    counted = counted_from(twin, {part.id: at})
    new = counted.part(part.id)
    if -new.joint.lower > new.joint.upper:  # it opens the other way now
        motion = replace(new.motion, state=-new.motion.state)
        new = replace(new, joint=new.joint.reversed(), motion=motion)
    return bare(replaced(counted, replace(new, closed_source=USER)))


def bare(twin: Twin) -> Twin:
    """Without the shapes and the inferred layer that the program made of the geometry that changed; the next
    export makes them anew. Stated ones stay."""
    return without_shapes(twin) if is_reconstructed(twin) else twin
