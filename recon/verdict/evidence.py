"""What a verdict is told by."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from recon.parts.find_parts import FoundParts, PartTracks
from recon.parts.moving_part import MovingPart
from recon.recording import Recording
from recon.verdict.explained import unexplained
from twin.scene import Mesh, Trajectory


@dataclass(frozen=True, eq=False)
class SceneEvidence:
    """All that the stages found. labels: label images (H, W) of some frames. parts: those of `found`, refined, with their meshes at
    state 0 of the joint; None for a part without a surface."""

    recording: Recording
    cameras: Trajectory
    labels: Mapping[int, NDArray[np.uint8]]
    found: FoundParts
    static: Mesh
    parts: Sequence[tuple[MovingPart, Mesh | None]]

    @cached_property
    def unexplained(self) -> tuple[int, float]:
        """The frame of rest that the twin explains worst, and the share of the picture."""
        return unexplained(self.recording, self.cameras, self.static, self.parts)


@dataclass(frozen=True, eq=False)
class PartEvidence:
    """One part among all of them, with the tracks that are rigid with it."""

    scene: SceneEvidence
    part: MovingPart
    mesh: Mesh | None
    tracks: PartTracks
