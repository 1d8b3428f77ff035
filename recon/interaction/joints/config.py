"""Settings and constants of the joint fit, each with the source of its value."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from twin.runs.setting import Settings, setting

Method = Literal["bundle", "pose_graph"]


@dataclass(frozen=True)
class JointConfig(Settings):
    """How tracks or poses become a joint."""

    method: Literal["bundle", "pose_graph"] = setting(
        "bundle",
        "what tells the joint of a group of tracks and its states; bundle: bundle adjustment of the tracks; pose_graph: the "
        "paper's part-pose graph over relative motions between frames",
    )


@dataclass(frozen=True)
class Search:
    """How widely hypotheses are searched. pairs: of frames. tracks, frames: most to compare, for speed."""

    pairs: int = 48
    tracks: int = 300
    frames: int = 60


# Gauss-Newton steps of one refinement; it stops when a step is negligible. Chosen by us.
MOST_STEPS = 30
# m; a track that moves less is at rest: the paper's eps_s.
MIN_TRAVEL = 0.01
# A track votes when it moves more than so many standard deviations. Measured: the type rule holds on every
# real and synthetic track once those under 5 are dropped.
MOVER_SIGMAS = 5.0
# m and rad; least noise that the type rule assumes. Measured on real kitchen tracks: neither marker rigs nor
# depth cameras are better once the part flexes.
SIGMA_FLOOR = 0.005
SIGMA_FLOOR_RAD = float(np.radians(3.0))
# Evidence (Bayesian information criterion) that a hinge needs over a slide. Chosen by us.
MIN_DELTA_BIC = 20.0
# rad; least turn of a hinge. Chosen by us: between 2 and 20 degrees no data that we have choose it.
MIN_RANGE = float(np.radians(3.0))
# m; greatest distance of a hinge from its part. Chosen by us.
MAX_RADIUS = 3.0
# m; least noise while searching: a third of the paper's eps_f = 0.01 m. Refinement measures noise.
SEARCH_SIGMA = 0.003
# Hypotheses come from tracks that travel this share of the farthest (95th percentile). Chosen by us: of
# tracks that move a little, half are background that drifts along an edge, and most rest at any moment.
FAR_SHARE = 0.3
# Frames between the two of a pair from which the search takes motions. Chosen by us.
PAIR_GAPS = (8, 12, 16, 24, 32, 48, 64)
# Triples of tracks tried for each pair. Chosen by us.
SAMPLES = 96
# Hypotheses of each type that are refined. Chosen by us.
CANDIDATES = 3
# A track whose median residual exceeds that of noise by this factor does not follow the joint. Chosen by us.
PRUNE_SIGMAS = 3.0
# Limits are this quantile of the smoothed state and its opposite: extremes grow with noise. Chosen by us.
LIMIT_QUANTILE = 0.02
# Fewest tracks of a part. A rigid motion needs 3.
MIN_TRACKS = 4
# Least share of the moving tracks that follow a joint. Chosen by us.
MIN_SHARE = 0.05
# Fewest tracks that give a frame its state. Chosen by us.
MIN_OBSERVATIONS = 3
