"""Refine a joint and its states with every pixel of the part: surfels (point to plane) and tracks together.

Once labels tell the part from the hand, its surface says more than its tracks: a surfel's distance to the
depth image fixes the state even where nothing can be tracked. Each surfel keeps a free offset along its
normal and each track three free coordinates; these are eliminated exactly (Schur complement), so that only
the joint and the states remain.

FunREC, supplement 1.4, eq. 3: fits every pixel in place of relative poses.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from recon.dense.noise import GOOD_SENSOR, DepthNoise
from recon.interaction.labels.label_frames import WORKING_WIDTH, LabelConfig, label_frames
from recon.interaction.motion.intervals import state_intervals
from recon.interaction.motion.movers import Movers
from recon.interaction.parts.find_parts import FoundParts, PartTracks
from recon.interaction.parts.moving_part import MovingPart
from recon.interaction.parts.same_motion import distinct
from recon.interaction.parts.static_spans import REST_MARGIN
from recon.interaction.refine.board import edge_tie, find_board, with_board
from recon.interaction.refine.front import LEAN_OF_DEPTH, LEAN_OF_TRACKS, find_front
from recon.interaction.refine.observations import (
    GATES,
    STEPS,
    VOXEL,
    Drift,
    Views,
    build_surfels,
    in_part,
    load_views,
    part_patches,
    pixels_on,
    surfel_terms,
    track_terms,
)
from recon.interaction.refine.panel import find_panel
from recon.interaction.refine.settling import Settled, settle
from recon.interaction.refine.solver import step
from recon.interaction.refine.terms import Terms, join
from recon.interaction.refine.uncertainty import with_uncertainty
from recon.observation.room import Room
from recon.recording import Recording
from twin.geometry import Array
from twin.runs.keys import Stage
from twin.runs.loop import Loop, untold
from twin.scene import HAND_LABEL, Joint, Motion, Trajectory

REFINE = Stage("refine", 26, ("labels",))
POLISH = Stage("polish", 16, ())
_DRIFT = Drift()
_LEAP = 0.05  # of the range; smooth motion stays within .03 of its median at a turning point
_FIRST_GRID = 2 / 3  # of the final labels' working width


def refine_found(
    recording: Recording,
    cameras: Trajectory,
    found: FoundParts,
    of_labels: LabelConfig,
    noise: DepthNoise,
    progress: Loop = untold,
) -> tuple[MovingPart, ...]:
    """Labels by the joints so far, then joints and states refined by labelled pixels; one part a motion."""
    parts = [p.part for p in found.parts]
    if not parts:
        return ()
    # As often as the final ones: a door's far face is in few frames. More frames, or a finer grid, add time
    # and no accuracy: on 24 random recordings all joints were as near to the truth, with a third less time.
    coarser = max(round(_FIRST_GRID * WORKING_WIDTH), 32)
    first = replace(of_labels, every=max(of_labels.every, 4))
    labels = label_frames(recording, cameras, parts, first, noise, width=coarser, progress=progress)
    return distinct(refine_parts(recording, cameras, labels, found, noise))


def polish_parts(
    recording: Recording,
    cameras: Trajectory,
    labels: Mapping[int, NDArray[np.uint8]],
    found: FoundParts,
    refined: Sequence[MovingPart],
    noise: DepthNoise,
) -> tuple[MovingPart, ...]:
    """Refined once more with the final labels, which show what the first ones missed, by tight gates."""
    tracks = tuple(replace(t, part=p) for t, p in zip(found.of(refined), refined, strict=True))
    return refine_parts(recording, cameras, labels, replace(found, parts=tracks), noise, GATES[-3:])


def refine_parts(
    recording: Recording,
    cameras: Trajectory,
    labels: Mapping[int, NDArray[np.uint8]],
    found: FoundParts,
    noise: DepthNoise = GOOD_SENSOR,
    gates: Sequence[float] = GATES,
    drift: Drift = _DRIFT,
    voxel: float = VOXEL,
) -> tuple[MovingPart, ...]:
    """All parts with refined joints, states, uncertainties and intervals.

    Args:
        labels: label images of some frames, from a first pass with the joints in `found`.
        noise: of depth.
        gates: greatest distances (m) of what is taken for the same surface, one round each.
        drift: of the cameras, where the recording shows no larger one.
        voxel: m; surfels are means over voxels of this side.
    """
    if not found.parts:
        return ()
    views, room = load_views(recording, cameras), Room.of(recording, cameras)
    out = []
    for tracks in found.parts:
        end, rests = _refine_one(
            views, labels, tracks, found.movers, recording.intrinsics.fx, noise, gates, voxel
        )
        fit = with_uncertainty(
            end.joint,
            end.state,
            tracks.part.motion.state,
            rests,
            end.terms,
            end.left,
            drift.at_least(noise.drift),
            room,
        )
        spans = state_intervals(tracks.part.motion.frames, fit.state, fit.jitter)
        joint = replace(fit.joint, covariance=fit.covariance, sigma=fit.sigma)
        motion = replace(
            tracks.part.motion,
            state=fit.state,
            intervals=tuple((i.first, i.last) for i in spans),
            residual=fit.residual,
        )
        out.append(replace(tracks.part, joint=joint, motion=motion))
    return tuple(out)


def _refine_one(
    views: Views,
    labels: Mapping[int, NDArray[np.uint8]],
    tracks: PartTracks,
    movers: Movers,
    focal: float,
    noise: DepthNoise,
    gates: Sequence[float],
    voxel: float,
) -> tuple[Settled, NDArray[np.bool_]]:
    """Alternate association and Gauss-Newton until the joint settles, and the frames (n,) of rest; `focal` is
    the recording's, px."""
    part = tracks.part
    rows = np.array([views.row[int(f)] for f in part.motion.frames])
    state = without_leaps(part.motion.state)
    rests = _rests(part.motion)
    joint: Joint = replace(part.joint, covariance=None, sigma=None)
    lean = LEAN_OF_DEPTH if tracks.type_source == "depth" else LEAN_OF_TRACKS
    patches = part_patches(views, labels, part)
    # Where a wrong joint puts the rim of a board beside what is seen, it is taken for the hand.
    outlines = part_patches(views, labels, part, also=HAND_LABEL)

    def one_round(gate: float, joint: Joint, state: Array) -> tuple[Joint, Array, Terms]:
        surfels = build_surfels(views, patches, rows, joint, state, voxel)
        panel, surfels = find_panel(part.joint, part.motion.state, *surfels, noise)
        seen = surfel_terms(views, surfels, rows, joint, state, gate, noise)
        board = find_board(joint, *surfels, noise)
        if board is not None:
            shown = in_part(views, outlines, rows, joint, state)
            edges = edge_tie(board, shown, state, rests, partial(pixels_on, views, rows, joint, state))
            seen = with_board(seen, board, edges)
        front = find_front(part.joint, *surfels, noise, lean)
        if front is not None or panel is not None:
            seen = replace(seen, board=front or panel)
        terms = join(
            seen,
            track_terms(views, movers, tracks.members, part, rows, joint, state, focal, noise),
        )
        for _ in range(STEPS):
            joint, state = step(joint, state, part.motion.state, rests, terms)
        return joint, state, terms

    *wider, last = gates
    for gate in wider:
        joint, state, _ = one_round(gate, joint, state)
    return settle(partial(one_round, last), joint, state), rests


def without_leaps(state: Array) -> Array:
    """States (n,) without leaps of one or two frames: the median of five stands in their place.

    A hand that lets go carries the tracks along for a frame, and a surface as far away is no evidence within
    the gates that follow. No part goes a twentieth of its range and comes back within two frames.
    """
    around = np.lib.stride_tricks.sliding_window_view(np.pad(state, 2, mode="edge"), 5)
    usual = np.median(around, axis=1)
    leaps = np.abs(state - usual) > _LEAP * float(np.ptp(usual))
    return np.where(leaps, usual, state)


def _rests(motion: Motion) -> NDArray[np.bool_]:
    """Frames (n,) well outside the intervals in which the part moves; none when these are not known."""
    out = np.full(len(motion.frames), bool(motion.intervals))
    for first, last in motion.intervals:
        out &= (motion.frames < first - REST_MARGIN) | (motion.frames > last + REST_MARGIN)
    return out
