"""What finding parts hands on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recon.interaction.motion.movers import Movers
from recon.interaction.parts.moving_part import MovingPart


@dataclass(frozen=True, eq=False)
class PartTracks:
    """A moving part, the tracks (K,) that are rigid with it, and why its joint has this type."""

    part: MovingPart
    members: NDArray[np.bool_]
    type_source: str


@dataclass(frozen=True, eq=False)
class FoundParts:
    """The movers and all parts."""

    movers: Movers
    parts: tuple[PartTracks, ...]

    def of(self, parts: Sequence[MovingPart]) -> tuple[PartTracks, ...]:
        """The tracks of these parts, refined ones or some of them, by their ids."""
        known = {tracks.part.id: tracks for tracks in self.parts}
        return tuple(known[part.id] for part in parts)
