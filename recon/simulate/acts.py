"""One interaction: the part, what stands around it, where it is held, when, and its state in every frame."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from recon.simulate.grip import Grasp
from recon.simulate.mjcf import Articulation
from recon.simulate.timeline import Timeline
from twin.geometry import Array, transform


@dataclass(frozen=True)
class Act:
    """scene: the part among all that stands around it meanwhile. states (frames,): of the part, rad or m, in
    every frame of the recording. reaches: whether a hand comes.
    """

    scene: Articulation
    grasp: Grasp
    line: Timeline
    states: Array
    reaches: bool = True

    @property
    def led(self) -> Array:
        """From where the grip is when it is taken to where it is farthest from there (3,), metres."""
        during = self.states[self.line.start : self.line.end + 1]
        farthest = float(during[np.argmax(np.abs(during - during[0]))])
        ends = [
            transform(self.scene.pose(s), self.grasp.point[None])[0] for s in (farthest, float(during[0]))
        ]
        return np.asarray(ends[0] - ends[1])
