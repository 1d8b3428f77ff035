"""Whether a fit found a known part again, or another one that moves as a part does.

FunREC, supplement 3.2: any number of parts, no mask of the hand.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from recon.interaction.joints.result import MotionFit
from recon.interaction.motion.movers import Movers
from recon.interaction.parts.config import (
    MAX_AXIS_SIGMA,
    MAX_LOOSENESS,
    MAX_MOVING_SHARE,
    MAX_RESIDUAL,
    MIN_SHARE,
    MIN_TRACKS,
    MIN_TRAVEL,
    REST_TOLERANCE,
    SAME_AXIS,
    SAME_PIVOT,
)
from recon.interaction.parts.moving_part import MovingPart
from recon.interaction.parts.static_spans import REST_MARGIN, moving_spans
from twin import geometry as geo
from twin.scene import Revolute


def same_part(
    fit: MotionFit,
    members: NDArray[np.bool_],
    movers: Movers,
    found: Sequence[MovingPart],
) -> int | None:
    """Index of the found part that the new tracks belong to, if there is one: its joint and states carry most
    of them, or the new fit found its joint again at the same time (from the tracks on its other face)."""
    for number, other in enumerate(found):
        T_part_world = geo.invert_pose(other.joint.poses(other.motion.state))
        frames = other.motion.frames
        rigid = 0
        for k in np.flatnonzero(members):
            seen = movers.visible[frames, k]
            back = geo.transform(T_part_world[seen], movers.points_world[frames[seen], k][:, None])[:, 0]
            spread = np.linalg.norm(back - np.median(back, axis=0), axis=1)
            rigid += bool(np.median(spread) < 2.0 * REST_TOLERANCE)
        if rigid > 0.5 * int(members.sum()) or _same_joint(fit, other):
            return number
    return None


def _same_joint(fit: MotionFit, other: MovingPart) -> bool:
    """Whether a fit has the joint of a found part and moves together with it, or right before or after it."""
    joint, known = fit.joint, other.joint
    if joint.kind != known.kind or geo.line_angle(joint.axis, known.axis) > SAME_AXIS:
        return False
    if isinstance(joint, Revolute) and isinstance(known, Revolute):
        centre = np.nanmedian(fit.landmarks, axis=0)
        feet = [geo.nearest_point_on_line(centre, j.pivot, j.axis) for j in (joint, known)]
        if np.linalg.norm(feet[0] - feet[1]) > SAME_PIVOT:
            return False
    gap = 2 * REST_MARGIN
    spans = moving_spans(fit)
    return any(
        i.first <= last + gap and first <= i.last + gap
        for i in spans
        for first, last in other.motion.intervals
    )


def is_another_part(
    fit: MotionFit,
    members: NDArray[np.bool_],
    movers: Movers,
    first: MotionFit,
    of_first: NDArray[np.bool_],
) -> bool:
    """A further part must move as a part does: from rest to rest, rigidly, far, and seen by enough tracks.

    Tracks that drift along edges while the camera sways also follow some joint, but loosely and never rest.
    """
    enough = int(members.sum()) >= max(MIN_TRACKS, MIN_SHARE * int(of_first.sum()))
    lever = np.linalg.norm(fit.joint.velocity(0.0, np.nanmedian(fit.landmarks, axis=0)))
    far = float(fit.joint.upper * lever) >= MIN_TRAVEL
    moving = sum(i.last - i.first + 1 for i in moving_spans(fit))
    rests = 0 < moving <= MAX_MOVING_SHARE * len(fit.frames) and bool(np.any(members & movers.rested))
    sure = fit.joint.sigma is not None and fit.joint.sigma.axis <= MAX_AXIS_SIGMA
    loose = fit.residual > min(MAX_RESIDUAL, MAX_LOOSENESS * first.residual)
    return enough and far and rests and sure and not loose
