"""Articulation-aware clustering: which tracks move together by one joint. Nothing assumes one part.

As in the paper: tracks that travel, a line or an arc for each, density clusters (HDBSCAN) over the joints
that these speak for. A single noisy track pins its joint down badly, so clusters are only seeds here: a joint
is fitted to each, every track that follows that joint rigidly joins, and the rest is searched for joints.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from recon.interaction.joints.candidates import TrackFit, compare_kinds, fit_kinds
from recon.interaction.joints.clustering.line_arc import track_shapes
from recon.interaction.joints.config import (
    LIMIT_QUANTILE,
    MIN_OBSERVATIONS,
    MOVER_SIGMAS,
    PRUNE_SIGMAS,
    SEARCH_SIGMA,
    Method,
    Search,
)
from recon.interaction.joints.hypotheses import travel_and_noise
from recon.interaction.joints.inliers import follows, predicted_travel, row_medians
from recon.interaction.joints.observations import Kind, Model, Observations, residuals
from recon.interaction.joints.sign_and_limits import orient
from recon.interaction.joints.type_selection import decide
from twin import geometry as geo
from twin.errors import MissingDependencyError
from twin.packages import to_install
from twin.robust import LENGTH3_MEDIAN
from twin.runs.setting import Settings, setting
from twin.scene import Prismatic, Revolute


@dataclass(frozen=True)
class ClusterConfig(Settings):
    """Density clusters over joints; chosen by us unless a setting says otherwise."""

    eps_s: float = setting(
        0.01,
        "least travel of a moving track (the paper's); noise widens it to 5 standard deviations",
        unit="m",
        above=0,
    )
    eps_f: float = setting(
        0.01,
        "greatest error of its line or arc (the paper's); noise widens it to 2.5 standard deviations",
        unit="m",
        above=0,
    )
    min_share: float = setting(
        0.05, "a part has at least this share of the moving tracks", unit="", at_least=0, below=1
    )
    min_size: int = setting(6, "and this many", unit="tracks", at_least=4)
    max_parts: int = setting(8, "most clusters sought", unit="parts", at_least=1)


_DEFAULT = ClusterConfig()
# The joint of a cluster only finds members: a part's own fit is finer. Chosen by us, for speed.
_COARSE = Search(pairs=24, tracks=150, frames=40)


@dataclass(frozen=True, eq=False)
class Cluster:
    """Tracks that one joint carries: members (K,) bool, kind, the joint found with them (state 0 at the first
    frames, no covariance), score: summed path of the members in metres, by which clusters are sorted."""

    members: NDArray[np.bool_]
    kind: Kind
    joint: Prismatic | Revolute
    score: float


def cluster_tracks(
    points_world: ArrayLike,
    visible: ArrayLike,
    *,
    config: ClusterConfig = _DEFAULT,
    method: Method = "bundle",
) -> list[Cluster]:
    """Clusters of tracks, best first; empty when nothing moves.

    Args:
        points_world: (T, K, 3) m, NaN where not visible.
        visible: (T, K) bool.
        method: as `JointConfig.method`.

    Raises MissingDependencyError without scikit-learn.
    """
    points, seen = geo.as_float(points_world), np.asarray(visible, dtype=bool)
    everything = Observations.of(points, seen)
    travel, noise = travel_and_noise(everything)
    moving = np.flatnonzero(travel > max(config.eps_s, MOVER_SIGMAS * noise))
    least = max(config.min_size, int(np.ceil(config.min_share * len(moving))))
    if len(moving) < least:
        return []
    obs = everything.take(moving)
    free = np.ones(len(moving), dtype=bool)
    found: list[Cluster] = []
    seeds = [*_seeds(obs, noise, least, config), None]
    while seeds and len(found) < config.max_parts:
        seed = seeds[0]
        cluster = _grow(obs, free if seed is None else free & seed, free, noise, least, method)
        if cluster is None:
            seeds.pop(0)
            continue
        members, fit = cluster
        free &= ~_explained(obs, fit, noise)
        full = np.zeros(seen.shape[1], dtype=bool)
        full[moving[members]] = True
        found.append(_cluster(full, obs.take(members), fit))
    return sorted(found, key=lambda c: -c.score)


def _seeds(obs: Observations, noise: float, least: int, config: ClusterConfig) -> list[NDArray[np.bool_]]:
    """Density clusters over the joints of single tracks, largest first."""
    shapes = track_shapes(obs, max(noise, SEARCH_SIGMA))
    fitted = np.flatnonzero(shapes.error < max(config.eps_f, 2.5 * noise))
    if len(fitted) < least:
        return []
    labels = require_hdbscan()(min_cluster_size=least, allow_single_cluster=True, copy=True).fit_predict(
        shapes.screw[fitted]
    )
    out: list[NDArray[np.bool_]] = []
    for label in range(labels.max() + 1):
        mask = np.zeros(len(shapes.error), dtype=bool)
        mask[fitted[labels == label]] = True
        out.append(mask)
    return sorted(out, key=lambda m: -int(m.sum()))


def _grow(
    obs: Observations,
    seed: NDArray[np.bool_],
    free: NDArray[np.bool_],
    noise: float,
    least: int,
    method: Method,
) -> tuple[NDArray[np.bool_], TrackFit] | None:
    """Fit the seed's joint and take every free track that follows it; nothing when too few do."""
    if seed.sum() < least:
        return None
    fits = fit_kinds(obs.take(seed), noise, method, _COARSE)
    if not fits:
        return None
    kind, _ = decide(compare_kinds(obs.take(seed), fits))
    fit = fits.get(kind) or next(iter(fits.values()))
    members = follows(obs, fit.bundle.model, fit.scale(noise)) & free
    return (members, fit) if members.sum() >= least else None


def _explained(obs: Observations, fit: TrackFit, noise: float) -> NDArray[np.bool_]:
    """Tracks that need no joint of their own: they follow, or stay near a follower (a hand on the handle)."""
    sigma = max(fit.scale(noise), SEARCH_SIGMA)
    square, _, _ = residuals(obs, fit.bundle.model, sigma)
    return np.asarray(np.sqrt(row_medians(square, obs.weight)) < PRUNE_SIGMAS * LENGTH3_MEDIAN * sigma)


def _cluster(full: NDArray[np.bool_], obs: Observations, fit: TrackFit) -> Cluster:
    model: Model = fit.bundle.model
    _, _, marks = residuals(obs, model, max(fit.bundle.sigma, 1e-5))
    score = float(predicted_travel(obs, model, marks).sum())
    frames = np.flatnonzero((obs.weight > 0).sum(0) >= MIN_OBSERVATIONS)
    oriented = orient(model, fit.bundle.covariance, frames, LIMIT_QUANTILE)
    joint = replace(oriented.joint, covariance=None, sigma=None)
    return Cluster(full, model.kind, joint, score)


def require_hdbscan() -> Any:
    """The density clustering. Raises MissingDependencyError without scikit-learn."""
    try:
        from sklearn.cluster import HDBSCAN
    except ImportError as e:
        raise MissingDependencyError(
            f"clusters of tracks need scikit-learn, which can't be imported ({e})",
            to_install("scikit-learn", "clustering"),
        ) from None
    return HDBSCAN
