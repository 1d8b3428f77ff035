"""Settings of the joint fit, each with the source of its default."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np

from twin.runs.setting import Former, Left, Settings, setting

MOST_STEPS = 30  # Gauss-Newton steps of one refinement; it stops when a step is negligible


@dataclass(frozen=True)
class JointConfig(Settings):
    """How tracks or poses become a joint; chosen by us unless a setting says otherwise."""

    method: Literal["bundle", "pose_graph"] = setting(
        "bundle",
        "what tells the joint of a group of tracks and its states; bundle: bundle adjustment of the tracks; pose_graph: the "
        "paper's part-pose graph over relative motions between frames",
    )
    min_travel: float = setting(
        0.01, "a track that moves less is at rest (the paper's eps_s)", unit="m", above=0
    )
    mover_sigmas: float = setting(
        5.0,
        "a track votes when it moves more than so many standard deviations; measured: the type rule holds on every real and "
        "synthetic track once those under 5 are dropped",
        unit="",
        above=0,
    )
    sigma_floor: float = setting(
        0.005,
        "least noise that the type rule assumes: neither marker rigs nor depth cameras are better once the part flexes "
        "(measured on real kitchen tracks)",
        unit="m",
        above=0,
    )
    sigma_floor_rad: float = setting(
        float(np.radians(3.0)), "the same of angles", unit="rad", above=0, at_most=np.pi
    )
    min_delta_bic: float = setting(
        20.0, "evidence that a hinge needs over a slide (Bayesian information criterion)", unit="", at_least=0
    )
    min_range: float = setting(
        float(np.radians(3.0)),
        "least turn of a hinge; between 2 and 20 degrees no data that we have choose it: --type-hint can name the type",
        unit="rad",
        at_least=0,
        at_most=2 * np.pi,
    )
    max_radius: float = setting(3.0, "greatest distance of a hinge from its part", unit="m", above=0)
    search_sigma: float = setting(
        0.003,
        "least noise while searching, three times it about the paper's eps_f = 0.01 m; the refinement measures the noise itself",
        unit="m",
        above=0,
    )
    far_share: float = setting(
        0.3,
        "hypotheses come from tracks that travel this share of the farthest (95th percentile): of what moves a little, half is "
        "background that drifts along an edge, and most of it rests at any moment",
        unit="",
        at_least=0,
        below=1,
    )
    pair_gaps: tuple[int, ...] = setting(
        (8, 12, 16, 24, 32, 48, 64),
        "distances in time of the pairs that the search for motions takes",
        unit="frames",
        at_least=1,
        least=1,
    )
    pairs: int = setting(48, "pairs of frames of that search", unit="", at_least=1)
    samples: int = setting(96, "triples of tracks tried for each pair", unit="", at_least=1)
    candidates: int = setting(3, "hypotheses of each type that are refined", unit="", at_least=1)
    search_tracks: int = setting(
        300, "most tracks on which hypotheses are compared, for speed", unit="tracks", at_least=1
    )
    search_frames: int = setting(
        60, "most frames on which hypotheses are compared, for speed", unit="frames", at_least=1
    )
    prune_sigmas: float = setting(
        3.0,
        "a track whose median residual exceeds that of noise by this factor does not follow the joint",
        unit="",
        above=0,
    )
    limit_quantile: float = setting(
        0.02,
        "limits are this quantile of the smoothed state and its opposite: least and greatest grow with the noise",
        unit="",
        at_least=0,
        below=0.5,
    )
    min_tracks: int = setting(4, "fewest tracks of a part; a rigid motion needs 3", unit="tracks", at_least=3)
    min_share: float = setting(0.05, "least share of what moves", unit="", at_least=0, below=1)
    min_observations: int = setting(3, "fewest tracks that give a frame its state", unit="tracks", at_least=1)
    seed: int = setting(0, "of the random samples", unit="", at_least=0)

    FORMERLY: ClassVar[Former] = {"iterations": Left(MOST_STEPS)}
