"""Two witnesses: joints by tracks and joints by depth alone compete on every frame's depth."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from recon.interaction.joints.config import LIMIT_QUANTILE, SEARCH_SIGMA
from recon.interaction.joints.inliers import track_support
from recon.interaction.joints.observations import Model, Observations
from recon.interaction.motion.movers import Movers
from recon.interaction.parts.changed.proposals import Proposed
from recon.interaction.parts.changed.search import ChangedPart, changed_parts
from recon.interaction.parts.config import SAME_AXIS, SAME_PIVOT
from recon.interaction.parts.moving_part import MovingPart
from recon.recording import Recording
from twin import geometry as geo
from twin.geometry import Array
from twin.scene import Joint, Revolute, Trajectory

# Support of a track that moves with a part. Chosen by us.
_FOLLOW = 0.3
# m. Error of joints and states that depth alone found. Chosen by us.
_COARSE_M = 0.015


@dataclass(frozen=True, eq=False)
class Witnessed:
    """A joint by depth with a state for each posed frame, and the tracks (K,) that follow it.

    by_tracks: the tracks' part of the same joint, or None. mended: see `ChangedPart.mended`, None where the
    tracks' own states (n,) stay. as_well: of the tracks' own states, of the mended ones where most stay.
    """

    joint: Joint
    state: Array
    followers: NDArray[np.bool_]
    by_tracks: int | None
    as_well: float = 1.0
    mended: Array | None = None


def witnessed(
    recording: Recording,
    cameras: Trajectory,
    movers: Movers,
    tracked: Sequence[MovingPart],
) -> list[Witnessed]:
    """What depth says of the parts. tracked: parts by tracks, whose joints compete for changed surfaces."""
    out = []
    known = [_proposed(p.joint) for p in tracked]
    for part in changed_parts(recording, cameras, known):
        oriented = part.oriented(LIMIT_QUANTILE)
        state = np.interp(cameras.frames, part.frames, oriented.state)
        its = Witnessed(
            replace(oriented.joint, covariance=None),
            state,
            followers(oriented.joint, cameras.frames, state, movers),
            next((k for k, p in enumerate(tracked) if _same(oriented.joint, p.joint, part)), None),
        )
        if its.by_tracks is not None:
            joint, m = known[its.by_tracks], tracked[its.by_tracks].motion
            mended, mostly = part.mended(joint, m.frames, m.state)
            as_well = part.as_well(joint, m.frames, mended if mostly else m.state)
            its = replace(its, as_well=as_well, mended=None if mended is m.state else mended)
        out.append(its)
    return out


def _proposed(joint: Joint) -> Proposed:
    return Proposed(joint.kind, joint.axis, joint.pivot if isinstance(joint, Revolute) else np.zeros(3))


def _same(joint: Joint, tracked: Joint, part: ChangedPart) -> bool:
    """Whether both joints are one as far as the part shows."""
    if joint.kind != tracked.kind or geo.line_angle(joint.axis, tracked.axis) > SAME_AXIS:
        return False
    if isinstance(joint, Revolute) and isinstance(tracked, Revolute):
        centre = part.surface.points.mean(axis=0)
        feet = [geo.nearest_point_on_line(centre, j.pivot, j.axis) for j in (joint, tracked)]
        return bool(np.linalg.norm(feet[0] - feet[1]) <= SAME_PIVOT)
    return True


def followers(joint: Joint, frames: NDArray[np.int64], state: Array, movers: Movers) -> NDArray[np.bool_]:
    """Movers (K,) that follow a joint with states (n,) in frames (n,)."""
    every = np.interp(np.arange(len(movers.visible)), frames, state)
    pivot = joint.pivot if isinstance(joint, Revolute) else np.zeros(3)
    out = np.zeros_like(movers.moving)
    asked = np.flatnonzero(movers.moving)
    if len(asked):
        obs = Observations.of(movers.points_world[:, asked], movers.visible[:, asked])
        model = Model(joint.kind, joint.axis, pivot, every)
        out[asked] = track_support(obs, model, max(SEARCH_SIGMA, _COARSE_M)) > _FOLLOW
    return out
