"""Both kinds of joint fitted to moving tracks, and the evidence between them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recon.interaction.joints.bundle import ROUGHLY, Bundle, refine
from recon.interaction.joints.config import (
    CANDIDATES,
    FAR_SHARE,
    LIMIT_QUANTILE,
    MAX_RADIUS,
    MIN_TRACKS,
    MIN_TRAVEL,
    MOST_STEPS,
    MOVER_SIGMAS,
    SEARCH_SIGMA,
    SIGMA_FLOOR,
    Method,
    Search,
)
from recon.interaction.joints.hypotheses import Hypothesis, pair_hypotheses, travel_and_noise
from recon.interaction.joints.initial_states import states_of
from recon.interaction.joints.inliers import follows, track_support
from recon.interaction.joints.observations import KINDS, Kind, Model, Observations, residuals
from recon.interaction.joints.pose_graph.fit_tracks import pose_graph_of_tracks
from recon.interaction.joints.type_selection import TypeEvidence, delta_bic, truncated_chi2
from twin.errors import ReconstructionError
from twin.geometry import Array
from twin.runs.threads import each

_WIDEST = 2.0  # times the noise known beforehand (by us)
# times the greatest distance of a hinge: it is a slide's, however it is refined further (by us)
_TOO_FAR = 3.0

_WIDELY = Search()


@dataclass(frozen=True, eq=False)
class TrackFit:
    bundle: Bundle  # of the following tracks alone
    members: NDArray[np.bool_]  # which of the moving tracks follow

    def scale(self, noise: float) -> float:
        """Noise (m) that decides who follows: the measured one, but a fit that carries nothing well must not
        widen its own gate until everything follows."""
        return min(max(self.bundle.sigma, noise), _WIDEST * max(noise, SEARCH_SIGMA))


def movers(travel: Array, noise: float) -> NDArray[np.int64]:
    least = max(MIN_TRAVEL, MOVER_SIGMAS * noise)
    moving = np.flatnonzero(travel > least)
    if len(moving) < MIN_TRACKS:
        most = float(travel.max(initial=0.0))
        raise ReconstructionError(
            f"almost nothing moves: {len(moving)} of {len(travel)} tracks travel more than {least * 1e3:.0f} mm, "
            f"the farthest {most * 1e3:.1f} mm, with noise of {noise * 1e3:.1f} mm",
            "give the interval in which the part moves, or a recording with a longer motion",
        )
    return moving


def fit_kinds(
    obs: Observations,
    noise: float,
    method: Method = "bundle",
    search: Search = _WIDELY,
    kinds: Sequence[Kind] = KINDS,
) -> dict[Kind, TrackFit]:
    """The best joint of each kind on moving tracks; a kind that too few tracks follow is missing.

    noise: of one coordinate in metres. method: as `JointConfig.method`.
    """
    sigma = max(noise, SEARCH_SIGMA)
    candidates = _candidates(obs, sigma, search, kinds)
    settled = each(lambda model: _settle(obs, model, noise, sigma, method), candidates.values())
    return {kind: fit for kind, fit in zip(candidates, settled, strict=True) if fit is not None}


def _candidates(obs: Observations, sigma: float, search: Search, kinds: Sequence[Kind]) -> dict[Kind, Model]:
    """The joint of each kind that most tracks follow over the motion, refined on some of them."""
    rng = np.random.default_rng(0)
    travel, _ = travel_and_noise(obs)
    tracks = np.flatnonzero(travel >= FAR_SHARE * np.quantile(travel, 0.95))
    frames = np.arange(obs.weight.shape[1])
    if len(tracks) > search.tracks:
        tracks = np.sort(rng.choice(tracks, search.tracks, replace=False))
    if len(frames) > search.frames:
        frames = np.unique(np.linspace(0, len(frames) - 1, search.frames).astype(np.int64))
    some = obs.take(tracks)
    few = obs.take(tracks, frames)
    proposals = [h for h in pair_hypotheses(some, sigma, search.pairs, rng) if h.kind in kinds]
    _ = few.unrest, some.unrest  # found once, before the threads ask for them

    def score(joint: Hypothesis) -> float:
        model = Model(joint.kind, joint.axis, joint.pivot, states_of(few, joint, sigma, rounds=2))
        return float(track_support(few, model, sigma).sum())

    ranked = sorted(zip(each(score, proposals), proposals, strict=True), key=lambda row: -row[0])
    of_kind = [[h for worth, h in ranked if worth > 0 and h.kind == k][:CANDIDATES] for k in kinds]
    chosen = [h for joints in of_kind for h in joints]
    out: dict[Kind, tuple[float, Model]] = {}
    for support, model in each(lambda h: _first_refinement(some, h, sigma), chosen):
        if model.kind not in out or support > out[model.kind][0]:
            out[model.kind] = support, model
    return {kind: model for kind, (_, model) in out.items()}


def _first_refinement(obs: Observations, joint: Hypothesis, sigma: float) -> tuple[float, Model]:
    """Support and model of a hypothesis after a short refinement on the tracks that support it."""
    start = Model(joint.kind, joint.axis, joint.pivot, states_of(obs, joint, sigma))
    members = _supporters(obs, start, sigma)
    if members.sum() < MIN_TRACKS:
        return 0.0, start
    model = refine(obs.take(members), start, sigma, 8).model
    return float(track_support(obs, model, sigma).sum()), model


def _settle(obs: Observations, model: Model, noise: float, sigma: float, method: Method) -> TrackFit | None:
    """Refine, prune the tracks which do not follow, refine again; nothing when too few tracks follow."""
    members, far = _supporters(obs, model, sigma), _TOO_FAR * MAX_RADIUS
    scale = sigma
    fit: TrackFit | None = None
    for _ in range(6):
        if members.sum() < MIN_TRACKS:
            break
        bundle = refine(obs.take(members), model, scale, MOST_STEPS, ROUGHLY, far)
        fit, model = TrackFit(bundle, members), bundle.model
        scale = fit.scale(noise)
        again = follows(obs, model, scale)
        if np.array_equal(again, members):
            break
        members = again
    if fit is None:
        return None
    of_members = obs.take(fit.members)
    if method == "pose_graph":
        return TrackFit(pose_graph_of_tracks(of_members, fit.bundle.model, scale), fit.members)
    return TrackFit(refine(of_members, fit.bundle.model, scale, MOST_STEPS, farthest=far), fit.members)


def _supporters(obs: Observations, model: Model, sigma: float) -> NDArray[np.bool_]:
    """Tracks that follow; when a rough model carries too few, the quarter that follows best."""
    members = follows(obs, model, sigma)
    if members.sum() >= 2 * MIN_TRACKS:
        return members
    support = track_support(obs, model, sigma)
    least = max(MIN_TRACKS, len(support) // 4)
    return np.asarray(support >= max(float(np.sort(support)[-min(least, len(support))]), 1e-9))


def compare_kinds(obs: Observations, fits: dict[Kind, TrackFit]) -> TypeEvidence:
    """Compare both kinds on the tracks that either carries, each judged by the noise of the tighter one: a
    loose fit that follows much poorly must not outvote a joint that follows its part well."""
    tight = min(fit.bundle.sigma for fit in fits.values())
    gate = max(tight, SEARCH_SIGMA)
    carried = [follows(obs, fit.bundle.model, gate) for fit in fits.values()]
    union = np.logical_or.reduce(carried)
    shared = obs.take(union if union.any() else np.logical_or.reduce([fit.members for fit in fits.values()]))
    seen = shared.weight > 0
    sigma = max(SIGMA_FLOOR, tight)
    chi2: dict[str, float] = {}
    for kind, fit in fits.items():
        square, _, _ = residuals(shared, fit.bundle.model, sigma)
        chi2[kind] = truncated_chi2(square[seen], sigma)
    if "revolute" not in fits:
        return TypeEvidence(0.0, 0.0, float("inf"))
    hinge = fits["revolute"].bundle
    away = hinge.landmarks - hinge.model.pivot
    radius = float(
        np.median(np.linalg.norm(away - np.outer(away @ hinge.model.axis, hinge.model.axis), axis=1))
    )
    turned = float(np.ptp(np.quantile(hinge.model.state, [LIMIT_QUANTILE, 1 - LIMIT_QUANTILE])))
    if "prismatic" not in fits:
        return TypeEvidence(float("inf"), turned, radius)
    dbic = delta_bic(chi2["prismatic"], chi2["revolute"], 3 * int(seen.sum()))
    return TypeEvidence(dbic, turned, radius)


def agreeing_rms(bundle: Bundle) -> float:
    """RMS residual (m) over the observations within 3 sigma of their landmark."""
    r = bundle.residual[np.isfinite(bundle.residual)]
    agreeing = r[r <= 3.0 * np.sqrt(3.0) * bundle.sigma]
    return float(np.sqrt(np.mean(agreeing**2))) if agreeing.size else 0.0
