"""Parts that move alike are one: a board that was found in two pieces."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from recon.interaction.parts.moving_part import MovingPart
from twin import geometry as geo
from twin.geometry import Array
from twin.scene import Revolute

# m from the joint of the points that are compared: the reach of a cupboard's door. Chosen by us.
_REACH = 0.3
# m, root mean square over the frames, by which they may differ: refined joints of one board differ by less
# than a fifth of it. Chosen by us.
_ALIKE = 0.01


def distinct(parts: Sequence[MovingPart]) -> tuple[MovingPart, ...]:
    """The parts without those that move as an earlier one does, in every frame."""
    kept: list[MovingPart] = []
    for part in parts:
        if not any(move_alike(part, other) for other in kept):
            kept.append(part)
    return tuple(kept)


def move_alike(a: MovingPart, b: MovingPart) -> bool:
    """Whether two parts are one rigid body as far as their motion tells; nothing that hardly moves is."""
    frames = np.intersect1d(a.motion.frames, b.motion.frames)
    if a.joint.kind != b.joint.kind or not len(frames):
        return False
    centre = a.joint.pivot if isinstance(a.joint, Revolute) else np.zeros(3)
    points = centre + _REACH * np.concatenate([np.eye(3), -np.eye(3)])
    first, second = (_moved(part, frames, points) for part in (a, b))
    travel = float(np.linalg.norm(first - first[:1], axis=-1).max())
    apart = float(np.sqrt(np.mean(np.sum((first - second) ** 2, axis=-1))))
    return apart < _ALIKE and travel > 3 * _ALIKE


def _moved(part: MovingPart, frames: NDArray[np.int64], points: Array) -> Array:
    """Where points (n, 3) of the first frame are in each of the frames (T, n, 3)."""
    state = part.motion.state[np.isin(part.motion.frames, frames)]
    poses = part.joint.poses(state - state[0])
    return np.asarray(np.stack([geo.transform(pose, points) for pose in poses]))
