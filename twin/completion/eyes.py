"""Where the cameras of a recording stood, seen from a body of the twin."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from twin import geometry as geo
from twin.geometry import Array
from twin.scene import Part, Twin

# Frames between those whose cameras are asked what they saw. Chosen by us: a quarter of a second.
EVERY = 8


def static_eyes(twin: Twin) -> Array | None:
    """Where the cameras stood (n, 3) m in the world; None without camera poses."""
    return None if twin.cameras is None else twin.cameras.T_world_cam[::EVERY, :3, 3]


def part_eyes(twin: Twin, part: Part) -> Array | None:
    """Where the cameras stood (n, 3) m as a moved part saw them, at state 0; None without camera poses."""
    if twin.cameras is None:
        return None
    poses, states = twin.cameras, states_of(twin)
    eyes = []
    for frame, pose in zip(poses.frames[::EVERY].tolist(), poses.T_world_cam[::EVERY], strict=True):
        moved = twin.part_pose(part.id, states(frame))
        eyes.append(geo.transform(geo.invert_pose(moved), pose[None, :3, 3])[0])
    return np.array(eyes)


def states_of(twin: Twin) -> Callable[[int], dict[int, float]]:
    """The states of all parts that have one in a frame, by part id."""
    known = {
        p.id: dict(zip(p.motion.frames.tolist(), p.motion.state.tolist(), strict=True)) for p in twin.parts
    }
    return lambda frame: {k: states[frame] for k, states in known.items() if frame in states}
