"""Settings of finding parts among tracks, each with the source of its default."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from recon.joints.clustering.clusters import ClusterConfig
from recon.motion.intervals import IntervalConfig
from recon.parts.hand_tracks import HandColorConfig
from twin.runs.setting import Settings, group, setting


@dataclass(frozen=True)
class MotionConfig(Settings):
    """Finding parts among tracks; chosen by us."""

    method: Literal["fits", "clusters"] = setting(
        "fits",
        "how tracks are told apart that move by different joints; fits: each joint is fitted to all that no earlier one explains; "
        "clusters: the paper's motion clustering (needs the extra `clustering`)",
    )
    far_share: float = setting(
        0.3,
        "tracks that travel less than this share of the farthest (95th percentile) wait for the last fits",
        unit="",
        above=0,
        below=1,
    )
    rest_tolerance: float = setting(
        0.012, "a track of the part stays within it while the part rests", unit="m", above=0
    )
    max_parts: int = setting(8, "most parts sought", unit="parts", at_least=1)
    min_tracks: int = setting(15, "fewest tracks of a further part", unit="tracks", at_least=3)
    min_share: float = setting(
        0.1, "fewest tracks of a further part, as a share of the first one's", unit="", at_least=0, at_most=1
    )
    min_travel: float = setting(0.04, "least median path of its tracks", unit="m", at_least=0)
    max_residual: float = setting(0.008, "greatest error (RMS) that its fit may leave", unit="m", above=0)
    max_looseness: float = setting(
        2.5, "and at most so many times that of the first part, which the same camera sees", unit="", above=0
    )
    max_moving_share: float = setting(
        0.8, "share of the frames that see it in which it may move", unit="", above=0, at_most=1
    )
    max_axis_sigma: float = setting(
        float(np.radians(1.4)), "greatest uncertainty of its axis", unit="rad", above=0, at_most=np.pi
    )
    same_axis: float = setting(
        float(np.radians(10.0)),
        "fits whose axes differ by less, and which move at the same time, are faces of one part",
        unit="rad",
        at_least=0,
        at_most=np.pi / 2,
    )
    same_pivot: float = setting(0.06, "and whose pivots differ by less", unit="m", at_least=0)
    interval: IntervalConfig = group(IntervalConfig, "what moves, and when")
    hand: HandColorConfig = group(HandColorConfig, "which tracks lie on the hand")
    clusters: ClusterConfig = group(ClusterConfig, "the paper's motion clustering, with method = clusters")
