"""Joints by tracks and joints by depth compete for what pictures show."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from recon.interaction.boards.meanwhile import moving
from recon.interaction.boards.proposals import Proposed
from recon.interaction.boards.search import SIGMA, DepthPart, parts_by_depth
from recon.interaction.joints.config import LIMIT_QUANTILE, SEARCH_SIGMA
from recon.interaction.joints.inliers import track_support
from recon.interaction.joints.observations import Model, Observations
from recon.interaction.motion.movers import Movers
from recon.interaction.parts.moving_part import MovingPart
from recon.recording import Recording
from twin.geometry import Array
from twin.scene import Joint, Revolute, Trajectory

# Share of what depth's own joint explains that one of tracks must explain. Chosen by us: of 23 recordings
# that we looked at, tracks had another joint in eleven (share up to .56), one more than 1.5 deg off in three
# (up to .84), and one as good as depth's in nine (from .89, but for two).
_AS_WELL = 0.87
# States of tracks stay unless depth's explain more by this ratio, or explain as much and the tracks' go so
# many times as far: they ran on while the part was out of view (.85 to 1.05 in 15 right open recordings, 1.75
# if wrong). Chosen by us.
_MORE, _FARTHER = 1.03, 1.4
# Standard deviations of depth's states by which those of tracks leave them where the tracks slip, and share
# of the moving frames up to which the others stay. Chosen by us.
_SLIPS, _MOSTLY = 3.0, 0.5
# Support of a track that moves with a part. Chosen by us.
_FOLLOW = 0.3
# m. Error of joints and states that depth alone found. Chosen by us.
_COARSE_M = 0.015


@dataclass(frozen=True, eq=False)
class Witnessed:
    """A joint by depth with a state for each posed frame, and the tracks (K,) that follow it.

    by_tracks: the tracks' part whose joint explains as much, or None. as_well: what it explains by the states
    that it is given, over what depth's does. mended: states (n,) for that part's frames where depth's explain
    more than its own, else None. strength: what depth's joint explains, as a share of the board's pixels.
    board: points (m, 3) m of what it carries, in the first frame.
    """

    joint: Joint
    state: Array
    followers: NDArray[np.bool_]
    board: Array
    by_tracks: int | None
    as_well: float = 1.0
    strength: float = 1.0
    mended: Array | None = None


def witnessed(
    recording: Recording,
    cameras: Trajectory,
    movers: Movers,
    tracked: Sequence[MovingPart],
) -> list[Witnessed]:
    """What depth says of the parts. tracked: parts by tracks, whose joints compete for what moves."""
    known = [proposed(p.joint) for p in tracked]
    return [told(part, cameras, movers, tracked, known) for part in parts_by_depth(recording, cameras, known)]


def told(
    part: DepthPart,
    cameras: Trajectory,
    movers: Movers,
    tracked: Sequence[MovingPart],
    known: Sequence[Proposed],
) -> Witnessed:
    """What depth says of one part. known: the joints of those by tracks."""
    oriented = part.oriented(LIMIT_QUANTILE)
    state = np.interp(cameras.frames, part.frames, oriented.state)
    its = Witnessed(
        replace(oriented.joint, covariance=None),
        state,
        followers(oriented.joint, cameras.frames, state, movers),
        part.carried.board(part.joint, part.state),
        None,
        strength=part.score / part.carried.carriers[0].area,
    )
    explained = [part.by(joint) for joint in known]
    best = max(range(len(known)), key=lambda k: explained[k][1], default=None)
    if best is None or explained[best][1] < _AS_WELL:
        return its
    mended, share = _mended(part, known[best], tracked[best], explained[best][0])
    return replace(its, by_tracks=best, as_well=share, mended=mended)


def _mended(part: DepthPart, joint: Proposed, tracked: MovingPart, best: Array) -> tuple[Array | None, float]:
    """States (n,) of tracks with those of depth, `best` (T,), where they leave them, if so more is explained;
    and the share that is explained. Tracks slip, or lie on a hand that lets go."""
    m, most = tracked.motion, max(part.worth(part.joint, part.state), 1e-12)
    own = np.interp(m.frames, part.frames, best)
    own = own + np.median(m.state - own)
    slips = np.abs(m.state - own) > _SLIPS * SIGMA[joint.kind]
    tried = (
        own - own[0] + m.state[0] if slips[moving(own)].mean() > _MOSTLY else np.where(slips, own, m.state)
    )
    its, mended = (part.worth(joint, np.interp(part.frames, m.frames, s)) for s in (m.state, tried))
    farther = np.ptp(m.state) > _FARTHER * np.ptp(tried) and mended * _MORE > its
    return (tried, mended / most) if slips.any() and (mended > _MORE * its or farther) else (None, its / most)


def proposed(joint: Joint) -> Proposed:
    return Proposed(joint.kind, joint.axis, joint.pivot if isinstance(joint, Revolute) else np.zeros(3))


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
