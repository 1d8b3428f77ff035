"""Settings of finding parts among tracks, each with the source of its default."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from recon.joints.clustering.clusters import ClusterConfig
from recon.motion.intervals import IntervalConfig
from recon.parts.hand_tracks import HandColorConfig
from twin.errors import ConfigError


@dataclass(frozen=True)
class MotionConfig:
    """Finding parts among tracks. Chosen by us unless the comment says otherwise.

    method: how tracks are told apart that move by different joints: "fits", each joint fitted to all that no earlier one
    explains, or "clusters", the paper's motion clustering (needs the extra `clustering`).
    far_share: tracks that travel less than this share of the farthest travelling ones (95th percentile) wait for the
    last fits. rest_tolerance: m, a track of the part stays within it while the part rests. min_tracks, min_share: a
    further part needs that many tracks, and that share of the first part's. min_travel: m, its tracks' median path.
    max_residual: m, RMS that its fit may leave. max_looseness: most times the RMS of the first part, which the same camera
    sees. max_moving_share: of the frames that see it, those in which it moves.
    max_axis_sigma: rad, uncertainty of its axis. same_axis, same_pivot: rad and m, two fits nearer than this that move
    at the same time are two faces of one part.
    """

    method: Literal["fits", "clusters"] = "fits"
    far_share: float = 0.3
    rest_tolerance: float = 0.012
    max_parts: int = 8
    min_tracks: int = 15
    min_share: float = 0.1
    min_travel: float = 0.04
    max_residual: float = 0.008
    max_looseness: float = 2.5
    max_moving_share: float = 0.8
    max_axis_sigma: float = float(np.radians(1.4))
    same_axis: float = float(np.radians(10.0))
    same_pivot: float = 0.06
    interval: IntervalConfig = field(default_factory=IntervalConfig)
    hand: HandColorConfig = field(default_factory=HandColorConfig)
    clusters: ClusterConfig = field(default_factory=ClusterConfig)

    def __post_init__(self) -> None:
        if (
            not 0 < self.far_share < 1
            or self.rest_tolerance <= 0
            or self.max_parts < 1
            or self.min_tracks < 3
        ):
            raise ConfigError(
                f"motion: far_share in 0..1, positive rest_tolerance, max_parts >= 1, min_tracks >= 3 are needed: {self}"
            )
