"""Joints of groups of tracks, and how well all others follow them.

A group is a choice among the movers (`motion.movers`); who chooses it is `parts.find_parts`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recon.interaction.joints.config import SEARCH_SIGMA, JointConfig
from recon.interaction.joints.fit_tracks import MotionFit, fit_again, fit_motion
from recon.interaction.joints.inliers import track_support
from recon.interaction.joints.observations import Model, Observations
from recon.interaction.joints.type_selection import TypeHint
from recon.interaction.motion.movers import Movers
from recon.interaction.motion.spread import spread
from twin import geometry as geo
from twin.errors import ReconstructionError
from twin.geometry import Array
from twin.scene import Revolute

# a fit to more tracks is kept when the tracks follow it nearly as well; wrong ones have a quarter or less
AS_WELL = 0.9


@dataclass(frozen=True, eq=False)
class GroupFit:
    """A fit to the tracks `chosen` (K,), those of them that follow (`members`, (K,)), and how many of all
    free ones do, each counted by how well (`support`)."""

    fit: MotionFit
    chosen: NDArray[np.bool_]
    support: float

    @property
    def members(self) -> NDArray[np.bool_]:
        out = np.zeros_like(self.chosen)
        out[np.flatnonzero(self.chosen)[self.fit.track_inliers]] = True
        return out


def fit_group(
    choices: Sequence[NDArray[np.bool_]],
    free: NDArray[np.bool_],
    movers: Movers,
    config: JointConfig,
    hints: Sequence[TypeHint] = (),
    least: float = 0.0,
) -> GroupFit:
    """The fit to the first choice of tracks that has one with a support of at least `least`.

    Raises ReconstructionError, that of the first choice, when none has.
    """
    failed: list[ReconstructionError] = []
    for chosen in choices:
        try:
            points, visible = movers.points_world[:, chosen], movers.visible[:, chosen]
            fit = fit_motion(points, visible, config=config, hints=hints)
        except ReconstructionError as e:
            failed.append(e)
            continue
        worth = float(support(fit, free, movers).sum())
        if worth >= least:
            return GroupFit(fit, chosen, worth)
        failed.append(
            ReconstructionError(
                f"{int(fit.track_inliers.sum())} tracks follow a joint hardly better than they stand still",
                "give the interval in which the part moves",
            )
        )
    raise failed[0]


def support(fit: MotionFit, asked: NDArray[np.bool_], movers: Movers) -> Array:
    """How much better each track (K,) follows a fit than standing still, 0..1; 0 for those not asked for.

    Past its known frames the part is held still.
    """
    obs = Observations.of(movers.points_world[:, asked], movers.visible[:, asked])
    state = np.interp(np.arange(len(movers.visible)), fit.frames, fit.state)
    pivot = fit.joint.pivot if isinstance(fit.joint, Revolute) else np.zeros(3)
    model = Model(fit.joint.kind, fit.joint.axis, pivot, state)
    out = np.zeros(len(asked))
    out[asked] = track_support(obs, model, SEARCH_SIGMA)
    return out


def on_course(fit: MotionFit, movers: Movers, tolerance: float) -> NDArray[np.bool_]:
    """Movers (K,) at a constant distance from the fitted joint's axis and place on it, to `tolerance` m.

    That needs no state, so it finds the part's points in frames of which the fit knows none.
    """
    joint, out = fit.joint, np.zeros(movers.moving.shape, bool)
    course = movers.points_world[:, movers.moving] @ geo.orthogonal_basis(joint.axis)
    if isinstance(joint, Revolute):
        off = course - joint.pivot @ geo.orthogonal_basis(joint.axis)
        course = np.stack([np.hypot(off[..., 0], off[..., 1]), off[..., 2]], axis=-1)
    else:
        course = course[..., :2]
    strays, _ = spread(course, movers.visible[:, movers.moving], 0.9)
    out[movers.moving] = strays < tolerance
    return out


def widened(
    fit: MotionFit, group: NDArray[np.bool_], movers: Movers, config: JointConfig, max_residual: float
) -> MotionFit:
    """The fit to a larger group of tracks (K,), when it knows the state of more frames and leaves no more
    than `max_residual` metres; else the fit as it was.

    A door that crosses edge-on loses the tracks on its front before those on its inside begin.
    """
    points, visible = movers.points_world[:, group], movers.visible[:, group]
    try:
        wide = fit_again(fit, points, visible, config)
    except ReconstructionError:
        return fit
    better = len(wide.frames) > len(fit.frames) and wide.residual <= max_residual
    before, after = (float(support(f, group, movers).sum()) for f in (fit, wide))
    return wide if better and after >= AS_WELL * before else fit
