"""Joint and motion of one part, from 3D tracks (`fit_motion`) or from its own poses (`fit_motion_poses`).

Tracks may hold what a real recording holds: mostly static background, drifting tracks, single wild
observations and a hand that moves along with the part without being rigid with it. Motions between pairs of
frames propose joints, the joint that most tracks follow over the whole motion is refined by a robust bundle
(`joints.bundle`), and the type is decided by evidence (`joints.type_selection`).

FunREC, supplement 3.2: hypotheses from pairs of tracks in place of single ones.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from recon.interaction.joints.candidates import TrackFit, agreeing_rms, compare_kinds, fit_kinds, movers
from recon.interaction.joints.config import (
    LIMIT_QUANTILE,
    MIN_OBSERVATIONS,
    MIN_SHARE,
    MIN_TRACKS,
    JointConfig,
)
from recon.interaction.joints.hypotheses import travel_and_noise
from recon.interaction.joints.observations import KINDS, Kind, Observations
from recon.interaction.joints.pose_graph.fit_poses import fit_motion_poses
from recon.interaction.joints.result import MotionFit
from recon.interaction.joints.sign_and_limits import orient
from recon.interaction.joints.track_axes import first_axis
from recon.interaction.joints.type_selection import TypeEvidence, TypeHint, decide, hint_about
from twin import geometry as geo
from twin.errors import InputError, ReconstructionError
from twin.geometry import Array

__all__ = ["JointConfig", "MotionFit", "TypeEvidence", "fit_motion", "fit_motion_poses"]

_DEFAULT = JointConfig()


def fit_motion(
    points_world: ArrayLike,
    visible: ArrayLike | None = None,
    *,
    config: JointConfig = _DEFAULT,
    joint_type: Kind | None = None,
    confidence: ArrayLike | None = None,
    hints: Sequence[TypeHint] = (),
) -> MotionFit:
    """Fit a joint to 3D tracks in the world frame.

    Args:
        points_world: (T, K, 3) m, frames first, NaN where not visible. Tracks first (K, T, 3) are turned,
            with a warning, where the motion itself leaves no doubt.
        visible: (T, K) bool; None takes every point that is finite.
        confidence: (T, K), not negative, weighs observations.
        joint_type: take this type instead of deciding it.
        hints: may tip what the motion leaves open.

    Raises:
        InputError: shapes do not match, or it can't be told which axis counts the frames.
        ReconstructionError: nothing moves, or no joint explains what moves.
    """
    points, seen, trust = _checked(points_world, visible, confidence)
    everything = Observations.of(points, seen, trust)
    moving, fits = _fits(everything, KINDS, config)
    if fits:
        evidence = compare_kinds(everything.take(moving), fits)
        tightest = min(fits.values(), key=lambda f: f.bundle.sigma)
        hint = hint_about(hints, tightest.bundle.model.state)
        kind, source = decide(evidence, hint) if joint_type is None else (joint_type, "given")
    if not fits or kind not in fits:
        raise _none_carries(joint_type or "slide or hinge", moving)
    return _motion_fit(fits[kind], moving, everything, evidence, source)


def fit_again(
    fit: MotionFit, points_world: Array, visible: NDArray[np.bool_], config: JointConfig = _DEFAULT
) -> MotionFit:
    """The joint of a fit's type on other tracks, (T, K, 3) m and (T, K); what told the type stays with it.

    Raises ReconstructionError: nothing moves, or no such joint explains what moves.
    """
    everything, kind = Observations.of(points_world, visible), fit.joint.kind
    moving, fits = _fits(everything, (kind,), config)
    if kind not in fits:
        raise _none_carries(kind, moving)
    return _motion_fit(fits[kind], moving, everything, fit.evidence, fit.type_source)


def _fits(
    everything: Observations, kinds: Sequence[Kind], config: JointConfig
) -> tuple[NDArray[np.int64], dict[Kind, TrackFit]]:
    """Which tracks move, and the joint of each kind that enough of them follow."""
    travel, noise = travel_and_noise(everything)
    moving = movers(travel, noise)
    fits = fit_kinds(everything.take(moving), noise, config.method, kinds=kinds)
    least = _least(moving)
    return moving, {kind: fit for kind, fit in fits.items() if fit.members.sum() >= least}


def _least(moving: NDArray[np.int64]) -> int:
    return max(MIN_TRACKS, int(MIN_SHARE * len(moving)))


def _none_carries(joint: str, moving: NDArray[np.int64]) -> ReconstructionError:
    return ReconstructionError(
        f"{len(moving)} tracks move but no {joint} carries {_least(moving)} of them together",
        "check that the interval holds one part's motion, or cluster the tracks first",
    )


def _checked(
    points: ArrayLike, visible: ArrayLike | None, confidence: ArrayLike | None
) -> tuple[Array, Any, Array | None]:
    p = geo.as_float(points)
    _check_axes(p)
    v = np.isfinite(p).all(axis=-1) if visible is None else np.asarray(visible, dtype=bool)
    if p.shape[:2] != v.shape:
        turned = v.shape == p.shape[1::-1]
        raise InputError(
            f"tracks need points (T, K, 3) and visible (T, K), got {p.shape} and {v.shape}",
            "turn one of them: frames come first in both" if turned else "put frames first, tracks second",
        )
    if np.isinf(p).any():
        raise InputError("track points hold infinite values", "mark them as not visible")
    c = None if confidence is None else geo.as_float(confidence)
    if c is not None and c.shape != v.shape:
        raise InputError(f"confidence needs the shape of visible {v.shape}, got {c.shape}")
    order = first_axis(p)
    if order == "tracks":
        warnings.warn(
            f"points {p.shape} have their tracks first: taken as {p.shape[1]} frames of {p.shape[0]} tracks",
            stacklevel=3,
        )
        return p.swapaxes(0, 1), v.T, None if c is None else c.T
    if order == "unclear" and visible is None:
        raise InputError(
            f"points {p.shape} may be frames of tracks or tracks of frames: neighbours on the second axis are nearer",
            "give visible too, np.isfinite(points).all(-1), when frames come first; else points.swapaxes(0, 1)",
        )
    return p, v, c


def _check_axes(p: Array) -> None:
    """Raise InputError unless points have shape (T, K, 3)."""
    if p.ndim == 3 and p.shape[2] == 3:
        return
    remedy = "put frames first, tracks second, and x, y, z last"
    if p.ndim == 3 and p.shape.count(3) == 1:
        remedy = f"put x, y, z last: np.moveaxis(points, {p.shape.index(3)}, -1)"
    raise InputError(f"tracks need points (T, K, 3), got {p.shape}", remedy)


def _motion_fit(
    fit: TrackFit,
    moving: NDArray[np.int64],
    everything: Observations,
    evidence: TypeEvidence,
    source: str,
) -> MotionFit:
    bundle = fit.bundle
    r = bundle.residual
    agree = r <= 3.0 * np.sqrt(3.0) * bundle.sigma  # NaN compares false
    frames = np.flatnonzero(agree.sum(axis=0) >= MIN_OBSERVATIONS)
    if len(frames) < 2:
        raise ReconstructionError(
            f"only {len(frames)} frames show {MIN_OBSERVATIONS} tracks of the part",
            "give longer tracks",
        )
    oriented = orient(bundle.model, bundle.covariance, frames, LIMIT_QUANTILE)
    inlier = np.zeros(len(everything.points), dtype=bool)
    inlier[moving[fit.members]] = True
    landmarks = np.full((len(inlier), 3), np.nan)
    landmarks[inlier] = geo.transform(
        replace(oriented.joint, covariance=None).pose(oriented.shift), bundle.landmarks
    )
    moved = int((everything.weight[moving] > 0).sum())
    return MotionFit(
        joint=oriented.joint,
        frames=frames.astype(np.int64),
        state=oriented.state,
        state_sigma=oriented.state_sigma,
        residual=agreeing_rms(bundle),
        inliers=float(agree.sum()) / max(moved, 1),
        track_inliers=inlier,
        landmarks=landmarks,
        evidence=evidence,
        type_source=source,
    )
