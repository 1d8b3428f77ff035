"""Refine a joint and its states with every pixel of the part: surfels (point to plane) and tracks in one system.

Once labels tell the part from the hand, its surface says more than its tracks: a surfel's distance to the depth image
fixes the state even where nothing can be tracked. Each surfel keeps a free offset along its normal and each track
three free coordinates; these are eliminated exactly (Schur complement), so that only the joint and the states remain.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from recon.motion.find_parts import FoundParts, PartTracks
from recon.motion.intervals import IntervalConfig, Movers, state_intervals
from recon.motion.static_spans import REST_MARGIN
from recon.moving_part import MovingPart
from recon.recording import Recording
from recon.refine.observations import (
    RefineConfig,
    Terms,
    Views,
    build_surfels,
    join,
    load_views,
    surfel_terms,
    track_terms,
)
from recon.refine.parallel_faces import face_step
from recon.refine.solver import add_priors, linearise, reduced, robust_weights, step
from twin import geometry as geo
from twin.geometry import Array
from twin.scene import Joint, JointSigma, Motion, Revolute, Trajectory

_DEFAULT = RefineConfig()
_BLOCK = 8  # frames whose errors count as one; about half a second, the time scale of head sway
# Slow errors of the camera poses as they show at the part, standard deviations in each direction, m and rad: measured 0.17 mm
# and 0.014 degrees on the recordings of benchmarks/reconstruct.md. Shares of the cosines fall like a random walk's.
_DRIFT_M, _DRIFT_RAD = 2e-4, float(np.radians(0.015))
_DRIFT_SHARES = (0.74, 0.18, 0.08)


def refine_parts(
    recording: Recording,
    cameras: Trajectory,
    labels: Mapping[int, NDArray[np.uint8]],
    found: FoundParts,
    config: RefineConfig = _DEFAULT,
    interval: IntervalConfig | None = None,
) -> tuple[MovingPart, ...]:
    """All parts with refined joints, states, uncertainties and intervals.

    Args:
        labels: label images of some frames, from a first pass with the joints in `found`.
    """
    views = load_views(recording, cameras, config)
    out = []
    for tracks in found.parts:
        fit = _refine_one(views, labels, tracks, found.movers, recording.intrinsics.fx, config)
        spans = state_intervals(
            tracks.part.motion.frames, fit.state, fit.jitter, interval or IntervalConfig()
        )
        joint = replace(fit.joint, covariance=fit.covariance, sigma=fit.sigma)
        motion = replace(
            tracks.part.motion,
            state=fit.state,
            intervals=tuple((i.first, i.last) for i in spans),
            residual=fit.residual,
        )
        out.append(replace(tracks.part, joint=joint, motion=motion))
    return tuple(out)


@dataclass(frozen=True, eq=False)
class _Refined:
    joint: Joint  # without uncertainty
    state: Array
    covariance: Array
    sigma: JointSigma
    residual: float
    jitter: float  # standard deviation of the state from frame to frame, m or rad


def _refine_one(
    views: Views,
    labels: Mapping[int, NDArray[np.uint8]],
    tracks: PartTracks,
    movers: Movers,
    focal: float,
    config: RefineConfig,
) -> _Refined:
    """Alternate association and Gauss-Newton; `focal` is the recording's, px."""
    part = tracks.part
    rows = np.array([views.row[int(f)] for f in part.motion.frames])
    state = np.array(part.motion.state)
    rests = _rests(part.motion)
    joint: Joint = replace(part.joint, covariance=None, sigma=None)
    for gate in config.gates:
        surfels = build_surfels(views, labels, part, joint, state, config)
        terms = join(
            surfel_terms(views, surfels, rows, joint, state, gate, config),
            track_terms(views, movers, tracks.members, part, rows, joint, state, focal, config),
        )
        for _ in range(config.steps):
            joint, state = step(joint, state, part.motion.state, rests, terms)
        state = _with_parallel_faces(joint, state, surfels, terms)
    # States are counted from the first frame, whose pose is the part's frame.
    state = state - state[0]
    return _with_uncertainty(joint, state, part.motion.state, rests, terms)


def _rests(motion: Motion) -> NDArray[np.bool_]:
    """Frames (n,) well outside the intervals in which the part moves; none when these are not known."""
    out = np.full(len(motion.frames), bool(motion.intervals))
    for first, last in motion.intervals:
        out &= (motion.frames < first - REST_MARGIN) | (motion.frames > last + REST_MARGIN)
    return out


def _with_uncertainty(
    joint: Joint, state: Array, start: Array, rests: NDArray[np.bool_], terms: Terms
) -> _Refined:
    """Covariance of the joint's tangent and of the states, robust to errors shared within spans of frames.

    Sandwich estimator (Liang and Zeger 1986): what one bad camera pose or one leaking label does to all pixels of a few
    neighbouring frames counts once, not once a pixel. Errors that grow over the whole recording leave no residual; they
    are added as `_drift`.
    """
    value, jac = linearise(joint, state, terms)
    weight, mean = robust_weights(value, terms)
    d = jac.shape[1] - 1
    h, g = reduced(terms.term, terms.frame, weight, value, jac, len(state))
    h, _ = add_priors(h, g, d, state, start, rests)
    score = weight * (value - mean[terms.term])
    blocks = terms.frame // _BLOCK
    scores = np.zeros((int(blocks.max(initial=0)) + 1, len(h)))
    for k in range(d):
        np.add.at(scores[:, k], blocks, score * jac[:, k])
    np.add.at(scores, (blocks, d + terms.frame), score * jac[:, d])
    inverse = np.linalg.inv(h)
    pushed = scores @ inverse
    drifted = _drift(joint, state, terms, weight, jac) @ inverse
    covariance = pushed[:, :d].T @ pushed[:, :d] + drifted[:, :d].T @ drifted[:, :d] + inverse[:d, :d]
    residual = np.abs(value - mean[terms.term])
    inlier = weight * terms.sigma**2 > 0.25 * np.median(weight * terms.sigma**2)
    rms = float(np.sqrt(np.mean(residual[inlier] ** 2))) if inlier.any() else 0.0
    second = np.diff(state, 2)
    noise = 1.4826 * float(np.median(np.abs(second))) / np.sqrt(6.0)
    drift = float(np.sqrt(np.median(np.einsum("bi,bi->i", pushed[:, d + 1 :], pushed[:, d + 1 :]))))
    covariance = 0.5 * (covariance + covariance.T)
    sigma = JointSigma.of(covariance, float(np.hypot(noise, drift)))
    return _Refined(joint, state, covariance, sigma, rms, noise)


def _drift(joint: Joint, state: Array, terms: Terms, weight: Array, jac: Array) -> Array:
    """Scores (modes, d + n) of unseen slow errors: cosines over the recording, in six directions about the part."""
    n = terms.normals[terms.term]
    if isinstance(joint, Revolute):
        n = np.einsum("nij,nj->ni", geo.exp_so3(joint.axis * state[:, None])[terms.frame], n)
    turn = np.cross(terms.q - terms.q.mean(axis=0), n)
    moves = np.concatenate([_DRIFT_M * n, _DRIFT_RAD * turn], axis=1)
    total = np.maximum(np.bincount(terms.term, weight, len(terms.normals)), 1e-12)
    time = (np.arange(len(state)) + 0.5) / len(state)
    d = jac.shape[1] - 1
    out = []
    for k, share in enumerate(_DRIFT_SHARES):
        shape = np.sqrt(2.0 * share) * np.cos(np.pi * (k + 1) * time)[terms.frame]
        for move in moves.T:
            value = shape * move
            mean = np.bincount(terms.term, weight * value, len(total)) / total
            score = weight * (value - mean[terms.term])
            of_states = np.bincount(terms.frame, score * jac[:, d], len(state))
            out.append(np.concatenate([score @ jac[:, :d], of_states]))
    return np.stack(out)


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
