"""Refine a joint and its states with every pixel of the part: surfels (point to plane) and tracks in one system.

Once labels tell the part from the hand, its surface says more than its tracks: a surfel's distance to the depth image
fixes the state even where nothing can be tracked. Each surfel keeps a free offset along its normal and each track
three free coordinates; these are eliminated exactly (Schur complement), so that only the joint and the states remain.

FunREC, supplement 1.4, eq. 3: fits every pixel in place of relative poses.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from recon.dense.noise import GOOD_SENSOR, DepthNoise
from recon.labels.label_frames import LabelConfig, label_frames
from recon.motion.intervals import IntervalConfig, state_intervals
from recon.motion.movers import Movers
from recon.parts.find_parts import FoundParts, PartTracks
from recon.parts.moving_part import MovingPart
from recon.parts.same_motion import distinct
from recon.parts.static_spans import REST_MARGIN
from recon.recording import Recording
from recon.refine.observations import (
    STEPS,
    RefineConfig,
    Terms,
    Views,
    build_surfels,
    join,
    load_views,
    part_patches,
    surfel_terms,
    track_terms,
)
from recon.refine.parallel_faces import face_step
from recon.refine.settling import settle
from recon.refine.solver import step
from recon.refine.uncertainty import Refined, with_uncertainty
from twin.geometry import Array
from twin.runs.keys import Stage
from twin.runs.loop import Loop, untold
from twin.scene import Joint, Motion, Trajectory

REFINE = Stage("refine", 13, ("refine", "labels", "motion.interval"))
POLISH = Stage("polish", 7, ("refine", "motion.interval"))
_DEFAULT, _INTERVAL = RefineConfig(), IntervalConfig()


def refine_found(
    recording: Recording,
    cameras: Trajectory,
    found: FoundParts,
    config: RefineConfig,
    of_labels: LabelConfig,
    interval: IntervalConfig,
    noise: DepthNoise,
    progress: Loop = untold,
) -> tuple[MovingPart, ...]:
    """Labels with the joints found so far, then joints and states refined with every labelled pixel; what moves alike is one part."""
    parts = [p.part for p in found.parts]
    if not parts:
        return ()
    # As dense as the final ones: a door's far face is in few frames. Denser adds time and no accuracy.
    first = replace(of_labels, every=max(of_labels.every, 4))
    labels = label_frames(recording, cameras, parts, first, noise, progress=progress)
    return distinct(refine_parts(recording, cameras, labels, found, config, interval, noise))


def polish_parts(
    recording: Recording,
    cameras: Trajectory,
    labels: Mapping[int, NDArray[np.uint8]],
    found: FoundParts,
    refined: Sequence[MovingPart],
    config: RefineConfig,
    interval: IntervalConfig,
    noise: DepthNoise,
) -> tuple[MovingPart, ...]:
    """Refined once more with the final labels, which show what the first ones missed, by the last, tight gates."""
    tracks = tuple(replace(t, part=p) for t, p in zip(found.of(refined), refined, strict=True))
    tight = replace(config, gates=config.gates[-3:])
    return refine_parts(recording, cameras, labels, replace(found, parts=tracks), tight, interval, noise)


def refine_parts(
    recording: Recording,
    cameras: Trajectory,
    labels: Mapping[int, NDArray[np.uint8]],
    found: FoundParts,
    config: RefineConfig = _DEFAULT,
    interval: IntervalConfig = _INTERVAL,
    noise: DepthNoise = GOOD_SENSOR,
) -> tuple[MovingPart, ...]:
    """All parts with refined joints, states, uncertainties and intervals.

    Args:
        labels: label images of some frames, from a first pass with the joints in `found`.
        noise: of depth.
    """
    if not found.parts:
        return ()
    views = load_views(recording, cameras, config)
    out = []
    for tracks in found.parts:
        fit = _refine_one(views, labels, tracks, found.movers, recording.intrinsics.fx, config, noise)
        spans = state_intervals(tracks.part.motion.frames, fit.state, fit.jitter, interval)
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
    config: RefineConfig,
    noise: DepthNoise,
) -> Refined:
    """Alternate association and Gauss-Newton until the joint settles; `focal` is the recording's, px."""
    part = tracks.part
    rows = np.array([views.row[int(f)] for f in part.motion.frames])
    state = np.array(part.motion.state)
    rests = _rests(part.motion)
    joint: Joint = replace(part.joint, covariance=None, sigma=None)
    patches = part_patches(views, labels, part)

    def one_round(gate: float, joint: Joint, state: Array) -> tuple[Joint, Array, Terms]:
        surfels = build_surfels(views, patches, rows, joint, state, config)
        terms = join(
            surfel_terms(views, surfels, rows, joint, state, gate, noise, config),
            track_terms(views, movers, tracks.members, part, rows, joint, state, focal, noise, config),
        )
        for _ in range(STEPS):
            joint, state = step(joint, state, part.motion.state, rests, terms)
        return joint, _with_parallel_faces(joint, state, surfels, terms), terms

    *wider, last = config.gates
    for gate in wider:
        joint, state, _ = one_round(gate, joint, state)
    end = settle(partial(one_round, last), joint, state)
    # States are counted from the first frame, whose pose is the part's frame.
    state = end.state - end.state[0]
    drifting = config.with_drift(noise.drift)
    return with_uncertainty(end.joint, state, part.motion.state, rests, end.terms, end.left, drifting)


def _rests(motion: Motion) -> NDArray[np.bool_]:
    """Frames (n,) well outside the intervals in which the part moves; none when these are not known."""
    out = np.full(len(motion.frames), bool(motion.intervals))
    for first, last in motion.intervals:
        out &= (motion.frames < first - REST_MARGIN) | (motion.frames > last + REST_MARGIN)
    return out


def _with_parallel_faces(joint: Joint, state: Array, surfels: tuple[Array, Array], terms: Terms) -> Array:
    """Take the step between the frames that see a board's one face and those that see the other out of the state."""
    found = face_step(joint, *surfels)
    if found is None:
        return state
    step, near, far = found
    of_surfels = terms.term < len(near)
    term, frame = terms.term[of_surfels], terms.frame[of_surfels]
    sees_near = np.bincount(frame, near[term], len(state))
    sees_far = np.bincount(frame, far[term], len(state))
    known = sees_near + sees_far > 0
    if not known.any():
        return state
    share = sees_far[known] / (sees_near + sees_far)[known]
    every = np.interp(np.arange(len(state)), np.flatnonzero(known), share)
    # Seen in the part's frame, a state that is too large turns what is seen backwards by as much.
    return np.asarray(state + step * every)
