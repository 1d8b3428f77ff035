"""Both kinds of joint fitted to moving tracks, and the evidence between them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recon.joints.bundle import ROUGHLY, Bundle, refine
from recon.joints.config import MOST_STEPS, JointConfig
from recon.joints.hypotheses import Hypothesis, pair_hypotheses, travel_and_noise
from recon.joints.initial_states import states_of
from recon.joints.inliers import follows, track_support
from recon.joints.observations import KINDS, Kind, Model, Observations, residuals
from recon.joints.pose_graph.fit_tracks import pose_graph_of_tracks
from recon.joints.type_selection import TypeEvidence, delta_bic, truncated_chi2
from twin.errors import ReconstructionError
from twin.geometry import Array
from twin.runs.threads import each

_WIDEST = 2.0  # times the noise known beforehand (by us)
_TOO_FAR = (
    3.0  # times the greatest distance of a hinge: it is a slide's, however it is refined further (by us)
)


@dataclass(frozen=True, eq=False)
class TrackFit:
    bundle: Bundle  # of the following tracks alone
    members: NDArray[np.bool_]  # which of the moving tracks follow

    def scale(self, noise: float, config: JointConfig) -> float:
        """Noise (m) that decides who follows: the measured one, but a fit that carries nothing well must not widen its
        own gate until everything follows."""
        return min(max(self.bundle.sigma, noise), _WIDEST * max(noise, config.search_sigma))


def movers(travel: Array, noise: float, config: JointConfig) -> NDArray[np.int64]:
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


def fit_kinds(
    obs: Observations, noise: float, config: JointConfig, kinds: Sequence[Kind] = KINDS
) -> dict[Kind, TrackFit]:
    """The best joint of each kind on moving tracks; a kind that too few tracks follow is missing.

    noise: of one coordinate in metres.
    """
    sigma = max(noise, config.search_sigma)
    candidates = _candidates(obs, sigma, config, kinds)
    settled = each(lambda model: _settle(obs, model, noise, sigma, config), candidates.values())
    return {kind: fit for kind, fit in zip(candidates, settled, strict=True) if fit is not None}


def _candidates(
    obs: Observations, sigma: float, config: JointConfig, kinds: Sequence[Kind]
) -> dict[Kind, Model]:
    """The joint of each kind that most tracks follow over the whole motion, refined on a part of the tracks."""
    rng = np.random.default_rng(config.seed)
    travel, _ = travel_and_noise(obs)
    tracks = np.flatnonzero(travel >= config.far_share * np.quantile(travel, 0.95))
    frames = np.arange(obs.weight.shape[1])
    if len(tracks) > config.search_tracks:
        tracks = np.sort(rng.choice(tracks, config.search_tracks, replace=False))
    if len(frames) > config.search_frames:
        frames = np.unique(np.linspace(0, len(frames) - 1, config.search_frames).astype(np.int64))
    some = obs.take(tracks)
    few = obs.take(tracks, frames)
    proposals = [h for h in pair_hypotheses(some, sigma, config, rng) if h.kind in kinds]
    _ = few.unrest, some.unrest  # found once, before the threads ask for them

    def score(joint: Hypothesis) -> float:
        model = Model(joint.kind, joint.axis, joint.pivot, states_of(few, joint, sigma, rounds=2))
        return float(track_support(few, model, sigma, config).sum())

    ranked = sorted(zip(each(score, proposals), proposals, strict=True), key=lambda row: -row[0])
    of_kind = [[h for worth, h in ranked if worth > 0 and h.kind == k][: config.candidates] for k in kinds]
    chosen = [h for joints in of_kind for h in joints]
    out: dict[Kind, tuple[float, Model]] = {}
    for support, model in each(lambda h: _first_refinement(some, h, sigma, config), chosen):
        if model.kind not in out or support > out[model.kind][0]:
            out[model.kind] = support, model
    return {kind: model for kind, (_, model) in out.items()}


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


def _settle(
    obs: Observations, model: Model, noise: float, sigma: float, config: JointConfig
) -> TrackFit | None:
    """Refine, prune the tracks which do not follow, refine again; nothing when too few tracks follow."""
    members, far = _supporters(obs, model, sigma, config), _TOO_FAR * config.max_radius
    scale = sigma
    fit: TrackFit | None = None
    for _ in range(6):
        if members.sum() < config.min_tracks:
            break
        bundle = refine(obs.take(members), model, scale, MOST_STEPS, ROUGHLY, far)
        fit, model = TrackFit(bundle, members), bundle.model
        scale = fit.scale(noise, config)
        again = follows(obs, model, scale, config)
        if np.array_equal(again, members):
            break
        members = again
    if fit is None:
        return None
    of_members = obs.take(fit.members)
    if config.method == "pose_graph":
        return TrackFit(pose_graph_of_tracks(of_members, fit.bundle.model, scale), fit.members)
    return TrackFit(refine(of_members, fit.bundle.model, scale, MOST_STEPS, farthest=far), fit.members)


def _supporters(obs: Observations, model: Model, sigma: float, config: JointConfig) -> NDArray[np.bool_]:
    """Tracks that follow; when a rough model carries too few, the quarter that follows best."""
    members = follows(obs, model, sigma, config)
    if members.sum() >= 2 * config.min_tracks:
        return members
    support = track_support(obs, model, sigma, config)
    least = max(config.min_tracks, len(support) // 4)
    return np.asarray(support >= max(float(np.sort(support)[-min(least, len(support))]), 1e-9))


def compare_kinds(obs: Observations, fits: dict[Kind, TrackFit], config: JointConfig) -> TypeEvidence:
    """Compare both kinds on the tracks that either carries, each judged by the noise of the tighter one: a loose fit
    that follows much poorly must not outvote a joint that follows its part well."""
    tight = min(fit.bundle.sigma for fit in fits.values())
    gate = max(tight, config.search_sigma)
    carried = [follows(obs, fit.bundle.model, gate, config) for fit in fits.values()]
    union = np.logical_or.reduce(carried)
    shared = obs.take(union if union.any() else np.logical_or.reduce([fit.members for fit in fits.values()]))
    seen = shared.weight > 0
    sigma = max(config.sigma_floor, tight)
    chi2: dict[str, float] = {}
    rms: dict[str, float] = {}
    for kind, fit in fits.items():
        square, _, _ = residuals(shared, fit.bundle.model, sigma)
        chi2[kind] = truncated_chi2(square[seen], sigma)
        rms[kind] = agreeing_rms(fit.bundle)
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


def agreeing_rms(bundle: Bundle) -> float:
    """RMS residual (m) over the observations within 3 sigma of their landmark."""
    r = bundle.residual[np.isfinite(bundle.residual)]
    agreeing = r[r <= 3.0 * np.sqrt(3.0) * bundle.sigma]
    return float(np.sqrt(np.mean(agreeing**2))) if agreeing.size else 0.0
