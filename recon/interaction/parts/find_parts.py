"""Which parts move, by which joints: tracks in, one `PartTracks` per part out.

Parts are found one after the other among the tracks that no earlier part explains: either among all of them,
or in the groups of the paper's motion clustering (`MotionConfig.method`). For each, the first fit looks at
the tracks that travel far, the hand's among them. It tells roughly when the part is at rest, and with that
which tracks lie on the hand (they are in view and move while the part rests, or have the hand's colour). The
next one looks at the far ones of the others, and tells which tracks drift along edges: they move while the
part rests. The last ones use all that remain.

FunREC, supplement 3.2: hypotheses from pairs of tracks in place of single ones.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from itertools import repeat

import numpy as np
from numpy.typing import NDArray

from recon.interaction.joints.clustering.clusters import cluster_tracks
from recon.interaction.joints.config import MIN_TRACKS, JointConfig
from recon.interaction.joints.group_fits import AS_WELL, GroupFit, fit_group, on_course, support, widened
from recon.interaction.joints.result import MotionFit
from recon.interaction.joints.type_selection import TypeHint
from recon.interaction.motion.intervals import MIN_DISPLACEMENT, state_intervals
from recon.interaction.motion.movers import Movers, find_movers
from recon.interaction.parts.config import FAR_SHARE, MAX_RESIDUAL, MIN_SHARE, REST_TOLERANCE, MotionConfig
from recon.interaction.parts.found import FoundParts as FoundParts
from recon.interaction.parts.found import PartTracks as PartTracks
from recon.interaction.parts.hand_tracks import HandTracks
from recon.interaction.parts.moving_part import MovingPart
from recon.interaction.parts.part_matching import is_another_part, same_part
from recon.interaction.parts.static_spans import known_rest_spans, rest_spans, restless
from recon.interaction.parts.two_witnesses import reconciled_parts
from recon.recording import Recording
from recon.tracking.tracks import Tracks
from twin.errors import ReconstructionError
from twin.geometry import Array
from twin.runs.keys import Stage
from twin.scene import FIRST_PART_ID, Motion, Trajectory

MOTION = Stage("motion", 37, ("motion", "joints"))
_DEFAULT, _JOINTS = MotionConfig(), JointConfig()
# of telling restless tracks by the fit and fitting the others; more change nothing we measured
_CALM_ROUNDS = 2


def find_parts(
    recording: Recording,
    tracks: Tracks,
    cameras: Trajectory,
    config: MotionConfig = _DEFAULT,
    joints: JointConfig = _JOINTS,
    hints: Sequence[TypeHint] = (),
) -> FoundParts:
    """Find every part that moves by a joint. hints: expected joint types; see `joints.type_selection`.

    None where nothing moves, or no joint explains what moves: a warning says which.
    """
    movers = find_movers(tracks, cameras, recording.times)
    hand_of = HandTracks(recording, cameras, tracks).of
    search = Search(movers, hand_of, moving_part_of(recording, cameras), joints, hints)
    if movers.moving.sum() >= MIN_TRACKS:
        for group in _groups(movers, config, joints):
            if len(search.found) == config.max_parts or not (
                search.take(group) or config.method == "clusters"
            ):
                break  # all tracks together bring no more; of the clusters, each may
    parts = reconciled_parts(search.found, recording, cameras, movers, config.max_parts)
    if not parts:
        nothing = f"{int(movers.moving.sum())} of {len(tracks)} tracked points leave their place"
        why = search.failed[0].problem if search.failed else nothing
        warnings.warn(f"no part was found: {why}", stacklevel=2)
    return FoundParts(movers, parts)


def _groups(movers: Movers, config: MotionConfig, joints: JointConfig) -> Iterator[NDArray[np.bool_]]:
    """Masks (K,) of the tracks to look for the next part among: all, or cluster by cluster."""
    if config.method == "fits":
        yield from repeat(movers.moving)
    moving = np.flatnonzero(movers.moving)
    points, visible = movers.points_world[:, moving], movers.visible[:, moving]
    for cluster in cluster_tracks(points, visible, config=config.clusters, method=joints.method):
        mask = np.zeros_like(movers.moving)
        mask[moving[cluster.members]] = True
        yield mask


class Search:
    """The parts found so far, their fits, and which tracks (K,) are still free or lie on the hand.

    hand_of: mask of the tracks on the hand, from spans (first, last) of frames in which no part moves.
    to_part: makes the moving part of a number and a fit.
    """

    def __init__(
        self,
        movers: Movers,
        hand_of: Callable[[Sequence[tuple[int, int]]], NDArray[np.bool_]],
        to_part: Callable[[int, MotionFit], MovingPart],
        joints: JointConfig,
        hints: Sequence[TypeHint],
    ) -> None:
        self.movers, self.hand_of, self.to_part, self.joints = movers, hand_of, to_part, joints
        told = any(np.isinf(h.weight) for h in hints)  # the user's type holds whatever explains more
        least = 0 if told else MIN_TRACKS
        self.fit_group = partial(fit_group, movers=movers, config=joints, hints=hints, least=least)
        self.free, self.hand = movers.moving.copy(), np.zeros_like(movers.moving)
        self.found: list[PartTracks] = []
        self.fits: list[MotionFit] = []
        self.failed: list[ReconstructionError] = []
        self.least = 0.0  # support of a further fit, once there is a first one

    def take(self, group: NDArray[np.bool_], given: GroupFit | None = None) -> bool:
        """Look for a part among a group's free tracks (K,), or take the given one; False if there is none."""
        try:
            best = given or self._fit(self.free & group)
            if best.support < self.least:  # drift along edges, mostly
                raise ReconstructionError("what still moves explains little by any joint")
        except ReconstructionError as e:
            self.failed.append(e)
            return False
        fit, members = best.fit, best.members
        self.least = self.least or MIN_SHARE * best.support
        known = same_part(fit, members, self.movers, [f.part for f in self.found])
        if known is not None:
            members = self._join(known, members)
        elif self._is_another(fit, members):
            members = self._add(fit, members)
        else:
            self.failed.append(ReconstructionError("what still moves does not move as a part does"))
            return False
        self.free &= ~members & ~self.hand
        return True

    def _is_another(self, fit: MotionFit, members: NDArray[np.bool_]) -> bool:
        if not self.found:
            return True
        return is_another_part(fit, members, self.movers, self.fits[0], self.found[0].members)

    def _join(self, known: int, members: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """More tracks of a known part."""
        part, both = self.found[known], self.found[known].members | members
        self.fits[known] = self._widened(self.fits[known], both)
        self.found[known] = replace(part, part=self.to_part(part.part.id, self.fits[known]), members=both)
        return members

    def _add(self, fit: MotionFit, members: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """A further part, with all free tracks that stay on its course."""
        course = on_course(fit, self.movers, REST_TOLERANCE)
        circling = members | (self.free & ~self.hand & course)
        fit = self._widened(fit, circling)
        members = circling & (support(fit, circling, self.movers) > 0)
        part = self.to_part(FIRST_PART_ID + len(self.found), fit)
        self.found.append(PartTracks(part, members, fit.type_source))
        self.fits.append(fit)
        return members

    def _widened(self, fit: MotionFit, group: NDArray[np.bool_]) -> MotionFit:
        return widened(fit, group, self.movers, self.joints, MAX_RESIDUAL)

    def _fit(self, free: NDArray[np.bool_]) -> GroupFit:
        """The fit to one part among the free tracks (K,); what lies on the hand is noted."""
        first, frames = bool((free == self.movers.moving).all()), len(self.movers.visible)
        free = free & ~self.hand
        best = self.fit_group((self._far(free), free), free)
        self.hand = self.hand | self.hand_of(rest_spans(best.fit, frames))
        try:
            if (free & self.hand).any():
                free = free & ~self.hand
                best = self.fit_group((self._far(free), free), free)
            for _ in range(_CALM_ROUNDS):
                rests = known_rest_spans(best.fit, frames)
                calm = free & ~restless(self.movers, free, rests)
                if np.array_equal(calm, best.chosen):
                    break
                every = self.fit_group((calm,), free)
                if every.support < AS_WELL * best.support:  # led astray by tracks that drift along edges
                    break
                best = every
        except ReconstructionError as e:
            if first:
                warnings.warn(
                    f"the joint rests on tracks that may lie on the hand or drift along edges ({e.problem})",
                    stacklevel=4,
                )
        return best

    def _far(self, free: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """The free tracks that travel far, of all that do."""
        if not free.any():
            raise ReconstructionError("no moving tracks are left")
        reach = float(np.quantile(self.movers.travel[free], 0.95))
        return free & (self.movers.travel > max(MIN_DISPLACEMENT, FAR_SHARE * reach))


def moving_part_of(recording: Recording, cameras: Trajectory) -> Callable[[int, MotionFit], MovingPart]:
    """What makes the moving part of a number and a fit."""
    return partial(_moving_part, cameras.frames, recording.times[cameras.frames])


def _moving_part(frames: NDArray[np.int64], times: Array, number: int, fit: MotionFit) -> MovingPart:
    """A state for every posed frame; frames without an estimate lie between their neighbours for now."""
    state = np.interp(frames, fit.frames, fit.state)
    spans = state_intervals(frames, state, fit.joint.sigma.state if fit.joint.sigma else 0.0)
    moving = tuple((i.first, i.last) for i in spans)
    return MovingPart(number, fit.joint, Motion(frames, times, state, moving, fit.residual, fit.inliers))
