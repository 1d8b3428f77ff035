"""Settings and constants of finding parts among tracks, each with the source of its value."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from recon.interaction.joints.clustering.clusters import ClusterConfig
from twin.runs.setting import Settings, group, setting


@dataclass(frozen=True)
class MotionConfig(Settings):
    """Finding parts among tracks."""

    method: Literal["fits", "clusters"] = setting(
        "fits",
        "how tracks are told apart that move by different joints; fits: each joint is fitted to all that no earlier one explains; "
        "clusters: the paper's motion clustering (needs the extra `clustering`)",
    )
    max_parts: int = setting(8, "most parts sought", unit="parts", at_least=1)
    clusters: ClusterConfig = group(ClusterConfig, "the paper's motion clustering, with method = clusters")


# Tracks that travel less than this share of the farthest (95th percentile) wait for the last fits. By us.
FAR_SHARE = 0.3
# m; a track of the part stays within it while the part rests. Chosen by us.
REST_TOLERANCE = 0.012
# A further part has at least so many tracks, and this share of the first one's. Chosen by us.
MIN_TRACKS = 15
MIN_SHARE = 0.1
# m; least median path of its tracks. Chosen by us.
MIN_TRAVEL = 0.04
# m; greatest error (RMS) that its fit may leave. Chosen by us.
MAX_RESIDUAL = 0.008
# And at most so many times that of the first part, which the same camera sees. Chosen by us.
MAX_LOOSENESS = 2.5
# Share of the frames that see it in which it may move. Chosen by us.
MAX_MOVING_SHARE = 0.8
# rad; greatest uncertainty of its axis. Chosen by us.
MAX_AXIS_SIGMA = float(np.radians(1.4))
# rad and m; fits that differ by less in axis and pivot and move together are faces of a part. Chosen by us.
SAME_AXIS = float(np.radians(10.0))
SAME_PIVOT = 0.06
