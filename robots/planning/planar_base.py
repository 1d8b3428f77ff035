"""A mobile base: where the arm's inverse kinematics starts when base and arm are solved together."""

from __future__ import annotations

import numpy as np

from robots.model.kinematics import Chain
from robots.model.spec import RobotSpec
from twin.geometry import Array

# Turns of forearm and hand (rad) that start the search in each of the wrist's branches.
_WRISTS = ((0.0, 0.0), (0.0, 1.57), (0.0, -1.57), (1.2, 0.0), (-1.2, 0.0))


def planar_starts(target: Array, chain: Chain, spec: RobotSpec) -> list[Array]:
    """Start configurations, each (B, n), for tool poses `target` (B, 4, 4) in the frame of the base's stance.

    The base stays where it was put; the shoulder turns towards the target; the last three joints take the
    hand's main orientations. A home pose bent at the elbow keeps all of them away from singularities.
    """
    n = len(chain.lower)
    shoulder = chain.base
    mount = chain.fixed[: shoulder + 1, :3, 3].sum(axis=0)
    facing = np.arctan2(target[:, 1, 3] - mount[1], target[:, 0, 3] - mount[0])
    starts = []
    for forearm, hand in _WRISTS:
        q = np.tile(spec.home, (len(target), 1))
        q[:, shoulder] += facing
        if n - shoulder >= 3:
            q[:, -3] += forearm
        q[:, -1] += hand
        starts.append(np.clip(q, chain.lower, chain.upper))
    return starts
