"""Settings of the joint fit, each with the source of its default."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from twin.errors import ConfigError


@dataclass(frozen=True)
class JointConfig:
    """How tracks or poses become a joint.

    method: what tells the joint of a group of tracks and its states: "bundle", bundle adjustment of the tracks, or "pose_graph",
        the paper's part-pose graph over relative motions between frames.
    min_travel: m, a track that moves less is at rest (the paper's eps_s).
    mover_sigmas: a track must move more than this many noise standard deviations to vote (measured: the type rule
        holds on every real and synthetic track once those under 5 are dropped).
    sigma_floor, sigma_floor_rad: m and rad, the least noise the type rule assumes; marker rigs and depth cameras are
        never better than this once the part flexes (measured on real kitchen tracks).
    min_delta_bic, min_range, max_radius: a joint is revolute only with this much evidence, over at least this range
        (rad) and with at most this radius (m). The range limit between 2 and 20 degrees is not chosen by any data we
        have; the user can name the type.
    search_sigma: m, least noise while searching; 3 of it are about the paper's eps_f = 0.01 m. The refinement measures
        the noise itself.
    far_share: hypotheses come from tracks that travel this share of the farthest (95th percentile): on real recordings
        half of what moves a little is background that drifts along an edge, and at any moment most of it rests (by us).
    pair_gaps, pairs, samples: frame distances, number of frame pairs and triples a pair of the motion search (by us).
    candidates: hypotheses of each type that are refined (by us).
    search_tracks, search_frames: most tracks and frames on which hypotheses are compared (by us, for speed).
    prune_sigmas: a track whose median residual exceeds that of pure noise by this factor does not follow the joint.
    limit_quantile: limits are the quantiles q and 1 - q of the smoothed state, since min and max grow with the noise.
    min_tracks, min_share, min_observations: fewest tracks of a part, least share of what moves, fewest observations for a frame's state (by us).
    iterations: most Gauss-Newton steps a refinement takes (by us; it stops when the step is negligible).
    seed: of the random samples.
    """

    method: Literal["bundle", "pose_graph"] = "bundle"
    min_travel: float = 0.01
    mover_sigmas: float = 5.0
    sigma_floor: float = 0.005
    sigma_floor_rad: float = float(np.radians(3.0))
    min_delta_bic: float = 20.0
    min_range: float = float(np.radians(3.0))
    max_radius: float = 3.0
    search_sigma: float = 0.003
    far_share: float = 0.3
    pair_gaps: tuple[int, ...] = (8, 12, 16, 24, 32, 48, 64)
    pairs: int = 48
    samples: int = 96
    candidates: int = 3
    search_tracks: int = 300
    search_frames: int = 60
    prune_sigmas: float = 3.0
    limit_quantile: float = 0.02
    min_tracks: int = 4
    min_share: float = 0.05
    min_observations: int = 3
    iterations: int = 30
    seed: int = 0

    def __post_init__(self) -> None:
        for name in (
            "min_travel",
            "mover_sigmas",
            "sigma_floor",
            "sigma_floor_rad",
            "max_radius",
            "prune_sigmas",
            "search_sigma",
        ):
            value = getattr(self, name)
            if not (np.isfinite(value) and value > 0):
                raise ConfigError(f"joints: {name} must be positive, got {value!r}")
        for name in ("pairs", "samples", "candidates", "search_tracks", "search_frames", "iterations"):
            if getattr(self, name) < 1:
                raise ConfigError(f"joints: {name} must be at least 1, got {getattr(self, name)!r}")
        if self.min_tracks < 3:
            raise ConfigError(
                f"joints: min_tracks must be at least 3, got {self.min_tracks}", "a rigid motion needs 3"
            )
        for name in ("min_share", "far_share"):
            if not 0 <= getattr(self, name) < 1:
                raise ConfigError(f"joints: {name} must be in 0..1, got {getattr(self, name)!r}")
        if not 0 <= self.limit_quantile < 0.5:
            raise ConfigError(f"joints: limit_quantile must be in 0..0.5, got {self.limit_quantile}")
        if not self.pair_gaps or min(self.pair_gaps) < 1:
            raise ConfigError(
                f"joints: pair_gaps must be frame distances of at least 1, got {self.pair_gaps}"
            )
