"""Evidence about the scene as a whole."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from recon.interaction.motion.movers import Movers
from twin.verdict import Reason, reason

_APART_M = 0.1  # tracks farther from each other are of different things; about a hand's breadth, chosen by us
_FAR_M = 0.05  # what carries a thing goes farther; tracks that slip along edges mostly don't. Chosen by us
# tracks of a thing, as of a part (MIN_TRACKS of recon.interaction.joints.config)
_FEWEST = 4
# share of all tracks that move, as of a part (MIN_SHARE of recon.interaction.joints.config)
_SHARE = 0.05


def nothing_articulated(movers: Sequence[Movers]) -> Reason:
    """The reason against a scene without a part: how many things moved all the same, in each window."""
    return reason("NothingArticulated", "refused", sum(free_things(m) for m in movers))


def free_things(movers: Movers) -> int:
    """How many groups of neighbouring tracks went farther than what drifts."""
    moving = np.flatnonzero(movers.moving & (movers.travel > _FAR_M))
    if len(moving) < _FEWEST:
        return 0
    start = np.array([movers.points_world[movers.visible[:, k], k][0] for k in moving])
    near = cKDTree(start).sparse_distance_matrix(cKDTree(start), _APART_M)
    group = connected_components(near, directed=False)[1]
    return int((np.bincount(group) >= max(_FEWEST, _SHARE * len(moving))).sum())
