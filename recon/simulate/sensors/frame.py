"""What a depth camera is given of one frame."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recon.simulate.render import View
from twin.geometry import Array


@dataclass(frozen=True)
class Frame:
    """The exact rendering, unit viewing directions `rays` (H, W, 3) in the world, the colour picture (H, W,
    3) as it was taken, the frame's number, and the generator of what is drawn anew in it.
    """

    view: View
    rays: Array
    colour: NDArray[np.uint8]
    index: int
    rng: np.random.Generator
