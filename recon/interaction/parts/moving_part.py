"""What the motion stages hand to the labelling and fusion stages."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from twin import geometry as geo
from twin.errors import SceneError
from twin.geometry import Array
from twin.scene import FIRST_PART_ID, Joint, Motion

# rad and m by which a state is beyond others: more than those of frames between windows err by. Chosen by us.
_BEYOND = {"revolute": float(np.radians(2.5)), "prismatic": 0.012}
# Cosine between a face's normal and a slide in the face's own plane. Chosen by us.
_IN_PLANE = 0.5


@dataclass(frozen=True, eq=False)
class MovingPart:
    """A joint and its state over time, before the part's shape is known.

    id: label id, from 2. joint: in the world frame of the cameras; state 0 is the pose at the first frame
    (which end is closed is decided later). motion: one state for every frame with a known camera, rest frames
    included. windows: first and last frames of the times in which it was handled; none: all frames. carrier:
    the part that it is mounted on, at whose state 0 joint stands in the world; None for the static scene.
    board: points (n, 3) m of its surface at state 0, grown to edges of a picture; None where none was found.
    """

    id: int
    joint: Joint
    motion: Motion
    windows: tuple[tuple[int, int], ...] = ()
    carrier: MovingPart | None = None
    board: Array | None = None

    def __post_init__(self) -> None:
        if self.id < FIRST_PART_ID:
            raise SceneError(f"part ids start at {FIRST_PART_ID}, got {self.id}")

    def moved(self, T: Array) -> MovingPart:
        """The same part in a world into which T (4, 4) brings this one's points."""
        carrier = None if self.carrier is None else self.carrier.moved(T)
        board = None if self.board is None else geo.transform(T, self.board)
        return replace(self, joint=self.joint.transformed(T), carrier=carrier, board=board)

    def with_board(self, points: Array) -> MovingPart:
        """The part with a board that lies at these points (n, 3) m in its first frame."""
        back = geo.invert_pose(self.joint.pose(float(self.motion.state[0])))
        return replace(self, board=geo.transform(back, points))

    def standing(self, frame: int) -> MovingPart:
        """The part on its carrier as that stands in a frame: a part of the static scene."""
        T = None if self.carrier is None else self.carrier.pose(frame)
        return self if T is None else replace(self, joint=self.joint.transformed(T), carrier=None)

    @property
    def handled_states(self) -> Array:
        """States (n,) in the frames of its windows; of others those clearly beyond: it stood there."""
        if not self.windows:
            return self.motion.state
        frames, state, beyond = self.motion.frames, self.motion.state, _BEYOND[self.joint.kind]
        inside = np.logical_or.reduce([(frames >= a) & (frames <= b) for a, b in self.windows])
        low, high = state[inside].min() - beyond, state[inside].max() + beyond
        return state[inside | (state < low) | (state > high)]

    def slides_within(self, normal: Array) -> bool:
        """Whether it slides in the plane of a face of its with this normal (3,), as a sliding door does."""
        return self.joint.kind == "prismatic" and abs(float(normal @ self.joint.axis)) < _IN_PLANE

    @property
    def is_somewhere(self) -> bool:
        """Whether it has a state in any frame, and so has its carrier."""
        return len(self.motion.frames) > 0 and (self.carrier is None or self.carrier.is_somewhere)

    @property
    def handled_first(self) -> int:
        """The first frame in which somebody moves it."""
        return self.motion.intervals[0][0] if self.motion.intervals else int(self.motion.frames[0])

    def state(self, frame: int) -> float | None:
        """State at a recording frame, None when that frame has no estimate."""
        k = int(np.searchsorted(self.motion.frames, frame))
        known = k < len(self.motion.frames) and self.motion.frames[k] == frame
        return float(self.motion.state[k]) if known else None

    def pose(self, frame: int) -> Array | None:
        """T_world_part (4, 4): from state 0 to the world at a recording frame; None without an estimate."""
        state = self.state(frame)
        if state is None or self.carrier is None:
            return None if state is None else self.joint.pose(state)
        carried = self.carrier.pose(frame)
        return None if carried is None else carried @ self.joint.pose(state)

    def pose_at(self, states: Mapping[int, float]) -> Array:
        """T_world_part (4, 4) in states by part id."""
        own = self.joint.pose(states[self.id])
        return own if self.carrier is None else self.carrier.pose_at(states) @ own
