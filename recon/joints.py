"""Joint and motion of one part, from 3D tracks (`fit_motion`) or from its own poses (`fit_motion_poses`).

Tracks may hold what a real recording holds: mostly static background, drifting tracks, single wild observations and a
hand that moves along with the part without being rigid with it. Motions between pairs of frames propose joints, the
joint that most tracks follow over the whole motion is refined by a robust bundle (`recon.track_bundle`), and the type is
decided by evidence (`recon.joint_type`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from recon.joint_config import JointConfig
from recon.joint_type import TypeEvidence, decide, delta_bic, truncated_chi2
from recon.motion_fit import MotionFit
from recon.motion_frame import Oriented, orient
from recon.pose_fit import fit_motion_poses
from recon.track_bundle import Bundle, Kind, Model, Observations, refine, residuals
from recon.track_start import (
    Hypothesis,
    follows,
    pair_hypotheses,
    states_of,
    track_support,
    travel_and_noise,
)
from twin import geometry as geo
from twin.errors import InputError, ReconstructionError
from twin.geometry import Array

__all__ = ["JointConfig", "MotionFit", "TypeEvidence", "fit_motion", "fit_motion_poses"]


_DEFAULT = JointConfig()


def fit_motion(
    points_world: ArrayLike,
    visible: ArrayLike,
    *,
    config: JointConfig = _DEFAULT,
    joint_type: Kind | None = None,
    confidence: ArrayLike | None = None,
) -> MotionFit:
    """Fit a joint to 3D tracks in the world frame.

    Args:
        points_world: (T, K, 3) m, NaN where not visible. visible: (T, K) bool. confidence: (T, K), not negative, weighs
            observations. joint_type: take this type instead of deciding it.
    Raises:
        InputError: shapes do not match. ReconstructionError: nothing moves, or no joint explains what moves.
    """
    points, seen, trust = _checked(points_world, visible, confidence)
    everything = Observations.of(points, seen, trust)
    travel, noise = travel_and_noise(everything)
    moving = _movers(travel, noise, config)
    obs = everything.take(moving)
    sigma = max(noise, config.search_sigma)
    candidates = _candidates(obs, sigma, config)
    settled = {kind: _settle(obs, model, noise, sigma, config) for kind, model in candidates.items()}
    fits = {kind: fit for kind, fit in settled.items() if fit is not None}
    if not fits:
        raise ReconstructionError(
            f"{len(moving)} tracks move but no slide or hinge carries {config.min_tracks} of them together",
            "check that the interval holds one part's motion, or cluster the tracks first",
        )
    evidence = _evidence(obs, fits, config)
    if joint_type is None:
        kind, source = decide(evidence, config)
    else:
        kind, source = joint_type, "given"
    if kind not in fits:
        raise ReconstructionError(
            f"no {kind} joint explains the moving tracks", "let the type be decided from the motion"
        )
    return _motion_fit(fits[kind], moving, everything, evidence, source, config)


@dataclass(frozen=True, eq=False)
class _Fit:
    bundle: Bundle  # of the following tracks alone
    members: NDArray[np.bool_]  # which of the moving tracks follow


def _checked(
    points: ArrayLike, visible: ArrayLike, confidence: ArrayLike | None
) -> tuple[Array, Any, Array | None]:
    p, v = geo.as_float(points), np.asarray(visible, dtype=bool)
    if p.ndim != 3 or p.shape[2] != 3 or p.shape[:2] != v.shape:
        raise InputError(
            f"tracks need points (T, K, 3) and visible (T, K), got {p.shape} and {v.shape}",
            "put frames first, tracks second",
        )
    if np.isinf(p).any():
        raise InputError("track points hold infinite values", "mark them as not visible")
    if confidence is None:
        return p, v, None
    c = geo.as_float(confidence)
    if c.shape != v.shape:
        raise InputError(f"confidence needs the shape of visible {v.shape}, got {c.shape}")
    return p, v, c


def _movers(travel: Array, noise: float, config: JointConfig) -> NDArray[np.int64]:
    least = max(config.min_travel, config.mover_sigmas * noise)
    moving = np.flatnonzero(travel > least)
    if len(moving) < config.min_tracks:
        most = float(travel.max(initial=0.0))
        raise ReconstructionError(
            f"almost nothing moves: {len(moving)} of {len(travel)} tracks travel more than {least * 1e3:.0f} mm, "
            f"the farthest {most * 1e3:.1f} mm, with noise of {noise * 1e3:.1f} mm",
            "give the interval in which the part moves, or a recording with a longer motion",
        )
    return moving


def _candidates(obs: Observations, sigma: float, config: JointConfig) -> dict[Kind, Model]:
    """The joint of each kind that most tracks follow over the whole motion, refined on a part of the tracks."""
    rng = np.random.default_rng(config.seed)
    tracks, frames = np.arange(len(obs.points)), np.arange(obs.weight.shape[1])
    if len(tracks) > config.search_tracks:
        tracks = np.sort(rng.choice(tracks, config.search_tracks, replace=False))
    if len(frames) > config.search_frames:
        frames = np.unique(np.linspace(0, len(frames) - 1, config.search_frames).astype(np.int64))
    some = obs.take(tracks)
    few = obs.take(tracks, frames)
    proposals = pair_hypotheses(some, sigma, config, rng)
    out: dict[Kind, Model] = {}
    kinds: tuple[Kind, Kind] = ("prismatic", "revolute")
    for kind in kinds:
        scored: list[tuple[float, Hypothesis]] = []
        for joint in (h for h in proposals if h.kind == kind):
            model = Model(joint.kind, joint.axis, joint.pivot, states_of(few, joint, sigma, rounds=2))
            scored.append((float(track_support(few, model, sigma, config).sum()), joint))
        scored.sort(key=lambda row: -row[0])
        refined = [
            _first_refinement(some, h, sigma, config) for score, h in scored[: config.candidates] if score > 0
        ]
        best = max(refined, key=lambda row: row[0], default=None)
        if best is not None:
            out[kind] = best[1]
    return out


def _first_refinement(
    obs: Observations, joint: Hypothesis, sigma: float, config: JointConfig
) -> tuple[float, Model]:
    """Support and model of a hypothesis after a short refinement on the tracks that support it."""
    start = Model(joint.kind, joint.axis, joint.pivot, states_of(obs, joint, sigma))
    members = _supporters(obs, start, sigma, config)
    if members.sum() < config.min_tracks:
        return 0.0, start
    model = refine(obs.take(members), start, sigma, 8).model
    return float(track_support(obs, model, sigma, config).sum()), model


def _settle(obs: Observations, model: Model, noise: float, sigma: float, config: JointConfig) -> _Fit | None:
    """Refine, prune the tracks which do not follow, refine again; nothing when too few tracks follow."""
    members = _supporters(obs, model, sigma, config)
    scale = sigma
    fit: _Fit | None = None
    for _ in range(6):
        if members.sum() < config.min_tracks:
            return fit
        bundle = refine(obs.take(members), model, scale, config.iterations)
        fit, model = _Fit(bundle, members), bundle.model
        scale = max(bundle.sigma, noise)
        again = follows(obs, model, scale, config)
        if np.array_equal(again, members):
            break
        members = again
    return fit


def _supporters(obs: Observations, model: Model, sigma: float, config: JointConfig) -> NDArray[np.bool_]:
    """Tracks that follow; when a rough model carries too few, the quarter that follows best."""
    members = follows(obs, model, sigma, config)
    if members.sum() >= 2 * config.min_tracks:
        return members
    support = track_support(obs, model, sigma, config)
    least = max(config.min_tracks, len(support) // 4)
    return np.asarray(support >= max(float(np.sort(support)[-min(least, len(support))]), 1e-9))


def _evidence(obs: Observations, fits: dict[Kind, _Fit], config: JointConfig) -> TypeEvidence:
    """Compare both kinds on the tracks that either of them carries."""
    union = np.logical_or.reduce([fit.members for fit in fits.values()])
    shared = obs.take(union)
    seen = shared.weight > 0
    sigma = max(config.sigma_floor, min(fit.bundle.sigma for fit in fits.values()))
    chi2: dict[str, float] = {}
    rms: dict[str, float] = {}
    for kind, fit in fits.items():
        square, _, _ = residuals(shared, fit.bundle.model, sigma)
        chi2[kind] = truncated_chi2(square[seen], sigma)
        rms[kind] = _rms(fit.bundle)
    if "revolute" not in fits:
        return TypeEvidence(0.0, 0.0, float("inf"), rms["prismatic"], rms["prismatic"])
    hinge = fits["revolute"].bundle
    away = hinge.landmarks - hinge.model.pivot
    radius = float(
        np.median(np.linalg.norm(away - np.outer(away @ hinge.model.axis, hinge.model.axis), axis=1))
    )
    turned = float(np.ptp(np.quantile(hinge.model.state, [config.limit_quantile, 1 - config.limit_quantile])))
    if "prismatic" not in fits:
        return TypeEvidence(float("inf"), turned, radius, float("inf"), rms["revolute"])
    dbic = delta_bic(chi2["prismatic"], chi2["revolute"], 3 * int(seen.sum()))
    return TypeEvidence(dbic, turned, radius, rms["prismatic"], rms["revolute"])


def _rms(bundle: Bundle) -> float:
    """RMS residual (m) over the observations within 3 sigma of their landmark."""
    r = bundle.residual[np.isfinite(bundle.residual)]
    agreeing = r[r <= 3.0 * np.sqrt(3.0) * bundle.sigma]
    return float(np.sqrt(np.mean(agreeing**2))) if agreeing.size else 0.0


def _motion_fit(
    fit: _Fit,
    moving: NDArray[np.int64],
    everything: Observations,
    evidence: TypeEvidence,
    source: str,
    config: JointConfig,
) -> MotionFit:
    bundle = fit.bundle
    r = bundle.residual
    agree = r <= 3.0 * np.sqrt(3.0) * bundle.sigma  # NaN compares false
    frames = np.flatnonzero(agree.sum(axis=0) >= config.min_observations)
    if len(frames) < 2:
        raise ReconstructionError(
            f"only {len(frames)} frames show {config.min_observations} tracks of the part",
            "give longer tracks",
        )
    oriented: Oriented = orient(bundle.model, bundle.covariance, frames, config.limit_quantile)
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
        residual=_rms(bundle),
        inliers=float(agree.sum()) / max(moved, 1),
        track_inliers=inlier,
        landmarks=landmarks,
        evidence=evidence,
        type_source=source,
    )
